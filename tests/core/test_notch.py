"""The notch on the command, against its transfer function."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from cmg_mj import InputError
from cmg_mj.stages.notch import DEPTH_DAMPING, WIDTH_DAMPING, Notch
from tests.core.test_backlash import behind
from tests.recorded import push_recovery, recorded

DT = 0.005


def gain(hz: float, middle_hz: float) -> complex:
    """The amplitude of a sine after the notch has settled."""
    inputs = np.exp(2.0j * math.pi * hz * DT * np.arange(4000))
    real, imaginary = (behind(Notch(middle_hz, DT, math.inf), part) for part in (np.real(inputs), np.imag(inputs)))
    return complex(np.mean(((real + 1j * imaginary) / inputs)[2000:]))


@pytest.mark.parametrize("hz", [0.5, 4.0, 9.0, 10.0, 11.0, 30.0])
def test_its_transfer_is_that_of_its_formula(hz: float) -> None:
    # Tustin's rule, exact at the middle: w is the middle's, s what the rule makes of the frequency.
    w = 2.0 * math.pi * 10.0
    s = w / math.tan(0.5 * w * DT) * cmath.tanh(1j * math.pi * hz * DT)
    expected = (s * s + 2.0 * DEPTH_DAMPING * w * s + w * w) / (s * s + 2.0 * WIDTH_DAMPING * w * s + w * w)
    assert gain(hz, 10.0) == pytest.approx(expected, abs=1e-6)


def test_a_25th_is_left_in_the_middle_and_a_constant_passes() -> None:
    assert abs(gain(20.0, 20.0)) == pytest.approx(DEPTH_DAMPING / WIDTH_DAMPING, rel=1e-6)
    assert gain(0.0, 20.0) == pytest.approx(1.0, abs=1e-9)


def test_worlds_side_by_side_are_single_worlds() -> None:
    commands = np.random.default_rng(1).normal(size=(50, 3))
    notch = Notch(10.0, DT, 1.5)
    np.testing.assert_array_equal(behind(notch, commands), np.transpose([behind(notch, part) for part in commands.T]))


def test_its_result_is_within_the_limit() -> None:
    commands = np.repeat([3.0, -3.0], 50)
    assert np.abs(behind(Notch(30.0, DT, 1.0), commands)).max() == 1.0


def test_the_command_that_is_recorded_and_observed_is_behind_it() -> None:
    plain, notched = (
        recorded(push_recovery("duration_s=0.3", "push=[]", *more).run()) for more in ([], ["controller.notch_hz=20"])
    )
    (first,) = behind(Notch(20.0, DT, math.inf), plain["u_rad_s"][:1])
    assert notched["u_rad_s"][0] == first != plain["u_rad_s"][0]


def test_it_lies_below_half_the_rate() -> None:
    with pytest.raises(InputError, match=r"controller\.notch_hz = 100: must be below 100 Hz, half of"):
        push_recovery("controller.notch_hz=100")

"""sokolov2019, Figs 4 to 6: the gap behind the servo's motor, and the cycles that it makes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from cmg_mj.controller import Tick
from cmg_mj.papers.sokolov2019 import backlash
from cmg_mj.papers.sokolov2019.cycles import cycles
from cmg_mj.papers.sokolov2019.gap_prediction import share_of
from cmg_mj.papers.sokolov2019.rig import experiment


def test_gap_is_the_datasheets() -> None:
    assert math.degrees(backlash.gap_rad()) == pytest.approx(1.0 / 3.0)
    assert math.degrees(backlash.gap_rad(60.0)) == pytest.approx(1.0)


class Motor:
    """A controller that asks for given rates."""

    def __init__(self, rates: np.ndarray) -> None:
        self.rates, self.law, self.tick = iter(rates), experiment().law, None

    def update(self, step: int, ideal: Any) -> bool:
        self.tick: Any = Tick(0.0, 0.0, 0.0, 0.0, float(next(self.rates)), 0.0, [])
        return True


def test_the_gimbal_rests_until_the_motor_has_crossed_the_gap() -> None:
    """The motor swings by 2 about 0 behind a gap of 1; its angle less half the gap forward, plus half backward."""
    dt = experiment().law.dt
    motor = 2.0 * np.sin(np.linspace(0.0, 4.0 * np.pi, 401))
    asked = Motor(np.diff(motor) / dt)
    behind: Any = backlash.BehindAGap(asked, 1.0)  # type: ignore[arg-type]
    gimbal = [0.0]
    for step in range(400):
        assert behind.update(step, None)
        assert asked.tick is not None
        assert asked.tick.u == pytest.approx((motor[step + 1] - motor[step]) / dt)  # what its observers are told
        gimbal.append(gimbal[-1] + dt * behind.tick.u)
    angle = np.array(gimbal)
    assert np.abs(motor - angle).max() == pytest.approx(0.5)
    assert angle[50] == pytest.approx(1.5)  # the top of the first swing
    assert angle[60] == pytest.approx(1.5)  # the motor has turned back by 0.38
    assert angle[150] == pytest.approx(-1.5)
    still = (motor[1:-1] < 2.0 - 1e-9) & (np.abs(np.diff(angle)[1:]) < 1e-12)
    assert still.any()


def test_without_a_gap_it_is_the_rig_itself() -> None:
    prepared = experiment(["duration_s=1.5"])
    plain, behind = prepared.run_many(2), backlash.run_behind_a_gap(prepared, [0, 1], 0.0)
    assert plain.trajectory is not None
    assert behind.trajectory is not None
    for name in ("x1_rad", "u_rad_s", "push_n_m"):
        np.testing.assert_allclose(behind.trajectory[name], plain.trajectory[name], atol=1e-6)


@pytest.mark.parametrize("c", [-0.9, -0.3, 0.0, 0.6])
def test_share_is_the_fundamental_of_what_a_gap_passes(c: float) -> None:
    """By running the gap over whole turns."""
    dt = experiment().law.dt
    gap = 1.0 + c
    phase = np.linspace(0.0, 6.0 * np.pi, 6001)
    behind: Any = backlash.BehindAGap(Motor(np.diff(np.sin(phase)) / dt), gap)  # type: ignore[arg-type]
    angle = [0.0]
    for step in range(6000):
        behind.update(step, None)
        angle.append(angle[-1] + dt * behind.tick.u)
    last = np.array(angle)[4000:6000]
    fundamental = 2.0 * np.mean(last * np.exp(-1j * phase[4000:6000])) * 1j
    assert complex(fundamental) == pytest.approx(share_of(c), abs=2e-3)


def test_cycles_on_mujoco_are_those_of_the_linear_loop() -> None:
    """All three oscillate behind the gap, (8) and (9) as the describing function foresees; nothing does without."""
    found = cycles()
    assert all(cycle.sustained for cycle in found.ends.values())
    for name in ("linear", "luenberger"):
        foreseen = found.foreseen[name]
        assert foreseen is not None
        assert found.ends[name].amplitude_deg == pytest.approx(foreseen.amplitude_deg, rel=0.15)
        assert found.ends[name].frequency_hz == pytest.approx(foreseen.frequency_hz, rel=0.25)
        assert not backlash.cycle_of(name, 0.0).sustained
    half = backlash.cycle_of("linear", backlash.gap_rad(10.0))
    assert half.amplitude_deg == pytest.approx(found.ends["linear"].amplitude_deg / 2.0, rel=0.05)

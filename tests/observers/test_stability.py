"""A pole at zero is none that fades, to whichever side of zero rounding moves it."""

from __future__ import annotations

import numpy as np
import pytest

from cmg_mj.core.reduced_model import MARGIN, is_hurwitz
from tests.command import cmg_mj


@pytest.mark.parametrize("rounding", [0.0, 1.55e-16, -1.55e-16, -1e-9])
def test_rounding_does_not_decide(rounding: float) -> None:
    assert not is_hurwitz(np.array([-10.0 + 4.6j, -10.0 - 4.6j, rounding]))


def test_slow_poles_do_fade() -> None:
    assert is_hurwitz(np.array([-10.0, -2.0 * MARGIN]))
    assert not is_hurwitz(np.array([-10.0, 2.0 * MARGIN]))


def test_check_says_so() -> None:
    """The gains without an integrator; the tests of `check` and of its hints have the others."""
    checked = cmg_mj("check", "push_recovery", "--set", "controller.gains=[35, 4, -1, 0]")
    assert "true state: MARGINAL" in checked.out

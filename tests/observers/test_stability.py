"""A pole at zero is none that fades, to whichever side of zero rounding moves it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.core.reduced_model import MARGIN, is_hurwitz
from cmg_mj.laws.state_feedback import TABLE_2_GAINS, closed_loop_poles, lqr_gains
from tests.command import cmg_mj
from tests.observers.reference import PAPER


@pytest.mark.parametrize("rounding", [0.0, 1.55e-16, -1.55e-16, -1e-9])
def test_rounding_does_not_decide(rounding: float) -> None:
    assert not is_hurwitz(np.array([-10.0 + 4.6j, -10.0 - 4.6j, rounding]))


def test_slow_poles_do_fade() -> None:
    assert is_hurwitz(np.array([-10.0, -2.0 * MARGIN]))
    assert not is_hurwitz(np.array([-10.0, 2.0 * MARGIN]))


def test_poles_of_table_2() -> None:
    """s^4 + ... of (6) with u = -K_e x: their product and sum by the closed forms of the 4x4 determinant and trace."""
    poles = closed_loop_poles(PAPER, TABLE_2_GAINS)
    h, lever = PAPER.J_d * PAPER.omega_d / PAPER.J1, PAPER.gravity_torque / PAPER.J1
    _, k2, k3, k4 = TABLE_2_GAINS
    assert np.sum(poles).real == pytest.approx(-(h * k2 + k3), rel=1e-9)
    assert np.prod(poles).real == pytest.approx(lever * k4, rel=1e-9)
    assert is_hurwitz(poles)


def test_weights_that_leave_the_integrator_alone_are_refused() -> None:
    with pytest.raises(InputError, match="no stabilising gain for these weights"):
        lqr_gains(PAPER, (1.0, 1.0, 1.0, 0.0), 1.0)


@pytest.mark.parametrize(
    ("gains", "word"), [("[35, 4, -1, 0.3]", "stable"), ("[35, 4, -1, 0]", "MARGINAL"), ("[1, 4, -1, 0.3]", "UNSTABLE")]
)
def test_check_says_which(gains: str, word: str, tmp_path: Path) -> None:
    (tmp_path / "my.toml").write_text(f"[controller]\ngains = {gains}\n")
    assert f"  {word} with the reduced model" in cmg_mj("check", tmp_path / "my.toml").out

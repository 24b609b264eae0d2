"""Sections II and III of aranovskiy2020: the six bodies, the constants, the linearisation, where the law rests."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cmg_mj.laws.state_feedback import TABLE_2_GAINS
from cmg_mj.observers import make_observer
from cmg_mj.papers.aranovskiy2020 import model, paper
from cmg_mj.papers.linear_check import controllability_margin

SEED = 910_000
PAIR = paper.printed_model()


def test_six_bodies_move_as_the_reduced_model_says() -> None:
    r = model.residuals(100, SEED)
    assert max(r["tilt"], r["yaw"], r["torque"]) < 1e-10
    assert r["tilt_turned_J2"] > 1e-3  # a wrong sign would be seen
    assert r["tilt_as_printed"] > 0.1  # and so would the flywheels' own acceleration
    assert r["torque_turned_J2"] > 1e-4
    assert model.equations_2_to_4(r).verdict == model.gimbals_line(r).verdict == "reproduced"


@pytest.mark.parametrize("name", ["I_c", "J_d"])
def test_another_constant_is_not_the_gimbals_torque(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(paper.TABLE_1, name, 1.01 * paper.TABLE_1[name])
    assert model.gimbals_line(model.residuals(20, SEED)).verdict == "not reproduced"


def test_constants_of_table_1() -> None:
    """Worked out by hand."""
    np.testing.assert_allclose([PAIR.J1, PAIR.J2], [0.061841, -1.9e-4], rtol=1e-9)
    assert PAIR.gravity_torque == pytest.approx(3.4531, rel=1e-4)
    claim = model.table_1()
    assert claim.figures["largest_relative_difference"] < 1e-12
    assert claim.verdict == "reproduced within stated conditions"


def test_the_bench_starts_from_table_2() -> None:
    assert paper.K_E == TABLE_2_GAINS
    for name, parameters in paper.TABLE_2.items():
        observer: Any = make_observer(name, 0.005, PAIR)
        assert {key: getattr(observer, key) for key in parameters} == parameters


def test_controllability_by_hautus() -> None:
    """rank [A - s I, B] = 4 at every eigenvalue, which is another test than the report's."""
    for eigenvalue in np.linalg.eigvals(PAIR.A_e):
        pencil = np.hstack([PAIR.A_e - eigenvalue * np.eye(4), PAIR.B_e])
        assert np.linalg.svd(pencil, compute_uv=False)[-1] > 1e-2
    assert controllability_margin(PAIR.A_e, PAIR.B_e) > 1e-4
    assert controllability_margin(PAIR.A_e, np.array([[0.0], [0.0], [1.0], [0.0]])) < 1e-12


def test_the_linearisation_is_reproduced() -> None:
    claims = [model.linearisation(), model.law_equilibria()]
    assert [claim.verdict for claim in claims] == ["reproduced", "reproduced within stated conditions"]

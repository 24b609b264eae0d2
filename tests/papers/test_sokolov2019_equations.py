"""sokolov2019, Sections II and III: on other seeds, and the equilibria on the nonlinear model."""

from __future__ import annotations

import pytest

from cmg_mj.observers import make_observer
from cmg_mj.papers.sokolov2019 import equations, paper
from cmg_mj.papers.sokolov2019.rig import estimator, experiment
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario
from tests.plant import paper_model

SEED = 5_000


def test_table_i() -> None:
    claim = equations.table_i()
    assert claim.verdict == "reproduced"
    assert claim.figures["J1_kg_m2"] == pytest.approx(paper_model.J1_single, rel=1e-12)
    assert claim.figures["J2_kg_m2"] == pytest.approx(paper_model.J2, rel=1e-12)
    assert claim.figures["gravity_torque_n_m"] == pytest.approx(
        paper_model.m * paper_model.g * paper_model.l_single, rel=1e-12
    )


def test_table_i_with_another_number_is_not_reproduced(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(paper.TABLE_I, "l", 0.19)
    assert equations.table_i().verdict == "not reproduced"


def test_table_ii_is_what_the_bench_comes_with() -> None:
    """Its defaults were written down apart from the folder's constants."""
    prepared = experiment()
    for name in paper.TABLE_II:
        assert estimator(name, prepared) == make_observer(name, prepared.law.dt, prepared.plant.reduced)
    assert prepared.law == prepare(load_scenario("single_gimbal")).law


def test_equations_of_motion() -> None:
    claim = equations.equations_of_motion(states=50, seed=SEED)
    assert claim.verdict == "reproduced"
    assert claim.figures["largest_residual_with_J2_turned_n_m"] > 1e-3


def test_the_linearisation_and_the_rests() -> None:
    assert equations.law_equilibria().verdict == "reproduced within stated conditions"

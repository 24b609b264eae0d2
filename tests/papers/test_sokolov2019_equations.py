"""sokolov2019, Sections II and III: on other seeds, and the equilibria on the nonlinear model."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

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


def rest_of_reduced_model(gains: np.ndarray, e: float, duration: float = 60.0) -> np.ndarray:
    """Integrate the nonlinear model (3) under the law with y1 = x1 - e to its rest: x1, x2, x3, x_e."""
    model = paper.printed_model()

    def motion(t: float, state: np.ndarray) -> list[float]:
        x1, x2, x3, x_e = (float(value) for value in state)
        u = -float(gains @ [x1 - e, x2, x3, x_e])
        return [x2, model.tilt_acceleration(x1, x2, x3, u), u, -x3]

    return solve_ivp(motion, (0.0, duration), np.zeros(4), rtol=1e-9, atol=1e-11).y[:, -1]


def test_signs_of_the_equilibria_on_the_nonlinear_model() -> None:
    """Printed with a minus: integrated, not solved for."""
    claim = equations.law_equilibria()
    assert claim.verdict == "reproduced within stated conditions"
    e = 1e-3
    K_e = np.array(paper.K_E)
    of_6 = rest_of_reduced_model(K_e * [1.0, 1.0, 1.0, 0.0], e)
    of_7 = rest_of_reduced_model(K_e, e)
    assert of_6[2] / e == pytest.approx(claim.figures["gimbal_rest_of_6_rad_per_rad"], rel=1e-3)
    assert of_7[3] / e == pytest.approx(claim.figures["integrator_rest_of_7_s_per_rad"], rel=1e-3)
    np.testing.assert_allclose(of_7[:3], 0.0, atol=1e-6)
    assert of_6[2] / e < 0.0 < of_7[3] / e  # k3 is negative, k_e4 positive

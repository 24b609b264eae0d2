"""The symbolic proof: against conserved momenta, against curvature, and with formulas broken on purpose."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from sympy.diffgeom import CoordSystem, Manifold, Patch, TensorProduct, metric_to_Riemann_components

from cmg_mj.papers import plvcc
from cmg_mj.papers.plvcc import decide, q1, q2

PLVCC = {
    "constant": sp.Integer(3),
    "exponential": sp.exp(sp.Rational(3, 2) * q2),
    "cosh squared": sp.cosh(q2 / 2) ** 2,
    "scaled cosh squared": 5 * sp.cosh(q2) ** 2,
    "sphere": sp.cos(q2) ** 2,
    "polar": (q2 + 2) ** 2,
}
"""Inertias of constant curvature."""

NOT_PLVCC = {
    "the pair's, exact": plvcc.papers_m1("aranovskiy2020", numbers=True),
    "the single gimbal's, exact": plvcc.papers_m1("sokolov2019", numbers=True),
    "cosh": sp.cosh(q2),
    "2 + cos": 2 + sp.cos(q2),
    "Gaussian": sp.exp(-(q2**2)),
}


def gaussian_curvature(m1: Any) -> Any:
    """By sympy's own differential geometry: R_1212 of the metric m1 dq1^2 + dq2^2 over its determinant."""
    chart = CoordSystem("q", Patch("P", Manifold("M", 2)), sp.symbols("q1 q2", real=True))
    x1, x2 = chart.coord_functions()
    d1, d2 = chart.base_oneforms()
    inertia = m1.subs(q2, x2)
    riemann: Any = metric_to_Riemann_components(inertia * TensorProduct(d1, d1) + TensorProduct(d2, d2))
    return riemann[0, 1, 0, 1].subs({x1: q1, x2: q2})  # R^1_212, the metric's inverse has raised the first index


@pytest.mark.parametrize("name", [*PLVCC, *NOT_PLVCC])
def test_says_yes_just_where_the_curvature_is_constant(name: str) -> None:
    """Two independent Killing fields carry every point to every other, and so the curvature."""
    m1 = (PLVCC | NOT_PLVCC)[name]
    decision = decide(m1)
    curvature = sp.lambdify(q2, gaussian_curvature(m1))
    values = [float(curvature(angle)) for angle in (-0.7, 0.1, 0.4, 1.1)]
    is_constant = values == pytest.approx([values[0]] * 4, rel=1e-9, abs=1e-12)
    assert (decision.Psi is not None) == is_constant == (name in PLVCC)
    assert len(decision.values) == 2 - is_constant


def momenta(m1: Any, Psi: Any, duration: float = 1.0) -> np.ndarray:
    """Psi' M q' along a motion without forces, (n_times, 2). Lagrange's equations, integrated numerically."""
    inertia, slope = (sp.lambdify(q2, f) for f in (m1, sp.diff(m1, q2)))
    change = sp.lambdify((q1, q2), Psi)

    def motion(t: float, state: np.ndarray) -> list[float]:
        _, angle, v1, v2 = state
        return [v1, v2, -slope(angle) / inertia(angle) * v1 * v2, slope(angle) * v1**2 / 2.0]

    start = [0.3, -0.2, 0.8, -0.5]
    run = solve_ivp(motion, (0.0, duration), start, rtol=1e-11, atol=1e-12, t_eval=np.linspace(0.0, duration, 20))
    return np.array(
        [np.array(change(a, b), dtype=float).T @ [inertia(b) * v1, v2] for a, b, v1, v2 in zip(*run.y, strict=True)]
    )


@pytest.mark.parametrize("name", PLVCC)
def test_momenta_of_an_explicit_psi_do_not_change(name: str) -> None:
    """PLvCC means that without forces the new momenta are constant. B_(i) is not used here."""
    values = momenta(PLVCC[name], decide(PLVCC[name]).Psi)
    np.testing.assert_allclose(values, np.broadcast_to(values[0], values.shape), rtol=1e-7, atol=1e-9)


def test_exact_numbers_are_the_models() -> None:
    """Table 1's fractions against the constants that the tests of the plant use."""
    from tests.plant import paper_model as paper

    for name, J1, gimbals in (("aranovskiy2020", paper.J1, 2), ("sokolov2019", paper.J1_single, 1)):
        m1 = sp.lambdify(q2, plvcc.papers_m1(name, numbers=True))
        expected = gimbals * (J1 + paper.J2 * np.cos(0.4) ** 2) / (paper.I_c + paper.I_d)
        assert m1(0.4) == pytest.approx(expected, rel=1e-12)


def test_symmetric_part_is_the_lie_derivative_for_a_full_inertia() -> None:
    """Step 1 does not need M = diag(m1(q2), 1): any Psi, and an M(q) drawn at random, to first order at q = 0."""
    coefficients = np.random.default_rng(0).integers(1, 100, (3, 3)).tolist()
    u, v, w = (value + first * q1 + second * q2 for value, first, second in coefficients)
    assert plvcc.symmetric_part_is_lie_derivative(1, sp.Matrix([[u, v], [v, w]]))


def test_a_wrong_bracket_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """aranovskiy2020 prints the bracket unclearly: with its sign turned, its own entries do not come out."""
    right = plvcc.bracket
    monkeypatch.setattr(plvcc, "bracket", lambda X, Y: -right(X, Y))
    assert not all(plvcc.printed_entries().values())
    assert not plvcc.symmetric_part_is_lie_derivative(1, plvcc.ANY_M1)


@pytest.mark.parametrize(
    ("paper", "place", "verdict", "factor"),
    [
        ("aranovskiy2020", "Appendix", "reproduced within stated conditions", 2),
        ("sokolov2019", "Proposition 1", "reproduced", 1),
    ],
)
def test_claims(paper: Any, place: str, verdict: str, factor: int) -> None:
    claim = plvcc.claim(paper)
    assert (claim.place, claim.verdict) == (place, verdict)
    assert all(claim.figures["steps"].values())
    assert not claim.figures["d_zero_alone_is_singular"]
    assert claim.figures["factor_of_m1_printed"] == factor
    assert claim.figures["factor_of_m1_by_the_equations"] == 1


def test_a_broken_proof_is_not_reproduced(monkeypatch: pytest.MonkeyPatch) -> None:
    right = plvcc.condition
    monkeypatch.setattr(plvcc, "condition", lambda m1: right(m1) + sp.diff(m1, q2))
    claim = plvcc.claim("sokolov2019")
    assert claim.verdict == "not reproduced"

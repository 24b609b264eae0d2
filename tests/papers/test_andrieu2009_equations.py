"""andrieu2009: W of (19), (20) against differences and motions; (11), (12); (2) and the exponent of (6)."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from cmg_mj.papers.andrieu2009 import theorem_1, theory
from cmg_mj.papers.andrieu2009.observer import BiLimitCorrection
from cmg_mj.papers.andrieu2009.theory import Lyapunov, decay, states

WITHIN = "reproduced within stated conditions"


def make_lyapunov(d_inf: float, l1: float = 8.0, sigma: float = 3.0) -> Lyapunov:
    return Lyapunov(BiLimitCorrection((l1, 1.0), d_inf), sigma, 2.0 + d_inf)


def invert(W: Lyapunov, e1: float, e2: float) -> np.ndarray:
    """s1 and s2 of a state, q1 inverted by bisection."""
    low, high = -abs(e2) - 1.0, abs(e2) + 1.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if float(W.q1(np.array(middle))) < e2 else (low, middle)
    return np.array([[W.K.l[0] * e1], [0.5 * (low + high)]])


# --- (19), (20) ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("d_inf", [0.0, 0.3, 0.5])
def test_w_is_its_integral_and_the_gradient_its_derivative(d_inf: float) -> None:
    W = make_lyapunov(d_inf)
    for e1, e2 in ((0.3, -0.8), (-0.2, -0.1), (0.01, 1.5)):
        point = invert(W, e1, e2)
        middle = W.h(point[1])[0]
        first = quad(lambda s, middle=middle: float(W.h(np.array(s)) - middle), point[1][0], point[0][0])[0]
        assert W.W(*point)[0] == pytest.approx(first + W.sigma * abs(e2) ** W.d_W / W.d_W, rel=1e-9)
        step = 1e-6
        by_e1 = (W.W(*invert(W, e1 + step, e2)) - W.W(*invert(W, e1 - step, e2)))[0] / (2.0 * step)
        by_e2 = (W.W(*invert(W, e1, e2 + step)) - W.W(*invert(W, e1, e2 - step)))[0] / (2.0 * step)
        assert [float(part[0]) for part in W.gradient(*point)] == pytest.approx([by_e1, by_e2], rel=1e-4, abs=1e-7)


@pytest.mark.parametrize("d_inf", [0.25, 0.75])
def test_w_is_homogeneous_in_the_bi_limit(d_inf: float) -> None:
    """W has the degree d_W with the weights (1, 1) near 0 and (1 - d_inf, 1) far out, and is positive."""
    W = make_lyapunov(d_inf)
    near, far = invert(W, 0.4e-9, -0.7e-9), invert(W, 0.4 * (1e12) ** (1.0 - d_inf), -0.7e12)
    twice_near, twice_far = invert(W, 0.8e-9, -1.4e-9), invert(W, 0.4 * (2e12) ** (1.0 - d_inf), -1.4e12)
    assert W.W(*twice_near)[0] / W.W(*near)[0] == pytest.approx(2.0**W.d_W, rel=1e-3)
    assert W.W(*twice_far)[0] / W.W(*far)[0] == pytest.approx(2.0**W.d_W, rel=1e-3)
    without_e2 = [W.W(np.array([s]), np.zeros(1))[0] for s in (0.3e12, 0.3e12 * 2.0 ** (1.0 - d_inf))]
    assert without_e2[1] / without_e2[0] == pytest.approx(2.0**W.d_W, rel=1e-3)
    assert (W.W(*states()) > 0.0).all()


@pytest.mark.parametrize("d_inf", [0.0, 0.5, 0.9])
def test_w_falls_along_motions_as_19_says(d_inf: float) -> None:
    """Integrated, with A1 and A2 that swing within (17), from other states than those of the grid."""
    pair = theory.search(d_inf)
    assert pair is not None
    W, _, c1, _ = pair

    def slope(tau: float, e: np.ndarray) -> list[float]:
        k1, k2 = W.K(float(e[0]))
        spread = theory.SPREAD
        return [(1.0 + spread * np.sin(7.0 * tau)) * (e[1] + k1), (1.0 + spread * np.cos(3.0 * tau)) * k2]

    for start in ([1.0, -2.0], [-30.0, 5.0], [0.01, 0.02]):
        tau = np.linspace(0.0, 2.0, 401)
        motion = solve_ivp(slope, (0.0, 2.0), start, "LSODA", tau, rtol=1e-9, atol=1e-12).y
        values = np.array([W.W(*invert(W, *e))[0] for e in motion.T])
        fall = -np.diff(values) / np.diff(tau)
        bound = values + values ** ((W.d_W + d_inf) / W.d_W)
        assert (fall > 0.95 * c1 * np.minimum(bound[1:], bound[:-1]) - 1e-12).all()


@pytest.mark.parametrize("b", [0.1, 0.8])
def test_20_with_a_b_of_its_own(b: float) -> None:
    """dW/dE B E is the growth of W where e1 grows by b and e2 by 1 + b: c2 from differences along that."""
    W = make_lyapunov(0.4)
    grid = states(np.geomspace(1e-2, 1e2, 5), 7)
    e1, e2 = grid[0] / W.K.l[0], W.q1(grid[1])
    step = 1e-5
    quotients = []
    for x, z in zip(e1.tolist(), e2.tolist(), strict=True):
        ahead, behind = (invert(W, x * (1.0 + b * s), z * (1.0 + (1.0 + b) * s)) for s in (step, -step))
        growth = (W.W(*ahead) - W.W(*behind))[0] / (2.0 * step)
        quotients.append(growth / W.W(*invert(W, x, z))[0])
    assert decay(W, b, grid=grid)[1] == pytest.approx(min(quotients), rel=1e-3)


def test_constants_hold_on_a_finer_grid() -> None:
    claim = theory.equations_19_20()
    assert claim.verdict == "illustrated"
    for d_inf in (0.0, 0.5, 0.9):
        pair = theory.search(d_inf)
        assert pair is not None
        W, b, c1, _ = pair
        finer = decay(W, b, theory.SPREAD, states(np.geomspace(1e-9, 1e8, 501), 97))
        assert min(finer) > 0.0
        assert finer[0] == pytest.approx(c1, rel=0.1)


def test_19_holds_for_every_a_within_the_spread() -> None:
    """c1 by the worst of the four corners of (17), each by itself."""
    W, grid, spread = make_lyapunov(0.4), states(np.geomspace(1e-2, 1e2, 7), 9), 0.25
    grid = grid[:, np.abs(grid[0] - grid[1]) > 1e-6 * np.abs(grid[0])]
    e1, e2, (by_e1, by_e2), value = grid[0] / W.K.l[0], W.q1(grid[1]), W.gradient(*grid), W.W(*grid)
    k1, k2 = W.K(e1)
    bound = value + value ** ((W.d_W + 0.4) / W.d_W)
    corners = [
        (-(a1 * by_e1 * (e2 + k1) + a2 * by_e2 * k2) / bound).min()
        for a1 in (1.0 - spread, 1.0 + spread)
        for a2 in (1.0 - spread, 1.0 + spread)
    ]
    assert decay(W, 0.5, spread, grid)[0] == pytest.approx(min(corners))
    assert decay(W, 0.5, spread, grid)[0] < decay(W, 0.5, 0.0, grid)[0]


def test_a_poor_w_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Too little weight on e2 fails (20), too little l1 (19)."""
    assert decay(make_lyapunov(0.5, sigma=0.03), 0.5)[1] < 0.0
    assert decay(make_lyapunov(0.5, l1=0.5), 0.5, 0.3)[0] < 0.0
    monkeypatch.setattr(theory, "L1", (0.5,))
    assert theory.equations_19_20().verdict == "not reproduced"


# --- (11), (12) ---------------------------------------------------------------------------------------------


def test_disturbances_and_starts() -> None:
    error, gain = theorem_1.equations_11_12_claims()
    assert error.verdict == gain.verdict == "illustrated"  # one system, one observer
    for row in error.figures["late_scaled_error"].values():  # a tenth of the disturbance, about a tenth of the error
        assert row[1] / row[2] == pytest.approx(10.0, rel=0.1)
    assert np.all(np.diff(gain.figures["largest_gain_by_error"]) > 0.0)
    assert np.all(np.diff(gain.figures["largest_late_gain_by_amplitude"]) > 1.0)


def test_the_disturbed_solution_is_one_of_the_system() -> None:
    """Without an error at the start, and with exact measurements of y, what is left is what was put in."""
    errors, gain = theorem_1.follow(theorem_1.HOMOGENEOUS, [theorem_1.Column()])
    assert np.abs(errors).max() < 1e-4
    assert gain[0, 0] == 2.0  # phi2


# --- (2), (6) -----------------------------------------------------------------------------------------------


def test_linear_increments() -> None:
    claim = theory.linear_increments()
    assert claim.verdict == "reproduced"
    assert theory.increments_of_2(0.0, seed=5) == pytest.approx(1.0, abs=1e-9)
    assert theory.increments_of_2(0.2, seed=5) > 2.0


def test_exponent_of_6() -> None:
    """n = 2: 1 + p by section 2.1, 1 as printed, which bounds no power; the two differ for every n."""
    claim = theory.exponent_of_6()
    assert (claim.verdict, "n - i - 1" in claim.conditions) == ("illustrated", True)
    grown = [theory.quotient_of_6(1.0, 0.5, size) for size in (1e2, 1e4, 1e6)]
    assert grown[1] / grown[0] == pytest.approx(10.0, rel=0.1)
    assert grown[2] / grown[1] == pytest.approx(10.0, rel=0.1)

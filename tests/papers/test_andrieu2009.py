"""andrieu2009 reproduced: the plant against its equations, the claims on other seeds, and that they can fail."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from cmg_mj.papers.andrieu2009 import bioreactor, figures, on_the_rig, theorem_1, theory
from cmg_mj.papers.andrieu2009.bioreactor import Bioreactor, dilution
from cmg_mj.papers.andrieu2009.figures import (
    CONSTANT,
    HOMOGENEOUS,
    UPDATED,
    Run,
    Study,
    correction,
    replay,
    rms_by_kind,
    rms_late,
    run_plant,
    simple_copy,
    study,
)
from cmg_mj.papers.claim import Claim
from cmg_mj.papers.pair import push_recovery
from tests.papers.worlds import make_result

SEEDS, FIRST = 6, 500
"""Other seeds than the report's."""


@pytest.fixture(scope="module")
def runs() -> Study:
    return study(SEEDS, FIRST)


def of_json(claim: Claim) -> Claim:
    """A claim whose figures JSON can hold."""
    json.dumps(dict(claim.figures), allow_nan=False)
    return claim


# --- the plant ----------------------------------------------------------------------------------------------


def test_f2_is_the_derivative_of_x2_along_the_plant() -> None:
    """(15) from (14) by sympy."""
    e1, e2, u, h = sp.symbols("eta1 eta2 u hbar", positive=True)
    growth = e1 * e2 / (h * e1 + e2)
    derivative = sp.diff(growth, e1) * (growth - u * e1) + sp.diff(growth, e2) * (-growth + u * (1 - e2))
    m = (u / h, -u - 1 / h - 2 * u / (h * e1), 2 / (h * e1) + u / (h * e1**2), (h - 1) / (h * e1**2))
    assert sp.simplify(derivative - sum(m_i * growth**i for i, m_i in enumerate(m))) == 0
    reactor = Bioreactor(0.8)
    for point in ((0.3, 0.4, 0.2), (0.9, 0.05, 0.6)):
        expected = float(derivative.subs({e1: point[0], e2: point[1], u: point[2], h: sp.Rational(4, 5)}))
        assert reactor.f2(point[2], point[0], reactor.to_x2(*point[:2])) == pytest.approx(expected, rel=1e-12)


def test_slope_of_f2_is_its_derivative() -> None:
    reactor, d = Bioreactor(0.8), 1e-6
    for x1, x2, u in ((0.3, 0.1, 0.2), (0.02, 0.01, 0.6)):
        numeric = (reactor.f2(u, x1, x2 + d) - reactor.f2(u, x1, x2 - d)) / (2.0 * d)
        assert reactor.f2_slope(u, x1, x2) == pytest.approx(numeric, rel=1e-6)


def test_domain_is_the_image_of_the_set() -> None:
    """Random points of M_eta lie between the bounds on x2, its corners on them."""
    reactor = Bioreactor(0.8)
    rng = np.random.default_rng(1)
    eta = (
        np.array([reactor.eps1, reactor.eps2])
        + (1.0 - reactor.eps1 - reactor.eps2) * rng.dirichlet((1, 1, 1), 500)[:, :2]
    )
    x2 = reactor.to_x2(*eta.T)
    low, high = reactor.x2_bounds(eta[:, 0])
    assert (low <= x2 + 1e-15).all()
    assert (x2 <= high + 1e-15).all()
    assert reactor.x2_bounds(0.3)[0] == pytest.approx(reactor.to_x2(0.3, reactor.eps2))
    assert reactor.x2_bounds(0.3)[1] == pytest.approx(reactor.to_x2(0.3, 0.7))
    x1, _ = reactor.limit(np.array([-1.0, 0.5, 2.0]), np.zeros(3))
    assert x1.tolist() == [reactor.eps1, 0.5, 1.0 - reactor.eps2]
    assert [reactor.limit(0.3, x2)[1] for x2 in (-1.0, 1.0)] == [*reactor.x2_bounds(0.3)]


@pytest.mark.parametrize("hbar", [0.1, 0.8, 1.0, 1.3])
def test_closed_forms_of_the_bounds_are_the_maxima(hbar: float) -> None:
    """Omega_1 and Omega_2 against their definitions, over a dense grid of x2."""
    reactor = Bioreactor(hbar)
    rng = np.random.default_rng(2)
    for _ in range(200):
        x1 = math.exp(rng.uniform(math.log(reactor.eps1), math.log(1.0 - reactor.eps2)))
        u, p = rng.uniform(bioreactor.U_MIN, bioreactor.U_MAX), rng.uniform(0.1, 0.95)
        low, high = reactor.x2_bounds(x1)
        hat = rng.uniform(low, high)
        x2 = np.linspace(low, high, 4001)
        _, m1, m2, m3 = reactor.coefficients(u, x1)
        first = np.abs(m1 + (m2 + m3 * hat) * (hat + x2) + m3 * x2**2).max()
        inner = (m2 + m3 * hat) * (hat ** (1.0 - p) + x2 ** (1.0 - p))
        second = np.abs(m1 + hat**p * (inner + m3 * x2 ** (2.0 - p))).max()
        printed = np.abs(m1 + hat**p * (inner + m2 * x2 ** (2.0 - p))).max()
        assert reactor.Omega1(u, x1, hat) == pytest.approx(first, rel=1e-5)
        assert reactor.Omega2(u, x1, hat, p) == pytest.approx(second, rel=1e-5)
        assert reactor.Omega2(u, x1, hat, p, with_misprint=True) == pytest.approx(printed, rel=1e-5)


def test_input_is_the_papers() -> None:
    assert [dilution(t) for t in (0.0, 9.99, 10.0, 19.99, 20.0, 34.99, 35.0, 50.0)] == [
        0.410, 0.410, 0.02, 0.02, 0.6, 0.6, 0.1, 0.1,
    ]  # fmt: skip


def test_plant_comes_to_its_equilibrium_and_stays_in_its_set() -> None:
    """eta1 + eta2 = 1 and growth = u: eta2 = u hbar/(1 - u + u hbar) = u for hbar = 1."""
    run = run_plant([1, 2, 3], 0.0)
    assert run.eta[1, -1] == pytest.approx(0.1, abs=2e-2)
    before_20 = int(np.searchsorted(run.t, 34.99))
    assert run.eta[1, before_20] == pytest.approx(0.6, abs=1e-3)
    reactor = Bioreactor(1.0)
    assert run.eta[0].min() >= reactor.eps1
    assert run.eta[1].min() >= reactor.eps2
    assert run.eta.sum(axis=0).max() <= 1.0 + 1e-12
    assert np.array_equal(run.y, run.eta[0])
    assert run_plant([1], 0.05).y[:, 0] != pytest.approx(run.y[:, 0])


# --- the bounds ---------------------------------------------------------------------------------------------


def test_claims_on_the_bounds() -> None:
    parts = ("invariance", "coordinates", "increments", "order_of_bounds", "noise_level")
    claims = [of_json(getattr(bioreactor, part)()) for part in parts]
    partly = "reproduced within stated conditions"
    no = "not reproduced"
    assert [claim.verdict for claim in claims] == ["reproduced", "reproduced", partly, no, no]


def test_the_set_is_not_invariant_for_inputs_beyond_its_own() -> None:
    reactor = Bioreactor(1.0)
    assert bioreactor.least_inflow(reactor, bioreactor.U_MIN, bioreactor.U_MAX) > -1e-12
    assert bioreactor.least_inflow(reactor, 0.9 * bioreactor.U_MIN, bioreactor.U_MAX) < -1e-4
    assert bioreactor.least_inflow(reactor, bioreactor.U_MIN, 1.05 * bioreactor.U_MAX) < -1e-4


@pytest.mark.parametrize("p", [0.5, 0.9])
@pytest.mark.parametrize("hbar", [0.8, 1.0])
def test_both_inequalities_hold_and_the_misprint_shows(hbar: float, p: float) -> None:
    quotients = bioreactor.increments_over_domain(hbar, p, 24)
    for name in ("by_Omega1", "by_Omega2", "by_Omega2_local", "slope_over_Omega2"):
        assert quotients[f"{name}_ratio"] <= 1.0 + 1e-9
    assert quotients["slope_over_Omega2_printed_ratio"] > 1.01
    assert quotients["by_Omega2_printed_ratio"] <= 1.0  # c_inf is so large that the misprint does no harm there


def test_the_largest_slope_is_at_a_corner_of_the_domain() -> None:
    reactor = Bioreactor(0.8)
    low, _ = reactor.x2_bounds(reactor.eps1)
    assert reactor.df2_max == pytest.approx(abs(reactor.f2_slope(0.7, reactor.eps1, low)))
    assert reactor.df2_max == pytest.approx(121.07, abs=0.01)


# --- the figures --------------------------------------------------------------------------------------------


def test_rates_are_in_order_in_every_window(runs: Study) -> None:
    means, in_order = figures.ordered_rates(runs)
    assert in_order.tolist() == [True] * 4
    # An independent implementation's figures. In the first window the start has not quite faded.
    assert means[1, 1:] == pytest.approx([1.25, 2.93, 1.35], rel=0.03)
    assert means[2, 1:] == pytest.approx([1.23, 1.04, 1.18], rel=0.03)
    assert means[3, 1:] == pytest.approx([-1.22, -0.63, -1.11], abs=0.03)


def test_errors_are_in_order_in_every_seed(runs: Study) -> None:
    for replays in (runs.nominal, runs.loud):
        rms = rms_by_kind(runs.run, replays)
        assert figures.share_in_order(rms) >= 0.95
    assert rms_by_kind(runs.run, runs.nominal).mean(axis=1) == pytest.approx([0.255, 0.071, 0.056], rel=0.08)


def test_claims_on_the_figures(runs: Study) -> None:
    partly = "reproduced within stated conditions"
    claims = {
        figures.figure_1: (partly,),
        figures.figure_2: (partly,),
        figures.bias: (partly,),
        figures.bias_of_constant_gain: ("not reproduced",),
        figures.bias_of_updated_gains: ("not reproduced", partly),
        figures.spread: (partly,),
        simple_copy: ("reproduced",),
    }
    for make, verdicts in claims.items():
        assert of_json(make(runs)).verdict in verdicts


def test_claims_can_fail(runs: Study) -> None:
    """The observers' names exchanged."""
    swapped = {CONSTANT: runs.nominal[UPDATED], UPDATED: runs.nominal[CONSTANT], HOMOGENEOUS: runs.nominal[HOMOGENEOUS]}
    exchanged = runs._replace(nominal=swapped)
    for make in (figures.figure_1, figures.figure_2, figures.bias):
        claim = make(exchanged)
        assert claim.verdict == "not reproduced"
        assert claim.reason


def test_cause_of_a_bias_is_judged_by_what_is_left_without_it(runs: Study) -> None:
    """Observers that know hbar beside those that do not; the constant gain's bias stays, the others' mostly goes."""
    shares = figures.bias_left(runs)
    assert shares[0].min() > 0.7
    claim = figures.bias_of_constant_gain(runs)
    assert claim.figures["share_left_with_exact_hbar"] == shares[0].tolist()
    assert shares[1:, [0, 2]].max() < 0.4
    error = runs.nominal[CONSTANT].eta2_error
    gone = runs.exact | {CONSTANT: runs.exact[CONSTANT]._replace(eta2_error=0.1 * error)}
    partly = "reproduced within stated conditions"
    assert figures.bias_of_constant_gain(runs._replace(exact=gone)).verdict == partly
    claim = figures.bias_of_updated_gains(runs._replace(exact=runs.nominal))
    assert (claim.verdict, any(claim.measures.values())) == ("not reproduced", False)


def test_the_cause_of_a_bias_must_be_so_in_every_window(runs: Study, monkeypatch: pytest.MonkeyPatch) -> None:
    shares = np.full((3, 4), 0.2)
    monkeypatch.setattr(figures, "bias_left", lambda study: shares)
    partly = "reproduced within stated conditions"
    assert [figures.bias_of_constant_gain(runs).verdict, figures.bias_of_updated_gains(runs).verdict] == [partly] * 2
    shares[:, 3] = 0.7
    for claim in (figures.bias_of_constant_gain(runs), figures.bias_of_updated_gains(runs)):
        assert claim.verdict == "not reproduced"
        assert list(claim.measures.values()) == [True, True, True, False]


def test_order_of_figure_2_is_needed_in_nearly_every_seed(runs: Study) -> None:
    """With the second and third exchanged in one seed of six it is in order in five."""
    second, third = (np.array(runs.nominal[kind].eta2_error) for kind in (UPDATED, HOMOGENEOUS))
    second[:, 0], third[:, 0] = third[:, 0].copy(), second[:, 0].copy()
    swapped = {
        UPDATED: runs.nominal[UPDATED]._replace(eta2_error=second),
        HOMOGENEOUS: runs.nominal[HOMOGENEOUS]._replace(eta2_error=third),
    }
    claim = figures.figure_2(runs._replace(nominal=runs.nominal | swapped))
    assert claim.figures["share_of_seeds_in_order"] == pytest.approx(5.0 / 6.0)
    assert claim.verdict == "not reproduced"


def test_spread_must_go_with_the_rate(runs: Study) -> None:
    """The errors of the noisiest given to the one with the least rate."""
    noisy = runs.nominal[HOMOGENEOUS]._replace(eta2_error=10.0 * runs.nominal[CONSTANT].eta2_error)
    assert figures.spread(runs._replace(nominal=runs.nominal | {HOMOGENEOUS: noisy})).verdict == "not reproduced"


def test_the_homogeneous_terms_are_inert(runs: Study) -> None:
    claim = of_json(correction(runs))
    assert claim.is_ours
    assert claim.verdict == "reproduced within stated conditions"
    assert claim.figures["largest_argument"] < 1e-3
    assert claim.figures["largest_difference_eta2"] < 1e-4
    assert claim.figures["rms_error_eta2_linear_correction"] == pytest.approx(claim.figures["rms_error_eta2"], rel=1e-3)


def test_the_result_does_not_hang_on_the_step(runs: Study) -> None:
    """The same noise, interpolated, at half the step; the first half of the time."""
    fine = first_half(run_plant([FIRST, FIRST + 1], dt=0.005))
    coarse = first_half(runs.run)
    for kind in (UPDATED, HOMOGENEOUS):
        fine_rms = rms_late(fine, replay(kind, fine, Bioreactor(0.8)).eta2_error)
        coarse_rms = rms_late(coarse, runs.nominal[kind].eta2_error[: len(coarse.t), :2])
        assert fine_rms == pytest.approx(coarse_rms, rel=0.02)


def first_half(run: Run) -> Run:
    half = run.t <= 25.0
    return run._replace(t=run.t[half], u=run.u[half], eta=run.eta[:, half], y=run.y[half])


# --- the theory ---------------------------------------------------------------------------------------------


def test_claims_of_the_theory() -> None:
    general = "illustrated"
    verdicts = {
        theory.increments: general,
        theorem_1.no_observer_beyond_1: general,
        theory.scaling_conditions: "reproduced",
        theory.gain_tracking: general,
        theory.theorem_2: general,
        theorem_1.theorem_1: general,
    }
    for make, verdict in verdicts.items():
        assert of_json(make()).verdict == verdict


@pytest.mark.parametrize("p", [0.5, 1.5, 2.0])
def test_escaping_solution_solves_1(p: float) -> None:
    """x1' = x2 and x2' = x2^(1+p) by scipy, up to nine tenths of its time."""
    end = 3.0**-p / p
    x = solve_ivp(lambda t, x: [x[1], x[1] ** (1.0 + p)], (0.0, 0.9 * end), [0.0, 3.0], rtol=1e-10, atol=1e-12).y[:, -1]
    assert [float(v) for v in theorem_1.solution(p, 3.0, 0.1)] == pytest.approx(x.tolist(), rel=1e-7)


def test_escape_is_found_below_1_and_missed_beyond() -> None:
    """Other starts, powers and tolerances than the report's; the solution whose start is known is not missed."""
    for start in (3.0, 300.0):
        assert theorem_1.escape(0.4, start, tolerance=1e-8)[1][-1] < theorem_1.FOUND
        assert theorem_1.escape(2.0, 10.0 * start, tolerance=1e-8)[1][-1] > theorem_1.MISSED
    assert theorem_1.escape(1.5, 30.0, 30.0, 1e-9)[1].max() < 1e-4


# --- the rig ------------------------------------------------------------------------------------------------


def test_on_the_rig() -> None:
    """Three worlds of `high_gain` in the loop: it stands, and its gain does not move."""
    result = push_recovery("high_gain", 90_000, duration_s=on_the_rig.DURATION_S).run_many(3)
    errors = result.values("velocity_rms_error_rad_s")
    assert np.isfinite(errors).all()
    assert 0.05 < errors.mean() < 0.085
    claim = of_json(on_the_rig.idle_claim(result))
    assert claim.verdict == "reproduced within stated conditions"
    assert 1e-4 < claim.figures["largest_Omega_1_s"] < 0.015


def test_a_fall_on_the_rig_is_not_hidden() -> None:
    runs = dict.fromkeys(on_the_rig.KINDS, make_result([0.07, 0.071, 0.072, 0.073]))
    claim = of_json(on_the_rig.comparison_claim(runs | {"high_gain": make_result([0.06, 0.061, 0.059, 0.08], fell=1)}))
    assert claim.verdict == "not reproduced"
    assert claim.figures["stood_count"]["high_gain"] == 3
    assert claim.figures[on_the_rig.VELOCITY]["high_gain"] == pytest.approx(0.06)

"""The time-varying observer against aranovskiy2020 (10), its Riccati equation above all (Remark 1 there)."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm, solve_continuous_are

from cmg_mj.core.errors import InputError
from cmg_mj.observers import Measurement
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario
from tests.observers.reference import (
    DT,
    GRAVITY_TORQUE,
    HEAVY,
    J1,
    PAPER,
    integrate,
    ltv_slope,
    observer,
    rough_signals,
    run,
)
from tests.tiers import slow_but

Q = np.diag([1.0, 5e6, 1.0])  # Table 2
C = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def riccati_matrix(state) -> np.ndarray:
    """H, (3, 3)."""
    return np.array([[state.h11, state.h12, 0.0], [state.h12, state.h22, 0.0], [0.0, 0.0, state.h33]], dtype=float)


def relative_errors(package_step: np.ndarray, reference: np.ndarray) -> float:
    """Largest relative error of the entries that are not zero by structure."""
    mask = np.array([[1, 1, 0], [1, 1, 0], [0, 0, 1]], dtype=bool)
    return float(np.abs(package_step[..., mask] / reference[..., mask] - 1.0).max())


DURATIONS_S = slow_but([1.0, 4.0], 1.0)
"""Of the closed loop that the observer is compared along."""


# --- along a closed-loop run ---------------------------------------------------------------------------


@cache
def closed_loop(duration_s: float) -> Trajectory:
    """The observer in the loop, with sensor noise and a push in the middle."""
    scenario = load_scenario("push_recovery", [f"duration_s={duration_s}", f"push.0.start_s={duration_s / 2.0}"])
    trajectory = prepare(scenario.with_observer("ltv")).run().trajectory
    assert trajectory is not None
    assert len(trajectory) == round(200 * duration_s)
    return trajectory


@cache
def run_and_reference(duration_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """H and the estimate at every tick but the first, ours and the reference's."""
    y1, y2, u = (closed_loop(duration_s)[name] for name in ("y1_rad", "y2_rad", "u_rad_s"))
    start = np.concatenate([[y1[0], 0.0, y2[0]], np.eye(3).ravel()])
    reference = integrate(ltv_slope(), start, y1, y2, u)
    estimates, states = run(observer("ltv"), y1, y2, u)
    matrices = np.array([riccati_matrix(state) for state in states[1:]])
    return matrices, reference[:, 3:].reshape(-1, 3, 3), estimates, reference[:, :3]


@pytest.mark.parametrize("duration_s", DURATIONS_S)
def test_riccati_matrix_is_the_reference_integrations(duration_s: float) -> None:
    matrices, reference, _, _ = run_and_reference(duration_s)
    error = relative_errors(matrices, reference)
    condition = np.linalg.cond(matrices)
    print(f"largest relative error of H's entries {error:.1e}; condition number up to {condition.max():.3g}")
    assert error < 1e-6
    assert np.abs(reference[:, [0, 1, 2, 2], [2, 2, 0, 1]]).max() < 1e-9  # the third state decouples


@pytest.mark.parametrize("duration_s", DURATIONS_S)
def test_riccati_matrix_is_positive_definite_along_the_run(duration_s: float) -> None:
    matrices, _, _, _ = run_and_reference(duration_s)
    assert np.linalg.eigvalsh(matrices).min() > 0.5


@pytest.mark.parametrize("duration_s", DURATIONS_S)
def test_estimate_is_the_reference_integrations(duration_s: float) -> None:
    _, _, estimates, reference = run_and_reference(duration_s)
    error = np.abs(estimates - reference).max(axis=0)
    print(f"largest error of the estimate {error} (rate's rms {np.std(reference[:, 1]):.3f} rad/s)")
    np.testing.assert_array_less(error, [2e-6, 5e-5, 1e-12])


@pytest.mark.parametrize("duration_s", DURATIONS_S)
def test_estimate_recorded_in_the_loop_is_the_observers_alone(duration_s: float) -> None:
    """Measurements and commands of the record suffice: there is no other memory."""
    loop_estimates = np.stack(
        [closed_loop(duration_s)[f"estimate/ltv/{name}"] for name in ("x1_rad", "x2_rad_s", "x3_rad")], axis=1
    )
    _, _, estimates, _ = run_and_reference(duration_s)
    np.testing.assert_allclose(loop_estimates[1:], estimates, rtol=0.0, atol=1e-9)


# --- other gains, other rigs, other rates --------------------------------------------------------------

CASES = [
    pytest.param({}, PAPER, id="Table 2"),
    pytest.param({"Q": (300.0, 5e6, 1.0)}, PAPER, id="Q1"),
    pytest.param({"Q": (1.0, 2e4, 1.0)}, PAPER, id="Q2"),
    pytest.param({"Q": (1.0, 5e6, 900.0)}, PAPER, id="Q3"),
    pytest.param({"H0": (40.0, 1.0, 1.0)}, PAPER, id="H0 1"),
    pytest.param({"H0": (1.0, 3e4, 1.0)}, PAPER, id="H0 2"),
    pytest.param({"H0": (1.0, 1.0, 0.1)}, PAPER, id="H0 3"),
    pytest.param({"Q": (1.0, 100.0, 1.0)}, HEAVY, id="another rig"),
]


@pytest.mark.daily_cases("Table 2", "another rig", "Q2")
@pytest.mark.parametrize(("parameters", "model"), CASES)
def test_follows_the_continuous_observer(parameters: dict, model) -> None:
    y1, y2, u = rough_signals(100)
    start = np.concatenate([[y1[0], 0.0, y2[0]], np.diag(parameters.get("H0", (1.0, 1.0, 1.0))).ravel()])
    reference = integrate(ltv_slope(model, parameters.get("Q", (1.0, 5e6, 1.0))), start, y1, y2, u)
    estimates, states = run(observer("ltv", model=model, **parameters), y1, y2, u)
    error = relative_errors(np.array([riccati_matrix(s) for s in states[1:]]), reference[:, 3:].reshape(-1, 3, 3))
    relative_error = np.abs(estimates - reference[:, :3]).max(axis=0) / np.abs(reference[:, :3]).max(axis=0)
    print(f"{parameters}: relative error of H {error:.1e}, of the estimate {relative_error}")
    assert error < (2e-4 if model is HEAVY else 1e-6)
    np.testing.assert_array_less(relative_error, 1e-4)


def test_converges_with_the_square_of_the_period() -> None:
    """To the solution for smooth signals, on the rig where A' varies most."""
    u, duration = 0.7, 0.6

    def y1(t: np.ndarray | float) -> np.ndarray:
        return 0.05 * np.sin(9.0 * np.asarray(t)) + 0.02 * np.sin(21.0 * np.asarray(t) + 0.3)

    def y2(t: np.ndarray | float) -> np.ndarray:
        return u * np.asarray(t) + 0.3

    slope = ltv_slope(HEAVY)
    start = np.concatenate([[y1(0.0), 0.0, y2(0.0)], np.eye(3).ravel()])
    reference = solve_ivp(
        lambda t, z: slope(z, float(y1(t)), float(y2(t)), u),
        (0.0, duration),
        start,
        "DOP853",
        rtol=1e-11,
        atol=1e-12,
    ).y[:, -1]
    errors = []
    for n in (120, 240, 480, 960):
        t = np.linspace(0.0, duration, n + 1)
        _, states = run(observer("ltv", duration / n, HEAVY), y1(t), y2(t), np.full(n, u))
        H = reference[3:].reshape(3, 3)
        errors.append([abs(states[-1].x2 - reference[1]), relative_errors(riccati_matrix(states[-1]), H)])
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    print(f"orders of the rate and of H: {np.round(orders, 2).tolist()}")
    assert orders.min() > 1.9


def test_steady_riccati_matrix_solves_the_algebraic_equation() -> None:
    """At rest A' is the double integrator's."""
    A = np.zeros((3, 3))
    A[0, 1] = 1.0
    _, states = run(observer("ltv"), [0.01] * 6000, [0.3] * 6000, [0.0] * 6000)
    expected = solve_continuous_are(A.T, C.T, Q, np.eye(2))
    np.testing.assert_allclose(riccati_matrix(states[-1]), expected, rtol=1e-10, atol=1e-8)
    closed_form = [math.sqrt(1.0 + 2.0 * math.sqrt(5e6)), math.sqrt(5e6), 1.0]
    np.testing.assert_allclose([states[-1].h11, states[-1].h12, states[-1].h33], closed_form, rtol=1e-10)


@pytest.mark.parametrize("e_deg", [0.5, -2.0])
def test_a_bias_leaves_a_rate_error_of_the_closed_form(e_deg: float) -> None:
    """At rest y1 = -e: H12 (y1 - x1) balances gravity, and x2 = H11 (x1 - y1)."""
    y1 = -math.radians(e_deg)
    estimates, _ = run(observer("ltv"), [y1] * 1000, [0.0] * 1000, [0.0] * 1000)
    pull = GRAVITY_TORQUE * math.sin(y1) / J1
    expected = pull * math.sqrt(1.0 + 2.0 * math.sqrt(5e6)) / math.sqrt(5e6)
    assert estimates[-1, 1] == pytest.approx(expected, rel=1e-8)


# --- positive definite whatever the gains and the rate -------------------------------------------------

EXTREMES = [
    pytest.param(dt, (q1, q2, q3), steps, id=f"{dt:g} s, Q = {q1:g}, {q2:g}, {q3:g}")
    for dt in (0.001, 0.005, 0.05)
    for q1, q2, q3, steps in (
        (1.0, 5e6, 1.0, 200),
        (1e-3, 1e-3, 1e-3, 200),
        (1e-3, 1e12, 1e6, 25),
        (1e6, 1e-3, 1.0, 25),
        (1e6, 1e6, 1e6, 25),
        (1e6, 1e12, 1e-3, 25),
    )
] + [pytest.param(0.001, (1e12, q2, 1.0), 3, id=f"0.001 s, Q = 1e+12, {q2:g}, 1") for q2 in (1e-3, 1e12)]


@pytest.mark.parametrize(("dt", "weights", "steps"), EXTREMES)
def test_riccati_matrix_stays_positive_definite(dt: float, weights: tuple[float, float, float], steps: int) -> None:
    """Step after step on the rig where A' varies most, from small and large H0. By minors: H may be as ill
    conditioned as 1e16, where eigenvalues are lost in rounding."""
    y1, y2, u = rough_signals(steps)
    for h0 in (1e-3, 1e6):
        _, states = run(observer("ltv", dt, HEAVY, Q=weights, H0=(h0, h0, h0)), y1, y2, u)
        for state in states:
            assert np.isfinite(riccati_matrix(state)).all()
            assert state.h11 > 0.0
            assert state.h22 > 0.0
            assert state.h11 * state.h22 > state.h12**2
            assert state.h33 > 0.0


@pytest.mark.daily_cases("0.005-weights0", "0.005-weights1", "0.05-weights2")
@pytest.mark.parametrize(
    ("dt", "weights"),
    [(0.005, (1.0, 1e9, 1.0)), (0.005, (1e4, 1e9, 1e4)), (0.05, (1.0, 5e6, 1.0)), (0.05, (100.0, 1e6, 9.0))],
)
def test_riccati_matrix_settles_where_it_should(dt: float, weights: tuple[float, float, float]) -> None:
    """At rest: H12 = sqrt(Q2), H11 = sqrt(Q1 + 2 H12), H22 = H11 H12, H33 = sqrt(Q3)."""
    n = 2000
    _, states = run(observer("ltv", dt, Q=weights), [0.0] * n, [0.0] * n, [0.0] * n)
    h12 = math.sqrt(weights[1])
    h11 = math.sqrt(weights[0] + 2.0 * h12)
    expected = [[h11, h12, 0.0], [h12, h11 * h12, 0.0], [0.0, 0.0, math.sqrt(weights[2])]]
    np.testing.assert_allclose(riccati_matrix(states[-1]), expected, rtol=1e-8)


@pytest.mark.parametrize("dt", [0.001, 0.05])
@pytest.mark.parametrize("weights", [(400.0, 1e4, 1.0), (1.0, 5e6, 100.0)])
def test_riccati_matrix_is_exact_while_the_gimbal_stands(dt: float, weights: tuple[float, float, float]) -> None:
    """A' is constant then, of up to -4 1/s on this rig, and scipy's exponential of the Hamiltonian exact."""
    n, y2, u = 12, 0.7, 4.7
    _, states = run(observer("ltv", dt, HEAVY, Q=weights), [0.01] * n, [y2] * n, [u] * n)
    damping = u * HEAVY.J2 * math.sin(2.0 * y2) / (HEAVY.J1 + HEAVY.J2 * math.sin(y2) ** 2)
    A = np.array([[0.0, 1.0, 0.0], [0.0, -damping, 0.0], [0.0, 0.0, 0.0]])
    H, advance = np.eye(3), exact_map(A, dt, np.diag(weights))
    for state in states[1:]:
        H = advance(H)
        assert relative_errors(riccati_matrix(state), H) < 1e-8


@pytest.mark.daily_cases("0.1-weights2")
@pytest.mark.parametrize(
    ("dt", "weights"), [(0.005, (1e6, 5e6, 1.0)), (0.005, (1.0, 1e12, 1.0)), (0.1, (1.0, 5e6, 1.0))]
)
def test_estimate_is_stable_at_any_gain(dt: float, weights: tuple[float, float, float]) -> None:
    """The continuous observer is, whatever Q: its estimate of a steady tilt is the tilt, but for the bias."""
    n = 2000
    estimates, _ = run(observer("ltv", dt, Q=weights), [0.01] * n, [0.0] * n, [0.0] * n)
    assert estimates[-1, 0] == pytest.approx(0.01, abs=1e-2)


# --- Remark 1: is the Riccati equation delicate? Other methods are in tests/papers/ ---------------------


def exact_map(A: np.ndarray, h: float, weights: np.ndarray = Q) -> Callable[[np.ndarray], np.ndarray]:
    """H after a time h, by scipy's exponential of the whole Hamiltonian matrix."""
    E = expm(h * np.block([[-A.T, C.T @ C], [weights, A]]))
    return lambda H: (E[3:, :3] + E[3:, 3:] @ H) @ np.linalg.inv(E[:3, :3] + E[:3, 3:] @ H)


def package_step(H: np.ndarray, h: float) -> np.ndarray:
    """One sample of the package's observer at rest."""
    estimator = observer("ltv", h)
    still = Measurement(0.0, 0.0)
    state = estimator.init(still)._replace(h11=H[0, 0], h12=H[0, 1], h22=H[1, 1], h33=H[2, 2])
    return riccati_matrix(estimator.step(state, still, 0.0)[0])


@pytest.mark.parametrize("rate_hz", [200.0, 20.0])
def test_the_first_transient_is_exact(rate_hz: float) -> None:
    """From H0 = I at rest, for 0.2 s."""
    A = np.zeros((3, 3))
    A[0, 1] = 1.0
    H, advance = np.eye(3), exact_map(A, 1.0 / rate_hz)
    truth = H
    for _ in range(round(0.2 * rate_hz)):
        H, truth = package_step(H, 1.0 / rate_hz), advance(truth)
        assert H[0, 1] == pytest.approx(truth[0, 1], rel=1e-8)
        assert np.linalg.eigvalsh(H)[0] > 0.0
    assert package_step(np.eye(3), DT)[0, 1] == pytest.approx(exact_map(A, DT)(np.eye(3))[0, 1], rel=1e-12)


# --- refusals ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "parameters",
    [{"Q": (0.0, 5e6, 1.0)}, {"Q": (1.0, -5e6, 1.0)}, {"H0": (1.0, 1.0, 0.0)}, {"Q": (1.0, 1.0)}, {"Q": 3.0}],
)
def test_what_is_not_positive_definite_is_refused(parameters: dict) -> None:
    (name,) = parameters
    with pytest.raises(InputError, match=rf"^observer\.{name}"):
        observer("ltv", **parameters)

"""The LQG law against solutions written out here: its gains, its poles, its error."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import expm, solve_discrete_are

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.core.types import feedback_state
from cmg_mj.laws import make_law
from cmg_mj.laws.lqg import Lqg
from cmg_mj.observers import Measurement
from tests.plant import paper_model as paper
from tests.recorded import push_recovery, recorded

PAIR = ReducedModel(paper.J1, paper.J2, paper.J_d, paper.omega_d, paper.gravity_torque, 2)
NOISE = MeasurementNoise(0.0063, 0.41, 0.89, 3.1e-4)
UNLIMITED = 1e9
CASES: list[tuple[float, dict[str, Any]]] = [
    (0.005, {}),
    (0.02, {"state_cost": (100.0, 1.0, 1.0, 0.5), "input_cost": 3.0, "torque_walk": 0.2, "gimbal_white": 0.1}),
]
EVERY = pytest.mark.parametrize(("dt", "parameters"), CASES)


def law(dt: float = 0.005, rate_limit: float = UNLIMITED, noise: MeasurementNoise = NOISE, **parameters: Any) -> Lqg:
    result = make_law("lqg", dt, rate_limit, PAIR, noise, **parameters)
    assert isinstance(result, Lqg)
    return result


def rig() -> tuple[np.ndarray, np.ndarray]:
    """x1, x2, x3 and a torque on the whole rig, (4, 4) and (4, 1): aranovskiy2020 (6), two gimbals' shares."""
    A, B = np.zeros((4, 4)), np.zeros((4, 1))
    A[0, 1], A[1, 0], A[1, 3] = 1.0, paper.gravity_torque / paper.J1, 1.0 / (2.0 * paper.J1)
    B[1, 0], B[2, 0] = paper.J_d * paper.omega_d / paper.J1, 1.0
    return A, B


def discretise(A: np.ndarray, B: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
    """x(t) = F x(0) + G u."""
    F = expm(A * t)
    return F, quad_vec(lambda s: expm(A * s) @ B, 0.0, t, epsabs=1e-15, epsrel=1e-13)[0]


def regulator(dt: float, state_cost: Any, input_cost: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """K (1, 4), F, G: the cost's integral by quadrature, the Riccati equation by scipy."""
    A, B = np.zeros((4, 4)), np.zeros((4, 1))
    A[:3, :3], B[:3] = rig()[0][:3, :3], rig()[1][:3]
    A[3, 2] = -1.0
    W = np.diag([*state_cost, input_cost])

    def slope(t: float) -> np.ndarray:
        F, G = discretise(A, B, t)
        transition = np.vstack([np.hstack([F, G]), [0.0, 0.0, 0.0, 0.0, 1.0]])
        return transition.T @ W @ transition

    V = quad_vec(slope, 0.0, dt, epsabs=1e-14, epsrel=1e-12)[0]
    (F, G), Q, N, R = discretise(A, B, dt), V[:4, :4], V[:4, 4:], V[4:, 4:]
    S = solve_discrete_are(F, G, Q, R, s=N)
    return np.linalg.solve(G.T @ S @ G + R, G.T @ S @ F + N.T), F, G


def estimator(dt: float, walk: float, white: float, gimbal: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """P before a sample (4, 4), the gain M (4, 2), Q (4, 4): the noise's integral by quadrature."""
    A, B = rig()
    noise_input = np.array(
        [[0.0, 0.0, 0.0], [0.0, A[1, 3] * white, B[1, 0] * gimbal], [0.0, 0.0, gimbal], [walk, 0.0, 0.0]]
    )
    spread = noise_input @ noise_input.T

    def slope(t: float) -> np.ndarray:
        return expm(A * t) @ spread @ expm(A * t).T

    Q = quad_vec(slope, 0.0, dt, epsabs=1e-18, epsrel=1e-12)[0]
    C, R = np.eye(4)[[0, 2]], np.diag([NOISE.tilt**2, NOISE.gimbal**2])
    P = solve_discrete_are(expm(A * dt).T, C.T, Q, R)
    return P, P @ C.T @ np.linalg.inv(C @ P @ C.T + R), Q


def noises(control_law: Lqg) -> tuple[float, float, float]:
    return control_law.torque_walk, control_law.torque_white, control_law.gimbal_white


@EVERY
def test_gains_are_those_of_the_riccati_equation(dt: float, parameters: dict[str, Any]) -> None:
    control_law = law(dt, **parameters)
    K, _, _ = regulator(dt, control_law.state_cost, control_law.input_cost)
    np.testing.assert_allclose([control_law.gains], K, rtol=1e-7)


def test_fast_control_has_table_2s_gains_to_their_printed_digits() -> None:
    gains = law(1e-4).gains
    assert [round(k) for k in gains[:3]] + [round(gains[3], 1)] == [35, 4, -1, 0.3]


@EVERY
def test_the_filter_is_that_of_the_riccati_equation(dt: float, parameters: dict[str, Any]) -> None:
    control_law = law(dt, **parameters)
    P, M, Q = estimator(dt, *noises(control_law))
    np.testing.assert_allclose(control_law.process_noise, Q, rtol=1e-9, atol=1e-24)
    np.testing.assert_allclose(control_law.expected_covariance, P, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(control_law.innovation_gain, M, rtol=1e-6, atol=1e-9)


def joint(control_law: Lqg) -> np.ndarray:
    """One period of the linear rig and the law, (9, 9): made by running the law itself on unit vectors."""
    F, G = discretise(*rig(), control_law.dt)
    columns = []
    for unit in np.eye(9).tolist():
        x, state = np.array(unit[:4]), type(control_law.init(Measurement(0.0, 0.0)))(*unit[4:])
        state, u = control_law.step(state, Measurement(float(x[0]), float(x[2])), feedback_state(0.0, 0.0, 0.0), 0.0)
        columns.append([*(F @ x + G[:, 0] * u), *state])
    return np.array(columns).T


@EVERY
def test_the_closed_loops_poles_are_the_regulators_and_the_filters(dt: float, parameters: dict[str, Any]) -> None:
    """The separation principle, and a 1 for the torque, which nothing in the loop can change."""
    control_law = law(dt, **parameters)
    K, F, G = regulator(dt, control_law.state_cost, control_law.input_cost)
    _, M, _ = estimator(dt, *noises(control_law))
    transition = expm(rig()[0] * dt)
    separate_poles = [
        *np.linalg.eigvals(F - G @ K),
        *np.linalg.eigvals(transition - transition @ M @ np.eye(4)[[0, 2]]),
        1.0,
    ]
    joint_poles = np.linalg.eigvals(joint(control_law))
    np.testing.assert_allclose(np.poly(joint_poles), np.poly(separate_poles), rtol=1e-6, atol=1e-9)
    assert np.sort(np.abs(joint_poles))[-2] < 1.0 - 1e-4


def test_its_noises_are_those_of_the_observer_kalman() -> None:
    """As docs/assumptions.md has them."""
    assert noises(law()) == (0.03, 0.082, 0.024)


def test_it_rests_where_gravity_balances_the_torque() -> None:
    """A torque on the rig, which both gimbals' shares of gravity hold: nothing to be done."""
    control_law, torque = law(), 0.1
    x1 = -torque / (2.0 * paper.gravity_torque)
    state = control_law.init(Measurement(x1, 0.0))._replace(torque=torque)
    state, u = control_law.step(state, Measurement(x1, 0.0), feedback_state(0.0, 0.0, 0.0), 0.0)
    assert u == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(state, (x1, 0.0, 0.0, torque, 0.0), atol=1e-12)


@pytest.mark.parametrize("tilt", [-0.1, 0.1])
@pytest.mark.parametrize("gimbal", [-0.2, 0.2])
def test_at_the_limit_it_expects_what_was_commanded_and_does_not_wind_up(tilt: float, gimbal: float) -> None:
    control_law = law(rate_limit=0.5)
    state, u = control_law.step(
        control_law.init(Measurement(tilt, gimbal)), Measurement(tilt, gimbal), feedback_state(0.0, 0.0, 0.0), 0.0
    )
    assert u == -math.copysign(0.5, tilt)
    F, G = discretise(*rig(), control_law.dt)
    np.testing.assert_allclose(state[:4], F @ [tilt, 0.0, gimbal, 0.0] + G[:, 0] * u, rtol=1e-9)
    # The integrator's next step would add k4 x3 to the demand, whose sign is that of u.
    is_winding_up = control_law.gains[3] * gimbal * u > 0.0
    assert state.x_e == (0.0 if is_winding_up else pytest.approx(-control_law.dt * (gimbal + 0.5 * control_law.dt * u)))


def test_a_sensor_without_noise_is_taken() -> None:
    control_law = law(noise=MeasurementNoise(0.0, 0.0, 0.0, 0.0))
    np.testing.assert_allclose(np.diag(control_law.innovation_gain[[0, 2]]), 1.0, atol=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("e", [-1.5, 0.5, 1.5])
def test_the_gimbals_come_back_whatever_the_bias(e: float) -> None:
    """Integral action, on the rig: the mean gimbal angle of the last seconds."""
    settings = ["controller.kind=lqg", f"plant.equilibrium_bias_deg={e}", "duration_s=30", "push=[]"]
    result = push_recovery(*settings).run_many(4)
    assert result.stood.all()
    angles = np.degrees(recorded(result)["y2_rad"])
    assert np.abs(angles[-2000:].mean(axis=0)).max() < 2.0
    assert np.abs(angles).max() > 5.0


@pytest.mark.slow
@pytest.mark.parametrize("missing_part", ["torque", "integrator"])
def test_either_integral_action_alone_falls_at_a_large_bias(missing_part: str) -> None:
    """Why it is there twice."""
    experiment = push_recovery("controller.kind=lqg", "plant.equilibrium_bias_deg=2.0")
    assert experiment.run_many(4).stood.all()
    control_law: Any = experiment.law
    if missing_part == "integrator":
        (A, B), dt = rig(), control_law.dt
        F, G = discretise(A[:3, :3], B[:3], dt)
        Q, R = dt * np.diag(control_law.state_cost[:3]), np.array([[dt * control_law.input_cost]])
        S = solve_discrete_are(F, G, Q, R)
        K = np.linalg.solve(G.T @ S @ G + R, G.T @ S @ F)
        control_law.__dict__["gains"] = (*K.ravel().tolist(), 0.0)
    else:
        control_law.__dict__["innovation_gain"] = np.vstack([control_law.innovation_gain[:3], [[0.0, 0.0]]])
    control_law.__dict__.pop("_numbers", None)
    assert not experiment.run_many(4).stood.any()

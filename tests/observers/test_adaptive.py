"""The adaptive observer on the scissored pair, against the reduced model."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm, solve_continuous_lyapunov

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.types import extra_signals
from cmg_mj.observers import Measurement, make_observer
from cmg_mj.observers.adaptive import Adaptive
from tests.observers.reference import DT, PAPER, observer, rough_signals, run

PAIR = dataclasses.replace(PAPER, gimbals=2)

MODES: dict[str, dict[str, Any]] = {
    "bias": {},
    "bias and sinusoid": {"sinusoid_hz": 1.3},
    "torque": {"bias": False, "torque": True, "known_bias_deg": -1.2},
    "torque and sinusoid": {"bias": False, "torque": True, "sinusoid_hz": 7.0, "known_bias_deg": 0.8},
    "sinusoid": {"bias": False, "sinusoid_hz": 0.4},
}


SIGNALS = {
    "bias": ("bias_rad",),
    "bias and sinusoid": ("bias_rad", "disturbance_n_m"),
    "torque": ("torque_n_m",),
    "torque and sinusoid": ("torque_n_m", "disturbance_n_m"),
    "sinusoid": ("disturbance_n_m",),
}


def adaptive(model: ReducedModel = PAIR, dt: float = DT, **parameters: Any) -> Any:
    return make_observer("adaptive", dt, model, **parameters)


def reduced_run(e: float, torque: Callable[[float], float], duration: float) -> np.ndarray:
    """y1, y2, u, x2 of the reduced rig, held upright by the exact state, with a torque on the whole rig."""
    model, x, rows = PAIR, np.array([0.01, 0.0, 0.0]), []
    x_e = 35.0 / 0.3 * e
    for k in range(round(duration / DT) + 1):
        u = float(np.clip(-(35.0 * (x[0] - e) + 4.0 * x[1] - x[2] + 0.3 * x_e), -4.7, 4.7))
        rows.append((x[0] - e, x[2], u, x[1]))
        x_e -= DT * x[2]

        def slope(s: float, x: np.ndarray, u: float = u, t: float = k * DT) -> list[float]:
            D = model.J1 + model.J2 * math.sin(x[2]) ** 2
            gyroscopic = u * (model.J_d * model.omega_d * math.cos(x[2]) - model.J2 * x[1] * math.sin(2.0 * x[2]))
            share = torque(t + s) / model.gimbals
            return [x[1], (gyroscopic + model.gravity_torque * math.sin(x[0]) + share) / D, u]

        x = solve_ivp(slope, (0.0, DT), x, rtol=1e-8, atol=1e-10).y[:, -1]
    return np.array(rows).T


@pytest.mark.daily_cases("-1.5")
@pytest.mark.parametrize("e_deg", [-1.5, 0.3, 2.0])
def test_finds_the_bias(e_deg: float) -> None:
    """Without noise; what is left is sin(y1 + e) less sin y1 + e cos y1, 1e-4 of e."""
    y1, y2, u, x2 = reduced_run(math.radians(e_deg), lambda t: 0.0, 8.0)
    result = run(adaptive(), y1, y2, u)[0]
    assert math.degrees(result[-1, 3]) == pytest.approx(e_deg, rel=2e-3)
    assert abs(result[-1, 1] - x2[-1]) < 1e-3


def test_finds_the_torque_on_the_whole_rig_if_the_bias_is_known() -> None:
    y1, y2, u, x2 = reduced_run(math.radians(1.0), lambda t: 0.15, 8.0)
    result = run(adaptive(bias=False, torque=True, known_bias_deg=1.0), y1, y2, u)[0]
    assert result[-1, 3] == pytest.approx(0.15, rel=2e-3)
    assert abs(result[-1, 1] - x2[-1]) < 1e-3
    wrong = run(adaptive(bias=False, torque=True), y1, y2, u)[0]  # the bias is taken for a torque: 2 M sin e more
    assert wrong[-1, 3] == pytest.approx(0.15 + 2.0 * PAIR.gravity_torque * math.sin(math.radians(1.0)), rel=2e-3)


def test_finds_bias_and_sinusoid() -> None:
    w, e = 2.0 * math.pi * 1.0, math.radians(0.8)
    y1, y2, u, x2 = reduced_run(e, lambda t: 0.2 * math.sin(w * t + 0.7), 14.0)
    result = run(adaptive(sinusoid_hz=1.0), y1, y2, u)[0]
    t = DT * np.arange(1, len(y1))
    late = t > 12.0
    assert np.abs(result[late, 3] - e).max() < 0.02 * e
    assert np.abs(result[late, 4] - 0.2 * np.sin(w * t[late] + 0.7)).max() < 0.004
    assert np.abs(result[late, 1] - x2[1:][late]).max() < 2e-3
    blind = run(adaptive(), y1, y2, u)[0]
    rms = [float(np.sqrt(np.mean((rows[late, 1] - x2[1:][late]) ** 2))) for rows in (result, blind)]
    assert rms[0] < 0.1 * rms[1]


def test_noise_moves_the_bias_by_what_the_linear_filter_says() -> None:
    """With T at rest, (7) to (9) are a linear filter of y1; its variance is a Lyapunov equation's. 40 seeds."""
    sigma, e, many = math.radians(0.3), math.radians(1.0), 40
    estimator = adaptive()
    y1, y2, u, _ = reduced_run(e, lambda t: 0.0, 10.0)
    noisy = y1[:, None] + np.random.default_rng(9).normal(0.0, sigma, (len(y1), many))
    errors = run(estimator, noisy, y2[:, None], u[:, None])[0][round(7.0 / DT) - 1 :, 3] - e

    b, (l1, l2) = PAIR.gravity_torque / PAIR.J1, estimator.L
    T = np.array([b / -l2, l1 * b / l2])  # 0 = (A + L C2) T + B0
    gain = -estimator.Gamma[0] * estimator.Sigma * T[0]  # (9)
    correction = np.array([l1 + T[0] * gain, l2 + T[1] * gain, gain])
    F = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, b], [0.0, 0.0, 0.0]]) + np.outer(correction, [1.0, 0.0, 0.0])
    g = np.array([0.0, b, 0.0]) - correction  # gravity at the measured tilt, and the correction
    variance = solve_continuous_lyapunov(F, -np.outer(g, g) * sigma**2 * DT)[2, 2]
    result, expected = float(np.degrees(np.std(errors))), math.degrees(math.sqrt(variance))
    assert result == pytest.approx(expected, rel=0.1)
    assert abs(np.degrees(np.mean(errors))) < 0.02


@pytest.mark.parametrize("hertz", [0.0, 3.0])
def test_learning_rate_is_the_stiffness_that_a_quiet_rig_comes_to(hertz: float) -> None:
    """Sigma times the sum of Gamma_i T1_i^2, with the T that the observer itself has after 3 s at rest."""
    estimator = adaptive(bias=not hertz, sinusoid_hz=hertz)
    state = run(estimator, [0.0] * 601)[1][-1]
    weights = (estimator.Gamma[2],) * 2 if hertz else estimator.Gamma[:1]
    result = estimator.Sigma * sum(weight * T1**2 for weight, T1 in zip(weights, state.T1, strict=True))
    assert estimator.learning_rate == pytest.approx(result, rel=0.02)


def test_an_error_decays_as_the_gains_say() -> None:
    """Without learning: (A + L C2) with the defaults, poles of 25 rad/s and damping ratio 0.7."""
    dt, n = 5e-4, 80
    estimator = adaptive(dt=dt, Gamma=(1e-12, 1e-12, 1e-12))
    state, still = estimator.init(Measurement(0.0, 0.0))._replace(x1=0.02, x2=-0.3), Measurement(0.0, 0.0)
    for _ in range(n):
        state, _ = estimator.step(state, still, 0.0)
    matrix = np.array([[-2.0 * 0.7 * 25.0, 1.0], [-(25.0**2), 0.0]])
    assert (state.x1, state.x2) == pytest.approx(tuple(expm(matrix * n * dt) @ [0.02, -0.3]), rel=1e-3)


def test_default_weights_learn_a_bias_and_a_torque_at_1_per_second() -> None:
    """Sigma Gamma T1^2, T1 the steady solution of (8): (M/J1)/w^2 a radian and 1/(gimbals J1)/w^2 a N m, w^2 = -L2."""
    estimator = Adaptive(DT, PAIR)
    w2, (bias, torque, sinusoid) = -estimator.L[1], estimator.Gamma
    assert estimator.Sigma * bias * (PAPER.gravity_torque / PAPER.J1 / w2) ** 2 == pytest.approx(1.0, rel=0.02)
    assert estimator.Sigma * torque * (1.0 / (2.0 * PAPER.J1) / w2) ** 2 == pytest.approx(1.0, rel=0.02)
    assert sinusoid == torque  # per unit of torque the same, whatever its frequency


@pytest.mark.parametrize("mode", MODES)
def test_names_what_it_estimates(mode: str) -> None:
    estimator = adaptive(**MODES[mode])
    _, estimate = estimator.step(estimator.init(Measurement(0.01, 0.2)), Measurement(0.012, 0.21), 0.4)
    assert estimate._fields == ("x1", "x2", "x3", *extra_signals(estimator)) == ("x1", "x2", "x3", *SIGNALS[mode])


def test_homogeneous_adaptive_is_this_and_then_homogeneous_with_its_bias() -> None:
    both = observer("homogeneous_adaptive", k1=25.0, alpha=0.9, Sigma=7.0, L=(-30.0, -200.0), Gamma=0.5)
    alone: Any = observer("adaptive", Sigma=7.0, L=(-30.0, -200.0), Gamma=(0.5, 1.0, 1.0))
    homogeneous: Any = observer("homogeneous", k1=25.0, alpha=0.9)
    y1, y2, u = (signal.tolist() for signal in rough_signals(80))
    biases = run(alone, y1, y2, u)[0][:, 3].tolist()
    state, expected = homogeneous.init(Measurement(y1[0], y2[0])), []
    for k, bias in enumerate(biases):
        state, estimate = homogeneous.step(state, Measurement(y1[k + 1], y2[k + 1]), u[k], bias)
        expected.append((*estimate, bias))
    np.testing.assert_array_equal(run(both, y1, y2, u)[0], expected)
    assert biases[-1] != 0.0

"""The homogeneous differentiator against aranovskiy2020 (11)."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.observers import Measurement, Observer
from tests.observers.reference import (
    DT,
    HEAVY,
    PAPER,
    homogeneous_slope,
    integrate,
    observer,
    rough_signals,
    run,
)


def start_state(estimator: Observer, x1: float, x2: float, y1: float = 0.0, y2: float = 0.0) -> Any:
    """A state with this estimate after this measurement."""
    return estimator.init(Measurement(y1, y2))._replace(x1=x1, x2=x2)


CASES = [
    pytest.param({}, PAPER, id="Table 2"),
    pytest.param({"k1": 35.0}, PAPER, id="k1"),
    pytest.param({"k2": 400.0}, PAPER, id="k2"),
    pytest.param({"alpha": 0.7}, PAPER, id="alpha"),
    pytest.param({}, HEAVY, id="another rig"),
]


@pytest.mark.parametrize(("parameters", "model"), CASES)
def test_one_sample_is_the_printed_equation(parameters: dict, model: ReducedModel) -> None:
    """Away from e = 0, where the right-hand side is smooth, at large rates, gimbal angles and commands."""
    rng = np.random.default_rng(11)
    for _ in range(20):
        x1, x2, y2, u = (
            0.01 * rng.normal(),
            rng.uniform(-9.0, 9.0),
            rng.uniform(-1.3, 1.3),
            rng.uniform(-4.7, 4.7),
        )
        y1 = x1 + math.copysign(0.3, rng.normal())
        next_sample = Measurement(y1 + 0.02 * rng.normal(), y2 + DT * u)
        expected = integrate(
            homogeneous_slope(model, **parameters), [x1, x2], [y1, next_sample.y1], [y2, next_sample.y2], [u]
        )
        estimator = observer("homogeneous", model=model, **parameters)
        _, estimate = estimator.step(start_state(estimator, x1, x2, y1, y2), next_sample, u)
        np.testing.assert_allclose(estimate[:2], expected[0], rtol=0.0, atol=1e-5)
        assert estimate.x3 == next_sample.y2


@pytest.mark.parametrize(("parameters", "model"), CASES)
def test_follows_the_continuous_observer_at_200_hz(parameters: dict, model: ReducedModel) -> None:
    """On a restless rig, the estimate crossing e = 0 all the time."""
    y1, y2, u = rough_signals(60)
    expected = integrate(homogeneous_slope(model, **parameters), [y1[0], 0.0], y1, y2, u)
    estimates, _ = run(observer("homogeneous", model=model, **parameters), y1, y2, u)
    error = np.sqrt(np.mean((estimates[:, 1] - expected[:, 1]) ** 2))
    tolerance = 2e-2 if parameters.get("alpha") == 0.7 else 3e-3
    assert error < tolerance * np.std(expected[:, 1])


def free_errors(alpha: float, dt: float, n: int, x1: float, x2: float) -> np.ndarray:
    """The error dynamics alone: no drive (y1 = 0, u = 0), so the estimate is the error, (n, 2)."""
    estimator = observer("homogeneous", dt, alpha=alpha)
    state, rows = start_state(estimator, x1, x2), []
    for _ in range(n):
        state, estimate = estimator.step(state, Measurement(0.0, 0.0), 0.0)
        rows.append(estimate[:2])
    return np.array(rows)


def test_converges_in_finite_time() -> None:
    """alpha = 1 gains a factor e every 0.1 s for ever; alpha = 0.85 has all digits within a second."""
    dt = 1e-3
    ours, linear = (np.abs(free_errors(alpha, dt, 1500, 0.05, -1.0)[:, 1]) for alpha in (0.85, 1.0))
    end_time = dt * (1 + int(np.flatnonzero(ours > 1e-9)[-1]))
    assert end_time < 1.2
    assert linear[round(end_time / dt)] > 1e-6


@pytest.mark.parametrize("alpha", [0.85, 0.7, 0.55])
def test_is_homogeneous(alpha: float) -> None:
    """An error (lambda, lambda^alpha) times larger goes the same way in lambda^(1 - alpha) times the time."""
    scale, n = 16.0, 60
    small = free_errors(alpha, 0.004, n, 0.002, -0.05)
    large = free_errors(alpha, 0.004 * scale ** (1.0 - alpha), n, 0.002 * scale, -0.05 * scale**alpha)
    np.testing.assert_allclose(large[:, 0], small[:, 0] * scale, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(large[:, 1], small[:, 1] * scale**alpha, rtol=0.0, atol=1e-8)


def test_with_alpha_1_it_is_a_linear_observer() -> None:
    """x' = [[-k1, 1], [-k2, 0]] x without drive. The step's error is RK4's, of fourth order."""
    errors = []
    for dt in (0.005, 0.0025):
        n = round(0.1 / dt)
        exact = expm(np.array([[-20.0, 1.0], [-150.0, 0.0]]) * 0.1) @ [0.03, -0.4]
        errors.append(np.abs(free_errors(1.0, dt, n, 0.03, -0.4)[-1] - exact).max())
    assert errors[0] < 2e-6
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.3)


# --- the friction model and a known bias: the papers' future work ---------------------------------------------


@pytest.mark.parametrize("gimbals", [1, 2])
def test_friction_enters_as_a_torque_on_the_whole_rig(gimbals: int) -> None:
    """Sample by sample against (11) with f2 - T(x2)/(gimbals D); T(x2)/x2 is that of the last estimate."""
    model = dataclasses.replace(HEAVY, gimbals=gimbals)
    dry, viscous, width = 0.3, 0.2, 0.05
    plain = homogeneous_slope(model)
    y1, y2, u = rough_signals(60)
    estimator = observer("homogeneous", DT, model, friction_n_m=dry, damping_n_m_s=viscous, friction_width_rad_s=width)
    _, states = run(estimator, y1, y2, u)
    for k in range(1, len(states)):
        before = states[k - 1]
        D = model.J1 + model.J2 * math.sin(y2[k - 1]) ** 2
        c = (dry / math.hypot(before.x2, width) + viscous) / (gimbals * D)
        span = slice(k - 1, k + 1)
        (exact,) = integrate(
            lambda x, a, b, command, c=c: plain(x, a, b, command) - [0.0, c * x[1]],
            (before.x1, before.x2),
            y1[span],
            y2[span],
            u[span],
        )
        np.testing.assert_allclose((states[k].x1, states[k].x2), exact, rtol=0.0, atol=1e-3)
    frictionless, _ = run(observer("homogeneous", DT, model), y1, y2, u)
    assert np.abs(frictionless[:, 1] - [state.x2 for state in states[1:]]).max() > 0.1  # friction matters here


def test_a_known_bias_is_where_gravity_pulls() -> None:
    """Without noise the observer that is told e has no rate error left; the one that is not has the closed form's."""
    e = math.radians(2.0)
    estimator: Any = observer("homogeneous")
    y = Measurement(-e, 0.0)  # at rest at the equilibrium, x1 = 0
    biased_state, plain_state = estimator.init(y), estimator.init(y)
    biased_estimate: Any = None
    plain_estimate: Any = None
    for _ in range(2000):
        biased_state, biased_estimate = estimator.step(biased_state, y, 0.0, e)
        plain_state, plain_estimate = estimator.step(plain_state, y, 0.0)
    assert abs(biased_estimate.x2) < 1e-8
    assert abs(plain_estimate.x2) > 0.05

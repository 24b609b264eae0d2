"""The contract of every observer: a value with pure, elementwise init and step, that filters and starts at rest."""

from __future__ import annotations

import copy
import dataclasses
import inspect
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.observers import OBSERVER_CLASSES, OBSERVERS, Estimate, Measurement
from tests.observers.reference import DT, PAPER, observer, rough_signals
from tests.plant import paper_model as paper

EVERY = sorted(OBSERVERS)


def flat(state: Any) -> list:
    """The numbers of a state, whatever its shape."""
    if isinstance(state, tuple | list):
        return [number for part in state for number in flat(part)]
    return [state]


def walk(estimator: Any, samples: Sequence[tuple[Any, ...]]) -> tuple[Any, list[Estimate]]:
    """Last state and all estimates along samples (y1, y2, acceleration, gyro, u held since the sample before)."""
    state, estimates = estimator.init(Measurement(*samples[0][:-1])), []
    for *y, u in samples[1:]:
        state, estimate = estimator.step(state, Measurement(*y), u)
        estimates.append(estimate)
    return state, estimates


def samples(n: int = 60, seed: int = 0) -> list[tuple[float, float, float, float, float]]:
    y1, y2, u = rough_signals(n, seed)
    acceleration, gyro = np.random.default_rng(seed).normal(0.0, 5.0, (2, n)).tolist()
    return list(zip(y1.tolist(), y2.tolist(), acceleration, gyro, [0.0, *u.tolist()[:-1]], strict=True))


@pytest.mark.parametrize("kind", EVERY)
def test_every_parameter_is_documented(kind: str) -> None:
    cls = type(observer(kind))
    for name in inspect.signature(cls).parameters:
        assert f"{name}: " in (cls.__doc__ or "")


@pytest.mark.parametrize("kind", EVERY)
def test_is_a_frozen_value(kind: str) -> None:
    estimator = observer(kind)
    assert dataclasses.is_dataclass(estimator)
    assert estimator == observer(kind)
    with pytest.raises(dataclasses.FrozenInstanceError):
        object.__getattribute__(estimator, "__setattr__")("dt", 0.1)


@pytest.mark.parametrize("kind", EVERY)
def test_starts_at_rest_at_the_measured_angles(kind: str) -> None:
    """At the equilibrium nothing moves, so the estimate stays (0, 0, y2) while the measurement does."""
    estimator = observer(kind)
    rest = Measurement(0.0, 0.3, 0.0, 0.0)
    state = estimator.init(rest)
    for _ in range(5):
        state, estimate = estimator.step(state, rest, 0.0)
        np.testing.assert_allclose(estimate[:3], (0.0, 0.0, 0.3), rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("kind", EVERY)
def test_step_has_no_memory_but_the_state(kind: str) -> None:
    """The same state gives the same step, from another instance, after other steps, and is left as it was."""
    estimator, twin = observer(kind), observer(kind)
    state, _ = walk(estimator, samples())
    before = copy.deepcopy(state)
    y, u = Measurement(0.02, 0.1, 3.0, 0.4), 1.5
    first = estimator.step(state, y, u)
    walk(estimator, samples(seed=1))
    assert flat(estimator.step(state, y, u)) == flat(first)
    assert flat(twin.step(state, y, u)) == flat(first)
    assert flat(state) == flat(before)


@pytest.mark.parametrize("kind", EVERY)
def test_estimate_uses_the_sample_it_is_given(kind: str) -> None:
    """A filter, not a one-step predictor: y1_k and (for y2's model) y2_k move the estimate of sample k."""
    estimator = observer(kind)
    state = estimator.init(Measurement(0.0, 0.1, 0.0, 0.0))
    _, estimate = estimator.step(state, Measurement(1e-5, 0.1, 0.0, 0.0), 0.0)
    _, tilt_estimate = estimator.step(state, Measurement(5e-5, 0.1, 0.0, 0.0), 0.0)
    assert abs(tilt_estimate.x2 - estimate.x2) > 1e-6
    _, gimbal_estimate = estimator.step(state, Measurement(1e-5, 0.3, 0.0, 0.0), 0.0)
    assert abs(gimbal_estimate.x3 - estimate.x3) > 1e-4


MODELS = ("ltv", "homogeneous", "luenberger", "kalman", "high_gain", "adaptive", "homogeneous_adaptive")
DIFFERENTIATORS = ("linear", "linear_high_gain", "finite_difference", "super_twisting", "gyro_free", "free_pivot")
DIFFERENTIATORS += ("mems_fused",)


def test_every_observer_is_a_model_or_a_differentiator() -> None:
    assert sorted(MODELS + DIFFERENTIATORS) == sorted(EVERY)


@pytest.mark.parametrize("kind", MODELS)
def test_models_use_the_command_held_since_the_sample_before(kind: str) -> None:
    """J_d omega_d/J1 u dt = 5.585 rad/s^2 a rad/s: what one period of u adds to the rate, but for the correction."""
    estimator = observer(kind)
    state = estimator.init(Measurement(0.0, 0.0))
    _, still = estimator.step(state, Measurement(0.0, 0.0), 0.0)
    _, command_estimate = estimator.step(state, Measurement(0.0, 2.0 * DT), 2.0)  # and the gimbal has turned
    assert command_estimate.x2 - still.x2 == pytest.approx(paper.J_d * paper.omega_d / paper.J1 * 2.0 * DT, rel=0.1)


@pytest.mark.parametrize("kind", DIFFERENTIATORS)
def test_differentiators_use_no_model(kind: str) -> None:
    """Neither the command nor the gimbal nor the rig's parameters reach the rate."""
    other_model = dataclasses.replace(PAPER, J1=1.0, J2=0.3, J_d=0.1, omega_d=10.0, gravity_torque=9.0)
    still = [(y1, 0.0, *measured, 0.0) for y1, _, *measured, _ in samples()]
    rates = [
        [e.x2 for e in walk(estimator, s)[1]]
        for estimator, s in ((observer(kind), samples()), (observer(kind, model=other_model), still))
    ]
    assert rates[0] == rates[1]


@pytest.mark.parametrize("n_worlds", [1, 5, 8])
@pytest.mark.parametrize("kind", EVERY)
def test_arrays_equal_floats_bit_by_bit(kind: str, n_worlds: int) -> None:
    estimator = observer(kind)
    worlds = [samples(120, seed) for seed in range(n_worlds)]
    batch_samples = [
        tuple(np.array([world[k][i] for world in worlds]) for i in range(5)) for k in range(len(worlds[0]))
    ]
    _, many = walk(estimator, batch_samples)
    for i, world in enumerate(worlds):
        _, single = walk(estimator, world)
        assert all(type(number) is float for number in single[-1])
        assert [tuple(float(part[i]) for part in estimate) for estimate in many] == single


@pytest.mark.parametrize("kind", EVERY)
@pytest.mark.parametrize("dt", [0.0, -0.005, float("nan"), float("inf")])
def test_a_sample_period_that_is_none_is_refused(kind: str, dt: float) -> None:
    with pytest.raises(InputError, match=r"^observer\.dt"):
        observer(kind, dt)


def positive_gains() -> list[tuple[str, str]]:
    """Observers, and the numbers among their parameters that are positive by default and must be."""
    result = []
    for kind in EVERY:
        estimator: Any = observer(kind)
        names = [
            field.name for field in dataclasses.fields(estimator) if field.name not in OBSERVER_CLASSES.bench_parameters
        ]
        result += [
            (kind, name) for name in names if isinstance(value := getattr(estimator, name), float) and value > 0.0
        ]
    may_be_zero = {("high_gain", "d_inf"), ("gyro_free", "bias_walk"), ("gyro_free", "jerk")}
    may_be_zero |= {("free_pivot", name) for name in ("bias_walk", "jerk", "pivot_start", "pivot_floor")}
    may_be_zero |= {
        ("free_pivot", name)
        for name in (
            "innovation_weight",
            "slow_innovation_weight",
            "rise_factor",
            "covariance_boost",
            "inflation",
            "odds_alike",
        )
    }
    return [gain for gain in result if gain not in may_be_zero]


@pytest.mark.parametrize(("kind", "name"), positive_gains())
def test_a_gain_that_is_not_positive_is_refused(kind: str, name: str) -> None:
    for value in (0.0, -1.0, float("nan")):
        parameters: Any = {name: value}
        with pytest.raises(InputError, match=rf"^observer\.{name} = .* \(observer {kind}\)$"):
            observer(kind, **parameters)

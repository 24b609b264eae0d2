"""The contract of every law: a value with pure, elementwise init and step, the same in one world and in many."""

from __future__ import annotations

import dataclasses
import inspect
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmg_mj import InputError
from cmg_mj.core.types import feedback_state, law_needs
from cmg_mj.laws import LAW_CLASSES, LAWS, FeedbackState, Law, make_law
from cmg_mj.observers import Measurement
from cmg_mj.results.trajectory import Trajectory
from tests.command import cmg_mj
from tests.observers.reference import DT, NOISE, PAPER
from tests.recorded import assert_same_bits, push_recovery, recorded

EVERY = sorted(LAWS)
SHORT = ("duration_s=0.5", "push.0.start_s=0.2", "push.0.duration_s=0.1")


def law(kind: str, rate_limit: float = 4.7) -> Law:
    return make_law(kind, DT, rate_limit, PAPER, NOISE)


def samples(n: int, shape: tuple[int, ...] = (), seed: int = 0) -> list[tuple[Measurement, FeedbackState]]:
    rng = np.random.default_rng(seed)
    tilt, rate, gimbal = 0.03 * rng.normal(size=(n, *shape)), rng.normal(size=(n, *shape)), rng.normal(size=(n, *shape))
    return [
        (Measurement(*parts[::2]), feedback_state(*parts))
        for parts in zip(*map(_to_list, (tilt, rate, gimbal)), strict=True)
    ]


def _to_list(signal: np.ndarray) -> list:
    return signal.tolist() if signal.ndim == 1 else list(signal)


def commands(control_law: Law, arguments: list[tuple[Measurement, FeedbackState]]) -> np.ndarray:
    state, u, result = control_law.init(arguments[0][0]), 0.0 * arguments[0][0].y1, []
    for y, x in arguments:
        state, u = control_law.step(state, y, x, u)
        result.append(u)
    return np.array(result)


@pytest.mark.parametrize("kind", EVERY)
def test_every_parameter_is_documented(kind: str) -> None:
    cls = LAW_CLASSES.find(kind)
    for name in inspect.signature(cls).parameters:
        assert f"{name}: " in (cls.__doc__ or "")


@pytest.mark.parametrize("kind", EVERY)
def test_is_a_frozen_value(kind: str) -> None:
    control_law = law(kind)
    assert dataclasses.is_dataclass(control_law)
    assert control_law == law(kind)
    with pytest.raises(dataclasses.FrozenInstanceError):
        object.__getattribute__(control_law, "__setattr__")("dt", 0.1)


@pytest.mark.parametrize("kind", EVERY)
def test_says_nothing_at_the_equilibrium(kind: str) -> None:
    nothing = (Measurement(0.0, 0.0), feedback_state(0.0, 0.0, 0.0))
    np.testing.assert_array_equal(commands(law(kind), [nothing] * 5), 0.0)


@pytest.mark.parametrize("kind", EVERY)
def test_step_has_no_memory_but_the_state(kind: str) -> None:
    control_law, arguments = law(kind), samples(40)
    first = commands(control_law, arguments)
    commands(control_law, samples(40, seed=1))
    np.testing.assert_array_equal(commands(control_law, arguments), first)


@pytest.mark.parametrize("kind", EVERY)
@pytest.mark.parametrize("rate_limit", [4.7, 0.5])
def test_many_worlds_are_single_ones(kind: str, rate_limit: float) -> None:
    """Bit for bit, the limit reached or not."""
    control_law, worlds = law(kind, rate_limit), 7
    many = samples(60, (worlds,))
    batch_commands = commands(control_law, many)
    assert np.abs(batch_commands).max() == rate_limit
    assert np.abs(batch_commands).min() < rate_limit
    for i in range(worlds):
        one = [(Measurement(*(float(p[i]) for p in y)), FeedbackState(*(float(p[i]) for p in x))) for y, x in many]
        np.testing.assert_array_equal(commands(control_law, one), batch_commands[:, i])


@pytest.mark.parametrize("kind", EVERY)
def test_a_law_that_needs_no_estimate_takes_none(kind: str) -> None:
    control_law, arguments = law(kind), samples(40)
    other = [(y, feedback_state(7.0, 7.0, 7.0, (7.0,))) for y, _ in arguments]
    assert (commands(control_law, arguments) == commands(control_law, other)).all() == (law_needs(control_law) == ())


@pytest.mark.parametrize("kind", EVERY)
def test_drivers_and_batch_are_one(kind: str) -> None:
    """The runner, MuJoCo's callback and a batch: one trajectory, to the last bit."""
    experiment = push_recovery(*SHORT, f"controller.kind={kind}")
    native = recorded(experiment.run())
    assert np.isfinite(native["x_e_rad_times_s"]).all()
    assert_same_bits(recorded(experiment.run(driver="callback")), native)
    assert_same_bits(recorded(experiment.run_many(2)).world(0), native)


@pytest.mark.daily_cases("state_feedback")
@pytest.mark.parametrize("kind", EVERY)
def test_worlds_of_other_limits_share_a_batch(kind: str) -> None:
    settings = ["plant.initial_tilt_deg=6.0", f"controller.kind={kind}"]
    limits = [3.0, 2.0, 1.5]
    vary = {"controller.rate_limit_rad_s": limits}
    many = recorded(push_recovery(*SHORT, *settings).run_many(3, settings=vary))
    for i, limit in enumerate(limits):
        one = recorded(push_recovery(*SHORT, *settings, f"controller.rate_limit_rad_s={limit}").run(world=i))
        np.testing.assert_array_equal(many["u_rad_s"][:, i], one["u_rad_s"])
        assert np.abs(one["u_rad_s"]).max() == limit


def test_what_the_bench_gives_is_no_parameter() -> None:
    for kind in EVERY:
        arguments: dict[str, Any] = dict.fromkeys(LAW_CLASSES.bench_parameters)
        assert {"dt", "rate_limit"} <= arguments.keys() & inspect.signature(LAW_CLASSES.find(kind)).parameters.keys()


def test_a_law_that_uses_the_noise_keeps_worlds_of_other_noise_apart() -> None:
    experiment = push_recovery(*SHORT, "controller.kind=lqg")
    with pytest.raises(InputError, match="the noise that the law is told differs"):
        experiment.run_many(2, settings={"sensors.accelerometer.noise_density_ug_rthz": [200.0, 400.0]})


@pytest.mark.slow
def test_a_law_without_an_integrator_is_recorded_and_plotted(elsewhere: None) -> None:
    outcome = cmg_mj("run", "push_recovery", "--set", f"controller.kind={__name__}:NoMemory", "--plot", "--out", "it")
    assert outcome.status == 0
    assert np.isnan(Trajectory.load(Path("it/trajectory.parquet"))["x_e_rad_times_s"]).all()
    outcome = cmg_mj("compare", "push_recovery", "--set", "controller.kind=lqg", "--observers", "linear", "--worlds", 1)
    assert "lqg takes nothing of the observer: every loop is the same" in outcome.err


class NoMemory:
    def __init__(self, dt: float, rate_limit: float) -> None:
        self.dt, self.rate_limit = dt, rate_limit

    def init(self, y: Measurement) -> int:
        return 0

    def step(self, state: int, y: Measurement, x: FeedbackState, u: Any) -> tuple[int, Any]:
        return 0, -35.0 * x.x1 - 4.0 * x.x2 + x.x3

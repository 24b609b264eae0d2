"""What every law must be: a value with pure, elementwise init and step, the same in one world and in many."""

from __future__ import annotations

import dataclasses
import inspect
from typing import Any

import numpy as np
import pytest

from cmg_mj import load_scenario, prepare
from cmg_mj.laws import LAWS, Fed, Law, law_class, make_law
from cmg_mj.laws.protocol import fed, needs
from cmg_mj.laws.registry import GIVEN
from cmg_mj.observers import Measurement
from tests.observers.reference import DT, NOISE, PAPER

EVERY = sorted(LAWS)
SHORT = ("duration_s=0.5", "push.0.start_s=0.2", "push.0.duration_s=0.1")


def law(kind: str, rate_limit: float = 4.7) -> Law:
    return make_law(kind, DT, rate_limit, PAPER, NOISE)


def samples(n: int, shape: tuple[int, ...] = (), seed: int = 0) -> list[tuple[Measurement, Fed]]:
    rng = np.random.default_rng(seed)
    tilt, rate, gimbal = 0.03 * rng.normal(size=(n, *shape)), rng.normal(size=(n, *shape)), rng.normal(size=(n, *shape))
    return [(Measurement(*parts[::2]), fed(*parts)) for parts in zip(*map(_listed, (tilt, rate, gimbal)), strict=True)]


def _listed(signal: np.ndarray) -> list:
    return signal.tolist() if signal.ndim == 1 else list(signal)


def commands(of: Law, given: list[tuple[Measurement, Fed]]) -> np.ndarray:
    state, u, found = of.init(given[0][0]), 0.0 * given[0][0].y1, []
    for y, x in given:
        state, u = of.step(state, y, x, u)
        found.append(u)
    return np.array(found)


@pytest.mark.parametrize("kind", EVERY)
def test_every_parameter_is_documented(kind: str) -> None:
    cls = law_class(kind)
    for name in inspect.signature(cls).parameters:
        assert f"{name}: " in (cls.__doc__ or "")


@pytest.mark.parametrize("kind", EVERY)
def test_is_a_frozen_value(kind: str) -> None:
    of = law(kind)
    assert dataclasses.is_dataclass(of)
    assert of == law(kind)
    with pytest.raises(dataclasses.FrozenInstanceError):
        object.__getattribute__(of, "__setattr__")("dt", 0.1)


@pytest.mark.parametrize("kind", EVERY)
def test_says_nothing_at_the_equilibrium(kind: str) -> None:
    nothing = (Measurement(0.0, 0.0), fed(0.0, 0.0, 0.0))
    np.testing.assert_array_equal(commands(law(kind), [nothing] * 5), 0.0)


@pytest.mark.parametrize("kind", EVERY)
def test_step_has_no_memory_but_the_state(kind: str) -> None:
    of, given = law(kind), samples(40)
    first = commands(of, given)
    commands(of, samples(40, seed=1))
    np.testing.assert_array_equal(commands(of, given), first)


@pytest.mark.parametrize("kind", EVERY)
@pytest.mark.parametrize("rate_limit", [4.7, 0.5])
def test_many_worlds_are_single_ones(kind: str, rate_limit: float) -> None:
    """Bit for bit, the limit reached or not."""
    of, worlds = law(kind, rate_limit), 7
    many = samples(60, (worlds,))
    together = commands(of, many)
    assert np.abs(together).max() == rate_limit
    assert np.abs(together).min() < rate_limit
    for i in range(worlds):
        one = [(Measurement(*(float(p[i]) for p in y)), fed(*(float(p[i]) for p in x))) for y, x in many]
        np.testing.assert_array_equal(commands(of, one), together[:, i])


@pytest.mark.parametrize("kind", EVERY)
def test_a_law_that_needs_no_estimate_takes_none(kind: str) -> None:
    of, given = law(kind), samples(40)
    other = [(y, fed(7.0, 7.0, 7.0, (7.0,))) for y, _ in given]
    assert (commands(of, given) == commands(of, other)).all() == (needs(of) == ())


@pytest.mark.parametrize("kind", EVERY)
def test_drivers_and_batch_are_one(kind: str) -> None:
    """The runner, MuJoCo's callback and a batch: one trajectory, to the last bit."""
    experiment = prepare(load_scenario("push_recovery", [*SHORT, f"controller.kind={kind}"]))
    native, callback, batch = experiment.run(), experiment.run(driver="callback"), experiment.run_many(2)
    assert native.trajectory is not None
    assert callback.trajectory is not None
    assert batch.trajectory is not None
    assert np.isfinite(native.trajectory["x_e_rad_times_s"]).all()
    for name, column in native.trajectory.columns.items():
        np.testing.assert_array_equal(callback.trajectory[name], column, name)
        of_batch = batch.trajectory[name]
        np.testing.assert_array_equal(of_batch if of_batch.ndim == 1 else of_batch[:, 0], column, name)


@pytest.mark.parametrize("kind", EVERY)
def test_worlds_of_other_limits_share_a_batch(kind: str) -> None:
    settings = ["plant.initial_tilt_deg=6.0", f"controller.kind={kind}"]
    experiment = prepare(load_scenario("push_recovery", [*SHORT, *settings]))
    limits = [3.0, 2.0, 1.5]
    many = experiment.run_many(3, vary={"controller.rate_limit_rad_s": limits}).trajectory
    assert many is not None
    for i, limit in enumerate(limits):
        own = prepare(load_scenario("push_recovery", [*SHORT, *settings, f"controller.rate_limit_rad_s={limit}"]))
        one = own.run(world=i).trajectory
        assert one is not None
        np.testing.assert_array_equal(many["u_rad_s"][:, i], one["u_rad_s"])
        assert np.abs(one["u_rad_s"]).max() == limit


def test_what_the_bench_gives_is_no_parameter() -> None:
    for kind in EVERY:
        given: dict[str, Any] = dict.fromkeys(GIVEN)
        assert {"dt", "rate_limit"} <= given.keys() & inspect.signature(law_class(kind)).parameters.keys()

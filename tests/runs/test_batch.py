"""Many worlds at once against the same worlds one by one."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import pytest

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.observers import OBSERVERS, Estimate, Measurement
from cmg_mj.results.result import Result
from cmg_mj.runs.experiment import Experiment
from tests.recorded import assert_same_bits, push_recovery, recorded

SHORT = ("duration_s=0.8", "push.0.start_s=0.2", "push.0.duration_s=0.1")

IMPERFECT = (
    "sensors.accelerometer.scale_error=[0.01,-0.01]",
    "sensors.accelerometer.misalignment_deg=[0.2,1.0]",
    "sensors.accelerometer.cross_axis=[0.02,-0.02]",
    "sensors.accelerometer.skew_s=0.003",
    "sensors.accelerometer.bias_instability_ug=400",
    "sensors.accelerometer.bandwidth_hz=94",
    "sensors.accelerometer.latency_s=0.001",
    "plant.flywheel_imbalance_kg_m=1e-5",
)


@cache
def experiment(*settings: str) -> Experiment:
    return push_recovery(*SHORT, *settings)


def assert_same(batch: Result, singles: Sequence[Result]) -> None:
    """Bit by bit: outcomes, summaries and every column, each world up to its end."""
    for i, single in enumerate(singles):
        assert_same_bits(recorded(batch).world(i), recorded(single))
        assert batch.outcomes[i] == single.outcomes[0]
        assert batch.summaries[i].keys() == single.summaries[0].keys()
        assert_same_numbers(batch.summaries[i], single.summaries[0])


def assert_same_numbers(ours: dict[str, Any], theirs: dict[str, Any]) -> None:
    """But for the order in which sums were added."""
    for name, value in theirs.items():
        if isinstance(value, dict):
            assert_same_numbers(ours[name], value)
        else:
            assert ours[name] == (None if value is None else pytest.approx(value, rel=1e-12)), name


@pytest.mark.daily_cases("gyro_free", "homogeneous", "homogeneous_adaptive", "kalman", "ltv")
@pytest.mark.parametrize("kind", sorted(OBSERVERS))
def test_batch_equals_single_runs(kind: str) -> None:
    setup = experiment(f"observer.kind={kind}")
    assert_same(setup.run_many(3), [setup.run(world=i) for i in range(3)])


@pytest.mark.daily_cases(
    "rates", "imperfect accelerometers", "gyro, estimated angles", "open_loop_observers", "single gimbal"
)
@pytest.mark.parametrize(
    "settings",
    [
        pytest.param(("sensors.accelerometer.rate_hz=1000", "sensors.encoder.rate_hz=100"), id="rates"),
        pytest.param(("sensors.accelerometer.latency_s=0.003", "sensors.fog.latency_s=0.01"), id="latency"),
        pytest.param(IMPERFECT, id="imperfect accelerometers"),
        pytest.param(("controller.feedback=fog", "controller.angle_source=estimated"), id="gyro, estimated angles"),
        pytest.param(("controller.feedback=truth", "open_loop_observers=all"), id="open_loop_observers"),
        pytest.param(("plant.integrator=implicitfast",), id="another integrator"),
        pytest.param(("plant.model=single_gimbal.xml", "plant.lock_thrust_bearing=true"), id="single gimbal"),
        pytest.param(("controller.rate_hz=1000", "duration_s=0.4"), id="1 kHz"),
    ],
)
def test_batch_equals_single_runs_in_every_setting(settings: tuple[str, ...]) -> None:
    setup = experiment(*settings)
    assert_same(setup.run_many(3), [setup.run(world=i) for i in range(3)])


@pytest.mark.daily_cases("homogeneous-21.2")
@pytest.mark.parametrize(("kind", "fall_angle_deg"), [("homogeneous", 21.2), ("ltv", 7.85), ("linear", 7.2)])
def test_worlds_that_fall_midway_leave_the_others_alone(kind: str, fall_angle_deg: float) -> None:
    """A push that ends near the angle that counts as a fall: the noise decides which worlds fall, and when."""
    settings = ("push.0.torque_n_m=2.5", f"metrics.fall_angle_deg={fall_angle_deg}")
    setup = experiment(f"observer.kind={kind}", *settings)
    batch = setup.run_many(12)
    has_fallen = [outcome.fell for outcome in batch.outcomes]
    assert 0 < sum(has_fallen) < 12
    assert_same(batch, [setup.run(world=i) for i in range(12)])
    for outcome, summary in zip(batch.outcomes, batch.summaries, strict=True):
        assert outcome.kind == ("fell" if outcome.fell else "done")
        assert (outcome.time_s < 0.8) == outcome.fell
        assert summary["settle_time_s"] is None or not outcome.fell


BIASES = (-10.0, -1.0, 0.0, 0.5, 1.5, 8.0)


@pytest.mark.daily_cases("homogeneous")
@pytest.mark.parametrize("kind", ["homogeneous", "ltv"])
def test_each_world_may_have_its_own_rig(kind: str) -> None:
    """Large biases fall at once and at different times; in the batch each world keeps its own model."""
    setup = experiment(f"observer.kind={kind}", "metrics.fall_angle_deg=12")
    vary = {"equilibrium_bias_deg": BIASES}
    batch = setup.run_many(len(BIASES), settings=vary)
    assert_same(batch, [one.run(world=i) for i, one in enumerate(setup.with_varied(vary))])
    ends = [outcome.time_s for outcome in batch.outcomes]
    assert [outcome.fell for outcome in batch.outcomes] == [True, False, False, False, False, True]
    assert 0.05 < ends[0] < 0.8
    assert 0.05 < ends[-1] < 0.8
    x1 = recorded(batch)["x1_rad"]
    assert np.isnan(x1[-1]).tolist() == [True, False, False, False, False, True]
    np.testing.assert_allclose(x1[0], np.radians(1.0), atol=1e-12)  # from each world's own equilibrium


def test_when_all_worlds_have_fallen_the_batch_ends() -> None:
    setup = experiment("metrics.fall_angle_deg=1.5", "push.0.torque_n_m=9.0")
    batch = setup.run_many(4)
    assert all(outcome.fell for outcome in batch.outcomes)
    assert len(recorded(batch)) < 100
    assert_same(batch, [setup.run(world=i) for i in range(4)])


# --- randomness ----------------------------------------------------------------------------------------


def test_a_world_is_the_same_in_any_batch() -> None:
    """Whatever its place and the others."""
    whole, some = (recorded(experiment().run_many(worlds)) for worlds in (6, [5, 2]))
    for place, world in enumerate((5, 2)):
        assert_same_bits(some.world(place), whole.world(world))


def test_seeds_and_worlds_differ() -> None:
    y1 = recorded(experiment().run_many(3))["y1_rad"]
    other = recorded(experiment("seed=1").run_many(3))["y1_rad"]
    signals = [*y1.T, *other.T]
    assert len({tuple(signal) for signal in signals}) == 6


def test_without_trajectory_the_numbers_are_the_same() -> None:
    full, lean = (experiment().run_many(3, keep_trajectory=keep) for keep in (True, False))
    assert lean.trajectory is None
    assert full.summaries == lean.summaries
    assert full.outcomes == lean.outcomes


# --- a world whose observer fails ----------------------------------------------------------------------


class FailsInWorld:
    """Returns NaN from the 30th sample on where the first tilt it saw was positive in the last digit it looks at."""

    def __init__(self, dt: float, model: ReducedModel) -> None:
        self.dt = dt

    def init(self, y: Measurement) -> tuple[Any, Any, int]:
        return y.y1, y.y1, 0

    def step(self, state: tuple[Any, Any, int], y: Measurement, u: Any) -> tuple[tuple, Estimate]:
        first, before, k = state
        rate = 0.5 * (y.y1 - before) / self.dt
        broken = (np.floor(1e5 * first) % 2 == 1) & (k >= 30)
        rate = np.where(broken, np.nan, rate)
        return (first, y.y1, k + 1), Estimate(y.y1, rate if np.ndim(y.y1) else float(rate), y.y2)


def test_a_world_whose_observer_returns_nan_ends_as_it_does_alone() -> None:
    setup = experiment(f"observer.kind={__name__}:FailsInWorld")
    singles = [setup.run(world=i) for i in range(6)]
    assert len({single.outcomes[0].kind for single in singles}) == 2  # some stop, some do not
    batch = setup.run_many(6)
    for outcome, single in zip(batch.outcomes, singles, strict=True):
        outcome.reason = single.outcomes[0].reason  # in other words
    assert_same(batch, singles)

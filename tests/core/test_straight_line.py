"""The straight line of a tick: to the last bit the functions it was printed from, and these where it is none."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from cmg_mj.core.arrays import signed_power, where
from cmg_mj.core.controller import PRINTED_AFTER
from cmg_mj.core.rig import RigControl
from cmg_mj.core.types import Estimate, Measurement
from cmg_mj.observers import Observer
from cmg_mj.results.result import Result
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario
from tests.recorded import assert_same_bits, push_recovery, recorded
from tests.sensors.test_accelerometer import ALL

DT = 0.005
UNROUNDED = ("sensors.accelerometer.counts_per_g=0", "sensors.encoder.counts_per_revolution=0")
VIBRATION = ("sensors.accelerometer.vibration_mg=4", "sensors.accelerometer.wheel_harmonics_mg=[5, 2]")
LATE = tuple(f"sensors.{kind}.latency_s=0.004" for kind in ("accelerometer", "encoder", "fog"))
TRIMMED = ("observer.kind=adaptive", "controller.bias_trim_s=0.5")


def run(experiment: Experiment, prints: bool, observer: Observer | None = None) -> Result:
    """Run it on the straight line, or on the plain functions alone; whether it was printed is looked at."""
    controller = experiment.controller(observer=observer)
    if not prints:
        controller._print_from = math.inf
    result = experiment.simulate(experiment.plant, controller)
    assert bool(controller._printed) == prints
    assert math.isfinite(controller._print_from) == prints
    return result


@pytest.mark.parametrize(
    ("scenario", "settings"),
    [
        ("push_recovery", ()),
        ("push_recovery", ("observer.kind=gyro_free",)),
        ("push_recovery", (*ALL, *UNROUNDED, *VIBRATION, *LATE, "controller.feedback=fog")),
        ("push_recovery", ("observer.kind=mems_fused", *UNROUNDED)),
        ("push_recovery", (*TRIMMED, "controller.notch_hz=20", "plant.gimbal_backlash_arcmin=10", *UNROUNDED)),
        ("two_axes", ("plant.turn_rate_rad_s=1.0", *UNROUNDED)),
        ("walk", ("duration_s=3.75", "gait.steps=2", *UNROUNDED)),
    ],
    ids=["stock", "gyro_free", "every effect", "mems_fused", "trim, notch, backlash", "two axes", "a walk"],
)
def test_it_is_the_plain_functions_to_the_last_bit(scenario: str, settings: tuple[str, ...]) -> None:
    experiment = prepare(load_scenario(scenario, ["duration_s=1.5", "push=[]", *settings]))
    printed, plain = (recorded(run(experiment, prints)) for prints in (True, False))
    assert len(plain) >= 300
    assert_same_bits(printed, plain)


class Elementwise:
    """A user's observer."""

    def init(self, y: Measurement) -> Any:
        return y.y1, 0.0

    def step(self, state: Any, y: Measurement, u: Any) -> Any:
        before, sample = state
        return (y.y1, sample + 1.0), Estimate(y.y1, self.limited(0.3 * (y.y1 - before) / DT, sample), y.y2)

    def limited(self, rate: Any, sample: Any) -> Any:
        return where(rate > 0.02, 0.02, rate)


class Branches(Elementwise):
    def limited(self, rate: Any, sample: Any) -> Any:
        return 0.02 if rate > 0.02 else rate


class Overflows(Elementwise):
    """At sample 200 the plain function has infinity, where a power of Python's raises."""

    def limited(self, rate: Any, sample: Any) -> Any:
        return rate / (1.0 + signed_power(where(sample == 200.0, 10.0, 1.0), 400.0))


class Divides(Elementwise):
    """At sample 200 by zero."""

    def limited(self, rate: Any, sample: Any) -> Any:
        return rate / (sample - 200.0)


OWN = push_recovery("duration_s=1.5", "push=[]", "controller.feedback=truth")


def as_the_packages_own(part: type, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(part, "__module__", "cmg_mj.mine")
    return part()


def test_users_parts_and_what_branches_run_as_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = []
    for part, is_own, prints in (
        (Elementwise, 0, False),
        (Branches, 0, False),
        (Elementwise, 1, True),
        (Branches, 1, False),
    ):
        observer = as_the_packages_own(part, monkeypatch) if is_own else part()
        controller = OWN.controller(observer=observer)
        assert math.isfinite(controller._print_from) == is_own  # nobody knows what a user's looks at
        runs.append(recorded(OWN.simulate(OWN.plant, controller)))
        assert math.isfinite(controller._print_from) == prints
        assert_same_bits(runs[-1], runs[0])
    assert np.ptp(runs[0]["estimate/homogeneous/x2_rad_s"]) > 0.02


@pytest.mark.parametrize(("part", "outcome"), [(Overflows, "done"), (Divides, "stopped")])
def test_where_it_fails_the_plain_function_says_what_is(
    part: type, outcome: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = run(OWN, False, part())
    observer, steps, update = as_the_packages_own(part, monkeypatch), [], RigControl.update

    def watched(self: Any, sampled: Any, deciding: Any, step: int, *rest: Any) -> Any:
        steps.append(int(step))
        return update(self, sampled, deciding, step, *rest)

    monkeypatch.setattr(RigControl, "update", watched)
    printed = run(OWN, True, observer)
    assert steps == [*range(PRINTED_AFTER + 1), 201]  # the last one of those before is recorded
    assert printed.outcomes == plain.outcomes
    assert printed.outcomes[0].kind == outcome
    assert_same_bits(recorded(printed), recorded(plain))


def test_readings_that_are_no_plain_floats_are_taken_as_they_are() -> None:
    """A straight line would take NumPy's numbers for constants."""
    plant, data, estimates = OWN.plant, OWN.plant.new_data(), []
    for kind in (float, np.float64):
        controller = OWN.controller()
        for step in range(2 * PRINTED_AFTER):
            data.sensordata[:] = 0.01 * math.sin(0.1 * step)
            controller.update(step, plant.ideal_readings([*map(kind, data.sensordata)], [*map(kind, data.qvel)]))
        estimates.append(controller.ticks[0].estimates)
    assert estimates[0] == estimates[1]

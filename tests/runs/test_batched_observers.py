"""Runs that share a batch though their observers differ are, to the last bit, what each is by itself."""

from __future__ import annotations

import numpy as np
import pytest

from cmg_mj.observers import OBSERVERS
from cmg_mj.results.result import Result
from cmg_mj.results.summary_keys import open_loop_figures
from cmg_mj.runs import side_by_side as side_by_side
from cmg_mj.runs.experiment import Experiment, prepare, run_batch
from cmg_mj.runs.side_by_side import BatchJob, run_of, run_side_by_side
from cmg_mj.scenario.loading import load_scenario


def experiment(observer: str, *more: str) -> Experiment:
    return prepare(load_scenario("push_recovery", ["duration_s=2.4", "open_loop_observers=[]", *more], observer))


def same(a: Result, b: Result) -> None:
    assert (a.observers, list(a.worlds), a.seconds, a.outcomes) == (b.observers, list(b.worlds), b.seconds, b.outcomes)
    assert a.summaries == b.summaries
    if a.trajectory is not None:
        assert b.trajectory is not None
        assert list(a.trajectory.columns) == list(b.trajectory.columns)
        assert a.trajectory.layout == b.trajectory.layout
        for name in a.trajectory.columns:
            np.testing.assert_array_equal(a.trajectory[name], b.trajectory[name], name)


class Batches:
    """Counts them."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.sizes: list[int] = []
        run = Experiment.simulate

        def count_batches(self_: Experiment, plants: list, *args: object, **options: object) -> Result:
            self.sizes.append(len(plants))
            return run(self_, plants, *args, **options)  # type: ignore[arg-type]

        monkeypatch.setattr(Experiment, "simulate", count_batches)


@pytest.mark.slow
def test_every_observer_beside_the_others_is_as_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = [run_of(experiment(name), 3) for name in OBSERVERS]
    alone = [run_batch(*run) for run in runs]
    batches = Batches(monkeypatch)
    for a, b in zip(run_side_by_side(runs), alone, strict=True):
        same(a, b)
    kinds = {experiment(name).axis_controller().extra_signals[0] for name in OBSERVERS}
    assert sorted(batches.sizes) != [3] * len(OBSERVERS)
    assert len(batches.sizes) == len(kinds)  # what is estimated beyond x is the same in a batch


@pytest.mark.slow
def test_parameters_noise_and_rigs_may_differ_too(monkeypatch: pytest.MonkeyPatch) -> None:
    noise = "sensors.accelerometer.noise_density_ug_rthz=800"
    runs = [
        run_of(experiment("homogeneous"), 2),
        run_of(experiment("homogeneous", "observer.k1=30.0", noise), 2),
        BatchJob(experiment("gyro_free").with_varied({"equilibrium_bias_deg": [0.0, 1.0, 1.0]}), [4, 4, 2]),
        run_of(experiment("gyro_free", noise), 1),
        run_of(experiment("homogeneous"), 1),
    ]
    alone = [run_batch(*run, keep_trajectory=False) for run in runs]
    batches = Batches(monkeypatch)
    for a, b in zip(run_side_by_side(runs, keep_trajectory=False), alone, strict=True):
        same(a, b)
    assert batches.sizes == [9]


@pytest.mark.slow
def test_what_a_batch_has_in_common_keeps_runs_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = [
        run_of(experiment("linear", *more), 2)
        for more in ((), ("controller.angle_source=estimated",), ("seed=3",), ("controller.rate_hz=100",), ())
    ]
    alone = [run_batch(*run) for run in runs]
    batches = Batches(monkeypatch)
    for a, b in zip(run_side_by_side(runs), alone, strict=True):
        same(a, b)
    assert sorted(batches.sizes) == [2, 2, 2, 4]


def test_a_batch_has_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(side_by_side, "MOST_WORLDS", 5)
    batches = Batches(monkeypatch)
    run_side_by_side([run_of(experiment(name, "duration_s=0.1", "push=[]"), 2) for name in ("linear", "ltv", "kalman")])
    assert batches.sizes == [4, 2]


def test_the_same_open_loop_observers_share_a_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    short = ("duration_s=0.2", "push=[]", 'open_loop_observers=["gyro_free"]')
    quiet = "sensors.accelerometer.noise_density_ug_rthz=100"
    runs = [
        run_of(experiment("linear", *short), 2),
        run_of(experiment("ltv", *short), 1),
        run_of(experiment("ltv", *short, quiet), 2),
        run_of(experiment("gyro_free", *short), 1),  # in the loop it is not in open loop as well
    ]
    alone = [run_batch(*run) for run in runs]
    batches = Batches(monkeypatch)
    for a, b in zip(run_side_by_side(runs), alone, strict=True):
        same(a, b)
    assert sorted(batches.sizes) == [1, 5]


def test_an_open_loop_observer_knows_the_noise_of_its_own_world() -> None:
    settings = ["duration_s=0.3", "push=[]"]
    noises = [100.0, 400.0, 400.0, 100.0]
    field = "sensors.accelerometer.noise_density_ug_rthz"
    homogeneous = prepare(load_scenario("push_recovery", settings))
    together = homogeneous.run_many(4, vary={field: noises})
    assert list(together.observers) == ["homogeneous", "gyro_free"]
    assert together.trajectory is not None
    for world, noise in enumerate(noises):
        alone = homogeneous.with_settings({field: noise}).run(world=world)
        assert alone.trajectory is not None
        assert together.summaries[world] == alone.summaries[0]
        for name, values in alone.trajectory.columns.items():
            np.testing.assert_array_equal(together.trajectory.world(world)[name], values, name)


def test_push_recovery_shows_gyro_free_beside_what_the_loop_does() -> None:
    """The open-loop observer adds its own columns and figures, and changes no bit of the others."""
    settings = ["duration_s=0.3", "push=[]"]
    beside = prepare(load_scenario("push_recovery", settings)).run()
    alone = prepare(load_scenario("push_recovery", [*settings, "open_loop_observers=[]"])).run()
    assert beside.trajectory is not None
    assert alone.trajectory is not None
    (shown,), (expected,) = beside.summaries, alone.summaries
    assert shown["references"] == expected["references"]
    assert list(open_loop_figures({**shown, "references": {}})) == ["gyro_free"]
    assert {key: value for key, value in shown.items() if key != "open_loop_observers"} == expected
    assert set(beside.trajectory.columns) - set(alone.trajectory.columns) == {
        f"estimate/gyro_free/{name}" for name in ("x1_rad", "x2_rad_s", "x3_rad")
    }
    for name, values in alone.trajectory.columns.items():
        np.testing.assert_array_equal(beside.trajectory[name], values, name)


class Raises:
    """An observer that gives up."""

    def __init__(self, dt: float, model: object) -> None: ...

    def init(self, y: tuple) -> int:
        return 0

    def step(self, state: int, y: tuple, u: float) -> tuple:
        if state > 50:
            raise ValueError("enough")
        return state + 1, (y[0], 0.0 * y[0], y[1])


def test_an_observer_that_raises_stops_its_own_run_alone() -> None:
    short = ("duration_s=0.5", "push=[]")
    runs = [run_of(experiment(name, *short), 2) for name in ("linear", f"{__name__}:Raises", "ltv")]
    actual = run_side_by_side(runs)
    assert [[outcome.kind for outcome in result.outcomes] for result in actual] == [
        ["done"] * 2,
        ["stopped"] * 2,
        ["done"] * 2,
    ]
    assert "ValueError: enough" in actual[1].outcomes[0].reason

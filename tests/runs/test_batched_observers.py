"""Runs that share a batch though their observers differ are, to the last bit, what each is by itself."""

from __future__ import annotations

import pytest

from cmg_mj.observers import OBSERVERS
from cmg_mj.results.result import Result
from cmg_mj.runs import side_by_side as side_by_side
from cmg_mj.runs.experiment import Experiment, run_batch
from cmg_mj.runs.side_by_side import BatchJob, run_jobs, run_of
from tests.recorded import assert_same_bits, push_recovery, recorded


def experiment(observer: str, *more: str) -> Experiment:
    return push_recovery("duration_s=2.4", "open_loop_observers=[]", *more, observer=observer)


@pytest.fixture
def batches(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Sizes of the batches that are run."""
    sizes: list[int] = []
    run = Experiment.simulate

    def count_batches(self: Experiment, plants: list, *args: object, **options: object) -> Result:
        sizes.append(len(plants))
        return run(self, plants, *args, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(Experiment, "simulate", count_batches)
    return sizes


def assert_alike(jobs: list[BatchJob], batches: list[int], keep_trajectory: bool = True) -> None:
    """Each run alone and side by side; what remains in `batches` are the sizes of those side by side."""
    alone = [run_batch(*job, keep_trajectory=keep_trajectory) for job in jobs]
    batches.clear()
    for a, b in zip(run_jobs(jobs, keep_trajectory=keep_trajectory), alone, strict=True):
        assert (a.observers, list(a.world_ids), a.seconds) == (b.observers, list(b.world_ids), b.seconds)
        assert (a.outcomes, a.summaries) == (b.outcomes, b.summaries)
        if keep_trajectory:
            assert recorded(a).layout == recorded(b).layout
            assert_same_bits(recorded(a), recorded(b))


@pytest.mark.slow
def test_every_observer_beside_the_others_is_as_by_itself(batches: list[int]) -> None:
    assert_alike([run_of(experiment(name), 3) for name in OBSERVERS], batches)
    axes = [experiment(name).axis_controller().axes[0] for name in OBSERVERS]
    kinds = {(axis.extra_signals[0], axis.reads_gyro) for axis in axes}
    assert len(batches) == len(kinds) < len(OBSERVERS)  # what is estimated beyond x, and the gyro, are common


NOISY, QUIET = (f"sensors.accelerometer.noise_density_ug_rthz={density}" for density in (800, 100))
BRIEF = ("duration_s=0.2", "push=[]", 'open_loop_observers=["gyro_free"]')
JOBS: dict[str, tuple[list[tuple[str, tuple[str, ...], int]], list[int]]] = {
    "parameters and noise may differ": (
        [
            ("homogeneous", (), 2),
            ("homogeneous", ("observer.k1=30.0", NOISY), 2),
            ("gyro_free", (NOISY,), 1),
            ("gyro_free", (), 1),
        ],
        [6],
    ),
    "what a batch has in common keeps runs apart": (
        [
            ("linear", more, 2)
            for more in ((), ("controller.angle_source=estimated",), ("seed=3",), ("controller.rate_hz=100",), ())
        ],
        [2, 2, 2, 4],
    ),
    "the same open-loop observers share a batch": (
        [
            ("linear", BRIEF, 2),
            ("ltv", BRIEF, 1),
            ("ltv", (*BRIEF, QUIET), 2),
            ("gyro_free", BRIEF, 1),  # in the loop it is not in open loop as well
        ],
        [1, 5],
    ),
}


@pytest.mark.daily_cases("the same open-loop observers share a batch")
@pytest.mark.parametrize(("jobs", "sizes"), JOBS.values(), ids=JOBS)
def test_runs_side_by_side_are_as_alone(
    jobs: list[tuple[str, tuple[str, ...], int]], sizes: list[int], batches: list[int]
) -> None:
    assert_alike([run_of(experiment(name, *more), worlds) for name, more, worlds in jobs], batches)
    assert sorted(batches) == sizes


@pytest.mark.slow
def test_rigs_may_differ_too(batches: list[int]) -> None:
    biased = experiment("gyro_free").with_varied({"equilibrium_bias_deg": [0.0, 1.0, 1.0]})
    assert_alike([run_of(experiment("homogeneous"), 2), BatchJob(biased, [4, 4, 2])], batches, keep_trajectory=False)
    assert batches == [5]


def test_a_batch_has_an_end(batches: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(side_by_side, "MAX_WORLDS", 5)
    run_jobs([run_of(experiment(name, *BRIEF), 2) for name in ("linear", "ltv", "kalman")])
    assert batches == [4, 2]


def test_an_open_loop_observer_knows_the_noise_of_its_own_world() -> None:
    noises = [100.0, 400.0, 400.0, 100.0]
    field = "sensors.accelerometer.noise_density_ug_rthz"
    homogeneous = push_recovery("duration_s=0.3", "push=[]")
    together = homogeneous.run_many(4, settings={field: noises})
    assert list(together.observers) == ["homogeneous", "gyro_free"]
    for world, noise in enumerate(noises):
        alone = homogeneous.with_settings({field: noise}).run(world=world)
        assert together.summaries[world] == alone.summaries[0]
        assert_same_bits(recorded(together).world(world), recorded(alone))


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
    actual = run_jobs(runs)
    assert [{outcome.kind for outcome in result.outcomes} for result in actual] == [{"done"}, {"stopped"}, {"done"}]
    assert "ValueError: enough" in actual[1].outcomes[0].reason

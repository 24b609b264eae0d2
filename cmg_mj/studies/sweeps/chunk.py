"""Computes one chunk of a sweep: a row a trial."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from cmg_mj.errors import InputError, raised
from cmg_mj.results.summary_keys import ID_COLUMNS, Summary
from cmg_mj.simulation.batch import BatchKey, PlantStructure, plant_structure
from cmg_mj.simulation.experiment import Experiment, prepare, run_batch
from cmg_mj.studies.sweeps.points import Point, Points
from cmg_mj.studies.sweeps.study import Chunk, SweepStudy

if TYPE_CHECKING:
    from cmg_mj.results.result import Result

REFUSED = "refused"
"""Outcome of a trial whose values do not fit each other: it never begins."""

BatchId = tuple[BatchKey, PlantStructure]
"""Properties that the worlds of one batch have in common."""


def compute(
    study: SweepStudy,
    chunk: Chunk,
    on_progress: Callable[[float], None] | None = None,
    *,
    points: Points | Mapping[int, Point] | None = None,
    threads: int = 0,
) -> list[Summary]:
    """Run the trials of a chunk.

    A trial that fails is a row with the reason: values that do not fit, physics that fails, an observer that raises.

    Args:
        study: The sweep.
        chunk: The trials.
        on_progress: Called after every tick with the share of the chunk that is done.
        points: The chunk's points by their numbers; by default they are made from the study.
        threads: Number of threads that step the worlds; 0: as many as there are processors.

    Returns:
        A row a trial, in the chunk's order: the point's number, the varied values, and the figures of the run.
    """
    points = study.points if points is None else points
    base = prepare(study.scenario_with(chunk.observer))
    baseline = chunk.observer if chunk.observer in study.baselines else None
    results: dict[tuple[int, int], Summary] = {}
    batches: dict[BatchId, list[tuple[int, int]]] = {}
    experiments: dict[int, Experiment] = {}
    batch_of: dict[int, BatchId] = {}
    refused: dict[int, str] = {}
    for trial in chunk.trials:
        number = trial[0]
        if number in refused:
            continue
        if number not in experiments:
            try:
                experiments[number] = base.with_settings(points[number])
                batch_of[number] = experiments[number].batch_key, plant_structure(experiments[number].plant)
            except InputError as error:
                refused[number] = str(error)
                continue
        batches.setdefault(batch_of[number], []).append(trial)
    for trials in batches.values():
        done, share = len(results) / len(chunk.trials), len(trials) / len(chunk.trials) / study.scenario.duration_s
        tick = part_of_progress(on_progress, done, share)
        rows = _run([experiments[number] for number, _ in trials], trials, tick, threads, baseline)
        results |= zip(trials, rows, strict=True)
    for trial in chunk.trials:
        if trial[0] in refused:
            results[trial] = _unfinished(REFUSED, refused[trial[0]])
    return _with_identity(study, chunk, points, results)


def rows_of_failed_chunk(study: SweepStudy, chunk: Chunk, reason: str) -> list[Summary]:
    """Make the rows of a chunk that could not be computed: the reason in each."""
    return _with_identity(study, chunk, study.points, dict.fromkeys(chunk.trials, _unfinished("stopped", reason)))


def _with_identity(
    study: SweepStudy, chunk: Chunk, points: Points | Mapping[int, Point], results: Mapping[tuple[int, int], Summary]
) -> list[Summary]:
    """Put the point, the observer, the world and the seed before each trial's result."""
    of_all = {"observer": chunk.observer, "seed": study.scenario.seed}
    return [
        {"point": number, **_as_columns(points[number]), **of_all, "world": world, **results[number, world]}
        for number, world in chunk.trials
    ]


def part_of_progress(
    on_progress: Callable[[float], None] | None, start: float, size: float
) -> Callable[[float], None] | None:
    """Make the report of a part of a progress, which begins at the start and adds the size; None without a progress."""
    return on_progress and (lambda share: on_progress(start + size * share))


def _run(
    experiments: Sequence[Experiment],
    trials: Sequence[tuple[int, int]],
    tick: Callable[[float], None] | None,
    threads: int,
    baseline: str | None,
) -> list[Summary]:
    """Run trials in one batch. Where one raises, those that it stopped run again, without it at last.

    They are halved until each trial is through or has raised by itself, so that no row depends on another's.
    """
    rows: dict[int, Summary] = {}
    onward = _monotonic_progress(tick) if tick else None
    parts = [list(range(len(trials)))]
    while parts:
        part = parts.pop()
        part_rows = _run_once([experiments[i] for i in part], [trials[i][1] for i in part], onward, threads, baseline)
        rows |= {i: row for i, row in zip(part, part_rows, strict=True) if row is not None}
        again = [i for i in part if i not in rows]
        half = (len(again) + 1) // 2
        parts += [trials_left for trials_left in (again[half:], again[:half]) if trials_left]
    return [rows[i] for i in range(len(trials))]


def _run_once(
    experiments: Sequence[Experiment],
    worlds: Sequence[int],
    tick: Callable[[float], None] | None,
    threads: int,
    baseline: str | None,
) -> list[Summary | None]:
    """Run one batch once; None for a trial that may have been stopped by another one."""
    try:
        result: Result = run_batch(experiments, worlds, keep_trajectory=False, on_progress=tick, threads=threads)
    except Exception as error:  # a user's observer may fail in any way
        alone = len(worlds) == 1
        return [_unfinished("stopped", raised(error)) if alone else None for _ in worlds]
    if any(outcome.kind == "interrupted" for outcome in result.outcomes):
        raise KeyboardInterrupt
    identity = {"observer", "in_loop_of", "world", "seed"}
    return [
        None if outcome.with_others else {key: value for key, value in row.items() if key not in identity}
        for outcome, row in zip(result.outcomes, result.rows(baseline), strict=True)
    ]


def _monotonic_progress(tick: Callable[[float], None]) -> Callable[[float], None]:
    """Report no time before the latest: what runs again is no step back."""
    latest = 0.0

    def report(time: float) -> None:
        nonlocal latest
        latest = max(latest, time)
        tick(latest)

    return report


def _unfinished(outcome: str, reason: str) -> Summary:
    return {"outcome": outcome, "stood": False, "end_time_s": 0.0, "reason": reason}


def _as_columns(point: Point) -> Point:
    """Make a point's values into what a table can hold: a list becomes its text."""
    return {
        field: value if isinstance(value, (int, float, str, bool)) else repr(value) for field, value in point.items()
    }


COLUMNS = [name for name in ID_COLUMNS if name != "in_loop_of"]
"""Columns of a trial, after what is varied and before its figures."""

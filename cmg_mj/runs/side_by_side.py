"""Runs with different observers in one batch: physics, sensors, law are the batch's, an observer has its own worlds."""

from __future__ import annotations

import dataclasses
from collections.abc import Hashable, Iterator, Sequence
from itertools import groupby
from typing import NamedTuple, Unpack

from cmg_mj.core.types import extra_signals, reads_gyro
from cmg_mj.results.result import Result
from cmg_mj.runs.batch import BatchedObservers, neighbours
from cmg_mj.runs.experiment import Experiment, run_batch
from cmg_mj.runs.simulate import SimulationOptions

MAX_WORLDS = 1024
"""Most worlds of one batch: beyond, Python's share of a world no longer falls and memory grows."""


class BatchJob(NamedTuple):
    """Worlds that `Experiment.run_many` would run by themselves.

    Attributes:
        experiments: One a world, all with the same observer.
        world_ids: Their numbers.
    """

    experiments: Sequence[Experiment]
    world_ids: Sequence[int]


def run_of(experiment: Experiment, worlds: int) -> BatchJob:
    """Worlds 0 to n - 1 of one experiment."""
    return BatchJob([experiment] * worlds, range(worlds))


def run_jobs(runs: Sequence[BatchJob], **options: Unpack[SimulationOptions]) -> list[Result]:
    """Run what differs in the observer, its parameters, or in numbers that worlds of one batch may differ in.

    Args:
        runs: What to run. Those that may share a batch do; the others have one of their own.
        **options: Those of `simulate`.

    Returns:
        A result a run, bit for bit what `run_many` returns for it alone.

    Raises:
        InputError: Worlds of one run differ in something that worlds of one batch have in common.
    """
    results_of_jobs: dict[int, Result] = {}
    for batch in _batches(runs):
        results = _run_together([runs[i] for i in batch], options) if len(batch) > 1 else []
        if not results or any(outcome.kind == "stopped" for result in results for outcome in result.outcomes):
            # An observer that raises stops all worlds of its batch: what the others do is seen without it.
            results = [run_batch(*runs[i], **options) for i in batch]
        results_of_jobs |= zip(batch, results, strict=True)
    return [results_of_jobs[i] for i in range(len(runs))]


def _batches(jobs: Sequence[BatchJob]) -> Iterator[list[int]]:
    """Return the jobs' indices, those together that may share a batch."""
    alike: dict[Hashable, list[int]] = {}
    for i, job in enumerate(jobs):
        alike.setdefault(_shared_key(job) or i, []).append(i)
    for indices in alike.values():
        batch: list[int] = []
        for i in indices:
            if batch and sum(len(jobs[j].world_ids) for j in [*batch, i]) > MAX_WORLDS:
                yield batch
                batch = []
            batch.append(i)
        yield batch


def _shared_key(job: BatchJob) -> Hashable:
    """Return the key that jobs of one batch share; None for a job that cannot share a batch."""
    first = job.experiments[0]
    if len(first.axes) > 1 or first.scenario.axes or len({one.batch_key for one in job.experiments}) > 1:
        return None
    key = tuple(part for part in first.batch_key if not part[1])
    observer = first.design.observer()
    gyro = first.scenario.observer.kind if reads_gyro(observer) else None  # columns and baselines differ
    return key, extra_signals(observer), gyro, tuple(first.scenario.open_loop_names())


def _run_together(jobs: Sequence[BatchJob], options: SimulationOptions) -> list[Result]:
    """Results of jobs in one batch."""
    parts = []
    # Neighbours with the same observer, with the same noise, are one part.
    for _, group in groupby(jobs, key=lambda job: job.experiments[0].batch_key):
        alike = list(group)
        parts.append((alike[0].experiments[0].design.observer(), sum(len(job.world_ids) for job in alike)))
    experiments = [experiment for job in jobs for experiment in job.experiments]
    numbers = [int(number) for job in jobs for number in job.world_ids]
    whole = run_batch(experiments, numbers, observer=BatchedObservers(parts), **options)
    places = neighbours([len(job.world_ids) for job in jobs])
    return [
        _renamed(whole.select(place), job.experiments[0].scenario.observer.kind)
        for job, place in zip(jobs, places, strict=True)
    ]


def _renamed(result: Result, observer: str) -> Result:
    """Return a result with the name of the observer that these worlds had."""
    before, *open_loop = result.observers
    trajectory = result.trajectory
    if trajectory is not None:
        old, new = f"estimate/{before}/", f"estimate/{observer}/"
        columns = {name.replace(old, new): values for name, values in trajectory.columns.items()}
        layout = dataclasses.replace(trajectory.layout, observers=(observer, *open_loop))
        trajectory = dataclasses.replace(trajectory, columns=columns, layout=layout)
    return dataclasses.replace(result, observers=(observer, *open_loop), trajectory=trajectory)

"""Runs with different observers in one batch: physics, sensors, law are the batch's, an observer has its own worlds."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.elementwise import Scalar
from cmg_mj.observers import Measurement, Observer
from cmg_mj.observers.protocol import extra_signals
from cmg_mj.results.result import Result
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.simulation.experiment import Experiment, batch_inputs, run_batch
from cmg_mj.simulation.pool import batch_key

MOST_WORLDS = 1024
"""Of one batch: beyond, Python's share of a world no longer falls and memory grows."""

TOLD = "the sensors' noise, which "
"""How `batch_key` begins to say what noise an observer is told."""


class BatchJob(NamedTuple):
    """What `Experiment.run_many` would run by itself.

    Attributes:
        experiments: One a world, all with the same observer.
        worlds: Their numbers.
    """

    experiments: Sequence[Experiment]
    worlds: Sequence[int]


def run_of(experiment: Experiment, worlds: int) -> BatchJob:
    """Worlds 0 to n - 1 of one experiment."""
    return BatchJob([experiment] * worlds, range(worlds))


class BatchedObservers:
    """Observers that stand beside each other in one batch, each in worlds of its own.

    Args:
        parts: An observer, and how many worlds it has, in the batch's order. All name the same extra signals.
    """

    def __init__(self, parts: Sequence[tuple[Observer, int]]) -> None:
        self.extra_signals = extra_signals(parts[0][0])
        ends = np.cumsum([worlds for _, worlds in parts]).tolist()
        self._parts = [
            (observer, slice(end - worlds, end)) for (observer, worlds), end in zip(parts, ends, strict=True)
        ]
        self._shapes = [(worlds,) for _, worlds in parts]

    def init(self, y: Measurement) -> list[Any]:
        """Each one's state at the first sample."""
        return [observer.init(_of(y, own)) for observer, own in self._parts]

    def step(self, states: list[Any], y: Measurement, u: Any) -> tuple[list[Any], Sequence[Scalar]]:
        """Advance each by one sample period; estimates are arrays (n_worlds,)."""
        stepped = [
            observer.step(state, _of(y, own), u[own])
            for state, (observer, own) in zip(states, self._parts, strict=True)
        ]
        whole = [
            [np.broadcast_to(part, shape) for part in estimate]
            for (_, estimate), shape in zip(stepped, self._shapes, strict=True)
        ]
        return [state for state, _ in stepped], [np.concatenate(parts) for parts in zip(*whole, strict=True)]


def _of(y: Measurement, worlds: slice) -> Measurement:
    """What some of the worlds measure."""
    y1, y2 = y
    return Measurement(y1[worlds], y2[worlds], y.acceleration[worlds])  # type: ignore[index]


def run_side_by_side(runs: Sequence[BatchJob], **options: Any) -> list[Result]:
    """Run what differs in the observer, its parameters, or in numbers that worlds of one batch may differ in.

    Args:
        runs: What to run. Those that may share a batch do; the others have one of their own.
        **options: Those of `simulate`.

    Returns:
        A result a run, bit for bit what `run_many` returns for it alone.

    Raises:
        InputError: Worlds of one run differ in something that worlds of one batch have in common.
    """
    found: dict[int, Result] = {}
    for batch in _batches(runs):
        results: list[Result] = []
        if len(batch) > 1:
            results = _shared([runs[i] for i in batch], options)
        if not results or any(outcome.kind == "stopped" for result in results for outcome in result.outcomes):
            # An observer that raises stops all worlds of its batch: what the others do is seen without it.
            results = [run_batch(*runs[i], **options) for i in batch]
        found |= zip(batch, results, strict=True)
    return [found[i] for i in range(len(runs))]


def _batches(runs: Sequence[BatchJob]) -> Iterator[list[int]]:
    """The runs' indices, those together that may share a batch."""
    alike: dict[Any, list[int]] = {}
    for i, run in enumerate(runs):
        alike.setdefault(_common(run) or i, []).append(i)
    for indices in alike.values():
        batch: list[int] = []
        for i in indices:
            if batch and sum(len(runs[j].worlds) for j in [*batch, i]) > MOST_WORLDS:
                yield batch
                batch = []
            batch.append(i)
        yield batch


def _common(run: BatchJob) -> Any:
    """What runs of one batch have in common; None for one that has to be by itself."""
    first = run.experiments[0]
    if first.axes or first.scenario.open_loop_names() or len({repr(_structure(e)) for e in _once(run.experiments)}) > 1:
        return None
    physics = first.plant.model.opt
    fields = {name: value for name, value in _structure(first).items() if not _of_observer(name)}
    return (
        repr(fields),
        physics.timestep,
        int(physics.integrator),
        (tuple(first.plant.joint_names), first.plant.joint_kinds),
        extra_signals(first.design.observer()),
    )


def _once(experiments: Sequence[Experiment]) -> list[Experiment]:
    """Each of them once."""
    return list({id(each): each for each in experiments}.values())


def _structure(experiment: Experiment) -> dict[str, str]:
    return batch_key(experiment.scenario, experiment.design)


def _of_observer(name: str) -> bool:
    return name.split(".")[0] == "observer" or name.startswith(TOLD)


def _shared(runs: Sequence[BatchJob], options: dict[str, Any]) -> list[Result]:
    """Results of runs in one batch."""
    parts = []
    # Neighbours with the same observer, told the same, are one part.
    for _, group in groupby(runs, key=lambda run: repr(_structure(run.experiments[0]))):
        of = list(group)
        parts.append((of[0].experiments[0].design.observer(), sum(len(run.worlds) for run in of)))
    experiments = [each for run in runs for each in run.experiments]
    numbers = [int(number) for run in runs for number in run.worlds]
    rigs, controller, pushes = batch_inputs(experiments, numbers, observer=BatchedObservers(parts))
    whole = experiments[0].simulate(rigs, controller, pushes, **options)
    ends = np.cumsum([len(run.worlds) for run in runs]).tolist()
    return [
        _renamed(whole.select(slice(end - len(run.worlds), end)), run.experiments[0].scenario.observer.kind)
        for run, end in zip(runs, ends, strict=True)
    ]


def _renamed(result: Result, observer: str) -> Result:
    """The same with the name of the observer that these worlds had."""
    (before,) = result.observers
    trajectory = result.trajectory
    if trajectory is not None and before != observer:
        old, new = f"estimate/{before}/", f"estimate/{observer}/"
        columns = {
            new + name.removeprefix(old) if name.startswith(old) else name: values
            for name, values in trajectory.columns.items()
        }
        layout = dataclasses.replace(trajectory.layout, observers=(observer,))
        trajectory = Trajectory(columns, trajectory.metadata, layout)
    return dataclasses.replace(result, observers=(observer,), trajectory=trajectory)

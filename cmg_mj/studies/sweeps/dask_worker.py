"""One chunk on a worker of a cluster: what is sent there, and the table that comes back."""

from __future__ import annotations

import dataclasses
import signal
import sys
import threading
from collections.abc import Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cmg_mj.errors import InputError
from cmg_mj.inputs.bundled import folder
from cmg_mj.scenario.resolve import versions
from cmg_mj.studies.sweeps.chunk import compute
from cmg_mj.studies.sweeps.points import Point
from cmg_mj.studies.sweeps.release_memory import release_free_memory
from cmg_mj.studies.sweeps.study import Chunk, SweepStudy
from cmg_mj.studies.sweeps.trials import as_bytes, table_of

_one_at_a_time = threading.Lock()
"""A worker with many threads is handed as many chunks: one is computed, on all of its threads."""


@dataclass(frozen=True)
class Part:
    """A chunk with all that it takes to compute it elsewhere, and no more: it is sent with every chunk.

    Attributes:
        study: The sweep, without its points.
        chunk: Which of its trials.
        points: Those of the chunk, by their numbers.
        bundled: The file of the model, if that comes with the package, which a worker may have in another folder.
        versions: What the figures depend on, name -> version.
    """

    study: SweepStudy
    chunk: Chunk
    points: Mapping[int, Point]
    bundled: str | None
    versions: Mapping[str, str]


def dask_setup(worker: Any) -> None:
    """Called by Dask on every worker that is started on this machine: Ctrl-C is the client's to hear."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def part_of(study: SweepStudy, chunk: Chunk) -> Part:
    """What to send for a chunk."""
    model = Path(study.scenario.plant.model).resolve()
    return Part(
        dataclasses.replace(study),  # anew: the points that this one has made stay behind
        chunk,
        {number: study.points[number] for number, _ in chunk.trials},
        model.name if model.parent == folder("models").resolve() else None,
        versions(),
    )


def computed(part: Part, threads: int, where: str) -> bytes:
    """Compute a chunk.

    Args:
        part: The chunk.
        threads: The worker's share of its machine.
        where: What to call the worker in an error.

    Returns:
        The chunk's table, as `as_bytes` has it.

    Raises:
        InputError: The worker is not fit for it: other versions, an observer or a model file that it does not have.
    """
    with _one_at_a_time, redirect_stdout(sys.stderr):  # a user's observer may print
        here = versions()
        for name, version in part.versions.items():
            if here[name] != version:
                raise InputError(f"worker {where}: {name} {here[name]} there, {version} here; they must be the same")
        study = part.study if part.bundled is None else _with_model(part.study, folder("models") / part.bundled)
        try:
            rows = compute(study, part.chunk, points=part.points, threads=threads)
        except InputError as error:
            raise InputError(f"worker {where}: {error}") from None
        release_free_memory()
        return as_bytes(table_of(study, rows))


def _with_model(study: SweepStudy, model: Path) -> SweepStudy:
    plant = dataclasses.replace(study.scenario.plant, model=str(model))
    return dataclasses.replace(study, scenario=study.scenario.model_copy(update={"plant": plant}))

"""One chunk on a worker of a cluster: its input, its computation, and the table that comes back."""

from __future__ import annotations

import dataclasses
import signal
import sys
import threading
from collections.abc import Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from cmg_mj.errors import InputError
from cmg_mj.inputs.files import folder
from cmg_mj.results.memory import release_free_memory
from cmg_mj.scenario.resolve import versions
from cmg_mj.studies.sweeps.chunk import compute
from cmg_mj.studies.sweeps.points import Point
from cmg_mj.studies.sweeps.study import Chunk, SweepStudy
from cmg_mj.studies.sweeps.trials import as_bytes, table_of

if TYPE_CHECKING:
    from distributed import Worker

_one_at_a_time = threading.Lock()
"""A worker with many threads is handed as many chunks: one is computed, on all of its threads."""


@dataclass(frozen=True)
class Part:
    """A chunk with all that it takes to compute it elsewhere, and no more: every chunk is sent so.

    Attributes:
        study: The sweep, without its points.
        chunk: The trials.
        points: The chunk's points by their numbers.
        bundled: The file of a model that comes with the package, which a worker may have in another folder.
        versions: Name -> version that the figures depend on.
    """

    study: SweepStudy
    chunk: Chunk
    points: Mapping[int, Point]
    bundled: str | None
    versions: Mapping[str, str]


def dask_setup(worker: Worker) -> None:
    """Ignore Ctrl-C, which is the client's to hear. Dask calls this on every worker that is started on this machine."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def part_of(study: SweepStudy, chunk: Chunk) -> Part:
    """Collect what a worker needs for a chunk."""
    model = Path(study.scenario.plant.model).resolve()
    return Part(
        dataclasses.replace(study),  # anew: the points that this one has made stay behind
        chunk,
        {number: study.points[number] for number, _ in chunk.trials},
        model.name if model.parent == folder("models").resolve() else None,
        versions(),
    )


def compute_part(part: Part, threads: int, where: str) -> bytes:
    """Compute a chunk.

    Args:
        part: The chunk.
        threads: The worker's share of its machine.
        where: The worker's name in an error.

    Returns:
        The chunk's table, as `as_bytes` has it.

    Raises:
        InputError: The worker has other versions, or lacks an observer or a model file.
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

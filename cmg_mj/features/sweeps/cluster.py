"""A sweep's chunks on a Dask cluster: workers compute, this process alone writes files."""

from __future__ import annotations

import dataclasses
import logging
import re
import signal
import sys
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, redirect_stdout, suppress
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

from cmg_mj.core.errors import InputError, RunStopped, raised
from cmg_mj.features.sweeps.chunks import GOES_ON, Store, compute, rows_of_failed_chunk, table_of
from cmg_mj.features.sweeps.study import Chunk, Point, SweepStudy
from cmg_mj.inputs.files import folder
from cmg_mj.scenario.resolve import versions

if TYPE_CHECKING:
    import pyarrow as pa
    from distributed import Client, Future, Worker

LOCAL = "local:"
MOST_LOCAL = 256
"""Most workers on this machine."""
ADDRESS = re.compile(r"((tcp|tls)://)?[^/\s]+:\d{1,5}")
PATIENCE_S = 10.0
"""Time for which a cluster may fail to answer."""
LOOK_S = 0.25
"""Interval at which Ctrl-C is looked for while nothing comes back."""
WINDOW = 256
"""Chunks that are handed over at once; each takes about 0.1 MB there."""
KILLS = 3
"""Workers that a chunk may kill before it is abandoned."""
_one_at_a_time = threading.Lock()
"""A worker with many threads is handed as many chunks: one is computed, on all of its threads."""


class Part(NamedTuple):
    """A chunk with all that it takes to compute it elsewhere.

    Attributes:
        study: The sweep, without its points.
        chunk: The trials.
        points: The chunk's points by their numbers.
        bundled: Name of a model that comes with the package, which a worker may have in another folder.
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


def local_workers(address: str) -> int | None:
    """Read how many workers to start here; None for the address of a scheduler.

    Raises:
        InputError: The address is written as neither.
    """
    if not address.startswith(LOCAL):
        if not ADDRESS.fullmatch(address):
            raise InputError(f"--cluster {address}: write tcp://HOST:PORT of a scheduler that is running, or {LOCAL}2")
        return None
    count = address.removeprefix(LOCAL)
    if not (count.isascii() and count.isdecimal() and 1 <= int(count[:9]) <= MOST_LOCAL):
        raise InputError(f"--cluster {address}: write {LOCAL}N with the number of workers, 1 to {MOST_LOCAL}")
    return int(count)


@contextmanager
def on_cluster(address: str) -> Iterator[Callable[..., None]]:
    """Connect to a cluster to run sweeps on.

    Args:
        address: The scheduler's address, or `local:N` for a cluster of N workers that is started here, on the loopback,
            and ended with the context.

    Yields:
        The function that runs the chunks, as `store.run` does.

    Raises:
        InputError: The cluster cannot be reached, or `distributed` is not installed.
    """
    if find_spec("distributed") is None:
        raise InputError('--cluster: distributed is not installed: python -m pip install "cmg_mj[cluster]"')
    import distributed

    workers = local_workers(address)
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what goes wrong is said here, in a line
    with ExitStack() as stack:
        try:
            scheduler: Any = address if workers is None else stack.enter_context(_started(workers))
            client = distributed.Client(scheduler, timeout=PATIENCE_S, set_as_default=False)
        except Exception as error:  # among others OSError, and RuntimeError where a worker does not start
            verb = "reached" if workers is None else "started"
            raise InputError(f"--cluster {address}: cannot be {verb}: {raised(error)}") from error
        yield partial(_run, stack.enter_context(client), address)


@contextmanager
def _started(workers: int) -> Iterator[Any]:
    """Start a cluster on this machine that only this machine can see."""
    from dask import config
    from dask.system import CPU_COUNT  # of those that this process may use
    from distributed import LocalCluster

    loopback = "127.0.0.1"
    with (
        TemporaryDirectory(prefix="cmg-mj-", ignore_cleanup_errors=True) as scratch,
        config.set({"temporary-directory": scratch}),
        LocalCluster(
            n_workers=workers,
            threads_per_worker=max(1, CPU_COUNT // workers),
            host=loopback,
            dashboard_address=f"{loopback}:0",  # the default listens everywhere
            worker_dashboard_address=f"{loopback}:0",
            preload=__name__,
            memory_limit=0,  # as in this process: a worker that is ended for its memory would look as if killed
            silence_logs=logging.CRITICAL,
            scheduler_kwargs={"allowed_failures": 0, "dashboard": False},
        ) as cluster,
    ):
        yield cluster


def _run(
    client: Client,
    address: str,
    store: Store,
    left: Sequence[int],
    on_progress: Callable[[float], None] | None = None,
) -> None:
    """Run the chunks that are left. The result does not depend on the workers, their number or their order.

    A chunk whose worker died is tried alone, at the end: a neighbour that waited on the same worker may be the cause.

    Raises:
        InputError: A worker lacks something.
        RunStopped: The cluster has gone away, or something fails on it.
    """
    from distributed import CancelledError, KilledWorker, wait

    chunks, waiting = store.study.chunks, deque(left)
    suspects: deque[int] = deque()
    killed: Counter[int] = Counter()
    alone: int | None = None
    done = store.study.trials - sum(chunks.size(number) for number in left)
    running: dict[Future, int] = {}
    try:
        while waiting or suspects or running:
            if suspects and not waiting and not running:
                alone = suspects.popleft()
                waiting.append(alone)
            while waiting and len(running) < WINDOW:
                number = waiting.popleft()
                running[client.submit(_compute_part, _part_of(store.study, chunks[number]), pure=False)] = number
            waited: Any = None
            with client.as_current(), suppress(TimeoutError):
                waited = wait(list(running), timeout=LOOK_S, return_when="FIRST_COMPLETED")
            for future in waited.done if waited else ():
                number = running.pop(future)
                try:
                    table = _result(future, address)
                except KilledWorker as error:
                    killed[number] += error.allowed_failures + 1
                    if number != alone or killed[number] < KILLS:
                        suspects.append(number)
                        continue
                    reason = f"its chunk has killed {killed[number]} workers"
                    table = table_of(store.study, rows_of_failed_chunk(store.study, chunks[number], reason))
                store.keep(number, table)
                done += chunks.size(number)
            if on_progress:
                on_progress(done)
    except CancelledError as error:
        raise RunStopped(f"--cluster {address}: is gone; {GOES_ON}") from error
    finally:
        if client.status == "running":
            client.cancel(list(running))


def _result(future: Future, address: str) -> pa.Table:
    from distributed import CancelledError, KilledWorker

    try:
        return future.result()
    except (CancelledError, KilledWorker):
        raise
    except InputError as error:
        raise InputError(f"--cluster {address}: {error}") from None
    except Exception as error:
        why = raised(error.__cause__ or error)
        raise RunStopped(f"--cluster {address}: a chunk cannot be computed there: {why}") from error


def _part_of(study: SweepStudy, chunk: Chunk) -> Part:
    model = Path(study.scenario.plant.model).resolve()
    return Part(
        dataclasses.replace(study),  # anew: the points that this one has made stay behind
        chunk,
        {number: study.points[number] for number, _ in chunk.trials},
        model.name if model.parent == folder("models").resolve() else None,
        versions(),
    )


def _compute_part(part: Part) -> pa.Table:
    """Compute a chunk on a worker.

    Raises:
        InputError: The worker has other versions, or lacks an observer or a model file.
    """
    from distributed import get_worker

    worker, study = get_worker(), part.study
    with _one_at_a_time, redirect_stdout(sys.stderr):  # a user's observer may print
        for name, version in versions().items():
            if part.versions[name] != version:
                raise InputError(f"worker {worker.address}: {name} {version} there, {part.versions[name]} here")
        if part.bundled is not None:
            plant = dataclasses.replace(study.scenario.plant, model=str(folder("models") / part.bundled))
            study = dataclasses.replace(study, scenario=study.scenario.model_copy(update={"plant": plant}))
        try:
            return table_of(study, compute(study, part.chunk, points=part.points, threads=worker.state.nthreads))
        except InputError as error:
            raise InputError(f"worker {worker.address}: {error}") from None

"""A sweep's chunks on a Dask cluster: workers compute, this process alone writes files."""

from __future__ import annotations

import dataclasses
import logging
import pickle
import re
import signal
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, redirect_stdout, suppress
from functools import lru_cache, partial
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from cmg_mj.core.errors import InputError, RunStopped, raised
from cmg_mj.features.sweeps.chunks import RESUMES, OnProgress, Store, compute, no_progress, rows_of, unfinished
from cmg_mj.features.sweeps.study import SweepStudy
from cmg_mj.inputs.files import folder
from cmg_mj.results.summary_keys import Summary
from cmg_mj.scenario.resolve import versions

if TYPE_CHECKING:
    from distributed import Client, Future, Worker

ADDRESS = re.compile(r"local:(?P<workers>[1-9]\d?|1\d\d|2[0-4]\d|25[0-6])|(?!local:)((tcp|tls)://)?[^/\s]+:\d{1,5}")
PATIENCE_S = 10.0
"""Time for which a cluster may fail to answer."""
LOOK_S = 0.25
"""Interval at which Ctrl-C is looked for while nothing comes back."""
KILLS = 3
"""Workers that a chunk may kill before it is abandoned."""
_one_at_a_time = threading.Lock()
"""A worker with many threads is handed as many chunks: one is computed, on all of its threads."""


def dask_setup(worker: Worker) -> None:
    """Ignore Ctrl-C, which is the client's to hear. Dask calls this on every worker that is started on this machine."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def on_cluster(address: str) -> AbstractContextManager[Callable[..., None]]:
    """Connect to a cluster to run sweeps on.

    Args:
        address: The scheduler's address, or `local:N` for a cluster of N workers that is started here, on the loopback,
            and ended with the context.

    Returns:
        Connects when it is entered, and gives the function that runs the chunks, as `chunks.run` does.

    Raises:
        InputError: The address is not written so, the cluster cannot be reached, or `distributed` is not installed.
    """
    written = ADDRESS.fullmatch(address)
    if written is None:
        raise InputError(
            f"--cluster {address}: write tcp://HOST:PORT of a scheduler that is running, or local:2 for 2 workers on "
            "this machine"
        )
    if find_spec("distributed") is None:
        raise InputError('--cluster: distributed is not installed: python -m pip install "cmg_mj[cluster]"')
    return _connected(address, written["workers"])


@contextmanager
def _connected(address: str, workers: str | None) -> Iterator[Callable[..., None]]:
    """Connect to a cluster, or to so many workers that are started here."""
    import distributed

    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what goes wrong is said here, in a line
    with ExitStack() as stack:
        try:
            scheduler: Any = address if workers is None else stack.enter_context(_started(int(workers)))
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
    client: Client, address: str, store: Store, left: Sequence[int], on_progress: OnProgress = no_progress
) -> None:
    """Run the chunks that are left. The result does not depend on the workers, their number or their order.

    A chunk whose worker died is tried alone, at the end: a neighbour that waited on the same worker may be the cause.

    Raises:
        InputError: A worker lacks something.
        RunStopped: The cluster has gone away, or something fails on it.
    """
    from distributed import CancelledError, KilledWorker, wait

    study = store.study
    task = partial(client.submit, compute_there, packed(study), wanted=versions(), pure=False)
    done = study.trials_without(left)
    killed: Counter[int] = Counter()
    suspects: list[int] = []
    running: dict[Future, int] = {task(number): number for number in left}
    alone = False
    try:
        while running or suspects:
            if not running:
                alone = True
                number = suspects.pop(0)
                running[task(number)] = number
            waited: Any = None
            with client.as_current(), suppress(TimeoutError):
                waited = wait(list(running), timeout=LOOK_S, return_when="FIRST_COMPLETED")
            for future in waited.done if waited else ():
                number = running.pop(future)
                try:
                    rows = future.result()
                except CancelledError:
                    raise
                except InputError as error:
                    raise InputError(f"--cluster {address}: {error}") from None
                except KilledWorker as error:
                    killed[number] += error.allowed_failures + 1
                    if not alone or killed[number] < KILLS:
                        suspects.append(number)
                        continue
                    observer, trials = study.chunk(number)
                    reason = unfinished("stopped", f"its chunk has killed {killed[number]} workers")
                    rows = rows_of(study, observer, dict.fromkeys(trials, reason), trials)
                except Exception as error:
                    why = raised(error.__cause__ or error)
                    raise RunStopped(f"--cluster {address}: a chunk cannot be computed there: {why}") from error
                store.keep(number, rows)
                done += study.chunk_size(number)
            on_progress(done)
    except CancelledError as error:
        raise RunStopped(f"--cluster {address}: is gone; {RESUMES}") from error
    finally:
        if client.status == "running":
            client.cancel(list(running))


def packed(study: SweepStudy) -> bytes:
    """Pack a study without its points, and the name of a bundled model, which a worker may have in another folder."""
    model = Path(study.scenario.plant.model).resolve()
    bundled = model.name if model.parent == folder("models").resolve() else None
    return pickle.dumps((dataclasses.replace(study), bundled))


@lru_cache(maxsize=1)  # a worker draws the points once
def _unpacked(content: bytes) -> SweepStudy:
    study, bundled = pickle.loads(content)
    if bundled is None:
        return study
    plant = dataclasses.replace(study.scenario.plant, model=str(folder("models") / bundled))
    return dataclasses.replace(study, scenario=study.scenario.model_copy(update={"plant": plant}))


def compute_there(content: bytes, number: int, wanted: Mapping[str, str]) -> list[Summary]:
    """Compute a chunk on a worker.

    Raises:
        InputError: The worker has other versions, or lacks an observer or a model file.
    """
    from distributed import get_worker

    worker = get_worker()
    with _one_at_a_time, redirect_stdout(sys.stderr):  # a user's observer may print
        for name, version in versions().items():
            if wanted[name] != version:
                raise InputError(f"worker {worker.address}: {name} {version} there, {wanted[name]} here")
        study = _unpacked(content)
        try:
            return compute(study, *study.chunk(number), threads=worker.state.nthreads)
        except InputError as error:
            raise InputError(f"worker {worker.address}: {error}") from None

"""A sweep's chunks on a Dask cluster: workers compute, this process alone writes files."""

from __future__ import annotations

import logging
import re
from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from importlib.util import find_spec
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from cmg_mj.errors import InputError, RunStopped, raised
from cmg_mj.studies.sweeps import dask_worker as on_worker
from cmg_mj.studies.sweeps.chunk import rows_of_failed_chunk
from cmg_mj.studies.sweeps.chunk_store import GOES_ON, Store
from cmg_mj.studies.sweeps.dask_worker import Part, compute_part, part_of
from cmg_mj.studies.sweeps.trials import from_bytes, table_of

if TYPE_CHECKING:
    from distributed import Client, Future

LOCAL = "local:"
MOST_LOCAL = 256
"""Most workers on this machine."""
ADDRESS = re.compile(r"((tcp|tls)://)?[^/\s]+:\d{1,5}")
LOOPBACK = "127.0.0.1"
PATIENCE_S = 10.0
"""Time for which a cluster may fail to answer."""
LOOK_S = 0.25
"""Interval at which Ctrl-C is looked for while nothing comes back."""
WINDOW = 2
"""Chunks a worker that are handed over at once: one computed, one to go on with. More would only take memory, and
those that wait on a worker count as killers when it dies."""
KILLS = 3
"""Workers that a chunk may kill before it is abandoned."""


@contextmanager
def on_cluster(address: str, note: Callable[[str], None]) -> Iterator[Cluster]:
    """Connect to a cluster to run sweeps on.

    Args:
        address: The scheduler's address, or `local:N` for a cluster of N workers that is started here, on the loopback,
            and ended with the context.
        note: Takes a line for the user.

    Yields:
        The cluster.

    Raises:
        InputError: The cluster cannot be reached, or `distributed` is not installed.
    """
    if find_spec("distributed") is None:
        raise InputError('--cluster: distributed is not installed: python -m pip install "cmg_mj[cluster]"')
    workers = local_workers(address)

    for name in ("distributed", "distributed.client", "distributed.gc"):  # what goes wrong is said here, in a line
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with ExitStack() as stack:
        try:
            scheduler = address if workers is None else stack.enter_context(_started(workers))
            client = stack.enter_context(_connected(scheduler))
        except UnicodeError as error:  # a part of the name is empty, or longer than 63 letters
            raise InputError(f"--cluster {address}: no name of a computer before the port") from error
        except Exception as error:  # among others OSError, and RuntimeError where a worker does not start
            verb = "reached" if workers is None else "started"
            raise InputError(f"--cluster {address}: cannot be {verb}: {raised(error)}") from error
        yield Cluster(address, client, note)


def _connected(scheduler: Any) -> Client:
    """Connect to a scheduler; a client that cannot is given up, as its own end would take long and print much."""
    import distributed

    client = distributed.Client.__new__(distributed.Client)
    try:
        client.__init__(scheduler, timeout=PATIENCE_S, set_as_default=False)
    except BaseException:
        client.status = "closed"
        raise
    return client


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
def _started(workers: int) -> Iterator[Any]:
    """Start a cluster on this machine that only this machine can see."""
    from dask import config
    from dask.system import CPU_COUNT  # of those that this process may use
    from distributed import LocalCluster

    with (
        TemporaryDirectory(prefix="cmg-mj-", ignore_cleanup_errors=True) as scratch,
        config.set({"temporary-directory": scratch}),
        LocalCluster(
            n_workers=workers,
            threads_per_worker=max(1, CPU_COUNT // workers),
            host=LOOPBACK,
            dashboard_address=f"{LOOPBACK}:0",  # the default listens everywhere
            worker_dashboard_address=f"{LOOPBACK}:0",  # the default listens everywhere
            preload=on_worker.__name__,
            memory_limit=0,  # as in this process: a worker that is ended for its memory would look as if killed
            silence_logs=logging.CRITICAL,
            scheduler_kwargs={"allowed_failures": 0, "dashboard": False},  # how many a chunk has killed is counted here
        ) as cluster,
    ):
        yield cluster


def on_dask(part: Part) -> bytes:
    """Compute a chunk on a worker."""
    from distributed import get_worker

    worker = get_worker()
    return compute_part(part, worker.state.nthreads, worker.address)


@dataclass
class Cluster:
    """A cluster that computes chunks.

    Attributes:
        address: The address that the user gave.
        client: The connection.
        note: Takes a line for the user.
        running: Future -> number of a chunk that is handed over.
        killed: A chunk's number -> number of workers that died while they had it.
    """

    address: str
    client: Client
    note: Callable[[str], None]
    running: dict[Future, int] = field(default_factory=dict)
    killed: Counter[int] = field(default_factory=Counter)

    def run(self, store: Store, on_progress: Callable[[float], None] | None = None) -> None:
        """Run the chunks that are not finished. The result does not depend on the workers, their number or their order.

        A chunk whose workers died is handed over again. After nearly too many deaths it is tried alone, at the end, as
        a neighbour on the same worker may have been the cause; if that kills too, its rows say so.

        Args:
            store: The sweep's store, opened.
            on_progress: Called several times a second with the trials done. A KeyboardInterrupt that it raises ends the
                sweep; what is finished is kept.

        Raises:
            InputError: A worker lacks something.
            RunStopped: The cluster has gone away, or something fails on it.
        """
        chunks = store.study.chunks
        left = deque(store.left())
        suspects: deque[int] = deque()
        alone: int | None = None
        done = store.study.trials - sum(chunks.size(number) for number in left)
        try:
            while left or suspects or self.running:
                room = self._window() - len(self.running) if left else 0
                for _ in range(min(room, len(left))):
                    self._hand_over(store, left.popleft())
                if not self.running:
                    alone = suspects.popleft()
                    self._hand_over(store, alone)
                for future, number in self._ended():
                    if self._kept(store, future, number):
                        done += chunks.size(number)
                    elif number == alone and self.killed[number] >= KILLS:
                        reason = f"its chunk has killed {self.killed[number]} workers"
                        store.keep(
                            number, table_of(store.study, rows_of_failed_chunk(store.study, chunks[number], reason))
                        )
                        done += chunks.size(number)
                    else:
                        (left if self.killed[number] < KILLS - 1 else suspects).append(number)
                if on_progress:
                    on_progress(done)
        finally:
            with suppress(Exception):  # the cluster may be gone
                self.client.cancel(list(self.running))
            self.running.clear()

    def _window(self) -> int:
        try:
            threads: Any = self.client.nthreads()
        except Exception as error:
            raise self._gone() from error
        if not threads and not self.running:
            self.note(f"--cluster {self.address}: no worker is there yet; waiting for one")
        return WINDOW * max(1, len(threads))

    def _hand_over(self, store: Store, number: int) -> None:
        part = part_of(store.study, store.study.chunks[number])
        self.running[self.client.submit(on_dask, part, pure=False)] = number

    def _ended(self) -> list[tuple[Future, int]]:
        """Take the chunks that have ended meanwhile, well or not, off the running ones."""
        from distributed import CancelledError, wait

        try:
            with self.client.as_current():
                waited: Any = wait(list(self.running), timeout=LOOK_S, return_when="FIRST_COMPLETED")
        except TimeoutError:
            return []
        except CancelledError as error:
            raise self._gone() from error
        return [(future, self.running.pop(future)) for future in waited.done]

    def _kept(self, store: Store, future: Future, number: int) -> bool:
        """Keep a chunk's table; False if its worker died."""
        from distributed import CancelledError, KilledWorker

        try:
            table = future.result()
        except KilledWorker as error:
            self.killed[number] += error.allowed_failures + 1
            return False
        except CancelledError as error:
            raise self._gone() from error
        except InputError as error:
            raise InputError(f"--cluster {self.address}: {error}") from None
        except Exception as error:
            why = raised(error.__cause__ or error)
            raise RunStopped(f"--cluster {self.address}: a chunk cannot be computed there: {why}") from error
        store.keep(number, from_bytes(table))
        return True

    def _gone(self) -> RunStopped:
        return RunStopped(f"--cluster {self.address}: is gone; {GOES_ON}")

"""Streams a run to a viewer; the run never waits for the viewer, and a failure costs the view alone."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from queue import SimpleQueue
from types import TracebackType

import rerun as rr
import rerun.blueprint as rrb

from cmg_mj.results.trajectory import Trajectory
from cmg_mj.visualization.recording.run import Run
from cmg_mj.visualization.recording.stream import application_name, require_enabled, set_up, strict
from cmg_mj.visualization.recording.streaming import StreamedRun, StreamHeader
from cmg_mj.visualization.recording.viewer import parts_of, url_of
from cmg_mj.visualization.recording.viewer_relay import Relay

TAKES_S = 1.0
"""Time that a viewer may take over a piece before it is asked again."""
PATIENCE_S = 5.0
"""Time for which the end of a run waits for a viewer that takes nothing."""
GONE, STUCK = "it has gone", "it takes no more"


class ViewerStream:
    """A run streamed to a viewer while it goes on.

    Use it as a context manager around the run and the writing of its files; `begin`, before the first step, `add` and
    `end` wait for nothing.

    Args:
        url: URL of a viewer that listens: `viewer.url_of`.
        header: The header of the run.

    Attributes:
        failure: The reason why the viewer has not received all of the run; empty if it has.

    Raises:
        InputError: The environment turns rerun off.
    """

    def __init__(self, url: str, header: StreamHeader) -> None:
        self.failure = ""
        self._url = url
        self._header = header
        self._jobs: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._n_done = 0
        self._deadline = float("inf")
        self._strict = strict()
        self._thread = threading.Thread(target=self._feed, name="live view", daemon=True)
        require_enabled(rr.RecordingStream("cmg-mj"))

    def __enter__(self) -> ViewerStream:
        self._strict.__enter__()
        self._relay = Relay(*parts_of(self._url))
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        try:
            self._close()
        finally:
            self._strict.__exit__(kind, error, traceback)

    def begin(self, empty: Trajectory) -> None:
        """Show the mechanism and the empty plots.

        Args:
            empty: The trajectory before the first tick.
        """
        # Not in the thread: MuJoCo's control callback, which the whole process shares, is set aside meanwhile.
        self._run = StreamedRun(self._header, empty)
        self._jobs.put(self._begin)

    def add(self, piece: Trajectory) -> None:
        """Show the next ticks."""
        self._jobs.put(lambda: self._run.add(self._rec, piece))

    def end(self, runs: Sequence[Run]) -> None:
        """Show the last ticks and the results of the finished run; of several axes, a run for each axis."""
        self._jobs.put(lambda: self._layout(self._run.end(self._rec, runs), active=False))

    def _begin(self) -> None:
        branches = self._run.branches
        names = [branch.run.name for branch in branches]
        self._rec = rr.RecordingStream(f"{application_name(names, branches)} live")
        self._rec.connect_grpc(url_of(str(self._relay.port)))
        labels = ", ".join(branch.label for branch in branches)
        set_up(self._rec, f"{self._header.experiment.title or 'Run'}: {labels}, live")
        self._layout(self._run.blueprint(), active=True)
        self._run.begin(self._rec)

    def _layout(self, blueprint: rrb.Blueprint, *, active: bool) -> None:
        """Send the layout; an inactive one waits for the viewer's Reset and moves nothing under the user's hand."""
        self._rec.send_blueprint(blueprint, make_active=active, make_default=True)

    def _feed(self) -> None:
        """Run the jobs in the thread; the viewer must take each job before the next."""
        try:
            while (job := self._jobs.get()) is not None:
                job()
                if reason := self._not_taken():
                    self.failure = reason
                    return
                self._n_done += 1
            if self._n_done:
                self._rec.disconnect()  # returns when the viewer has received everything
        except Exception as error:  # the run must not care
            self.failure = f"it could not be fed ({' '.join(str(error).split())})"

    def _not_taken(self) -> str:
        """Wait until the viewer has taken everything sent; return the reason if it does not.

        Rerun waits without end once it holds 100 MB for a viewer that stands still; it never gets so much here.
        """
        while True:
            start = time.monotonic()
            try:
                self._rec.flush(timeout_sec=TAKES_S)
                return ""
            except RuntimeError:  # raised both for a viewer that has gone and for one that stands still
                if time.monotonic() - start < 0.9 * TAKES_S:
                    return GONE
                if time.monotonic() > self._deadline:
                    return STUCK

    def _close(self) -> None:
        """Send the viewer the rest, as long as it takes any."""
        self._jobs.put(None)
        while self._thread.is_alive():
            n_done = self._n_done
            self._deadline = time.monotonic() + PATIENCE_S
            self._thread.join(PATIENCE_S)
            if self._thread.is_alive() and self._n_done == n_done:
                self._thread.join(2.0 * TAKES_S)  # its deadline has passed: it sets the reason
                break
        if self._thread.is_alive():
            self.failure = STUCK
        self._relay.cut()  # rerun waits for an answer at exit too
        self._thread.join(TAKES_S)

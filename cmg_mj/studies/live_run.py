"""A run shown in a viewer while it runs, in real time or as fast as is wanted."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING

from cmg_mj.results.result import Driver
from cmg_mj.simulation.experiment import Experiment
from cmg_mj.simulation.recorder import MultiAxisRecorder, TickRecorder
from cmg_mj.simulation.simulate import SimulationOptions
from cmg_mj.studies.save import RunReport, recording_header

if TYPE_CHECKING:
    from cmg_mj.visualization.recording.streaming import StreamHeader

PIECES_HZ = 20.0
"""The viewer gets new ticks so often: the eye takes it for motion."""
TOO_LATE_S = 0.25
"""A run this far behind its clock, as after Ctrl-Z, does not hurry to catch up."""


class RealTimeClock:
    """Holds a run to a clock.

    Args:
        factor: Simulated seconds per second of the clock; inf: as fast as the run goes.
        clock: Returns the time [s].
        sleep: Waits for so long [s].
    """

    def __init__(
        self,
        factor: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.factor = factor
        self._clock, self._sleep = clock, sleep
        self._start = clock()

    def start(self) -> None:
        """Take now for simulated time zero."""
        self._start = self._clock()

    def wait(self, simulated_s: float) -> None:
        """Wait until the clock has reached a simulated time."""
        if math.isinf(self.factor):
            return
        ahead = self._start + simulated_s / self.factor - self._clock()
        if ahead > 0.0:
            self._sleep(ahead)
        elif ahead < -TOO_LATE_S:
            self._start -= ahead


def shown_before(experiment: Experiment, driver: Driver = "native", world: int = 0) -> StreamHeader:
    """Collect what a viewer needs before a run's first tick."""
    from cmg_mj.visualization.recording.streaming import BranchSpec, StreamHeader

    several = len(experiment.parts) > 1
    branches = []
    for part in experiment.parts:
        bias = math.degrees(part.plant.apparent_bias(part.scenario.sensors.accelerometer))
        axis = part.plant.axis.name if several else None
        branches.append(BranchSpec(axis or experiment.scenario.observer.kind, bias, axis))
    return StreamHeader(recording_header(experiment, driver, world), branches, experiment.law.dt)


class LiveRun:
    """One run, streamed to a viewer while it runs. Streaming changes no number.

    Use it as a context manager around the run, which takes its `options`, and the writing of the files.

    Args:
        experiment: The experiment that runs.
        url: Address of a viewer that listens.
        pace: The clock that the run is held to.
        driver: Who calls the controller.
        world: Number of the world.
    """

    def __init__(
        self,
        experiment: Experiment,
        url: str,
        pace: RealTimeClock,
        *,
        driver: Driver = "native",
        world: int = 0,
    ) -> None:
        from cmg_mj.visualization.recording.live import ViewerStream  # 0.4 s of import, needed only here

        self._view = ViewerStream(url, shown_before(experiment, driver, world))
        self._pace = pace
        self._ticks = 0
        self._shown_at = -math.inf
        self._recorder: TickRecorder | MultiAxisRecorder | None = None

    @property
    def failure(self) -> str:
        """The reason why the viewer has not received every tick; empty if it has."""
        return self._view.failure

    def __enter__(self) -> LiveRun:
        self._view.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._view.__exit__(kind, error, traceback)

    def options(self, on_progress: Callable[[float], None] | None = None) -> SimulationOptions:
        """Make the options of `Experiment.run` that stream the run.

        Args:
            on_progress: Called first after every tick; if it raises KeyboardInterrupt, the run ends without waiting.

        Returns:
            The options.
        """

        def tick(simulated_s: float) -> None:
            if on_progress is not None:
                on_progress(simulated_s)
            now = time.monotonic()
            if now - self._shown_at >= 1.0 / PIECES_HZ:
                self._shown_at = now
                self._show()
            self._pace.wait(simulated_s)

        return {"on_start": self._start, "on_progress": tick}

    def _start(self, recorder: TickRecorder | MultiAxisRecorder) -> None:
        self._recorder = recorder
        self._view.begin(recorder.since(0))
        self._pace.start()

    def ended(self, report: RunReport) -> None:
        """Show how the run ended."""
        self._view.end(report.runs)

    def _show(self) -> None:
        assert self._recorder is not None
        ticks = self._recorder.since(self._ticks)
        self._ticks += len(ticks)
        self._view.add(ticks)

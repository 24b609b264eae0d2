"""A run shown in a viewer while it goes on, at real time or as fast as is wanted."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING

from cmg_mj.results.result import Driver, Result
from cmg_mj.simulation.experiment import Experiment
from cmg_mj.simulation.recorder import MultiAxisRecorder, TickRecorder
from cmg_mj.simulation.simulate import SimulationOptions
from cmg_mj.studies.save import recording_title, to_record

if TYPE_CHECKING:
    from cmg_mj.visualization.recording.streaming import StreamHeader

PIECES_HZ = 20.0
"""So often a viewer is given what there is: the eye takes it for motion."""
TOO_LATE_S = 0.25
"""A run that is so far behind its clock, as after Ctrl-Z, does not hurry to make up for it."""


class RealTimeClock:
    """Holds a run to a clock.

    Args:
        factor: Simulated seconds in one of the clock; inf: as fast as it goes.
        clock: Says how late it is [s].
        sleep: Waits so long [s].
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
        """Simulated time is zero now."""
        self._start = self._clock()

    def wait(self, simulated_s: float) -> None:
        """Wait until it is so late."""
        if math.isinf(self.factor):
            return
        ahead = self._start + simulated_s / self.factor - self._clock()
        if ahead > 0.0:
            self._sleep(ahead)
        elif ahead < -TOO_LATE_S:
            self._start -= ahead


def shown_before(experiment: Experiment, driver: Driver = "native", world: int = 0) -> StreamHeader:
    """What a viewer is told of a run before its first tick."""
    from cmg_mj.visualization.recording.streaming import BranchSpec, StreamHeader

    scenario = experiment.scenario
    several = len(experiment.parts) > 1
    branches = []
    for own in experiment.parts:
        bias = math.degrees(own.plant.apparent_bias(own.scenario.sensors.accelerometer))
        axis = own.plant.axis.name if several else None
        branches.append(BranchSpec(axis or scenario.observer.kind, bias, axis))
    return StreamHeader(
        branches,
        experiment.plant,
        experiment.law.dt,
        recording_title(experiment, driver),
        scenario.push,
        scenario.metrics,
        experiment.law.rate_limit,
        experiment.as_toml(driver, world),
    )


class LiveRun:
    """One run, streamed to a viewer while it goes on; what it computes is the same as without one.

    Use it as a context manager around the run, which takes its `options`, and the writing of the files.

    Args:
        experiment: What is run.
        url: Of a viewer that listens.
        pace: How fast.
        driver: Who calls the controller.
        world: Which world.
    """

    def __init__(
        self, experiment: Experiment, url: str, pace: RealTimeClock, *, driver: Driver = "native", world: int = 0
    ) -> None:
        from cmg_mj.visualization.recording.live import ViewerStream  # 0.4 s of import, needed only here

        self._experiment = experiment
        self._pace = pace
        self._ticks = 0
        self._shown_at = -math.inf
        self._rows: TickRecorder | MultiAxisRecorder | None = None
        self._view = ViewerStream(url, shown_before(experiment, driver, world))

    @property
    def lost(self) -> str:
        """Why the viewer has not got all of it, in words; empty if it has."""
        return self._view.lost

    def __enter__(self) -> LiveRun:
        self._view.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._view.__exit__(kind, error, traceback)

    def options(self, on_progress: Callable[[float], None] | None = None) -> SimulationOptions:
        """What `Experiment.run` must be given.

        Args:
            on_progress: Called first after every tick; where it hears Ctrl-C, the run ends without waiting.

        Returns:
            Options of `simulate`.
        """

        def tick(simulated_s: float) -> None:
            if on_progress is not None:
                on_progress(simulated_s)
            now = time.monotonic()
            if now - self._shown_at >= 1.0 / PIECES_HZ:
                self._shown_at = now
                self._show()
            self._pace.wait(simulated_s)

        return {"on_start": self._begin, "on_progress": tick}

    def _begin(self, rows: TickRecorder | MultiAxisRecorder) -> None:
        self._rows = rows
        self._view.begin(rows.since(0))
        self._pace.start()

    def ended(self, result: Result) -> None:
        """Show the end."""
        self._view.end(to_record(self._experiment, result))

    def _show(self) -> None:
        assert self._rows is not None
        piece = self._rows.since(self._ticks)
        self._ticks += len(piece)
        self._view.add(piece)

"""A run shown in rerun's viewer while it goes on: series and poses as they come."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable

import rerun as rr

from cmg_mj.results.result import Outcome
from cmg_mj.runs.simulate import SimulationOptions, Since
from cmg_mj.view.recording.layout import default_blueprint
from cmg_mj.view.recording.run import RecordingHeader, Run
from cmg_mj.view.recording.save import require_enabled, set_up
from cmg_mj.view.recording.scene import log_poses, log_shapes
from cmg_mj.view.recording.signals import Branch, log_styles, log_values, make_branches

PIECES_HZ = 20.0
"""Largest rate at which ticks are sent; the eye takes it for motion."""


class LiveView:
    """Rerun's viewer, started to receive a run while it goes on.

    Args:
        header: The experiment.
        name: Name of the run's branch; of several axes, each axis has a branch.

    Raises:
        InputError: The environment turns rerun off.
    """

    def __init__(self, header: RecordingHeader, name: str) -> None:
        self._header, self._name = header, name
        self._ticks, self._shown_at = 0, 0.0
        self._rec = rr.RecordingStream("cmg-mj live")
        require_enabled(self._rec)
        # rr.spawn's viewer would listen on every network interface
        command = [sys.executable, "-m", "rerun_cli", "--bind", "127.0.0.1", "--expect-data-soon"]
        self._viewer = subprocess.Popen(command, start_new_session=True)
        self._rec.connect_grpc()
        set_up(self._rec, header.title or name)

    def options(self, on_progress: Callable[[float], None]) -> SimulationOptions:
        """Make the options of `Experiment.run` that show the run.

        Args:
            on_progress: Called first after every tick.
        """

        def progress(simulated_s: float) -> None:
            on_progress(simulated_s)
            now = time.monotonic()
            if now - self._shown_at >= 1.0 / PIECES_HZ:
                self._shown_at = now
                self.show()

        return {"on_start": self._begin, "on_progress": progress}

    def _begin(self, since: Since) -> None:
        """Show the rig and empty plots, before the first tick."""
        self._since = since
        branches = self._new_ticks()
        self._rec.send_blueprint(default_blueprint(branches, "following"))
        for branch in branches:
            log_shapes(self._rec, branch)
            log_styles(self._rec, branch)

    def show(self) -> None:
        """Show the new ticks."""
        for branch in self._new_ticks():
            if len(branch.run.trajectory):
                log_values(self._rec, branch)
                log_poses(self._rec, branch)

    def _new_ticks(self) -> list[Branch]:
        ticks = self._since(self._ticks)
        self._ticks += len(ticks)
        now = Outcome("done", 0.0)
        runs = [Run(axis, ticks.along(axis), {}, now, axis) for axis in ticks.axes]
        return make_branches(self._header, runs or [Run(self._name, ticks, {}, now)])

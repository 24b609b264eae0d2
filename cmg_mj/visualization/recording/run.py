"""One run to be shown, and what is worked out of it before anything is drawn."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cmg_mj.results.result import Outcome
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.scenario.disturbances import Push
from cmg_mj.scenario.schema import MetricsSettings
from cmg_mj.visualization.plots.readability import figures_by_observer, observers_to_draw

BALANCING, PUSH, RECOVERING, SETTLED = "balancing", "push", "recovering", "settled"
ENDINGS = {"fell": "fallen", "stopped": "stopped", "interrupted": "interrupted"}
"""The phase in which a run that was not done ends, by the kind of its outcome."""


@dataclass(frozen=True)
class Run:
    """One run to be shown.

    Attributes:
        name: Its branch in the recording, usually the observer in the loop.
        trajectory: One world's ticks, columns (n_ticks,).
        summary: The run's numbers, by the names that `--json` prints.
        outcome: How it ended.
        axis: Which of the rig's axes, if it has several: trajectory and numbers are that axis'.
    """

    name: str
    trajectory: Trajectory
    summary: Mapping[str, Any]
    outcome: Outcome
    axis: str | None = None

    def pushes_on_axis(self, pushes: Sequence[Push]) -> list[Push]:
        """Those of the pushes that are about this axis."""
        return [push for push in pushes if self.axis is None or push.axis == self.axis]

    @property
    def observers(self) -> dict[str, Mapping[str, Any]]:
        """The observer in the loop, then those riding along, each with its numbers."""
        return figures_by_observer(self.trajectory.observers, self.summary)

    @property
    def open_loop_observers(self) -> tuple[str, ...]:
        """Those riding along."""
        return self.trajectory.observers[1:]


def best_observers(run: Run, among: Collection[str] | None = None) -> list[str]:
    """The one in the loop, and the best of those riding along; only those in `among`, if it is given."""
    there = {name: of for name, of in run.observers.items() if among is None or name in among}
    return observers_to_draw(there, always=[name for name in run.trajectory.observers[:1] if name in there])


def best_runs(runs: Sequence[Run]) -> list[str]:
    """Names of the runs in which the estimate was best, of those that stood to the end if there are enough."""
    return observers_to_draw({run.name: {**run.summary, "fell": run.outcome.kind in ENDINGS} for run in runs})


def torque_steps(pushes: Sequence[Push], end_s: float) -> list[tuple[float, float]]:
    """The torque on the frame as steps.

    Args:
        pushes: The pushes, which may overlap.
        end_s: End of the run; what comes later is left out [s].

    Returns:
        (time [s], torque from then on [N m]), in order of time.
    """
    edges = sorted({time for push in pushes for time in (push.start_s, push.end_s) if time < end_s})
    return [(t, sum(p.torque_n_m for p in pushes if p.start_s <= t < p.end_s)) for t in edges]


def phases(run: Run, pushes: Sequence[Push], settings: MetricsSettings) -> list[tuple[float, str]]:
    """What the rig is doing, as steps.

    Before the first push it is `balancing`. After a push (or from the start, if there is none) it is `recovering`
    until the tilt stays inside the settle band up to the next push or the end; from then on it is `settled`.

    Args:
        run: The run.
        pushes: Torques from outside.
        settings: The settle band.

    Returns:
        (time [s], name of the phase from then on), in order of time.
    """
    end = run.outcome.time_s
    steps = [(0.0, BALANCING)] if pushes and min(p.start_s for p in pushes) > 0.0 else []
    starts = sorted(push.start_s for push in pushes)
    steps += [(start, PUSH) for start in starts]
    for calm in sorted({push.end_s for push in pushes}) if pushes else [0.0]:
        if any(p.start_s <= calm < p.end_s for p in pushes):
            continue  # another push is still on
        until = min((start for start in starts if start >= calm), default=end)
        steps += _recovery(run.trajectory, calm, min(until, end), math.radians(settings.settle_band_deg))
    steps = sorted((time, name) for time, name in steps if time < end)
    steps = [step for i, step in enumerate(steps) if i == 0 or step[1] != steps[i - 1][1]]
    if run.outcome.kind in ENDINGS:
        steps.append((end, ENDINGS[run.outcome.kind]))
    return steps


def _recovery(trajectory: Trajectory, start: float, end: float, band: float) -> list[tuple[float, str]]:
    """Recovering and settled between two pushes."""
    time = trajectory["time_s"]
    inside = (time >= start - 1e-9) & (time < end - 1e-9)
    if not inside.any():
        return [(start, RECOVERING)]
    times = time[inside]
    outside = np.flatnonzero(np.abs(trajectory["x1_rad"][inside]) > band)
    first_settled = int(outside[-1]) + 1 if outside.size else 0
    steps = [(start, RECOVERING)] if first_settled > 0 else []
    if first_settled < len(times):
        steps.append((max(start, float(times[first_settled])), SETTLED))
    return steps

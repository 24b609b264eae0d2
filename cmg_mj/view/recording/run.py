"""A run to record: its names, colours and phases."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import rerun as rr

from cmg_mj.plant.axis import Axis
from cmg_mj.plant.plant import Plant
from cmg_mj.results.result import Outcome
from cmg_mj.results.summary_keys import section
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.scenario.schema import MetricsSettings
from cmg_mj.stages.push import Push
from cmg_mj.stages.swing import Swing
from cmg_mj.view.plots.style import (
    Colour,
    Summary,
    colours,
    observers_to_draw,
    short_names,
)

BALANCING, PUSH, RECOVERING, SETTLED = "balancing", "push", "recovering", "settled"
ENDINGS = {"fell": "fallen", "stopped": "stopped", "interrupted": "interrupted"}
"""Kind of the outcome of a run that did not reach its end -> the run's last phase."""


@dataclass(frozen=True)
class RecordingHeader:
    """The experiment of a recording's runs, known before the first tick.

    Attributes:
        plant: The plant of all runs.
        rate_limit_rad_s: Largest gimbal rate [rad/s].
        title: The experiment's title.
        pushes: Torques from outside, the same in all runs.
        swings: Sinusoidal torques from outside, the same in all runs.
        settings: The settle band.
        scenario_toml: The resolved scenario.
        lines: Functions of an axis and a trajectory that make more lines, as [gait] does.
    """

    plant: Plant
    rate_limit_rad_s: float
    title: str = ""
    pushes: Sequence[Push] = ()
    swings: Sequence[Swing] = ()
    settings: MetricsSettings = field(default_factory=MetricsSettings)
    scenario_toml: str = ""
    lines: Sequence[Callable[[Axis, Trajectory], Mapping[str, np.ndarray]]] = ()


@dataclass(frozen=True)
class Run:
    """A run to record.

    Attributes:
        name: Name of the run's branch in the recording, usually the observer in the loop.
        trajectory: One world's ticks, columns (n_ticks,).
        summary: The run's numbers, by the names that `--json` prints.
        outcome: The outcome.
        axis: The axis of trajectory and numbers, if the plant has several.
    """

    name: str
    trajectory: Trajectory
    summary: Summary
    outcome: Outcome
    axis: str | None = None

    @property
    def observers(self) -> dict[str, Summary]:
        """The observer in the loop, then the open-loop observers, each with its numbers, if it has any."""
        in_loop, *others = self.trajectory.observers
        open_loop = section(self.summary, "open_loop_observers")
        return {in_loop: self.summary, **{name: open_loop.get(name, {}) for name in others}}

    @property
    def references(self) -> dict[str, Summary]:
        """The baselines, each with its numbers."""
        return {**section(self.summary, "references")}

    @property
    def open_loop_observers(self) -> tuple[str, ...]:
        """The open-loop observers."""
        return self.trajectory.observers[1:]


class LegendEntry(NamedTuple):
    """A run or an observer as a recording names it.

    Attributes:
        name: The name.
        part: Its part of an entity path.
        label: The shortened name.
        color: Its colour.
        is_best: Whether it is switched on at first.
    """

    name: str
    part: str
    label: str
    color: Colour
    is_best: bool


def legend(figures: Mapping[str, Summary], always: Collection[str] = ()) -> list[LegendEntry]:
    """Make the legend of runs or observers.

    Args:
        figures: Name -> its numbers, which rank it.
        always: Names that are switched on in any case.

    Returns:
        An entry for each, in the order of `figures`.
    """
    names = list(figures)
    best, labels = observers_to_draw(figures, always), short_names(names)
    places = zip(numbered_parts(names), colours(names).items(), strict=True)
    return [LegendEntry(name, part, labels[name], color, name in best) for part, (name, color) in places]


def numbered_parts(names: Sequence[str]) -> list[str]:
    """Make parts of entity paths; each of several gets a number before its name, because the viewer sorts by path."""
    digits = len(str(len(names)))
    return [
        rr.escape_entity_path_part(f"{i:0{digits}}_{name}" if len(names) > 1 else name)
        for i, name in enumerate(names, 1)
    ]


def phases(run: Run, pushes: Sequence[Push], settings: MetricsSettings) -> list[tuple[float, str]]:
    """Divide a run into phases.

    Before the first push the phase is `balancing`. After a push (or from the start, if there is no push) the phase is
    `recovering` until the tilt stays inside the settle band up to the next push or the end. Then it is `settled`.

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
    for push_end in sorted({push.end_s for push in pushes}) if pushes else [0.0]:
        if any(p.start_s <= push_end < p.end_s for p in pushes):
            continue  # another push is still on
        next_push = min((start for start in starts if start >= push_end), default=end)
        steps += _recovery(run.trajectory, push_end, min(next_push, end), math.radians(settings.settle_band_deg))
    steps = sorted((time, name) for time, name in steps if time < end)
    steps = [step for i, step in enumerate(steps) if i == 0 or step[1] != steps[i - 1][1]]
    if run.outcome.kind in ENDINGS:
        steps.append((end, ENDINGS[run.outcome.kind]))
    return steps


def _recovery(trajectory: Trajectory, start: float, end: float, band: float) -> list[tuple[float, str]]:
    """Return the steps `recovering` and `settled` between two pushes."""
    time = trajectory["time_s"]
    window = (time >= start - 1e-9) & (time < end - 1e-9)
    if not window.any():
        return [(start, RECOVERING)]
    outside = np.flatnonzero(np.abs(trajectory["x1_rad"][window]) > band)
    settled = time[window][outside[-1] + 1 if len(outside) else 0 :]
    steps = [(start, RECOVERING)] if len(outside) else []
    return [*steps, (max(start, float(settled[0])), SETTLED)] if len(settled) else steps

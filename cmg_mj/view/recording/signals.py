"""The branches of a recording, one a run: their time series with paths, units, colours; the timeline; the phases."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr

from cmg_mj.core.types import BIAS
from cmg_mj.plant.plant import Plant
from cmg_mj.stages.push import Push
from cmg_mj.view.plots.style import BASELINE_COLOURS, BOUND_COLOURS, Colour
from cmg_mj.view.recording.run import (
    BALANCING,
    ENDINGS,
    PUSH,
    RECOVERING,
    SETTLED,
    LegendEntry,
    RecordingHeader,
    Run,
    legend,
    phases,
)

TIMELINE = "sim_time"
"""Simulated time from the start of the run."""

CONTROLLER: Colour = (200, 200, 200)
MODULES: tuple[Colour, ...] = ((225, 205, 165), (125, 150, 185), (160, 120, 90), (110, 160, 140))
"""Colours of the modules: pale, because strong colours are those of observers."""

PHASES: dict[str, Colour] = {
    BALANCING: (0, 114, 178),
    PUSH: (213, 94, 0),
    RECOVERING: (200, 140, 0),
    SETTLED: (0, 130, 96),
    **dict.fromkeys(ENDINGS.values(), (170, 40, 60)),
}

NO_PHASE = ""
"""State that ends the lane."""


@dataclass(frozen=True)
class Series:
    """An entity of scalars.

    Attributes:
        path: Path below the run's branch.
        name: Name in the legend; several lines share the name.
        time: Times, (n,) [s].
        values: Values, (n,) or (n, n_lines), in the unit that the plot's title names.
        color: Colour of the lines.
        width: Width of the lines.
        observer: The observer that made the series; empty if none did.
    """

    path: str
    name: str
    time: np.ndarray
    values: np.ndarray
    color: Colour
    width: float = 1.5
    observer: str = ""


@dataclass(frozen=True, kw_only=True)
class Lines:
    """A group of time series and its place in the recording.

    Attributes:
        path: Path of the group.
        label: Shortened name of the run or log.
        series: Path below the group -> series.
        timeline: Name of the timeline.
    """

    path: str
    label: str
    series: dict[str, Series]
    timeline: str = TIMELINE


@dataclass(frozen=True, kw_only=True)
class Branch(Lines):
    """A run and its place in the recording.

    Attributes:
        run: The run.
        entry: The run in the legends.
        observers: The run's observers in the legends.
        plant: The plant; of several axes, with the run's axis alone.
        pushes: The pushes about the run's axis.
    """

    run: Run
    entry: LegendEntry
    observers: Sequence[LegendEntry]
    plant: Plant
    pushes: Sequence[Push]


def make_branches(header: RecordingHeader, runs: Sequence[Run]) -> list[Branch]:
    """Make the branches of a recording, each named after its run."""
    # A run that did not reach its end ranks last.
    entries = legend({run.name: {**run.summary, "fell": run.outcome.kind in ENDINGS} for run in runs})
    branches = []
    for run, entry in zip(runs, entries, strict=True):
        plant = header.plant if run.axis is None else header.plant.single_axis(run.axis)
        observers = legend(run.observers, always=run.trajectory.observers[:1])
        branches.append(
            Branch(
                path=f"/{entry.part}",
                label=entry.label,
                series={row.path: row for row in _series(run, plant, observers, header)},
                run=run,
                entry=entry,
                observers=observers,
                plant=plant,
                pushes=[push for push in header.pushes if run.axis is None or push.axis == run.axis],
            )
        )
    return branches


def instant(seconds: float) -> np.timedelta64:
    """Round a time to the nanosecond (rerun would truncate it)."""
    return np.timedelta64(round(seconds * 1e9), "ns")


def time_column(seconds: np.ndarray, timeline: str = TIMELINE) -> rr.TimeColumn:
    """Make a column of times, (n,) [s]."""
    return rr.TimeColumn(timeline, duration=np.rint(seconds * 1e9).astype("timedelta64[ns]"))


def _series(run: Run, plant: Plant, observers: Sequence[LegendEntry], header: RecordingHeader) -> Iterator[Series]:
    """Make all time series of a run: tilt and gimbal angles in degrees, rates in rad/s, the integrator in rad s."""
    t, time = run.trajectory, run.trajectory["time_s"]
    true, gyro = BASELINE_COLOURS["true"], BASELINE_COLOURS["gyro"]
    yield Series("tilt/measured", "measured", time, np.degrees(t["y1_rad"]), gyro, 1.0)
    yield Series("tilt/true", "true", time, np.degrees(t["x1_rad"]), true, 2.5)
    yield _bounds("tilt/settle_band", "settle band", time, header.settings.settle_band_deg)
    yield Series("rate/true", "true", time, t["x2_rad_s"], true, 3.0)
    # the viewer draws in the order of the paths: the thin line of the gyro over the wide one that it follows
    yield Series("rate/true_by_gyro", "gyro", time, t["fog_rad_s"], gyro, 1.0)
    for observer in observers:
        yield from _estimates(run, observer)
    yield Series("command/u", "command", time, t["u_rad_s"], CONTROLLER)
    yield _bounds("command/limit", "rate limit", time, header.rate_limit_rad_s)
    for i, module in enumerate(plant.axis.modules):
        color = MODULES[i % len(MODULES)]
        part = rr.escape_entity_path_part(module.name.rpartition("/")[2])
        angle = t[f"angle/{module.name}/gimbal_rad"] - module.gimbal_zero
        speed = t[f"rate/{module.name}/flywheel_rad_s"] * np.sign(module.speed)
        # the modules' speeds agree: the first one's line is wider, and shines through
        width = 3.0 if i == 0 and len(plant.axis.modules) > 1 else 1.5
        suffix = "" if module.speed > 0.0 else " (spins backwards)"
        yield Series(f"gimbal/{part}", module.name, time, np.degrees(angle), color)
        yield Series(f"flywheel/{part}", module.name + suffix, time, speed, color, width)
    yield Series("integrator/x_e", "x_e", time, t["x_e_rad_times_s"], CONTROLLER)
    for make in header.lines:
        for i, (path, values) in enumerate(make(plant.axis, t).items()):
            folder, _, name = path.partition("/")
            color = MODULES[i % len(MODULES)]
            yield Series(f"{folder}/{rr.escape_entity_path_part(name)}", name, time, values, color)


def _estimates(run: Run, observer: LegendEntry) -> Iterator[Series]:
    """Make the series of one observer's estimates."""
    t, name = run.trajectory, observer.name
    time, rate = t["time_s"], t[f"estimate/{name}/x2_rad_s"]
    width = 1.5 if name == t.observers[0] else 1.0
    signals = {"rate_estimate": rate, "rate_error": rate - t["x2_rad_s"]}
    if BIAS in t.extra_signals(name):
        signals["bias"] = np.degrees(t[f"estimate/{name}/{BIAS}"])
    for folder, values in signals.items():
        path = f"{folder}/{observer.part}"
        yield Series(path, observer.label, time, values, observer.color, width, observer=name)
    if isinstance(bias := run.observers[name].get("bias_deg"), (int, float)):
        yield _level("bias/true", "true", time, [bias], BASELINE_COLOURS["true"], 2.5)


def log_styles(rec: rr.RecordingStream, branch: Lines) -> None:
    """Record the colours, widths and names of the series."""
    for row in branch.series.values():
        n = 1 if row.values.ndim == 1 else row.values.shape[1]
        style = rr.SeriesLines(colors=[row.color] * n, widths=[row.width] * n, names=[row.name] * n)
        rec.log(f"{branch.path}/{row.path}", style, static=True)


def log_values(rec: rr.RecordingStream, branch: Lines) -> None:
    """Record the values of the series, a column each."""
    for row in branch.series.values():
        if len(row.time):
            scalars = rr.Scalars.columns(scalars=row.values)
            rec.send_columns(f"{branch.path}/{row.path}", [time_column(row.time, branch.timeline)], scalars)


def log_phases(rec: rr.RecordingStream, header: RecordingHeader, branch: Branch, until_s: float) -> None:
    """Record the lane of phases; it ends with a run that did not reach its end.

    Args:
        rec: The recording.
        header: The experiment.
        branch: The run.
        until_s: Time until which a fall is shown; at least a little after the run, so that it is seen [s].
    """
    path, outcome = f"{branch.path}/phase", branch.run.outcome
    rec.log(path, rr.StateConfiguration(values=list(PHASES), colors=list(PHASES.values())), static=True)
    steps = phases(branch.run, branch.pushes, header.settings)
    if outcome.kind in ENDINGS:
        steps.append((max(until_s, 1.05 * outcome.time_s, outcome.time_s + 0.1), NO_PHASE))
    for time, name in steps:
        rec.set_time(TIMELINE, duration=instant(time))
        rec.log(path, rr.StateChange(state=name))
    rec.reset_time()


def _bounds(path: str, name: str, time: np.ndarray, bound: float) -> Series:
    """Make two horizontal lines at +-bound."""
    return _level(path, name, time, [bound, -bound], BOUND_COLOURS[name], 1.0)


def _level(path: str, name: str, time: np.ndarray, values: list[float], color: Colour, width: float) -> Series:
    """Make horizontal lines from the first time to the last."""
    ends = time[[0, -1]] if len(time) > 1 else time
    return Series(path, name, ends, np.tile(values, (len(ends), 1)), color, width)

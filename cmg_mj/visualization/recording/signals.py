"""The time series of a run: paths, units, colours; and the recording's timeline."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import rerun as rr

from cmg_mj.core.types import BIAS
from cmg_mj.plant.plant import Plant
from cmg_mj.scenario.schema import MetricsSettings
from cmg_mj.stages.push import Push
from cmg_mj.visualization.plots.colours import BASELINE_COLOURS, BOUND_COLOURS, Colour
from cmg_mj.visualization.plots.thinning import thinned
from cmg_mj.visualization.recording.legend import LegendEntry
from cmg_mj.visualization.recording.run import BALANCING, ENDINGS, PUSH, RECOVERING, SETTLED, Run, phases

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
        whole: Whether an axis must show the whole series; bounds, measurements and estimates may be cut off.
        observer: The observer that made the series; empty if none did.
    """

    path: str
    name: str
    time: np.ndarray
    values: np.ndarray
    color: Colour
    width: float = 1.5
    whole: bool = True
    observer: str = ""


@dataclass(frozen=True, kw_only=True)
class Lines:
    """A group of time series and its place in the recording.

    Attributes:
        path: Path of the group.
        label: Shortened name of the run or log.
        series: Path below the group -> series.
        timeline: Name of the timeline.
        falls_from: Time from which the run only fell; what follows takes no room on an axis [s].
    """

    path: str
    label: str
    series: dict[str, Series]
    timeline: str = TIMELINE
    falls_from: float = math.inf


def instant(seconds: float) -> np.timedelta64:
    """Round a time to the nanosecond (rerun would truncate it)."""
    return np.timedelta64(round(seconds * 1e9), "ns")


def time_column(seconds: np.ndarray, timeline: str = TIMELINE) -> rr.TimeColumn:
    """Make a column of times, (n,) [s]."""
    return rr.TimeColumn(timeline, duration=np.rint(seconds * 1e9).astype("timedelta64[ns]"))


def run_series(
    run: Run,
    plant: Plant,
    observers: Sequence[LegendEntry],
    settings: MetricsSettings,
    rate_limit: float | None,
    *,
    thin: bool = False,
) -> list[Series]:
    """Make all time series of a run.

    Args:
        run: The run.
        plant: The plant.
        observers: The run's observers.
        settings: The settle band.
        rate_limit: Largest gimbal rate, if it is known [rad/s].
        thin: Whether the outlines of a long run's series are enough.

    Returns:
        The series: tilt and gimbal angles in degrees, rates in rad/s, the integrator in rad s.
    """
    rows = _series(run, plant, observers, settings, rate_limit)
    return [_thinned(row) for row in rows] if thin else list(rows)


def _thinned(row: Series) -> Series:
    if row.values.ndim > 1:
        return row
    time, values = thinned(row.time, row.values)
    return replace(row, time=time, values=values)


def _series(
    run: Run, plant: Plant, observers: Sequence[LegendEntry], settings: MetricsSettings, rate_limit: float | None
) -> Iterator[Series]:
    """Make the series one by one: of a long run, all at once take much memory."""
    t = run.trajectory
    time = t["time_s"]
    true, gyro = BASELINE_COLOURS["true"], BASELINE_COLOURS["gyro"]
    yield Series("tilt/measured", "measured", time, np.degrees(t["y1_rad"]), gyro, 1.0, whole=False)
    yield Series("tilt/true", "true", time, np.degrees(t["x1_rad"]), true, 2.5)
    yield _bounds("tilt/settle_band", "settle band", time, settings.settle_band_deg)
    yield Series("rate/true", "true", time, t["x2_rad_s"], true, 3.0)
    # the viewer draws in the order of the paths: the thin line of the gyro over the wide one that it follows
    yield Series("rate/true_by_gyro", "gyro", time, t["fog_rad_s"], gyro, 1.0, whole=False)
    for observer in observers:
        yield from _estimates(run, observer)
    yield Series("command/u", "command", time, t["u_rad_s"], CONTROLLER)
    if rate_limit is not None:
        yield _bounds("command/limit", "rate limit", time, rate_limit)
    for i, module in enumerate(plant.axis.modules):
        color = MODULES[i % len(MODULES)]
        part = rr.escape_entity_path_part(module.of_axis)
        angle = t[f"angle/{module.name}/gimbal_rad"] - module.gimbal_zero
        speed = t[f"rate/{module.name}/flywheel_rad_s"] * np.sign(module.speed)
        # the modules' speeds agree: the first one's line is wider, and shines through
        width = 3.0 if i == 0 and len(plant.axis.modules) > 1 else 1.5
        suffix = "" if module.speed > 0.0 else " (spins backwards)"
        yield Series(f"gimbal/{part}", module.name, time, np.degrees(angle), color)
        yield Series(f"flywheel/{part}", module.name + suffix, time, speed, color, width)
    yield Series("integrator/x_e", "x_e", time, t["x_e_rad_times_s"], CONTROLLER)


def _estimates(run: Run, observer: LegendEntry) -> Iterator[Series]:
    """Make the series of one observer's estimates."""
    t, name = run.trajectory, observer.name
    time, rate = t["time_s"], t[f"estimate/{name}/x2_rad_s"]
    part, label, color = observer.part, observer.label, observer.color
    width = 1.5 if name == t.observers[0] else 1.0

    def line(folder: str, values: np.ndarray) -> Series:
        return Series(f"{folder}/{part}", label, time, values, color, width, whole=False, observer=name)

    yield line("rate_estimate", rate)
    yield line("rate_error", rate - t["x2_rad_s"])
    if BIAS in t.extra_signals(name):
        yield line("bias", np.degrees(t[f"estimate/{name}/{BIAS}"]))
        if isinstance(bias := run.observers[name].get("bias_deg"), (int, float)):
            ends = _ends(time)
            yield Series("bias/true", "true", ends, np.full(len(ends), bias), BASELINE_COLOURS["true"], 2.5)


def log_series(rec: rr.RecordingStream, branch: Lines) -> None:
    """Record time series, a column each."""
    log_styles(rec, branch)
    log_values(rec, branch)


def log_styles(rec: rr.RecordingStream, branch: Lines) -> None:
    """Record the colours, widths and names of the series."""
    for row in branch.series.values():
        n = 1 if row.values.ndim == 1 else row.values.shape[1]
        style = rr.SeriesLines(colors=[row.color] * n, widths=[row.width] * n, names=[row.name] * n)
        rec.log(f"{branch.path}/{row.path}", style, static=True)


def log_values(rec: rr.RecordingStream, branch: Lines) -> None:
    """Record the values of the series."""
    for row in branch.series.values():
        if len(row.time):
            scalars = rr.Scalars.columns(scalars=row.values)
            rec.send_columns(f"{branch.path}/{row.path}", [time_column(row.time, branch.timeline)], scalars)


def phase_steps(run: Run, pushes: Sequence[Push], settings: MetricsSettings, until_s: float) -> list[tuple[float, str]]:
    """Divide a run into the phases of its lane; the lane ends with a run that did not reach its end.

    Args:
        run: The run.
        pushes: Torques from outside.
        settings: The settle band.
        until_s: Time until which a fall is shown; at least a little after the run, so that it is seen [s].

    Returns:
        (time [s], name of the phase from then on), in order of time.
    """
    steps, outcome = phases(run, pushes, settings), run.outcome
    if outcome.kind in ENDINGS:
        steps.append((max(until_s, 1.05 * outcome.time_s, outcome.time_s + 0.1), NO_PHASE))
    return steps


def log_lane(rec: rr.RecordingStream, branch: str) -> None:
    """Record the colours of a branch's lane of phases."""
    states = rr.StateConfiguration(values=list(PHASES), colors=list(PHASES.values()))
    rec.log(f"{branch}/phase", states, static=True)


def log_phases(rec: rr.RecordingStream, branch: str, steps: Sequence[tuple[float, str]]) -> None:
    """Record phases: (time [s], name)."""
    for time, name in steps:
        rec.set_time(TIMELINE, duration=instant(time))
        rec.log(f"{branch}/phase", rr.StateChange(state=name))
    rec.reset_time()


def _bounds(path: str, name: str, time: np.ndarray, bound: float) -> Series:
    """Make two horizontal lines at +-bound."""
    ends = _ends(time)
    return Series(path, name, ends, np.tile([bound, -bound], (len(ends), 1)), BOUND_COLOURS[name], 1.0, whole=False)


def _ends(time: np.ndarray) -> np.ndarray:
    """Return the first and the last time."""
    return time[[0, -1]] if len(time) > 1 else time

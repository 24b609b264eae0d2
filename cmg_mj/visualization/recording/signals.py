"""The run as time series: what is plotted, under which name, in which unit and colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr

from cmg_mj.observers.protocol import BIAS
from cmg_mj.plant.plant import Plant
from cmg_mj.scenario.disturbances import Push
from cmg_mj.scenario.schema import MetricsSettings
from cmg_mj.visualization.plots.colours import BASELINE_COLOURS, Colour, colours
from cmg_mj.visualization.plots.readability import short_names
from cmg_mj.visualization.recording.camera import Ball
from cmg_mj.visualization.recording.run import BALANCING, ENDINGS, PUSH, RECOVERING, SETTLED, Run, phases
from cmg_mj.visualization.recording.timeline import TIMELINE, column, instant

LIMIT: Colour = (120, 120, 120)
CONTROLLER: Colour = (200, 200, 200)
CUBES: tuple[Colour, ...] = ((225, 205, 165), (125, 150, 185), (160, 120, 90), (110, 160, 140))
"""Strong colours are the observers'."""

PHASES: dict[str, Colour] = {
    BALANCING: (0, 114, 178),
    PUSH: (213, 94, 0),
    RECOVERING: (200, 140, 0),
    SETTLED: (0, 130, 96),
    **dict.fromkeys(ENDINGS.values(), (170, 40, 60)),
}

NO_PHASE = ""
"""Ends the lane."""


@dataclass(frozen=True)
class Series:
    """One entity of scalars.

    Attributes:
        path: Below the run's branch.
        name: In the legend; for several lines the same name.
        time: (n,) [s].
        values: (n,) or (n, n_lines), in the unit that the plot's title names.
        color: Of its lines.
        width: Of its lines.
        whole: Whether an axis must show all of it; bounds, measurements and estimates may be cut off.
        observer: Whose it is; empty if no observer's.
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
    """Time series and their place in the recording.

    Attributes:
        path: Where everything of them is found.
        label: Of what they are, shortened.
        series: By their path below the branch.
        timeline: What their time is called.
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
        rig: Where the rig is.
    """

    run: Run
    rig: Ball


def numbered(names: Sequence[str]) -> list[str]:
    """Parts of entity paths: the viewer sorts by them, so that of several each has its number before its name."""
    digits = len(str(len(names)))
    return [
        rr.escape_entity_path_part(f"{i:0{digits}}_{name}" if len(names) > 1 else name)
        for i, name in enumerate(names, 1)
    ]


def series(run: Run, plant: Plant, settings: MetricsSettings, rate_limit: float | None) -> list[Series]:
    """All time series of one run.

    Args:
        run: The run.
        plant: The rig.
        settings: The settle band.
        rate_limit: Largest gimbal rate [rad/s], if it is known.

    Returns:
        The series: tilt and gimbal angles in degrees, rates in rad/s, the integrator in rad s.
    """
    t = run.trajectory
    time = t["time_s"]
    true, gyro = BASELINE_COLOURS["true"], BASELINE_COLOURS["gyro"]
    rows = [
        Series("tilt/measured", "measured", time, np.degrees(t["y1_rad"]), gyro, 1.0, whole=False),
        Series("tilt/true", "true", time, np.degrees(t["x1_rad"]), true, 2.5),
        _bounds("tilt/settle_band", "settle band", time, settings.settle_band_deg),
        Series("rate/true", "true", time, t["x2_rad_s"], true, 3.0),
        Series("rate/gyro", "gyro", time, t["fog_rad_s"], gyro, 1.0, whole=False),
    ]
    labels = short_names(t.observers)
    for part, (name, color) in zip(numbered(t.observers), colours(t.observers).items(), strict=True):
        rows += _estimates(run, part, name, labels[name], color)
    rows.append(Series("command/u", "command", time, t["u_rad_s"], CONTROLLER))
    if rate_limit is not None:
        rows.append(_bounds("command/limit", "rate limit", time, rate_limit))
    for i, cube in enumerate(plant.cubes):
        color = CUBES[i % len(CUBES)]
        part = rr.escape_entity_path_part(cube.of_axis)
        angle = t[f"angle/{cube.name}/gimbal_rad"] - cube.gimbal_zero
        speed = t[f"rate/{cube.name}/flywheel_rad_s"] * np.sign(cube.speed)
        width = 3.0 if i == 0 and len(plant.cubes) > 1 else 1.5  # the cubes' speeds agree: one must shine through
        way = "" if cube.speed > 0.0 else " (spins backwards)"
        rows += [
            Series(f"gimbal/{part}", cube.name, time, np.degrees(angle), color),
            Series(f"flywheel/{part}", cube.name + way, time, speed, color, width),
        ]
    rows.append(Series("integrator/x_e", "x_e", time, t["x_e_rad_times_s"], CONTROLLER))
    return rows


def _estimates(run: Run, part: str, name: str, label: str, color: Colour) -> list[Series]:
    """What one observer says."""
    t = run.trajectory
    time, rate = t["time_s"], t[f"estimate/{name}/x2_rad_s"]
    said = {"rate_estimate": rate, "rate_error": rate - t["x2_rad_s"]}
    if BIAS in t.extra_signals(name):
        said["bias"] = np.degrees(t[f"estimate/{name}/{BIAS}"])
    width = 1.5 if name == t.observers[0] else 1.0
    rows = [
        Series(f"{folder}/{part}", label, time, values, color, width, whole=False, observer=name)
        for folder, values in said.items()
    ]
    if "bias" in said and (bias := run.observers[name].get("bias_deg")) is not None:
        ends = time[[0, -1]] if len(time) > 1 else time
        rows.append(Series("bias/true", "true", ends, np.full(len(ends), bias), BASELINE_COLOURS["true"], 2.5))
    return rows


def log_series(rec: rr.RecordingStream, branch: Lines) -> None:
    """Record time series, a column each.

    Args:
        rec: The recording.
        branch: What they are of.
    """
    log_styles(rec, branch)
    log_values(rec, branch)


def log_styles(rec: rr.RecordingStream, branch: Lines) -> None:
    """How the series are drawn."""
    for row in branch.series.values():
        n = 1 if row.values.ndim == 1 else row.values.shape[1]
        style = rr.SeriesLines(colors=[row.color] * n, widths=[row.width] * n, names=[row.name] * n)
        rec.log(f"{branch.path}/{row.path}", style, static=True)


def log_values(rec: rr.RecordingStream, branch: Lines) -> None:
    """The series' values."""
    for row in branch.series.values():
        if len(row.time):
            scalars = rr.Scalars.columns(scalars=row.values)
            rec.send_columns(f"{branch.path}/{row.path}", [column(row.time, branch.timeline)], scalars)


def phase_steps(run: Run, pushes: Sequence[Push], settings: MetricsSettings, until_s: float) -> list[tuple[float, str]]:
    """What the rig is doing as the steps of a lane, which a run that was not done ends.

    Args:
        run: The run.
        pushes: Torques from outside.
        settings: The settle band.
        until_s: Until when a fall is shown; at least a little longer than the run, or it could not be seen [s].

    Returns:
        (time [s], name of the phase from then on), in order of time.
    """
    steps, outcome = phases(run, pushes, settings), run.outcome
    if outcome.kind in ENDINGS:
        steps.append((max(until_s, 1.05 * outcome.time_s, outcome.time_s + 0.1), NO_PHASE))
    return steps


def log_lane(rec: rr.RecordingStream, branch: str) -> None:
    """The lane of phases of a branch, in its colours and still empty."""
    states = rr.StateConfiguration(values=list(PHASES), colors=list(PHASES.values()))
    rec.log(f"{branch}/phase", states, static=True)


def log_phases(rec: rr.RecordingStream, branch: str, steps: Sequence[tuple[float, str]]) -> None:
    """Record phases: (time [s], name)."""
    for time, name in steps:
        rec.set_time(TIMELINE, duration=instant(time))
        rec.log(f"{branch}/phase", rr.StateChange(state=name))
    rec.reset_time()


def _bounds(path: str, name: str, time: np.ndarray, bound: float) -> Series:
    """Two horizontal lines at +-bound."""
    ends = time[[0, -1]] if len(time) > 1 else time
    return Series(path, name, ends, np.tile([bound, -bound], (len(ends), 1)), LIMIT, 1.0, whole=False)

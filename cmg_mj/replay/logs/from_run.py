"""A run's own recording as a log, whose columns, pushes and scenario are known."""

from __future__ import annotations

from pathlib import Path

from cmg_mj.errors import InputError
from cmg_mj.replay.logs.log import REFERENCE, Log
from cmg_mj.replay.logs.table import PARQUET, head_of
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.stages.push import Push, push_windows

SAY_COLUMNS = "say which columns are what, --columns tilt=HEADING,rate=HEADING,..."


def log_of_trajectory(path: Path) -> Log:
    """Read a run's own recording, whose columns are known."""
    if not head_of(path).startswith(PARQUET):
        raise InputError(f"{path}: {SAY_COLUMNS}")
    try:
        trajectory = Trajectory.load(path)
    except InputError as error:
        if "not a trajectory written by" in str(error):
            raise InputError(f"{path}: {SAY_COLUMNS}") from error
        raise
    if trajectory.axes:
        raise InputError(
            f"{path}: a run about several axes ({', '.join(trajectory.axes)}), and replay takes one; save one of them "
            f"from Python: Trajectory.load(path).along({trajectory.axes[0]!r}).save(...)"
        )
    scenario = trajectory.metadata.get("scenario")
    if scenario is None:  # signals.parquet of a replay
        raise InputError(f"{path}: {SAY_COLUMNS}")
    try:
        rate = float(scenario["controller"]["rate_hz"])
        pushes = [Push(**push) for push in scenario.get("push", ())]
        columns = {name: trajectory[name] for name in ("time_s", "y1_rad", "y2_rad", "u_rad_s", "acceleration_rad_s2")}
        columns[REFERENCE] = trajectory["x2_rad_s"]
    except (LookupError, TypeError, ValueError) as error:
        raise InputError(
            f"{path}: a trajectory, but of an earlier version of cmg-mj; run its scenario again"
        ) from error
    if len(trajectory) < 2:
        raise InputError(f"{path}: a run that ended before its second tick")
    has = frozenset({"gimbals", "acceleration", "reference"})
    name = path.parent.name if path.stem == "trajectory" and path.parent.name else path.stem
    everything = [slice(0, len(trajectory))]
    return Log(name, 1.0 / rate, columns, everything, has, None, push_windows(pushes), scenario=scenario)

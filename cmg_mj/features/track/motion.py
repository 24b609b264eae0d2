"""Tracks at work: read, checked against the plant, and set from instant to instant."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError, nearest, shown
from cmg_mj.core.loop import Disturbance, Outside
from cmg_mj.features.track import Track
from cmg_mj.inputs.files import require_file
from cmg_mj.plant.elements import element_id
from cmg_mj.plant.plant import Plant
from cmg_mj.scenario.schema import Scenario

HUGE = 1e6
"""No setpoint is larger."""


class Columns(NamedTuple):
    """A file's setpoints."""

    names: tuple[str, ...]
    times: np.ndarray
    """Increasing, (n,) [s]."""
    setpoints: np.ndarray
    """(n, n_names)."""


def read_columns(file: str) -> Columns:
    """Read a file of setpoints.

    Raises:
        InputError: It cannot be read or holds no setpoints.
    """
    path = Path(file)
    require_file(path)
    status = path.stat()
    return _read(path, status.st_mtime_ns, status.st_size)


@functools.lru_cache(maxsize=16)
def _read(path: Path, _changed_ns: int, _size: int) -> Columns:
    """See `read_columns`; a file that changes is read anew."""
    import pyarrow as pa
    import pyarrow.csv as pacsv

    try:
        table = pacsv.read_csv(path)
        names = [name.strip() for name in table.column_names]
        if len(names) < 2 or not table.num_rows or names[0] != "time_s":
            raise InputError(f"{path}: must have a heading, time_s,ACTUATOR with a column an actuator, and rows")
        for name, column in zip(names, table.columns, strict=True):
            if not (pa.types.is_floating(column.type) or pa.types.is_integer(column.type)):
                raise InputError(f"{path}: column {shown(name)}: must hold numbers alone, with a point and no unit")
        times, *columns = (column.cast(pa.float64(), safe=False).to_numpy() for column in table.columns)
    except (pa.ArrowException, OSError, UnicodeError) as error:
        raise InputError(f"{path}: cannot be read as CSV: {' '.join(str(error).split())}") from error
    setpoints = np.column_stack(columns)
    wrong = np.flatnonzero(
        ~np.isfinite(times) | ~np.isfinite(setpoints).all(axis=1) | (np.diff(times, prepend=-np.inf) <= 0.0)
    )
    if len(wrong):
        raise InputError(f"{path}: row {wrong[0] + 1}: must hold finite numbers, and times that grow")
    return Columns(tuple(names[1:]), times, setpoints)


def check_tracks(scenario: Scenario, plant: Plant) -> None:
    """Refuse tracks that do not fit a plant.

    Raises:
        InputError: A file cannot be read, or names what is no actuator, a gimbal's, a flywheel's, or moved already; or
            an integrating actuator does not begin where the keyframe has it.
    """
    model, moved = plant.model, {}
    modules = [module for axis in plant.filed.axes for module in axis.modules]
    own = {i for module in (*modules, *plant.filed.held) for i in (module.servo, module.motor)}
    others = [model.actuator(i).name for i in range(model.nu) if i not in own]
    for i, track in enumerate(scenario.section("track")):
        field = f"track.{i}.file"
        try:
            names, times, setpoints = read_columns(track.file)
        except InputError as error:
            raise InputError(f"{field}: {error}") from error
        if track.start_s + times[0] >= scenario.duration_s:
            raise InputError(f"{field}: {track.file}: begins at {track.start_s + times[0]:g} s, when the run has ended")
        for name, way in zip(names, setpoints.T, strict=True):
            column = f"{field}: {track.file}: column {shown(name)}"
            if name not in others:
                what = nearest(name, others) if others else f"{plant.path} has none beside gimbals and flywheels"
                raise InputError(f"{column}: no such actuator to move; {what}")
            if name in moved:
                raise InputError(f"{column}: track.{moved[name]} moves it already")
            moved[name] = i
            _check_way(column, plant, model.actuator(name).id, way)


def _check_way(column: str, plant: Plant, actuator: int, way: np.ndarray) -> None:
    """Refuse setpoints that an actuator does not take, and one whose joint is held."""
    model, state = plant.model, plant.model.actuator_actadr[actuator]
    limited, ranges = (
        (model.actuator_ctrllimited, model.actuator_ctrlrange)
        if state < 0
        else (model.actuator_actlimited, model.actuator_actrange)
    )
    low, high = ranges[actuator] if limited[actuator] else (-HUGE, HUGE)
    if not low <= way.min() <= way.max() <= high:
        raise InputError(
            f"{column}: goes from {way.min():g} to {way.max():g}, and the actuator takes {low:g} to {high:g}"
        )
    if state >= 0 and abs(way[0] - (start := model.key_act[plant.key, state])) > 1e-6:
        raise InputError(
            f"{column} begins at {way[0]:g}, and the keyframe has it at {start:g}, from where an actuator with a state "
            "starts"
        )
    joint = int(model.actuator_trnid[actuator, 0])
    by_joint = model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_JOINT
    holding = (model.eq_type == mujoco.mjtEq.mjEQ_JOINT) & (model.eq_obj1id == joint) & (model.eq_active0 > 0)
    if by_joint and holding.any():
        raise InputError(
            f"{column}: an equality of the model holds the joint {model.joint(joint).name!r}; of a mounted robot: "
            f"mount it with --hold servos, or --release {model.joint(joint).name}"
        )


def track_motion(
    tracks: Sequence[Track], plants: Sequence[Plant], seed: int, world_ids: int | Sequence[int]
) -> TrackMotion:
    """Make what moves the actuators."""
    return TrackMotion(tracks, plants[0].model)


class TrackMotion(Disturbance):
    """Sets actuators at every instant: to the setpoint in the middle of what follows.

    One that integrates its control (`<intvelocity>`) is given the rate, so that its setpoint runs straight.
    """

    def __init__(self, tracks: Sequence[Track], model: mujoco.MjModel) -> None:
        self._timestep = float(model.opt.timestep)
        self._files = [(track.start_s, read_columns(track.file)) for track in tracks]
        names = [name for _, columns in self._files for name in columns.names]
        self.actuators = [element_id(model, "actuator", name) for name in names]
        self._integrates = model.actuator_dyntype[self.actuators] == mujoco.mjtDyn.mjDYN_INTEGRATOR

    def at(self, step: int, steps: int) -> Outside:
        """See `Disturbance`."""
        h = self._timestep
        start, middle, end = (self._setpoints(at * h) for at in (step, step + 0.5 * steps, step + steps))
        controls = np.where(self._integrates, (end - start) / (steps * h), middle)
        return Outside(setpoints=(self.actuators, controls))

    def _setpoints(self, time: float) -> np.ndarray:
        return np.array(
            [
                np.interp(time - start, columns.times, column)
                for start, columns in self._files
                for column in columns.setpoints.T
            ]
        )

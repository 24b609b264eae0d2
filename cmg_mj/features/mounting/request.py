"""The arguments of `mount`, checked before a file is read, and the axis that they name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError, nearest, shown
from cmg_mj.features.mounting.hold import Hold
from cmg_mj.plant.tilt_line import UP

NAMED = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
LEVEL_DEG = 5.0
"""An axis steeper than this is not horizontal [deg]."""
PARALLEL = math.cos(math.radians(5.0))

AxisLike = str | Sequence[float]


def chain_of(model: mujoco.MjModel, body: int) -> list[int]:
    """Return the joints between a body and the world, the nearest first."""
    joints = []
    while body:
        first = int(model.body_jntadr[body])
        joints += reversed(range(first, first + int(model.body_jntnum[body])))
        body = int(model.body_parentid[body])
    return joints


def hinge_or_direction(
    model: mujoco.MjModel, data: mujoco.MjData, body: int, axis: AxisLike, path: Path
) -> tuple[int | None, np.ndarray]:
    """Find the hinge or the direction that an axis names.

    Args:
        model: The robot.
        data: The robot as it is to stand, after a forward pass.
        body: The body that is to carry the pair.
        axis: The name of a hinge, or a direction in the body frame: `x`, `y`, or three numbers.
        path: The file, for messages.

    Returns:
        The hinge, or None for a body that is free; and the axis' direction in the world, (3,), horizontal.

    Raises:
        InputError: There is no such hinge, or the axis is not horizontal.
    """
    chain = chain_of(model, body)
    hinges = [j for j in chain if int(model.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_HINGE)]
    free = [j for j in chain if int(model.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_FREE)]
    by_name = {model.joint(j).name: j for j in hinges}
    if isinstance(axis, str) and axis in by_name:
        joint = by_name[axis]
        return joint, _level(data.xaxis[joint], f"hinge {axis!r}", path)
    vector = _vector(axis, list(by_name), path)
    turn = data.xmat[body].reshape(3, 3)
    direction = _level(turn @ vector, f"--axis {_axis_text(axis)}", path)
    parallel = [j for j in hinges if abs(float(data.xaxis[j] @ direction)) > PARALLEL]
    if free:
        return None, direction
    if not parallel:
        raise InputError(
            f"--axis {_axis_text(axis)}: {path}: body {model.body(body).name!r} has no hinge along it, and the "
            f"body is not free; its hinges: {', '.join(by_name) or 'none'} (--free-base lets it stand on the floor)"
        )
    joint = parallel[0]
    return joint, _level(data.xaxis[joint] * np.sign(data.xaxis[joint] @ direction), f"--axis {_axis_text(axis)}", path)


def _vector(axis: AxisLike, hinges: Sequence[str], path: Path) -> np.ndarray:
    if isinstance(axis, str):
        if axis not in NAMED:
            raise InputError(
                f"--axis {axis}: must be x, y, three numbers, or a hinge that carries the body; {path}: "
                f"{nearest(axis, hinges, 'its hinges')}"
            )
        return np.array(NAMED[axis])
    try:
        vector = np.array([float(part) for part in axis])
    except (TypeError, ValueError):
        vector = np.zeros(0)
    if vector.shape != (3,) or not np.isfinite(vector).all() or not np.linalg.norm(vector) > 1e-9:
        raise InputError(
            f"--axis {_axis_text(axis)}: must be x, y, three numbers that are not all 0, or a hinge's name"
        )
    return vector / np.linalg.norm(vector)


def _level(direction: np.ndarray, what: str, path: Path) -> np.ndarray:
    """Make a direction exactly horizontal, if it nearly is."""
    steep = math.degrees(math.asin(min(1.0, abs(float(direction @ UP)))))
    if steep > LEVEL_DEG:
        word = "along gravity" if steep > 90.0 - LEVEL_DEG else f"{steep:.3g} deg steep"
        raise InputError(f"{what}: {path}: lies {word} where the robot stands; a robot tilts about a horizontal line")
    level = direction - (direction @ UP) * UP
    return level / np.linalg.norm(level)


def _axis_text(axis: AxisLike) -> str:
    if isinstance(axis, str):
        return axis
    return shown(" ".join(f"{part:g}" if isinstance(part, float) else str(part) for part in axis))


SCALES = 0.05, 20.0
MOST_MODULES = 16
Base = Literal["as_is", "free"]
HOLDS, BASES = get_args(Hold), get_args(Base)


@dataclass(frozen=True)
class MountRequest:
    """The arguments of `mount`, which says what they mean."""

    body: str
    axis: AxisLike
    position: Sequence[float] | None
    modules: int
    scale: float
    name: str
    keyframe: str | None
    hold: Hold
    release: Sequence[str]
    base: Base

    def __post_init__(self) -> None:
        if not (isinstance(self.modules, int) and 1 <= self.modules <= MOST_MODULES):
            raise InputError(f"--modules {self.modules}: must be from 1 to {MOST_MODULES}")
        if not (isinstance(self.scale, (int, float)) and SCALES[0] <= self.scale <= SCALES[1]):
            raise InputError(f"--scale {self.scale}: must be from {SCALES[0]:g} to {SCALES[1]:g}")
        if not (isinstance(self.name, str) and (not self.name or self.name.isidentifier())):
            raise InputError(f"--name {self.name}: must be a word, such as roll")
        if self.position is not None and not _is_point(self.position):
            raise InputError(f"--position {self.position}: must be three numbers, a point in the body's frame [m]")
        if self.hold not in HOLDS:
            raise InputError(f"--hold {self.hold}: {nearest(str(self.hold), HOLDS, 'must be one of')}")
        if self.base not in BASES:
            raise InputError(f"base={self.base!r}: {nearest(str(self.base), BASES, 'must be one of')}")

    @property
    def prefix(self) -> str:
        """The first part of the names of the axis' elements, such as `roll/`."""
        return f"{self.name}/" if self.name else ""


def _is_point(position: Sequence[float]) -> bool:
    try:
        point = np.array(position, dtype=float)
    except (TypeError, ValueError):
        return False
    return point.shape == (3,) and bool(np.isfinite(point).all())

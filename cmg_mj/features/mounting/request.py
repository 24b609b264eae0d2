"""The arguments of `mount`, checked before a file is read, and the axis that they name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError, nearest
from cmg_mj.plant.tilt_line import UP

SCALES = 0.05, 20.0
MAX_MODULES = 16
NAMED = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
LEVEL_DEG = 5.0
"""An axis steeper than this is not horizontal [deg]."""
PARALLEL = math.cos(math.radians(5.0))

Hold = Literal["constraints", "servos"]
Base = Literal["as_is", "free"]
AxisLike = str | Sequence[float]


@dataclass(frozen=True)
class MountRequest:
    """The arguments of `mount`, which says what they mean. Three numbers may be a text too."""

    body: str
    axis: AxisLike
    position: str | Sequence[float] | None
    modules: int
    scale: float
    name: str
    keyframe: str | None
    hold: Hold
    release: Sequence[str]
    base: Base

    def __post_init__(self) -> None:
        if not (isinstance(self.modules, int) and 1 <= self.modules <= MAX_MODULES):
            raise InputError(f"--modules {self.modules}: must be from 1 to {MAX_MODULES}")
        if not SCALES[0] <= self.scale <= SCALES[1]:
            raise InputError(f"--scale {self.scale}: must be from {SCALES[0]:g} to {SCALES[1]:g}")
        if self.name and not self.name.isidentifier():
            raise InputError(f"--name {self.name}: must be a word, such as roll")
        if self.position is not None and _three_numbers(self.position) is None:
            raise InputError(f"--position {self.position}: must be three numbers, such as '0 0 0.1' [m]")
        for option, value, kind in (("--hold", self.hold, Hold), ("base", self.base, Base)):
            if value not in get_args(kind):
                raise InputError(f"{option} = {value}: {nearest(str(value), get_args(kind), 'must be one of')}")

    @property
    def prefix(self) -> str:
        """The first part of the names of the axis' elements, such as `roll/`."""
        return f"{self.name}/" if self.name else ""

    @property
    def point(self) -> np.ndarray | None:
        """The position as a vector, (3,) [m]."""
        return None if self.position is None else _three_numbers(self.position)


def _three_numbers(value: AxisLike) -> np.ndarray | None:
    parts = value.replace(",", " ").split() if isinstance(value, str) else value
    try:
        vector = np.array([float(part) for part in parts])
    except (TypeError, ValueError):
        return None
    return vector if vector.shape == (3,) and np.isfinite(vector).all() else None


def hinge_or_direction(
    model: mujoco.MjModel, data: mujoco.MjData, body: int, axis: AxisLike
) -> tuple[int | None, np.ndarray]:
    """Find the hinge or the direction that an axis names.

    Args:
        model: The robot.
        data: The robot as it is to stand, after a forward pass.
        body: The body that is to carry the pair.
        axis: The name of a hinge, or a direction in the body frame: `x`, `y`, or three numbers.

    Returns:
        The hinge, or None for a body that is free; and the axis' direction in the world, (3,), horizontal.

    Raises:
        InputError: There is no such hinge, or the axis is not horizontal.
    """
    chain, ancestor = [], body  # the joints between the body and the world, the nearest first
    while ancestor:
        first = int(model.body_jntadr[ancestor])
        chain += reversed(range(first, first + int(model.body_jntnum[ancestor])))
        ancestor = int(model.body_parentid[ancestor])
    hinges = {model.joint(j).name: j for j in chain if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE}
    is_free = any(model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE for j in chain)
    if isinstance(axis, str) and axis in hinges:
        return hinges[axis], _level(data.xaxis[hinges[axis]], f"hinge {axis!r}")
    vector = _three_numbers(NAMED.get(axis, axis) if isinstance(axis, str) else axis)
    if vector is None or not np.linalg.norm(vector) > 1e-9:
        raise InputError(
            f"--axis {axis}: must be x, y, three numbers that are not all 0, or a hinge that carries the body; "
            f"{nearest(str(axis), hinges, 'its hinges')}"
        )
    vector /= np.linalg.norm(vector)
    direction = _level(data.xmat[body].reshape(3, 3) @ vector, f"--axis {axis}")
    if is_free:
        return None, direction
    joint = next((j for j in hinges.values() if abs(float(data.xaxis[j] @ direction)) > PARALLEL), None)
    if joint is None:
        raise InputError(
            f"--axis {axis}: body {model.body(body).name!r} has no hinge along it, and the body is not free; "
            f"its hinges: {', '.join(hinges) or 'none'} (--free-base lets it stand on the floor)"
        )
    return joint, _level(data.xaxis[joint] * np.sign(data.xaxis[joint] @ direction), f"--axis {axis}")


def _level(direction: np.ndarray, what: str) -> np.ndarray:
    """Make a direction exactly horizontal, if it nearly is."""
    steep = math.degrees(math.asin(min(1.0, abs(float(direction @ UP)))))
    if steep > LEVEL_DEG:
        word = "along gravity" if steep > 90.0 - LEVEL_DEG else f"{steep:.3g} deg steep"
        raise InputError(f"{what}: lies {word} where the robot stands; a robot tilts about a horizontal line")
    level = direction - (direction @ UP) * UP
    return level / np.linalg.norm(level)

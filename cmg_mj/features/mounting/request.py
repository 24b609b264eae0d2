"""The arguments of `mount`, checked before a file is read, and the axis that they name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError, nearest
from cmg_mj.plant.elements import subtree
from cmg_mj.plant.mjcf import posed
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


def _three_numbers(value: AxisLike) -> np.ndarray | None:
    parts = value.replace(",", " ").split() if isinstance(value, str) else value
    try:
        vector = np.array([float(part) for part in parts])
    except (TypeError, ValueError):
        return None
    return vector if vector.shape == (3,) and np.isfinite(vector).all() else None


class Place(NamedTuple):
    """The place of the modules on a robot, and the line that it tilts about."""

    joint: str
    """The hinge that the robot tilts about, or its free joint."""
    free: bool
    direction: np.ndarray
    """Approximate direction of the line in the world, (3,)."""
    middle: np.ndarray
    """Middle of the row of modules in the body frame, (3,) [m]."""


def find_place(model: mujoco.MjModel, pose: np.ndarray, request: MountRequest) -> Place:
    """Find the requested axis and position on a robot.

    Args:
        model: The robot.
        pose: Joint positions, (nq,).
        request: The body, the axis, the position of the modules.

    Returns:
        The place of the modules. Of a body that is free, a direction names no hinge.

    Raises:
        InputError: The body has no mass, there is no such hinge, or the axis is not horizontal.
    """
    axis, body, data = request.axis, model.body(request.body).id, posed(model, pose)
    if not model.body_mass[body] > 0.0:
        heavy = [model.body(part).name for part in subtree(model, body) if model.body_mass[part] > 0.0]
        names = ", ".join(heavy) or "none"
        raise InputError(f"--body {request.body}: has no mass of its own; the bodies with mass on it: {names}")
    point = None if request.position is None else _three_numbers(request.position)
    middle = model.body_ipos[body].copy() if point is None else point
    chain, ancestor = [], body  # the joints between the body and the world, the nearest first
    while ancestor:
        first = model.body_jntadr[ancestor]
        chain += [model.joint(j) for j in reversed(range(first, first + model.body_jntnum[ancestor]))]
        ancestor = model.body_parentid[ancestor]
    hinges = {joint.name: joint.id for joint in chain if joint.type[0] == mujoco.mjtJoint.mjJNT_HINGE}
    if isinstance(axis, str) and axis in hinges:
        return Place(axis, False, _level(data.xaxis[hinges[axis]], f"hinge {axis!r}"), middle)
    vector = _three_numbers(NAMED.get(axis, axis) if isinstance(axis, str) else axis)
    if vector is None or not np.linalg.norm(vector) > 1e-9:
        raise InputError(
            f"--axis {axis}: must be x, y, three numbers that are not all 0, or a hinge that carries the body; "
            f"{nearest(str(axis), hinges, 'its hinges')}"
        )
    vector /= np.linalg.norm(vector)
    direction = _level(data.xmat[body].reshape(3, 3) @ vector, f"--axis {axis}")
    if chain and chain[-1].type[0] == mujoco.mjtJoint.mjJNT_FREE:  # only a child of the world is free
        return Place(chain[-1].name, True, direction, middle)
    for name, joint in hinges.items():
        along = data.xaxis[joint] @ direction
        if abs(along) > PARALLEL:
            return Place(name, False, _level(data.xaxis[joint] * np.sign(along), f"--axis {axis}"), middle)
    raise InputError(
        f"--axis {axis}: body {request.body!r} has no hinge along it, and the body is not free; its hinges: "
        f"{', '.join(hinges) or 'none'} (--free-base lets it stand on the floor)"
    )


def _level(direction: np.ndarray, what: str) -> np.ndarray:
    """Make a direction exactly horizontal, if it nearly is."""
    steep = math.degrees(math.asin(min(1.0, abs(direction @ UP))))
    if steep > LEVEL_DEG:
        word = "along gravity" if steep > 90.0 - LEVEL_DEG else f"{steep:.3g} deg steep"
        raise InputError(f"{what}: lies {word} where the robot stands; a robot tilts about a horizontal line")
    level = direction - (direction @ UP) * UP
    return level / np.linalg.norm(level)

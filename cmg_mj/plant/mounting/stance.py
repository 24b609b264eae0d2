"""Where a robot stands upright: its mass above the hinge, or above what it stands on."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.errors import InputError
from cmg_mj.plant.checks import TRUE_DEG
from cmg_mj.plant.mjcf import compile_model
from cmg_mj.plant.mounting.attach import place_cubes
from cmg_mj.plant.mounting.axes import hinge_or_direction
from cmg_mj.plant.mounting.keyframes import as_qpos
from cmg_mj.plant.mounting.request import MountRequest
from cmg_mj.plant.mounting.settling import UP, Support, stand

SMALLEST_HEIGHT_M = 1e-3
"""Less far above the line a robot's mass is not above it [m]."""
MOST_TRIES = 5
"""So often a robot is put on the floor, its modules turned along the line that it then stands on."""


class Place(NamedTuple):
    """Where on a robot modules go, and about what it tilts."""

    joint: str
    """The hinge that it tilts about, or its free joint."""
    free: bool
    direction: np.ndarray
    """Along the line, nearly, in the world, (3,)."""
    middle: np.ndarray
    """Of the row of modules, in the body's frame, (3,) [m]."""


def find_place(model: mujoco.MjModel, pose: np.ndarray, asked: MountRequest, path: Path) -> Place:
    """Look up what is asked for on a robot.

    Args:
        model: The robot.
        pose: Where its joints stand, (nq,).
        asked: The body, the axis, the place of the modules.
        path: The file, for messages.

    Returns:
        Where they go.

    Raises:
        InputError: The body has no mass, or there is no such axis.
    """
    body = model.body(asked.body).id
    if not model.body_subtreemass[body] > 0.0:
        raise InputError(f"--body {asked.body}: {path}: has no mass, nor has anything on it")
    hinge, direction = hinge_or_direction(model, posed(model, pose), body, asked.axis, path)
    joint = int(model.body_jntadr[int(model.body_rootid[body])]) if hinge is None else hinge  # the free one
    middle = model.body_ipos[body].copy() if asked.at is None else np.array(asked.at, dtype=float)
    return Place(model.joint(joint).name, hinge is None, direction, middle)


def stand_upright(
    spec: mujoco.MjSpec,
    poses: dict[str, np.ndarray],
    place: Place,
    mounts: Sequence[mujoco.MjsFrame],
    others: Sequence[str],
    asked: MountRequest,
    path: Path,
) -> tuple[mujoco.MjModel, Support]:
    """Place the modules along the line, and stand the robot up with them.

    What it stands on says better how the line lies than what was asked for, and modules along another line stand
    otherwise: it is put down until both agree.

    Args:
        spec: The robot with its modules, all joints held that are to be; the modules are placed in it.
        poses: Where its joints are at first, by name.
        place: Where the modules go.
        mounts: What each module hangs on.
        others: The hinges of other axes, which are to stand upright too.
        asked: The body, the modules' scale.
        path: The file, for messages.

    Returns:
        The model, compiled, and where it stands.

    Raises:
        InputError: It cannot stand upright, or stands by itself.
    """
    model = compile_model(spec, path)
    support, stood = Support(as_qpos(model, poses), np.zeros(3), place.direction), False
    for left in reversed(range(MOST_TRIES + 1)):
        turn = posed(model, support.pose).xmat[model.body(asked.body).id].reshape(3, 3)
        along = place_cubes(mounts, place.middle, turn.T @ axes_along(support.direction), asked.scale)
        if along and stood:
            break
        model = compile_model(spec, path)
        if not place.free:
            return model, _all_balanced(model, support, place.joint, others, path)
        if left:
            joint = model.joint(place.joint).id
            support, stood = stand(model, support.pose, joint, support.direction, path), True
    return model, support


def _all_balanced(model: mujoco.MjModel, start: Support, hinge: str, others: Sequence[str], path: Path) -> Support:
    """Turn the line's hinge, and those of other axes, so that the mass on each is above it."""
    line = model.joint(hinge).id
    pose = start.pose
    for joint in [*(model.joint(other).id for other in others), line] * (2 if others else 0):
        direction = start.direction if joint == line else posed(model, pose).xaxis[joint].copy()
        pose = _balanced(model, pose, joint, direction, path).pose  # which moves what another carries
    return _balanced(model, pose, line, start.direction, path)


def check_unturned(
    model: mujoco.MjModel, poses: Mapping[str, np.ndarray], qpos: np.ndarray, hinges: Sequence[str], path: Path
) -> None:
    """Where axes meet, the modules of one are square to its hinge as long as the others' hinges stay where they were.

    Raises:
        InputError: One has to turn for the robot to stand upright.
    """
    for name in hinges:
        turned = math.degrees(float(qpos[int(model.joint(name).qposadr[0])] - poses[name][0]))
        if abs(turned) > TRUE_DEG:
            raise InputError(
                f"{path}: to stand upright on all axes the hinge {name!r} has to turn by {turned:.3g} deg, and the "
                "modules of another axis would stand crooked: place the modules above both hinges (--at), or mount "
                "the first axis in a keyframe in which its mass is above both"
            )


def under_and_height(
    model: mujoco.MjModel, data: mujoco.MjData, joint: int, point: np.ndarray, direction: np.ndarray
) -> tuple[np.ndarray, float]:
    """The point of a line under a robot's mass, in the world (3,) [m], and how high the robot is above the line [m]."""
    root = int(model.jnt_bodyid[joint])
    under = point + ((data.subtree_com[root] - point) @ direction) * direction
    return under, _top(model, data, root) - float(point[2])


def axes_along(direction: np.ndarray) -> np.ndarray:
    """A line's axes in the world, by columns: y along it, z upward."""
    return np.stack([np.cross(direction, UP), direction, UP], axis=1)


def posed(model: mujoco.MjModel, qpos: np.ndarray) -> mujoco.MjData:
    """A model with its joints somewhere, after a forward pass."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    return data


def _balanced(model: mujoco.MjModel, qpos: np.ndarray, joint: int, direction: np.ndarray, path: Path) -> Support:
    """Turn a hinge so that the mass on it is above it."""
    data = posed(model, qpos)
    point = data.xanchor[joint].copy()
    arm = data.subtree_com[int(model.jnt_bodyid[joint])] - point
    radial = arm - (arm @ direction) * direction
    if float(np.linalg.norm(radial)) < SMALLEST_HEIGHT_M:
        raise InputError(
            f"{path}: the mass on the hinge {model.joint(joint).name!r} lies on its axis: there is nothing to balance"
        )
    lean = math.atan2(float(radial @ np.cross(direction, UP)), float(radial @ UP))
    sign = math.copysign(1.0, float(data.xaxis[joint] @ direction))
    address = int(model.jnt_qposadr[joint])
    upright = float(qpos[address]) - sign * lean
    low, high = model.jnt_range[joint]
    if model.jnt_limited[joint] and not low <= upright <= high:
        raise InputError(
            f"{path}: the hinge {model.joint(joint).name!r} would stand upright at {upright:.4g} rad, beyond its range "
            f"of {low:.4g} to {high:.4g}"
        )
    qpos = qpos.copy()
    qpos[address] = upright
    return Support(qpos, point, direction)


def _top(model: mujoco.MjModel, data: mujoco.MjData, root: int) -> float:
    """The highest point of all that a body carries [m]."""
    highest = -math.inf
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        while body not in (0, root):
            body = int(model.body_parentid[body])
        if body == root:
            centre, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
            turn = data.geom_xmat[geom].reshape(3, 3)
            middle = data.geom_xpos[geom] + turn @ centre
            highest = max(highest, float(middle[2] + np.abs(turn[2]) @ half))
    return highest

"""The upright stance of a robot: its mass above the hinge, or above its contacts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.features.mounting.attach import place_modules
from cmg_mj.features.mounting.axes import hinge_or_direction
from cmg_mj.features.mounting.keyframes import as_qpos
from cmg_mj.features.mounting.request import MountRequest
from cmg_mj.features.mounting.settling import Support, stand
from cmg_mj.plant.checks import TRUE_DEG
from cmg_mj.plant.mjcf import compile_model, posed
from cmg_mj.plant.tilt_line import UP

SMALLEST_HEIGHT_M = 1e-3
"""Smallest height of a robot's mass above the line [m]."""
MOST_TRIES = 5
"""Most rounds of settling on the floor and turning the modules along the contact line."""


class Place(NamedTuple):
    """The place of the modules on a robot, and the line that it tilts about."""

    joint: str
    """The hinge that the robot tilts about, or its free joint."""
    free: bool
    direction: np.ndarray
    """Approximate direction of the line in the world, (3,)."""
    middle: np.ndarray
    """Middle of the row of modules in the body frame, (3,) [m]."""


def find_place(model: mujoco.MjModel, pose: np.ndarray, request: MountRequest, path: Path) -> Place:
    """Find the requested axis and position on a robot.

    Args:
        model: The robot.
        pose: Joint positions, (nq,).
        request: The body, the axis, the position of the modules.
        path: The file, for messages.

    Returns:
        The place of the modules.

    Raises:
        InputError: The body has no mass, or there is no such axis.
    """
    body = model.body(request.body).id
    if not model.body_subtreemass[body] > 0.0:
        raise InputError(f"--body {request.body}: {path}: has no mass, nor has anything on it")
    hinge, direction = hinge_or_direction(model, posed(model, pose), body, request.axis, path)
    joint = int(model.body_jntadr[int(model.body_rootid[body])]) if hinge is None else hinge  # the free one
    middle = model.body_ipos[body].copy() if request.position is None else np.array(request.position, dtype=float)
    return Place(model.joint(joint).name, hinge is None, direction, middle)


def stand_upright(
    spec: mujoco.MjSpec,
    poses: dict[str, np.ndarray],
    place: Place,
    mounts: Sequence[mujoco.MjsFrame],
    others: Sequence[str],
    request: MountRequest,
    path: Path,
) -> tuple[mujoco.MjModel, Support]:
    """Place the modules along the line, and stand the robot up with them.

    The contacts determine the line better than the request, and modules along another line shift the contacts.
    The robot settles on the floor until both agree.

    Args:
        spec: The robot with its modules, all joints held that are to be; the modules are placed in it.
        poses: Where its joints are at first, by name.
        place: Where the modules go.
        mounts: The body that carries each module.
        others: The hinges of other axes, which are to stand upright too.
        request: The body, the modules' scale.
        path: The file, for messages.

    Returns:
        The compiled model and its support.

    Raises:
        InputError: The robot cannot stand upright, or stands by itself.
    """
    model = compile_model(spec, path)
    support, settled = Support(as_qpos(model, poses), np.zeros(3), place.direction), False
    for tries_left in reversed(range(MOST_TRIES + 1)):
        turn = posed(model, support.pose).xmat[model.body(request.body).id].reshape(3, 3)
        unchanged = place_modules(mounts, place.middle, turn.T @ axes_along(support.direction), request.scale)
        if unchanged and settled:
            break
        model = compile_model(spec, path)
        if not place.free:
            return model, _all_balanced(model, support, place.joint, others, path)
        if tries_left:
            joint = model.joint(place.joint).id
            support, settled = stand(model, support.pose, joint, support.direction, path), True
    return model, support


def _all_balanced(model: mujoco.MjModel, start: Support, hinge: str, others: Sequence[str], path: Path) -> Support:
    """Turn the hinges of all axes so that the mass on each hinge is above it."""
    line = model.joint(hinge).id
    pose = start.pose
    for joint in [*(model.joint(other).id for other in others), line] * (2 if others else 0):
        direction = start.direction if joint == line else posed(model, pose).xaxis[joint].copy()
        pose = _balanced(model, pose, joint, direction, path).pose  # which moves what another carries
    return _balanced(model, pose, line, start.direction, path)


def check_unturned(
    model: mujoco.MjModel, poses: Mapping[str, np.ndarray], qpos: np.ndarray, hinges: Sequence[str], path: Path
) -> None:
    """Check that no hinge turned: the modules of one axis are square to its hinge only while the other hinges rest.

    Raises:
        InputError: A hinge has to turn for the robot to stand upright.
    """
    for name in hinges:
        turned = math.degrees(float(qpos[int(model.joint(name).qposadr[0])] - poses[name][0]))
        if abs(turned) > TRUE_DEG:
            raise InputError(
                f"{path}: to stand upright on all axes the hinge {name!r} has to turn by {turned:.3g} deg, and the "
                "modules of another axis would stand crooked: place the modules above both hinges (--position), or "
                "mount the first axis in a keyframe in which its mass is above both"
            )


def under_and_height(
    model: mujoco.MjModel, data: mujoco.MjData, joint: int, point: np.ndarray, direction: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return the line's point under a robot's mass, in the world (3,) [m], and the robot's height above it [m]."""
    root = int(model.jnt_bodyid[joint])
    under = point + ((data.subtree_com[root] - point) @ direction) * direction
    return under, _top(model, data, root) - float(point[2])


def axes_along(direction: np.ndarray) -> np.ndarray:
    """Return a line's axes in the world, by columns: y along the line, z upward."""
    return np.stack([np.cross(direction, UP), direction, UP], axis=1)


def _balanced(model: mujoco.MjModel, qpos: np.ndarray, joint: int, direction: np.ndarray, path: Path) -> Support:
    """Turn a hinge so that the mass it carries is above it."""
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
    """Return the highest point of everything that a body carries [m]."""
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

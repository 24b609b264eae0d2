"""Settling of a free robot on the floor: kept from tilting until it rests, its contacts show the line."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.features.mounting.servos import rest_controls
from cmg_mj.plant.tilt_line import UP

LONGEST_S = 10.0
"""Longest time for a robot to come to rest [s]."""
AT_REST = 1e-4
"""Rates below which a robot rests [m/s, rad/s]."""
UPRIGHT_DEG = 0.005
"""Largest lean of the mass from above the line [deg]."""
MOST_ROUNDS = 40
"""Most rounds of resting and leaning; on flat tyres each takes an eighth off the lean."""
LARGEST_LEAN_DEG = 20.0
"""A robot whose mass lies farther from its line of support has fallen, whatever holds it [deg]."""
STANDS_DEG = 2.0
"""A robot that must lean so far before it falls stands by itself [deg]."""
LONG_M = 0.02
"""Contacts farther apart than this along the axis determine its direction [m]."""


class Support(NamedTuple):
    """The stance of a robot and the line that it stands on."""

    pose: np.ndarray
    """Joint positions, (nq,)."""
    point: np.ndarray
    """A point of the line, in the world (3,) [m]."""
    direction: np.ndarray
    """Direction of the line, horizontal, in the world (3,)."""


def stand(model: mujoco.MjModel, pose: np.ndarray, joint: int, direction: np.ndarray, path: Path) -> Support:
    """Let a free robot settle on the floor, its mass above a line through its contacts.

    Args:
        model: The robot with its modules, all joints held that are to be.
        pose: Joint positions at first, (nq,).
        joint: The robot's free joint.
        direction: Approximate direction of the line, horizontal, in the world. Contacts far apart determine the line
            better.
        path: The file, for messages.

    Returns:
        The stance and the line.

    Raises:
        InputError: The robot has nothing to stand on, falls over, or stands by itself.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    _keep_servos(model, data)
    mujoco.mj_forward(model, data)
    _touch_down(model, data, joint, path)
    leaned = 0.0
    for _ in range(MOST_ROUNDS):
        _rest(model, data, joint, direction, path)
        point, direction = _support(model, data, joint, direction, path)
        body = int(model.jnt_bodyid[joint])
        arm = data.subtree_com[body] - point
        lean = math.atan2(float(arm @ np.cross(direction, UP)), float(arm[2]))
        leaned += lean
        if abs(math.degrees(leaned)) > LARGEST_LEAN_DEG:
            raise InputError(
                f"{path}: falls over: where it stands its mass lies {abs(math.degrees(leaned)):.3g} deg beside the "
                "line that it tilts about; give a keyframe in which it stands"
            )
        if abs(math.degrees(lean)) < UPRIGHT_DEG:
            return Support(data.qpos.copy(), point, direction)
        _turn(model, data, joint, point, direction, lean)
    raise InputError(f"{path}: does not come to stand upright; give a keyframe in which it stands")


def _keep_servos(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Let position servos keep the joints where they are, and drive nothing else."""
    mujoco.mj_forward(model, data)
    data.act[:], data.ctrl[:] = rest_controls(model, data)


def _bodies_on(model: mujoco.MjModel, joint: int) -> np.ndarray:
    """Return which bodies hang on a free joint, (nbody,)."""
    root = int(model.jnt_bodyid[joint])
    return model.body_rootid == model.body_rootid[root]


def _touch_down(model: mujoco.MjModel, data: mujoco.MjData, joint: int, path: Path) -> None:
    """Lower or lift the robot until it touches the fixed world."""
    tree = _bodies_on(model, joint)
    robot = [geom for geom in range(model.ngeom) if tree[model.geom_bodyid[geom]]]
    floor = [geom for geom in range(model.ngeom) if model.body_weldid[model.geom_bodyid[geom]] == 0]
    gaps = [
        mujoco.mj_geomDistance(model, data, here, there, 100.0, None)
        for here in robot
        for there in floor
        if model.geom_contype[here] & model.geom_conaffinity[there]
        or model.geom_contype[there] & model.geom_conaffinity[here]
    ]
    if not gaps or model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CONTACT):
        raise InputError(
            f"{path}: has nothing to stand on: no geom of the robot's collides with one of the world's; give it a "
            'floor (<geom type="plane" size="5 5 0.1"/> in the worldbody), and let contacts be on'
        )
    data.qpos[model.jnt_qposadr[joint] + 2] -= min(gaps)
    mujoco.mj_forward(model, data)
    # A contact with a margin already pushes at a distance: a robot let down farther is thrown up.
    depths = [
        contact.includemargin - contact.dist
        for contact in data.contact[: data.ncon]
        if tree[model.geom_bodyid[contact.geom1]] != tree[model.geom_bodyid[contact.geom2]] and contact.includemargin
    ]
    data.qpos[model.jnt_qposadr[joint] + 2] += max(depths, default=0.0)
    mujoco.mj_forward(model, data)


def _rest(model: mujoco.MjModel, data: mujoco.MjData, joint: int, direction: np.ndarray, path: Path) -> None:
    """Let the robot come to rest, kept from tilting by a torque that vanishes where its mass is above the line."""
    body, dof = int(model.jnt_bodyid[joint]), int(model.jnt_dofadr[joint])
    mass = float(model.body_subtreemass[body])
    height = max(float(data.subtree_com[body][2] - data.xipos[body][2] + 1.0), 0.1)
    stiffness = 20.0 * mass * float(np.linalg.norm(model.opt.gravity)) * height
    damping = 2.0 * math.sqrt(stiffness * mass * height**2)
    drag = mass * 2.0
    start = data.xquat[body].copy()
    steps = math.ceil(LONGEST_S / model.opt.timestep)
    for step in range(steps):
        off = np.empty(3)
        mujoco.mju_subQuat(off, start, data.xquat[body])  # in the body's axes
        turn = data.xmat[body].reshape(3, 3)
        along = turn.T @ direction
        torque = along * (stiffness * (off @ along) - damping * (data.qvel[dof + 3 : dof + 6] @ along))
        data.qfrc_applied[dof : dof + 3] = -drag * data.qvel[dof : dof + 3]
        data.qfrc_applied[dof + 3 : dof + 6] = torque
        mujoco.mj_step(model, data)
        if not np.isfinite(data.qpos).all():
            raise InputError(f"{path}: its physics fails while it settles on the floor")
        if step * model.opt.timestep > 0.3 and np.abs(data.qvel).max() < AT_REST:
            break
    mujoco.mj_forward(model, data)
    turned = np.empty(3)
    mujoco.mju_subQuat(turned, data.xquat[body], start)
    if math.degrees(float(np.linalg.norm(turned))) > LARGEST_LEAN_DEG:
        raise InputError(
            f"{path}: falls over while it settles, by {math.degrees(float(np.linalg.norm(turned))):.3g} deg, about "
            "another line than the one that is balanced; give a keyframe in which it stands"
        )


def _support(
    model: mujoco.MjModel, data: mujoco.MjData, joint: int, direction: np.ndarray, path: Path
) -> tuple[np.ndarray, np.ndarray]:
    """Return the middle of the contacts, (3,) [m], and the direction of their line, (3,)."""
    tree = _bodies_on(model, joint)
    points, loads = [], []
    for i in range(data.ncon):
        contact = data.contact[i]
        bodies = model.geom_bodyid[[contact.geom1, contact.geom2]]
        force = np.zeros(6)
        mujoco.mj_contactForce(model, data, i, force)
        if tree[bodies].any() and not tree[bodies].all() and force[0] > 0.0:
            points.append(contact.pos.copy())
            loads.append(force[0])
    if not points:
        raise InputError(f"{path}: does not come to rest on anything")
    places = np.array(points)
    middle = np.average(places, axis=0, weights=loads)
    along = _longest_direction(places - middle, np.array(loads), direction)
    if float(np.ptp(places @ along)) > LONG_M and float(along @ direction) > math.cos(math.radians(LARGEST_LEAN_DEG)):
        direction = along
    width = float(np.ptp(places @ np.cross(direction, UP)))
    height = float(data.subtree_com[int(model.jnt_bodyid[joint])][2] - middle[2])
    if math.degrees(math.atan2(0.5 * width, max(height, 1e-9))) > STANDS_DEG:
        raise InputError(
            f"{path}: stands by itself: its support is {width:.3g} m wide across the axis; a pair balances a robot "
            "that stands on a line or a point (another --axis?)"
        )
    return middle, direction


def _longest_direction(arms: np.ndarray, loads: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return the horizontal direction in which loads lie farthest apart, (3,), to the side of the given one.

    It is the principal axis of the loads. A line through the two contacts farthest apart would go through opposite
    corners of flat tyres.
    """
    level = arms[:, :2]
    axis = np.append(np.linalg.eigh(level.T @ (loads[:, None] * level))[1][:, 1], 0.0)
    return axis * math.copysign(1.0, float(axis @ direction))


def _turn(
    model: mujoco.MjModel, data: mujoco.MjData, joint: int, point: np.ndarray, direction: np.ndarray, lean: float
) -> None:
    """Turn the robot back about the line by the angle that its mass leans, and stop it."""
    address = int(model.jnt_qposadr[joint])
    quaternion = np.empty(4)
    mujoco.mju_axisAngle2Quat(quaternion, direction, -lean)
    moved, turned = np.empty(3), np.empty(4)
    mujoco.mju_rotVecQuat(moved, data.qpos[address : address + 3] - point, quaternion)
    mujoco.mju_mulQuat(turned, quaternion, data.qpos[address + 3 : address + 7])
    data.qpos[address : address + 3], data.qpos[address + 3 : address + 7] = point + moved, turned
    data.qvel[:] = 0.0
    mujoco.mj_forward(model, data)

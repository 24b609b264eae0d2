"""Joints that nobody holds, held where they stand."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Literal

import mujoco
import numpy as np

from cmg_mj.errors import InputError, nearest
from cmg_mj.plant.mounting.element_names import free_name
from cmg_mj.plant.mounting.servos import holds

Hold = Literal["constraints", "servos"]
IMPEDANCE = 0.9999
"""Of a constraint that holds a joint, MuJoCo's largest. What it lacks of 1 is the share of every acceleration that the
joint gives way by: with MuJoCo's default of 0.9 to 0.95 a trunk on its waist jerks with every change of the command,
and its accelerometers show that as tilt."""
SAME_PLACE = 1e-3
"""A joint so near is where a constraint holds it [rad, m]: files have six digits."""


def held_name(joint: str) -> str:
    """What the constraint that holds a joint is called."""
    return f"{joint}_held"


def joint_held(spec: mujoco.MjSpec, tie: mujoco.MjsEquality) -> str:
    """The joint that an equality constraint holds where it stands, as an earlier mount's does; "" for any other.

    Whatever it is called: it is on, and of one joint alone, or of a ball's body with the one that this hangs on.
    """
    if not tie.active:
        return ""
    if int(tie.type) == int(mujoco.mjtEq.mjEQ_JOINT):
        return "" if tie.name2 else tie.name1
    body = spec.body(tie.name2) if tie.name2 else None
    if int(tie.type) != int(mujoco.mjtEq.mjEQ_WELD) or body is None or body.parent is None:
        return ""
    balls = [joint.name for joint in body.joints if int(joint.type) == int(mujoco.mjtJoint.mjJNT_BALL)]
    of_bodies = int(tie.objtype) == int(mujoco.mjtObj.mjOBJ_BODY) and tie.name1 == body.parent.name
    return balls[0] if of_bodies and len(balls) == len(body.joints) == 1 else ""


def _check_stands(model: mujoco.MjModel, pose: np.ndarray, name: str, tie: mujoco.MjsEquality, path: Path) -> None:
    """See that a constraint of the file's holds a joint where the robot is to stand, not elsewhere."""
    address = int(model.joint(name).qposadr[0])
    at, stands = float(model.qpos0[address] + tie.data[0]), float(pose[address])
    if int(tie.type) == int(mujoco.mjtEq.mjEQ_JOINT) and abs(at - stands) > SAME_PLACE:
        raise InputError(
            f"{path}: equality {tie.name!r} holds the joint {name!r} at {at:.4g}, and the robot is to stand with it at "
            f"{stands:.4g}: give a --keyframe that has it there, or take the equality out of the file"
        )


def hold_joints(
    spec: mujoco.MjSpec,
    model: mujoco.MjModel,
    pose: np.ndarray,
    how: Hold,
    moving: Collection[str],
    loose: Collection[str],
    path: Path,
) -> list[str]:
    """Tie every joint to where it stands, by an equality constraint.

    Args:
        spec: The model, which is changed.
        model: The same, compiled.
        pose: Where the joints stand, (nq,).
        how: `constraints`: all joints; `servos`: those that no actuator of the robot's drives.
        moving: Joints that tilt the robot, and those of modules: they are left alone, or let go if they were held.
        loose: Joints that the user wants free.
        path: The file, for messages.

    Returns:
        The joints that are held so.

    Raises:
        InputError: A joint to be left free does not exist, or the file holds one elsewhere.
    """
    names = [model.joint(i).name for i in range(model.njnt)]
    for name in loose:
        if name not in names:
            raise InputError(f"--free {name}: {path} has no such joint; {nearest(name, names, 'its joints')}")
    own = [actuator.target for actuator in spec.actuators if holds(actuator)] if how == "servos" else []
    ties = {joint: tie for tie in spec.equalities if (joint := joint_held(spec, tie))}
    already = set(ties)
    for name in already & {*moving, *loose}:
        if ties[name].name.startswith(held_name(name)):  # the user's own is the user's
            spec.delete(ties[name])
    for name in already - {*moving, *loose}:
        _check_stands(model, pose, name, ties[name], path)
    taken = {tie.name for tie in spec.equalities}
    held = [name for name in names if name not in {*moving, *loose, *own, *already}]
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_kinematics(model, data)
    for name in held:
        joint = model.joint(name)
        kind = int(joint.type[0])
        if kind == int(mujoco.mjtJoint.mjJNT_FREE):
            raise InputError(
                f"{path}: body {model.body(int(joint.bodyid[0])).name!r} is free and carries no pair: give --free "
                f"{name} if it is to move"
            )
        if kind == int(mujoco.mjtJoint.mjJNT_BALL):
            body = int(joint.bodyid[0])
            parent = int(model.body_parentid[body])
            turn = data.xmat[parent].reshape(3, 3).T
            relative = np.empty(4)
            inverse = data.xquat[parent] * [1.0, -1.0, -1.0, -1.0]
            mujoco.mju_mulQuat(relative, inverse, data.xquat[body])
            tie = spec.add_equality(
                name=free_name(held_name(name), taken),
                type=mujoco.mjtEq.mjEQ_WELD,
                active=True,
                objtype=mujoco.mjtObj.mjOBJ_BODY,
                name1=model.body(parent).name,
                name2=model.body(body).name,
            )
            at = turn @ (data.xpos[body] - data.xpos[parent])
            tie.data[:11] = [0.0, 0.0, 0.0, *at, *relative, 1.0]
        else:
            tie = spec.add_equality(
                name=free_name(held_name(name), taken),
                type=mujoco.mjtEq.mjEQ_JOINT,
                active=True,
                objtype=mujoco.mjtObj.mjOBJ_JOINT,
                name1=name,
            )
            address = int(joint.qposadr[0])
            tie.data[:] = 0.0
            tie.data[0] = pose[address] - model.qpos0[address]
        tie.solimp[:2] = IMPEDANCE
    return held

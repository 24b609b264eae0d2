"""Joints that nobody holds, held where they stand."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Literal

import mujoco
import numpy as np

from cmg_mj.errors import InputError, nearest

Hold = Literal["constraints", "servos"]
IMPEDANCE = 0.9999
"""Of a constraint that holds a joint, MuJoCo's largest. What it lacks of 1 is the share of every acceleration that the
joint gives way by: with MuJoCo's default of 0.9 to 0.95 a trunk on its waist jerks with every change of the command,
and its accelerometers show that as tilt."""


def held_name(joint: str) -> str:
    """What the constraint that holds a joint is called."""
    return f"{joint}_held"


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
        InputError: A joint to be left free does not exist.
    """
    names = [model.joint(i).name for i in range(model.njnt)]
    for name in loose:
        if name not in names:
            raise InputError(f"--free {name}: {path} has no such joint; {nearest(name, names, 'its joints')}")
    own = [actuator.target for actuator in spec.actuators] if how == "servos" else []
    already = [name for name in names if spec.equality(held_name(name))]
    for name in already:
        if name in {*moving, *loose}:
            spec.delete(spec.equality(held_name(name)))
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
                name=held_name(name),
                type=mujoco.mjtEq.mjEQ_WELD,
                objtype=mujoco.mjtObj.mjOBJ_BODY,
                name1=model.body(parent).name,
                name2=model.body(body).name,
            )
            at = turn @ (data.xpos[body] - data.xpos[parent])
            tie.data[:11] = [0.0, 0.0, 0.0, *at, *relative, 1.0]
        else:
            tie = spec.add_equality(
                name=held_name(name), type=mujoco.mjtEq.mjEQ_JOINT, objtype=mujoco.mjtObj.mjOBJ_JOINT, name1=name
            )
            address = int(joint.qposadr[0])
            tie.data[:] = 0.0
            tie.data[0] = pose[address] - model.qpos0[address]
        tie.solimp[:2] = IMPEDANCE
    return held

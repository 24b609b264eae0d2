"""What holds a robot where it stands: constraints on its joints, its own servos, the keyframe of a run."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Literal

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError, nearest
from cmg_mj.plant.elements import EQUILIBRIUM_KEY, ON_A_JOINT, joint_sizes
from cmg_mj.plant.mujoco_state import posed

_LINEAR = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtGain.mjGAIN_AFFINE)
_INTEGRATOR = int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
_FILTERS = int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT)


def holds(actuator: mujoco.MjsActuator) -> bool:
    """Return whether an actuator is a position servo of a joint: its force depends on the joint's position."""
    return int(actuator.trntype) in ON_A_JOINT and _pulls_back(int(actuator.biastype), actuator.biasprm)


def rest_controls(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[np.ndarray, np.ndarray]:
    """Return the controls and filter states with which position servos exert no force where they are.

    The force of a servo of gain k is k a + b0 + b1 l. Its length l is the gear times the joint's position, and a is its
    control, or the state of its filter or integrator.

    Args:
        model: The robot.
        data: The same where it is to be held, after a forward pass.

    Returns:
        act (na,) and ctrl (nu,); 0 for other actuators.
    """
    act, ctrl = np.zeros(model.na), np.zeros(model.nu)
    for i in range(model.nu):
        bias, kind = model.actuator_biasprm[i], int(model.actuator_gaintype[i])
        if not _pulls_back(int(model.actuator_biastype[i]), bias) or kind not in _LINEAR:
            continue
        length = float(data.actuator_length[i])
        gain = float(model.actuator_gainprm[i, 0])
        if kind == int(mujoco.mjtGain.mjGAIN_AFFINE):
            gain += float(model.actuator_gainprm[i, 1]) * length
        if gain == 0.0:
            continue
        target, dynamics = -(float(bias[0]) + float(bias[1]) * length) / gain, int(model.actuator_dyntype[i])
        state = int(model.actuator_actadr[i])
        if dynamics == _INTEGRATOR:
            act[state] = target
        elif dynamics in _FILTERS:
            act[state] = ctrl[i] = target
        elif state < 0:
            ctrl[i] = target
    return act, ctrl


def _pulls_back(kind: int, bias: np.ndarray) -> bool:
    return kind == int(mujoco.mjtBias.mjBIAS_AFFINE) and bool(bias[1] != 0.0)


Hold = Literal["constraints", "servos"]
IMPEDANCE = 0.9999
"""Impedance of a constraint that holds a joint, MuJoCo's largest. A held joint still follows the share 1 - IMPEDANCE
of every acceleration. With MuJoCo's default of 0.9 to 0.95 a trunk on its waist jerks with every change of the command,
and its accelerometers show that as tilt."""
SAME_PLACE = 1e-3
"""Largest distance of a joint from where a constraint of the file holds it [rad, m]; files have six digits."""


def unused_name(name: str, names: Collection[str]) -> str:
    """Return the name, or the first of `name_2`, `name_3`, ... that is not taken."""
    number, candidate = 1, name
    while candidate in names:
        number += 1
        candidate = f"{name}_{number}"
    return candidate


def constraint_name(joint: str) -> str:
    """Return the name of the constraint that holds a joint."""
    return f"{joint}_held"


def joint_held(spec: mujoco.MjSpec, tie: mujoco.MjsEquality) -> str:
    """Return the joint that an equality constraint holds, as an earlier mount's does; "" for any other constraint.

    Such a constraint is active, and is of one joint alone, or welds a ball joint's body to its parent.
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
    """Check that a constraint of the file holds a joint where the robot is to stand."""
    address = int(model.joint(name).qposadr[0])
    target, stands = float(model.qpos0[address] + tie.data[0]), float(pose[address])
    if int(tie.type) == int(mujoco.mjtEq.mjEQ_JOINT) and abs(target - stands) > SAME_PLACE:
        raise InputError(
            f"{path}: equality {tie.name!r} holds the joint {name!r} at {target:.4g}, and the robot is to stand with "
            f"it at {stands:.4g}: give a --keyframe that has it there, or take the equality out of the file"
        )


def hold_joints(
    spec: mujoco.MjSpec,
    model: mujoco.MjModel,
    pose: np.ndarray,
    hold: Hold,
    moving: Collection[str],
    released: Collection[str],
    path: Path,
) -> list[str]:
    """Hold every joint where it stands, by an equality constraint.

    Args:
        spec: The model, which is changed.
        model: The same, compiled.
        pose: Joint positions, (nq,).
        hold: `constraints`: all joints; `servos`: those that no servo of the robot's holds.
        moving: Joints that tilt the robot, and those of modules. They stay free, or are released if they were held.
        released: Joints that the user wants free.
        path: The file, for messages.

    Returns:
        The joints that a new constraint holds.

    Raises:
        InputError: A joint to release does not exist, or the file holds a joint elsewhere.
    """
    names = [model.joint(i).name for i in range(model.njnt)]
    for name in released:
        if name not in names:
            raise InputError(f"--release {name}: {path} has no such joint; {nearest(name, names, 'its joints')}")
    on_servos = [actuator.target for actuator in spec.actuators if holds(actuator)] if hold == "servos" else []
    ties = {joint: tie for tie in spec.equalities if (joint := joint_held(spec, tie))}
    already, free = set(ties), {*moving, *released}
    for name in already & free:
        if ties[name].name.startswith(constraint_name(name)):  # the user's own is the user's
            spec.delete(ties[name])
    for name in already - free:
        _check_stands(model, pose, name, ties[name], path)
    tie_names = {tie.name for tie in spec.equalities}
    held = [name for name in names if name not in {*free, *on_servos, *already}]
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_kinematics(model, data)
    for name in held:
        kind = int(model.joint(name).type[0])
        if kind == int(mujoco.mjtJoint.mjJNT_FREE):
            body = model.body(int(model.joint(name).bodyid[0])).name
            raise InputError(
                f"{path}: body {body!r} is free and carries no pair: give --release {name} if it is to move"
            )
        add = _weld_ball if kind == int(mujoco.mjtJoint.mjJNT_BALL) else _fix_joint
        tie = add(spec, model, data, name, unused_name(constraint_name(name), tie_names))
        tie.solimp[:2] = IMPEDANCE
    return held


def _weld_ball(
    spec: mujoco.MjSpec, model: mujoco.MjModel, data: mujoco.MjData, joint: str, name: str
) -> mujoco.MjsEquality:
    """Weld a ball joint's body to its parent, as they stand."""
    body = int(model.joint(joint).bodyid[0])
    parent = int(model.body_parentid[body])
    turn = data.xmat[parent].reshape(3, 3).T
    relative = np.empty(4)
    inverse = data.xquat[parent] * [1.0, -1.0, -1.0, -1.0]
    mujoco.mju_mulQuat(relative, inverse, data.xquat[body])
    tie = spec.add_equality(
        name=name,
        type=mujoco.mjtEq.mjEQ_WELD,
        active=True,
        objtype=mujoco.mjtObj.mjOBJ_BODY,
        name1=model.body(parent).name,
        name2=model.body(body).name,
    )
    place = turn @ (data.xpos[body] - data.xpos[parent])
    tie.data[:11] = [0.0, 0.0, 0.0, *place, *relative, 1.0]
    return tie


def _fix_joint(
    spec: mujoco.MjSpec, model: mujoco.MjModel, data: mujoco.MjData, joint: str, name: str
) -> mujoco.MjsEquality:
    """Fix a hinge or a slide where it stands."""
    tie = spec.add_equality(
        name=name, type=mujoco.mjtEq.mjEQ_JOINT, active=True, objtype=mujoco.mjtObj.mjOBJ_JOINT, name1=joint
    )
    address = int(model.joint(joint).qposadr[0])
    tie.data[:] = 0.0
    tie.data[0] = data.qpos[address] - model.qpos0[address]
    return tie


Poses = Mapping[str, np.ndarray]
"""Joint -> its position in qpos."""


def poses_of(model: mujoco.MjModel, qpos: np.ndarray) -> dict[str, np.ndarray]:
    """Return the position of each joint of a compiled model, by its name."""
    poses = {}
    for i in range(model.njnt):
        address = int(model.jnt_qposadr[i])
        poses[model.joint(i).name] = qpos[address : address + joint_sizes(int(model.jnt_type[i]))[0]].copy()
    return poses


def as_qpos(model: mujoco.MjModel, poses: Poses) -> np.ndarray:
    """Return poses as a vector qpos, with the model's reference for joints that have none."""
    qpos = model.qpos0.copy()
    for name, values in poses.items():
        address = int(model.joint(name).qposadr[0])
        qpos[address : address + len(values)] = values
    return qpos


def write_keyframe(
    spec: mujoco.MjSpec,
    model: mujoco.MjModel,
    name: str,
    qpos: np.ndarray,
    speeds: Mapping[str, float],
    ctrl: Mapping[str, float],
) -> None:
    """Write a keyframe in which the robot stands and its flywheels turn.

    Args:
        spec: The model, which gets the keyframe.
        model: The same, compiled.
        name: Name of the keyframe.
        qpos: Joint positions, (nq,).
        speeds: Joint -> speed, for those that turn [rad/s].
        ctrl: Actuator -> control. Other position servos hold their joints in place.
    """
    qvel, (act, controls) = np.zeros(model.nv), rest_controls(model, posed(model, qpos))
    for joint, speed in speeds.items():
        qvel[int(model.joint(joint).dofadr[0])] = speed
    for i in range(model.nu):
        controls[i] = ctrl.get(model.actuator(i).name, controls[i])
    spec.add_key(name=name, qpos=qpos, qvel=qvel, act=act, ctrl=controls)


def pop_keyframes(spec: mujoco.MjSpec, model: mujoco.MjModel) -> list[tuple[str, dict[str, np.ndarray]]]:
    """Remove a robot's own keyframes before it gets more joints, and return their names and poses."""
    keyframes = [(model.key(i).name, poses_of(model, model.key_qpos[i])) for i in range(model.nkey)]
    # The equilibrium of an axis mounted earlier is written anew.
    keyframes = [(name, poses) for name, poses in keyframes if name != EQUILIBRIUM_KEY]
    for key in list(spec.keys):
        spec.delete(key)
    return keyframes

"""What holds a robot where it stands: constraints on its joints, its own servos, the keyframe of a run."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError, nearest
from cmg_mj.features.mounting.request import MountRequest
from cmg_mj.plant.elements import ON_A_JOINT
from cmg_mj.plant.mjcf import posed

_FILTERS = mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT


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
        bias, (gain, slope), kind = model.actuator_biasprm[i], model.actuator_gainprm[i, :2], model.actuator_gaintype[i]
        length, state = data.actuator_length[i], model.actuator_actadr[i]
        if kind == mujoco.mjtGain.mjGAIN_AFFINE:
            gain += slope * length
        elif kind != mujoco.mjtGain.mjGAIN_FIXED:
            continue
        if not _pulls_back(model.actuator_biastype[i], bias) or gain == 0.0:
            continue
        target, dynamics = -(bias[0] + bias[1] * length) / gain, int(model.actuator_dyntype[i])
        if state < 0 or dynamics in _FILTERS:
            ctrl[i] = target
        if dynamics in (mujoco.mjtDyn.mjDYN_INTEGRATOR, *_FILTERS):
            act[state] = target
    return act, ctrl


def _pulls_back(kind: int, bias: np.ndarray) -> bool:
    """Return whether an actuator is a position servo: its force depends on the joint's position."""
    return kind == mujoco.mjtBias.mjBIAS_AFFINE and bool(bias[1] != 0.0)


IMPEDANCE = 0.9999
"""Impedance of a constraint that holds a joint, MuJoCo's largest. A held joint still follows the share 1 - IMPEDANCE
of every acceleration. With MuJoCo's default of 0.9 to 0.95 a trunk on its waist jerks with every change of the command,
and its accelerometers show that as tilt."""
SAME_PLACE = 1e-3
"""Largest distance from where a constraint of the file holds what it ties [rad, m]; files have six digits."""


def unused_name(name: str, names: Collection[str]) -> str:
    """Return the name, or the first of `name_2`, `name_3`, ... that is not taken."""
    number, candidate = 1, name
    while candidate in names:
        number += 1
        candidate = f"{name}_{number}"
    return candidate


def joint_held(spec: mujoco.MjSpec, tie: mujoco.MjsEquality) -> str:
    """Return the joint that an equality constraint holds, as an earlier mount's does; "" for any other constraint.

    Such a constraint is active, and is of one joint alone, or welds a ball joint's body to its parent.
    """
    if not tie.active:
        return ""
    if tie.type == mujoco.mjtEq.mjEQ_JOINT:
        return "" if tie.name2 else tie.name1
    body = spec.body(tie.name2) if tie.name2 and tie.type == mujoco.mjtEq.mjEQ_WELD else None
    if body is None or body.parent is None or tie.objtype != mujoco.mjtObj.mjOBJ_BODY or tie.name1 != body.parent.name:
        return ""
    is_ball = [joint.type for joint in body.joints] == [mujoco.mjtJoint.mjJNT_BALL]
    return body.joints[0].name if is_ball else ""


def hold_joints(
    spec: mujoco.MjSpec, model: mujoco.MjModel, pose: np.ndarray, request: MountRequest, moving: Collection[str]
) -> list[str]:
    """Hold every joint where it stands, by an equality constraint.

    Args:
        spec: The model, which is changed.
        model: The same, compiled.
        pose: Joint positions, (nq,).
        request: Whether servos of the robot's hold their joints, and the joints that the user wants free.
        moving: Joints that tilt the robot, and those of modules. They stay free, or are released if they were held.

    Returns:
        The joints that a new constraint holds.

    Raises:
        InputError: A joint to release does not exist, or the file holds a joint elsewhere.
    """
    poses = poses_of(model, pose)
    for name in request.release:
        if name not in poses:
            raise InputError(f"--release {name}: no such joint; {nearest(name, poses, 'its joints')}")
    working = [a for a in spec.actuators if not spec.option.disableactuator >> a.group & 1]
    servos = [a for a in working if a.trntype in ON_A_JOINT and _pulls_back(a.biastype, a.biasprm)]
    on_servos = [servo.target for servo in servos if request.hold == "servos"]
    free, ties, data = {*moving, *request.release}, set[str](), posed(model, pose)
    broken = (data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY) & (np.abs(data.efc_pos) > SAME_PLACE)
    for i, tie in enumerate(list(spec.equalities)):
        name = joint_held(spec, tie)
        ties.add(name)
        if name in free and tie.name.startswith(f"{name}_held"):  # the user's own is the user's
            spec.delete(tie)
        elif off := np.abs(data.efc_pos[broken & (data.efc_id == i)]).tolist():
            raise InputError(
                f"equality {tie.name!r} of {tie.name1!r} is off by {max(off):.4g} where the robot is to stand: give a "
                "--keyframe in which it is not, or take the equality out of the file"
            )
    tie_names = {tie.name for tie in spec.equalities}
    held = [name for name in poses if name not in {*free, *on_servos, *ties}]
    for name in held:
        kind = model.joint(name).type[0]
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            body = model.body(model.joint(name).bodyid[0]).name
            raise InputError(f"body {body!r} is free and carries no pair: give --release {name} if it is to move")
        if kind == mujoco.mjtJoint.mjJNT_BALL:
            tie = _weld_ball(spec, model, data, name)
        else:
            tie = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, objtype=mujoco.mjtObj.mjOBJ_JOINT, name1=name)
            tie.data[:] = 0.0
            tie.data[0] = data.joint(name).qpos[0] - model.joint(name).qpos0[0]
        tie.name, tie.active = unused_name(f"{name}_held", tie_names), True
        tie.solimp[:2] = IMPEDANCE
    return held


def _weld_ball(spec: mujoco.MjSpec, model: mujoco.MjModel, data: mujoco.MjData, joint: str) -> mujoco.MjsEquality:
    """Weld a ball joint's body to its parent, as they stand."""
    body = model.joint(joint).bodyid[0]
    parent = model.body_parentid[body]
    place, turn = relative_pose(data.body(body), data.xpos[parent], data.xquat[parent])
    tie = spec.add_equality(
        type=mujoco.mjtEq.mjEQ_WELD,
        objtype=mujoco.mjtObj.mjOBJ_BODY,
        name1=model.body(parent).name,
        name2=model.body(body).name,
    )
    tie.data[:11] = [0.0, 0.0, 0.0, *place, *turn, 1.0]
    return tie


def relative_pose(body: Any, position: np.ndarray, quaternion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the position and quaternion of a body's data in a frame of this position and quaternion."""
    back_pos, back_quat, place, turn = np.empty(3), np.empty(4), np.empty(3), np.empty(4)
    mujoco.mju_negPose(back_pos, back_quat, position, quaternion)
    mujoco.mju_mulPose(place, turn, back_pos, back_quat, body.xpos, body.xquat)
    return place, turn


def poses_of(model: mujoco.MjModel, qpos: np.ndarray) -> dict[str, np.ndarray]:
    """Return the position of each joint of a compiled model, by its name."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    return {model.joint(i).name: data.joint(i).qpos.copy() for i in range(model.njnt)}


def as_qpos(model: mujoco.MjModel, poses: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return poses as a vector qpos, with the model's reference for joints that have none."""
    data = mujoco.MjData(model)
    for name, values in poses.items():
        data.joint(name).qpos = values
    return data.qpos.copy()


def write_keyframe(
    spec: mujoco.MjSpec,
    model: mujoco.MjModel,
    name: str,
    qpos: np.ndarray,
    speeds: Mapping[str, float],
    own: mujoco.MjData | None = None,
) -> None:
    """Write a keyframe in which the robot stands and its flywheels turn; other position servos hold their joints.

    Args:
        spec: The model, which gets the keyframe.
        model: The same, compiled.
        name: Name of the keyframe.
        qpos: Joint positions, (nq,).
        speeds: Flywheel joint -> speed, which its motor holds [rad/s].
        own: The robot without the pair at a keyframe of its file, of which all but the pair's is kept.
    """
    data = posed(model, qpos)
    data.act[:], data.ctrl[:] = rest_controls(model, data)
    if own is not None:
        for i in range(own.model.njnt):
            data.joint(own.model.joint(i).name).qvel = own.joint(i).qvel
        data.act[: own.act.size], data.ctrl[: own.ctrl.size] = own.act, own.ctrl  # attached actuators come last
        data.time, data.mocap_pos, data.mocap_quat = own.time, own.mocap_pos, own.mocap_quat
    for joint, speed in speeds.items():
        data.joint(joint).qvel = data.actuator(f"{joint}_motor").ctrl = speed
    mocap = {"mpos": data.mocap_pos.ravel(), "mquat": data.mocap_quat.ravel()}
    spec.add_key(name=name, time=data.time, qpos=qpos, qvel=data.qvel, act=data.act, ctrl=data.ctrl, **mocap)

"""Hinges taken out of a rig: what a locked axis or thrust bearing is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError, nearest, shown
from cmg_mj.plant.axis import ResolvedModel
from cmg_mj.plant.elements import ON_A_JOINT, TILT_ELEMENT, joint_sizes
from cmg_mj.plant.mjcf import data_at_keyframe
from cmg_mj.plant.tilt_line import HingeLine, line_named
from cmg_mj.scenario.plant_settings import PlantSettings


def lock_thrust_bearing(spec: mujoco.MjSpec, path: Path) -> None:
    """Remove the yaw joint.

    Raises:
        InputError: There is no yaw joint.
    """
    if "yaw" not in [joint.name for joint in spec.joints]:
        raise InputError(f"plant.lock_thrust_bearing = true: {path} has no joint 'yaw' to lock")
    remove_hinge(spec, "yaw")


def lock_axes(spec: mujoco.MjSpec, rig: ResolvedModel, settings: PlantSettings) -> Callable[[mujoco.MjModel], None]:
    """Take the hinges of axes out, upright as they are at the keyframe.

    Args:
        spec: The parsed model, which is changed.
        rig: The same, compiled.
        settings: Which axes to lock.

    Returns:
        A finish that leaves the compiled model as it is.

    Raises:
        InputError: There is no such axis, it tilts about no hinge, or no axis is left.
    """
    axes, path, model, known = settings.locked_axes, rig.path, rig.model, rig.modules
    setting, data, hinges = f"plant.locked_axes = {shown(list(axes))}: {path}", data_at_keyframe(model, rig.key), []
    for axis in dict.fromkeys(axes):
        if axis not in known:
            names = nearest(axis, known, "its axes") if any(known) else "its only one has no name"
            raise InputError(f"{setting} has no axis {axis!r}; {names}")
        name = f"{axis}/{TILT_ELEMENT}".lstrip("/")
        line = line_named(model, data, name, rig.key)
        if not isinstance(line, HingeLine):
            raise InputError(f"{setting} tilts about {name!r} as a free body does; only a hinge can be locked")
        hinges.append(line)
    if len(hinges) == len(known):
        leave = ", ".join(map(repr, known))
        raise InputError(f"{setting} would have no axis left to tilt about; leave one of {leave}")
    for line in hinges:
        name = model.joint(line.joint).name
        angle = line.zero - model.qpos0[line.angle]
        if angle:
            if line.joint != model.body_jntadr[model.jnt_bodyid[line.joint]]:
                raise InputError(
                    f"{setting}: hinge {name!r} stands at {angle:g} rad at the keyframe, behind another joint of its "
                    "body; give it a body of its own"
                )
            _turn(spec.joint(name), angle)
        remove_hinge(spec, name)
    return lambda _: None


def _turn(hinge: Any, angle: float) -> None:
    """Turn the body of a hinge, its first joint, about it [rad]."""
    body = hinge.parent
    orientation = np.array(body.quat)
    if body.alt.type != mujoco.mjtOrientation.mjORIENTATION_QUAT:
        compiler = body.compiler
        orientation = np.array(
            mujoco.MjSpec.resolve_orientation(degree=compiler.degree, sequence=compiler.eulerseq, orientation=body.alt)
        )
        body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    orientation /= np.linalg.norm(orientation)
    turn, arm, place, both = np.empty(4), np.empty(3), np.empty(3), np.empty(4)
    point = np.array(hinge.pos)
    mujoco.mju_axisAngle2Quat(turn, np.array(hinge.axis) / np.linalg.norm(hinge.axis), angle)
    mujoco.mju_rotVecQuat(arm, point, turn)
    mujoco.mju_mulPose(place, both, np.array(body.pos), orientation, point - arm, turn)
    body.pos, body.quat = place, both


def remove_hinge(spec: mujoco.MjSpec, name: str) -> None:
    """Take a joint out, with what drives, reads or holds it, and their entries in every keyframe.

    Args:
        spec: The parsed model, which is changed.
        name: The joint.
    """
    before = spec.joints[: [joint.name for joint in spec.joints].index(name)]
    of_joints = [sum(joint_sizes(int(joint.type))[i] for joint in before) for i in (0, 1)]
    drives = list(spec.actuators)
    gone = [i for i, drive in enumerate(drives) if drive.target == name and drive.trntype in ON_A_JOINT]
    none = mujoco.mjtDyn.mjDYN_NONE
    starts = np.cumsum([0, *(0 if drive.dyntype == none else max(1, drive.actdim) for drive in drives)])
    states = [state for i in gone for state in range(starts[i], starts[i + 1])]
    hinge = mujoco.mjtObj.mjOBJ_JOINT
    reads = [sensor for sensor in spec.sensors if sensor.objname == name and sensor.objtype == hinge]
    holds = [one for one in spec.equalities if one.type == mujoco.mjtEq.mjEQ_JOINT]
    holds = [one for one in holds if name in (one.name1, one.name2)]
    for element in [*(drives[i] for i in gone), *reads, *holds, spec.joint(name)]:
        spec.delete(element)
    for key in spec.keys:  # which may leave any of these out, or have them wrong, of which the compiler speaks
        values = (key.qpos, of_joints[:1]), (key.qvel, of_joints[1:]), (key.act, states), (key.ctrl, gone)
        key.qpos, key.qvel, key.act, key.ctrl = (
            np.delete(entries, at if len(entries) else []) for entries, at in values
        )

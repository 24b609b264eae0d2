"""An MJCF file -> a compiled model that has all that a rig needs, or a line that says what it lacks."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from cmg_mj.errors import InputError, nearest

KEYFRAME = "equilibrium"


def _one_line(error: Exception) -> str:
    """MuJoCo's message without what tells a user nothing."""
    text = " ".join(str(error).split()).removeprefix("Error: ")
    syntax = re.match(r"XML parse error .*Line number=(\d+)", text)
    return f"XML syntax error at line {syntax[1]}" if syntax else re.sub(r" The static bodies .* remain so\.", "", text)


def parse(path: Path) -> mujoco.MjSpec:
    """Read a model file and see that it is a rig.

    Raises:
        InputError: It is no MJCF, or lacks a named element.
    """
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        raise InputError(f"{path}: not a model MuJoCo can read: {_one_line(error)}") from error
    require(spec, path)
    return spec


def compile_model(spec: mujoco.MjSpec, path: Path) -> mujoco.MjModel:
    """Compile a parsed model.

    Raises:
        InputError: MuJoCo's compiler refuses it.
    """
    try:
        return spec.compile()
    except ValueError as error:
        raise InputError(f"{path}: does not compile: {_one_line(error)}") from error


def require(spec: mujoco.MjSpec, path: Path) -> None:
    """A rig has certain joints, actuators, sensors and a keyframe, by name.

    The compiler, which comes after this, would only say that the keyframe has the wrong size.
    """
    elements = {
        "joint": {joint.name: joint for joint in spec.joints},
        "actuator": {actuator.name: actuator for actuator in spec.actuators},
        "sensor": {sensor.name: sensor for sensor in spec.sensors},
        "keyframe": {key.name: key for key in spec.keys},
    }

    def get(kind: str, name: str) -> Any:
        if name not in elements[kind]:
            raise InputError(
                f"{path}: the model has no {kind} {name!r}; {nearest(name, elements[kind], 'its ' + kind + 's')}"
            )
        return elements[kind][name]

    def check(is_right: bool, what: str) -> None:
        if not is_right:
            raise InputError(f"{path}: {what}")

    for joint in spec.joints:
        check(bool(joint.name), f"the joint of body {joint.parent.name!r} has no name")
        check(int(joint.type) == int(mujoco.mjtJoint.mjJNT_HINGE), f"joint {joint.name!r} must be a hinge")
    axis = np.array(get("joint", "tilt").axis)
    check(bool(axis[1] > 0.0 and axis[0] == axis[2] == 0.0), "joint 'tilt' must turn about y (axis=\"0 1 0\")")
    suffixes = ("/gimbal", "/flywheel", "/gimbal_servo", "/flywheel_motor", "/gimbal_encoder")
    names = [name for kind in elements.values() for name in kind]
    cubes = [name.rpartition("/")[0] for name in names if name.endswith(suffixes)]
    for cube in dict.fromkeys(cubes or ["cube1"]):
        for name, actuator in (("gimbal", "gimbal_servo"), ("flywheel", "flywheel_motor")):
            get("joint", f"{cube}/{name}")
            drive = get("actuator", f"{cube}/{actuator}")
            drives = drive.target == f"{cube}/{name}" and int(drive.trntype) == int(mujoco.mjtTrn.mjTRN_JOINT)
            check(drives, f"actuator '{cube}/{actuator}' must drive the joint '{cube}/{name}'")
        encoder = get("sensor", f"{cube}/gimbal_encoder")
        is_one = int(encoder.type) == int(mujoco.mjtSensor.mjSENS_JOINTPOS) and encoder.objname == f"{cube}/gimbal"
        check(is_one, f"sensor '{cube}/gimbal_encoder' must be the jointpos of '{cube}/gimbal'")
    sensors = {"accelerometer_inner": "accelerometer", "accelerometer_outer": "accelerometer", "fog": "gyro"}
    for name, kind in sensors.items():
        is_one = int(get("sensor", name).type) == int(getattr(mujoco.mjtSensor, f"mjSENS_{kind.upper()}"))
        check(is_one, f"sensor {name!r} must be of the kind {kind!r}")
    get("keyframe", KEYFRAME)


def lock_thrust_bearing(spec: mujoco.MjSpec, path: Path) -> None:
    """Take the yaw joint out, and its entry out of every keyframe."""
    names = [joint.name for joint in spec.joints]
    if "yaw" not in names:
        raise InputError(f"plant.lock_thrust_bearing = true: {path} has no joint 'yaw' to lock")
    index = names.index("yaw")
    spec.delete(spec.joint("yaw"))
    for key in spec.keys:  # which may leave its rates out, or have them wrong, of which the compiler speaks
        key.qpos, key.qvel = (np.delete(values, [index] if len(values) else []) for values in (key.qpos, key.qvel))

"""The parts of a rig, by name and kind; finds all parts that a model lacks, not only the first."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import mujoco

from cmg_mj.core.errors import nearest

EQUILIBRIUM_KEY = "equilibrium"
TILT_ELEMENT = "tilt"
"""The hinge that a rig tilts about, or the site whose y axis lies along a line that it tilts about."""
BEND_JOINT = "bend"
"""Joint and body that a frame which bends gets, beside what its file has."""
ACCELEROMETERS = "accelerometer_inner", "accelerometer_outer"
SENSORS = {**dict.fromkeys(ACCELEROMETERS, "accelerometer"), "fog": "gyro"}
REQUIRED_ELEMENTS = (
    "a rig needs a joint or a site tilt, the joints MODULE/gimbal, MODULE/flywheel, the actuators MODULE/gimbal_servo, "
    f"MODULE/flywheel_motor, the sensors MODULE/gimbal_encoder, {', '.join(SENSORS)} and the keyframe "
    f"{EQUILIBRIUM_KEY}, for one MODULE or more; of several axes each has its name before these, as roll/tilt and "
    "roll/MODULE/gimbal"
)
ON_A_JOINT = mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT
"""Transmissions of an actuator that drives a joint."""
_OF_A_MODULE = ("/gimbal", "/flywheel", "/gimbal_servo", "/flywheel_motor", "/gimbal_encoder")


@dataclass(frozen=True)
class Module:
    """Addresses of one module in the compiled model.

    Attributes:
        name: Its prefix, `cube1`.
        gimbal: Address of the gimbal angle in qpos.
        gimbal_dof: Address of its rate in qvel; the same where a rig consists of hinges and slides alone.
        flywheel: Address of the flywheel's angle in qpos.
        flywheel_dof: Address of its rate in qvel.
        servo: The gimbal servo's control.
        motor: The flywheel motor's control.
        direction: +1 or -1: the sign of u its gimbal is given, so that all modules push the same way.
        gimbal_zero: Gimbal angle at which the spin axis is upright, x3 = 0 [rad].
        speed: Nominal flywheel speed, signed [rad/s].
    """

    name: str
    gimbal: int
    gimbal_dof: int
    flywheel: int
    flywheel_dof: int
    servo: int
    motor: int
    direction: float
    gimbal_zero: float
    speed: float


def missing_elements(spec: mujoco.MjSpec) -> list[str]:
    """List the joints, actuators, sensors and the keyframe that a rig needs and a parsed model lacks.

    The compiler, which comes after this, would only say that the keyframe has the wrong size.

    Args:
        spec: The parsed model.

    Returns:
        Clauses for an error message.
    """
    elements: dict[str, dict[str, Any]] = {
        "joint": {joint.name: joint for joint in spec.joints},
        "actuator": {actuator.name: actuator for actuator in spec.actuators},
        "sensor": {sensor.name: sensor for sensor in spec.sensors},
        "keyframe": {key.name: key for key in spec.keys},
    }
    missing: dict[str, list[str]] = {kind: [] for kind in elements}
    wrong = []

    def check(kind: str, name: str, words: str = "", **right: object) -> None:
        element = elements[kind].get(name)
        if element is None:
            missing[kind].append(name)
        elif any(getattr(element, field) != value for field, value in right.items()):
            wrong.append(f"{kind} {name!r} must {words}")

    for joint in spec.joints:
        if not joint.name:
            wrong.append(f"the joint of body {joint.parent.name!r} has no name")
    hinge = mujoco.mjtJoint.mjJNT_HINGE
    if "yaw" in elements["joint"]:
        check("joint", "yaw", "be a hinge", type=hinge)
    names = [name for kind in elements.values() for name in kind]
    sites = {site.name for site in spec.sites}
    for axis in axes_in([*names, *sites]) or [""]:
        prefix = f"{axis}/" if axis else ""
        tilt = prefix + TILT_ELEMENT
        if tilt not in sites:
            check("joint", tilt, "be a hinge", type=hinge)
            x, y, z = elements["joint"][tilt].axis if tilt in elements["joint"] else (0.0, 1.0, 0.0)
            if x or z or y <= 0.0:
                wrong.append(f'joint {tilt!r} must turn about y (axis="0 1 0")')
        for module in modules_in(names, axis) or [f"{prefix}cube1"]:
            gimbal, flywheel = f"{module}/gimbal", f"{module}/flywheel"
            for joint, drive in ((gimbal, f"{gimbal}_servo"), (flywheel, f"{flywheel}_motor")):
                check("joint", joint, "be a hinge", type=hinge)
                check("actuator", drive, f"drive the joint {joint!r}", target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            encodes = {"objname": gimbal, "type": mujoco.mjtSensor.mjSENS_JOINTPOS}
            check("sensor", f"{gimbal}_encoder", f"be the jointpos of {gimbal!r}", **encodes)
        for name, kind in SENSORS.items():
            check(
                "sensor",
                prefix + name,
                f"be of the kind {kind!r}",
                type=getattr(mujoco.mjtSensor, f"mjSENS_{kind.upper()}"),
            )
    check("keyframe", EQUILIBRIUM_KEY)
    return [
        f"the model has no {kind} {', '.join(map(repr, names))}; {nearest(names[0], elements[kind], f'its {kind}s')}"
        for kind, names in missing.items()
        if names
    ] + wrong


def element_id(model: mujoco.MjModel, kind: str, name: str) -> int:
    """Return the number of an element of a kind, such as `joint`; -1 if there is none of that name."""
    return int(mujoco.mj_name2id(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), name))


def subtree(model: mujoco.MjModel, root: int) -> list[int]:
    """List a body and all that it carries."""
    bodies = [root]
    for body in range(root + 1, model.nbody):  # a body comes after its parent
        if model.body_parentid[body] in bodies:
            bodies.append(body)
    return bodies


def joint_sizes(kind: int) -> tuple[int, int]:
    """Return how many numbers a joint of a kind (MuJoCo's mjtJoint) has in qpos and in qvel."""
    return {0: (7, 6), 1: (4, 3)}.get(kind, (1, 1))


def axes_in(names: Iterable[str]) -> list[str]:
    """Names of the axes that elements' names speak of; the only one of a rig need have none."""
    of_an_axis = {TILT_ELEMENT, *SENSORS}
    axes = [axis for name in names for axis, _, last in [name.rpartition("/")] if last in of_an_axis]
    return list(dict.fromkeys(axes))


def modules_in(names: Iterable[str], axis: str) -> list[str]:
    """Prefixes of the modules of an axis that elements' names speak of, such as `cube1` or `roll/cube1`."""
    prefixes = dict.fromkeys(name.rpartition("/")[0] for name in names if name.endswith(_OF_A_MODULE))
    return [prefix for prefix in prefixes if prefix.rpartition("/")[0] == axis]


def axis_modules(model: mujoco.MjModel) -> dict[str, list[str]]:
    """Find the axes of a compiled model, each with the names of its modules."""
    joints = [model.joint(i).name for i in range(model.njnt)]
    sites = [model.site(i).name for i in range(model.nsite)]
    return {axis: modules_in(joints, axis) for axis in axes_in([*joints, *sites])}

"""The unstable pole of an uncontrolled robot, by simulation."""

from __future__ import annotations

import copy
import math

import mujoco

from cmg_mj.plant.tilt_line import HingeLine, Line

TRIED_DEG = 0.05
"""Tilt at which a robot is released [deg]."""
UNTIL = 4.0
"""Growth of the tilt at which the simulation ends."""
OVERLAP_M = 1e-4
"""Smallest depth of an overlap [m]."""
ALIKE = 0.01
"""Relative difference of poles up to which a robot falls alike."""
LONGEST_S = 3.0
"""Longest simulation; a robot whose tilt has not grown so much by then falls too slowly to judge, or stands [s]."""
SLOWEST = math.acosh(UNTIL) / LONGEST_S
"""Slowest fall of a robot that a pair is mounted on [1/s]."""


def simulated_pole(model: mujoco.MjModel, key: int, line: Line, bias: float = 0.0) -> float:
    """Simulate a small tilt's growth cosh(lambda t), flywheels at rest and gimbals held, and return its pole lambda.

    Args:
        model: The plant's model.
        key: The keyframe in which the plant stands.
        line: The tilt line.
        bias: Equilibrium bias e: tilt of the equilibrium, less that of the keyframe [rad].

    Returns:
        lambda [1/s]; 0 if the tilt does not grow, and less than `SLOWEST` if it has not grown enough in time.
    """
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, key)
    spinning = data.qvel != 0.0
    data.qvel[spinning] = 0.0
    for motor in range(model.nu):  # whatever drives a joint that turned
        joint = int(model.actuator_trnid[motor, 0])
        if int(model.actuator_trntype[motor]) == int(mujoco.mjtTrn.mjTRN_JOINT) and spinning[model.jnt_dofadr[joint]]:
            data.ctrl[motor] = 0.0
    start = math.radians(TRIED_DEG)
    line.tilt(data, start - bias)
    growth = 1.0
    while growth < UNTIL and data.time < LONGEST_S:
        mujoco.mj_step(model, data)
        growth = (float(line.lean(data.qpos)) + bias) / start
    return math.acosh(growth) / float(data.time) if growth > 1.0 else 0.0


def overlap(model: mujoco.MjModel, key: int, line: Line, pole: float) -> str:
    """Describe the deepest overlap of geoms on a robot that a hinge carries, if contacts change how it falls.

    Args:
        model: The plant's model.
        key: The keyframe in which the plant stands.
        line: The tilt line.
        pole: Its simulated pole [1/s].

    Returns:
        A clause; "" for a robot on the floor, where nothing overlaps, and where the robot falls alike without contacts.
    """
    if not isinstance(line, HingeLine):
        return ""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, key)
    mujoco.mj_forward(model, data)
    deepest = min(data.contact[: data.ncon], key=lambda contact: contact.dist, default=None)
    if deepest is None or deepest.dist > -OVERLAP_M:
        return ""
    untouched = copy.copy(model)
    untouched.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    if abs(simulated_pole(untouched, key, line) - pole) <= ALIKE * pole:
        return ""
    names = [
        f"{model.geom(geom).name!r}"
        if model.geom(geom).name
        else f"one of {model.body(model.geom_bodyid[geom]).name!r}"
        for geom in (deepest.geom1, deepest.geom2)
    ]
    return f"its geoms {' and '.join(names)} overlap by {-1e3 * deepest.dist:.3g} mm, and contact holds it"

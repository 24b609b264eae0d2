"""How a robot starts to fall when nothing is controlled: what its reduced model is tried on."""

from __future__ import annotations

import math

import mujoco

from cmg_mj.plant.tilt_line import Line

TRIED_DEG = 0.05
"""From which tilt it is let fall [deg]."""
UNTIL = 4.0
"""Until it leans so many times as much."""
LONGEST_S = 3.0
"""A robot that has not begun to fall by then stands [s]."""


def falls_with(model: mujoco.MjModel, key: int, line: Line, bias: float = 0.0) -> float:
    """The pole lambda of cosh(lambda t), as which a small tilt grows: flywheels at rest, gimbals held.

    Args:
        model: The rig.
        key: The keyframe in which it stands.
        line: The line that it tilts about.
        bias: e, by which its equilibrium is off the keyframe [rad].

    Returns:
        lambda [1/s]; 0 if it does not fall.
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
    grown = 1.0
    while grown < UNTIL and data.time < LONGEST_S:
        mujoco.mj_step(model, data)
        grown = (float(line.lean(data.qpos)) + bias) / start
    return math.acosh(grown) / float(data.time) if grown >= UNTIL else 0.0

"""The turn of body A of a scissored pair whose halves are not alike: conservation of momentum about the vertical."""

from __future__ import annotations

import math
from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.plant.plant import Plant
from cmg_mj.results.trajectory import Trajectory


class Inertia(NamedTuple):
    """The parts of the momentum about the vertical at the upright."""

    yaw: float
    """Inertia of all that turns with body A [kg m^2]."""
    gimbal: float
    """I_c + I_d of a gimbal about its own axis [kg m^2]."""
    spin: float
    """J_d [kg m^2]."""


def inertia_of(plant: Plant) -> Inertia:
    """Read off the mass matrix at the keyframe."""
    data = mujoco.MjData(plant.model)
    mujoco.mj_resetDataKeyframe(plant.model, data, plant.key)
    mujoco.mj_forward(plant.model, data)
    M = np.zeros((plant.model.nv, plant.model.nv))
    mujoco.mj_fullM(plant.model, data, M)
    module = plant.axis.modules[0]
    return Inertia(*(float(M[i, i]) for i in (plant.yaw or 0, module.gimbal, module.flywheel)))


def carried_momentum(plant: Plant, trajectory: Trajectory) -> np.ndarray:
    """Return the momentum of gimbals and flywheels about the vertical, (n_ticks, ...) [N m s].

    The gimbals' axis is b_x, whose vertical part is -sin q_b; the flywheels' is b_y cos q_c + b_z sin q_c, whose
    vertical part is cos q_b sin q_c.
    """
    parts, names = inertia_of(plant), plant.joint_names
    tilt = trajectory[f"angle/{names[plant.tilt]}_rad"]
    total = np.zeros_like(tilt)
    for module in plant.axis.modules:
        angle = trajectory[f"angle/{names[module.gimbal]}_rad"]
        turning = trajectory[f"rate/{names[module.gimbal]}_rad_s"]
        spinning = trajectory[f"rate/{names[module.flywheel]}_rad_s"]
        total = total - parts.gimbal * turning * np.sin(tilt)
        total = total + parts.spin * spinning * np.cos(tilt) * np.sin(angle)
    return total


def balanced_yaw_rate(plant: Plant, trajectory: Trajectory) -> np.ndarray:
    """Body A's rate by conservation: no torque acts about the vertical, so I q_a' + carried stays [rad/s]."""
    momentum = carried_momentum(plant, trajectory)
    return (momentum[0] - momentum) / inertia_of(plant).yaw


def predict_yaw_rate(kind: str, size: float, plant: Plant, trajectory: Trajectory) -> np.ndarray:
    """Body A's rate foretold from a run of the symmetric rig, for a small mismatch [rad/s].

    The law holds the mean of both gimbal angles x3, whatever each does, so x3 and the tilt are those of the symmetric
    rig to first order. With h = J_d omega_d cos q_b the flywheels carry h (cos x3_1 - cos x3_2).

    Args:
        kind: Kind of mismatch, of `MISMATCHES`.
        size: Size of the mismatch.
        plant: The symmetric rig.
        trajectory: Its run.

    Returns:
        The rate, (n_ticks, ...).
    """
    parts = inertia_of(plant)
    tilt = trajectory[f"angle/{plant.joint_names[plant.tilt]}_rad"]
    x3, turning = trajectory["x3_rad"], np.gradient(trajectory["x3_rad"], trajectory["time_s"], axis=0)
    h = parts.spin * abs(plant.axis.modules[0].speed) * np.cos(tilt)
    if kind == "flywheel speed":
        momentum = size * h * np.cos(x3)
    elif kind == "gimbal offset":
        half = math.radians(size) / 2.0
        momentum = h * (np.cos(x3 - half) - np.cos(x3 + half))
    else:  # servo gain
        first = 2.0 * x3 / (2.0 + size)
        momentum = h * (np.cos(first) - np.cos((1.0 + size) * first)) + parts.gimbal * size * turning * np.sin(tilt)
    return (momentum[0] - momentum) / parts.yaw

"""What one gimbal does about the vertical: the torque on a locked thrust bearing, the motion on a free one.

A scissored pair cancels it (aranovskiy2020, Hypothesis 1); sokolov2019 has one gimbal and no yaw in its model.

With yaw at rest, the bodies' angular momentum about the vertical is, with q_c = pi/2 + x3,

    H = cos q_b (J_d w_d cos x3 - (J2/2) sin(2 x3) w_b) - sin q_b (I_c + I_d) w_c

of which nearly all is the flywheel's: upright, at q_b = -pi/4, it has J_d w_d/sqrt(2). A locked bearing carries dH/dt.
On a free one I_z q_a' + H stays what it was, and the yaw rate's gyroscopic torque acts back on the tilt like a spring
of stiffness (J_d w_d)^2/(2 I_z).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.callback import control
from cmg_mj.plant import Plant, load_plant
from cmg_mj.reproduce.single_gimbal import experiment, servo_of
from cmg_mj.scenario import Experiment, load_scenario, prepare
from cmg_mj.timing import whole_steps


class Motion(NamedTuple):
    """Joint angles, rates and accelerations of one cube's rig without yaw: q_b, q_c, q_d, each (..., 3) in SI units."""

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray


def vertical_momentum(plant: Plant, motion: Motion) -> np.ndarray:
    """H of the module's docstring, (...) [N m s]."""
    r, inertia = plant.reduced, servo_of(plant).inertia
    q_b, x3 = motion.q[..., 0], motion.q[..., 1] - plant.cubes[0].gimbal_zero
    w_b, w_c, w_d = np.moveaxis(motion.v, -1, 0)
    spin = r.J_d * w_d * np.cos(x3) - 0.5 * r.J2 * np.sin(2.0 * x3) * w_b
    return np.cos(q_b) * spin - np.sin(q_b) * inertia * w_c


def vertical_torque(plant: Plant, motion: Motion) -> np.ndarray:
    """dH/dt, (...) [N m]."""
    r, inertia = plant.reduced, servo_of(plant).inertia
    q_b, x3 = motion.q[..., 0], motion.q[..., 1] - plant.cubes[0].gimbal_zero
    w_b, w_c, w_d = np.moveaxis(motion.v, -1, 0)
    dw_b, dw_c, dw_d = np.moveaxis(motion.a, -1, 0)
    spin = r.J_d * w_d * np.cos(x3) - 0.5 * r.J2 * np.sin(2.0 * x3) * w_b
    dspin = r.J_d * (dw_d * np.cos(x3) - w_d * np.sin(x3) * w_c)
    dspin -= r.J2 * (np.cos(2.0 * x3) * w_c * w_b + 0.5 * np.sin(2.0 * x3) * dw_b)
    by_spin = np.cos(q_b) * dspin - np.sin(q_b) * w_b * spin
    return by_spin - inertia * (np.cos(q_b) * w_b * w_c + np.sin(q_b) * dw_c)


class Locked(NamedTuple):
    """A run on a locked bearing, one row a control tick."""

    time_s: np.ndarray
    motion: Motion
    torque: np.ndarray
    """What the bearing carries about the vertical, by MuJoCo's inverse dynamics, (n_ticks,) [N m]."""


def locked_run(prepared: Experiment, world: int = 0) -> Locked:
    """Run one world and ask MuJoCo which yaw torque keeps the bearing where it is.

    The inverse dynamics are those of the same rig with its yaw joint, which is given no motion.
    """
    plant = prepared.plant
    free = load_plant(dataclasses.replace(prepared.scenario.plant, lock_thrust_bearing=False))
    controller = prepared.controller(world)
    timestep = plant.model.opt.timestep
    changes = {}
    for push in prepared.scenario.push:
        for time, torque in ((push.start_s, push.torque_n_m), (push.end_s, -push.torque_n_m)):
            step = whole_steps(time, timestep, "push", f"{time:g} s")
            changes[step] = changes.get(step, 0.0) + torque
    data, there, inverse = plant.new_data(), mujoco.MjData(plant.model), mujoco.MjData(free.model)
    rows, torques, times = [], [], []
    for step in range(whole_steps(prepared.scenario.duration_s, timestep, "duration_s", "")):
        data.qfrc_applied[plant.tilt] += changes.get(step, 0.0)
        if control(plant, controller, data):
            mujoco.mj_copyData(there, plant.model, data)
            mujoco.mj_forward(plant.model, there)
            for name in ("qpos", "qvel", "qacc"):
                getattr(inverse, name)[:] = [0.0, *getattr(there, name)]
            mujoco.mj_inverse(free.model, inverse)
            rows.append([there.qpos.copy(), there.qvel.copy(), there.qacc.copy()])
            torques.append(float(inverse.qfrc_inverse[free.yaw]))
            times.append(data.time)
        mujoco.mj_step(plant.model, data)
    return Locked(np.array(times), Motion(*np.swapaxes(np.array(rows), 0, 1)), np.array(torques))


def locked(settings: Sequence[str] = (), model: str = "single_gimbal.xml", observer: str = "homogeneous") -> Locked:
    """The scenario `single_gimbal` on a locked bearing, or the same with another rig."""
    fields = [f"plant.model={model}", "plant.lock_thrust_bearing=true", *settings]
    return locked_run(prepare(load_scenario("single_gimbal", fields, observer)))


class Free(NamedTuple):
    """The free bearing's numbers."""

    yaw_inertia: float
    """I_z upright, everything that yaws [kg m^2]."""
    gyroscopic_stiffness: float
    """(J_d w_d)^2/(2 I_z) [N m/rad]."""
    gravity_stiffness: float
    """m g l [N m/rad], the wrong way."""
    poles: np.ndarray
    """Of the law with the true rate on the linearised rig [1/s]."""


def free_bearing() -> Free:
    """Read off the model, with the law's poles when the tilt has lost its gravity to the yaw."""
    plant = load_plant(model="single_gimbal.xml", equilibrium_bias_deg=0.0, initial_tilt_deg=0.0)
    data = plant.new_data()
    M = np.zeros((plant.model.nv, plant.model.nv))
    mujoco.mj_fullM(plant.model, data, M)
    r, law = plant.reduced, experiment().law
    I_z = float(M[plant.yaw, plant.yaw])
    stiffness = (r.J_d * r.omega_d) ** 2 / (2.0 * I_z)
    A_e = r.A_e.copy()
    A_e[1, 0] = (r.gravity_torque - stiffness) / r.J1
    return Free(I_z, stiffness, r.gravity_torque, np.linalg.eigvals(A_e - r.B_e @ np.array([law.gains])))

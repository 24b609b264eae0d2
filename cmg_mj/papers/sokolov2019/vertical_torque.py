"""One gimbal's momentum about the vertical, and the torque that a locked thrust bearing carries.

With yaw at rest, the bodies' angular momentum about the vertical is, with q_c = pi/2 + x3,

    H = cos q_b (J_d w_d cos x3 - (J2/2) sin(2 x3) w_b) - sin q_b (I_c + I_d) w_c

of which nearly all is the flywheel's: upright, at q_b = -pi/4, it has J_d w_d/sqrt(2). A locked bearing carries dH/dt.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.papers.sokolov2019.rig import read_servo
from cmg_mj.plant.plant import Plant, load_plant
from cmg_mj.runs.callback import control
from cmg_mj.runs.experiment import Experiment


class Motion(NamedTuple):
    """Joint angles, rates and accelerations of one cube's rig without yaw: q_b, q_c, q_d, each (..., 3) in SI units."""

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray


def vertical_momentum(plant: Plant, motion: Motion) -> np.ndarray:
    """Return H of the module's docstring, (...) [N m s]."""
    r, inertia = plant.reduced, read_servo(plant).inertia
    q_b, x3 = motion.q[..., 0], motion.q[..., 1] - plant.axis.modules[0].gimbal_zero
    w_b, w_c, w_d = np.moveaxis(motion.v, -1, 0)
    spin = r.J_d * w_d * np.cos(x3) - 0.5 * r.J2 * np.sin(2.0 * x3) * w_b
    return np.cos(q_b) * spin - np.sin(q_b) * inertia * w_c


def vertical_torque(plant: Plant, motion: Motion) -> np.ndarray:
    """Return dH/dt, (...) [N m]."""
    r, inertia = plant.reduced, read_servo(plant).inertia
    q_b, x3 = motion.q[..., 0], motion.q[..., 1] - plant.axis.modules[0].gimbal_zero
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
    """Torque of the bearing about the vertical, by MuJoCo's inverse dynamics, (n_ticks,) [N m]."""

    def torque_between(self, start_s: float, end_s: float) -> np.ndarray:
        """Return the torque between two times, (n_ticks,) [N m]."""
        return self.torque[(self.time_s > start_s) & (self.time_s < end_s)]


def locked_run(prepared: Experiment, world: int = 0) -> Locked:
    """Run one world and ask MuJoCo which yaw torque keeps the bearing where it is.

    The inverse dynamics are those of the same rig with its yaw joint, which is given no motion.
    """
    plant, scenario = prepared.plant, prepared.scenario
    free = load_plant(replace(scenario.plant, lock_thrust_bearing=False))
    controller = prepared.controller(world)
    half_a_step = plant.model.opt.timestep / 2.0
    data, tick_data, inverse = plant.new_data(), mujoco.MjData(plant.model), mujoco.MjData(free.model)
    times, rows, torques = [], [], []
    while data.time < scenario.duration_s - half_a_step:
        data.qfrc_applied[plant.tilt] = sum(
            push.torque_n_m
            for push in scenario.push
            if push.start_s - half_a_step < data.time < push.end_s - half_a_step
        )
        if control(plant, controller, data):
            mujoco.mj_copyData(tick_data, plant.model, data)
            mujoco.mj_forward(plant.model, tick_data)
            for name in ("qpos", "qvel", "qacc"):
                getattr(inverse, name)[:] = [0.0, *getattr(tick_data, name)]
            mujoco.mj_inverse(free.model, inverse)
            times.append(data.time)
            rows.append([tick_data.qpos.copy(), tick_data.qvel.copy(), tick_data.qacc.copy()])
            torques.append(float(inverse.qfrc_inverse[free.yaw]))
        mujoco.mj_step(plant.model, data)
    return Locked(np.array(times), Motion(*np.swapaxes(np.array(rows), 0, 1)), np.array(torques))

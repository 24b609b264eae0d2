"""Fig. 2, the thrust bearing: the torque on a locked one, the motion on a free one.

A scissored pair cancels it (aranovskiy2020, Hypothesis 1); sokolov2019 has one gimbal and no yaw in its model. With
yaw at rest, the bodies' angular momentum about the vertical is, with q_c = pi/2 + x3,

    H = cos q_b (J_d w_d cos x3 - (J2/2) sin(2 x3) w_b) - sin q_b (I_c + I_d) w_c

of which nearly all is the flywheel's: upright, at q_b = -pi/4, it has J_d w_d/sqrt(2). A locked bearing carries dH/dt.
On a free bearing I_z q_a' + H stays what it was, and the yaw rate's gyroscopic torque acts back on the tilt like a
spring of stiffness (J_d w_d)^2/(2 I_z).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import mujoco
import numpy as np

from cmg_mj.laws import StateFeedback
from cmg_mj.papers.claim import Array, Claim
from cmg_mj.papers.linear_check import mass_matrix, poles_as_pairs
from cmg_mj.papers.recorded import largest_size, push_intervals, rms, trace, trajectory_of
from cmg_mj.papers.sokolov2019.rig import PUSH_AND_NOISE, experiment, read_servo
from cmg_mj.plant.plant import Plant, load_plant
from cmg_mj.results.intervals import mean_interval
from cmg_mj.results.result import Result
from cmg_mj.runs.callback import control
from cmg_mj.runs.experiment import Experiment
from cmg_mj.view.plots.figure import Line, Panel, Picture

SEED, WORLDS = 84_000, 20
BALANCED = "plant.equilibrium_bias_deg=0.0"
UPRIGHT = "plant.initial_tilt_deg=0.0"
LOCKED = (BALANCED, UPRIGHT, "duration_s=3.0")
"""A push at 1 s is over by then."""
FREE = (BALANCED, "plant.lock_thrust_bearing=false", "duration_s=7.0")
PUSHED = "a push of the upright rig"
CASES = {
    PUSHED: (UPRIGHT,),
    "let go 1 deg off, no push": ("plant.initial_tilt_deg=1.0", "push=[]"),
    "let go upright, no push": (UPRIGHT, "push=[]"),
}
"""The cases of the rig on a free bearing."""

# --- the torque on a locked bearing -------------------------------------------------------------------------


class Motion(NamedTuple):
    """Joint angles, rates and accelerations of one cube's rig without yaw: q_b, q_c, q_d, each (..., 3) in SI units."""

    q: Array
    v: Array
    a: Array


def vertical_torque(plant: Plant, motion: Motion) -> Array:
    """Return dH/dt of the module's docstring, (...) [N m]."""
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

    time_s: Array
    motion: Motion
    torque: Array
    """Torque of the bearing about the vertical, by MuJoCo's inverse dynamics, (n_ticks,) [N m]."""

    def torque_between(self, start_s: float, end_s: float) -> Array:
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
            torques.append(inverse.qfrc_inverse[free.yaw])
        mujoco.mj_step(plant.model, data)
    return Locked(np.array(times), Motion(*np.swapaxes(np.array(rows), 0, 1)), np.array(torques))


# --- the study ----------------------------------------------------------------------------------------------


class Study(NamedTuple):
    """Locked and free, over seeds, the law fed with the exact rate."""

    locked: Sequence[Locked]
    """One run a world, with the push."""
    pair: Locked
    """The scissored pair in the same experiment."""
    free: Mapping[str, Result]
    """Case -> runs on a free bearing."""


def study(worlds: int = WORLDS, seed: int = SEED) -> Study:
    """Run them all."""
    settings = [f"seed={seed}", *LOCKED]
    prepared = experiment(settings, feedback="truth")
    locked = [locked_run(prepared, world) for world in range(worlds)]
    pair_settings = ["plant.model=scissored_pair.xml", "plant.lock_thrust_bearing=true"]
    pair = locked_run(experiment([*settings, *pair_settings], feedback="truth"))
    free = {
        case: experiment([f"seed={seed}", *FREE, *changes], feedback="truth").run_many(worlds)
        for case, changes in CASES.items()
    }
    return Study(locked, pair, free)


def stiffness() -> dict[str, Any]:
    """Read a free bearing's numbers off the model.

    Returns:
        I_z upright, of everything that yaws [kg m^2]; (J_d w_d)^2/(2 I_z) and m g l, the wrong way [N m/rad]; the poles
        of the law with the true rate when the tilt has lost its gravity to the yaw [1/s].
    """
    plant = load_plant(model="single_gimbal.xml", equilibrium_bias_deg=0.0, initial_tilt_deg=0.0)
    r, law = plant.reduced, experiment().law
    assert isinstance(law, StateFeedback)
    I_z = mass_matrix(plant.model, plant.new_data())[plant.yaw, plant.yaw]
    gyroscopic = (r.J_d * r.omega_d) ** 2 / (2.0 * I_z)
    A_e = r.A_e.copy()
    A_e[1, 0] = (r.gravity_torque - gyroscopic) / r.J1
    return {
        "yaw_inertia_kg_m2": I_z,
        "gyroscopic_stiffness_n_m_rad": gyroscopic,
        "gravity_stiffness_n_m_rad": r.gravity_torque,
        "poles_on_free_bearing_1_s": poles_as_pairs(np.linalg.eigvals(A_e - r.B_e @ np.array([law.gains]))),
    }


def claim(runs: Study) -> Claim:
    """Judge the thrust bearing, which the model of one tilt angle leaves out."""
    plant, worlds = experiment([BALANCED]).plant, len(runs.locked)
    error = max(largest_size(vertical_torque(plant, run.motion) - run.torque) for run in runs.locked)
    peak = mean_interval([largest_size(run.torque_between(1.0, 1.6)) for run in runs.locked])
    pair = largest_size(runs.pair.torque)
    mean_torque = np.mean([run.torque for run in runs.locked], axis=0)  # without most of its noise
    example, pushed = runs.locked[0], trajectory_of(runs.free[PUSHED]).world(0)
    t, push = example.time_s, push_intervals(pushed)
    x1, x3 = example.motion.q[:, 0] - plant.tilt_zero, example.motion.q[:, 1] - plant.axis.modules[0].gimbal_zero
    torques = [
        Line(t, example.torque, "on the bearing", color=1, width=0.5),
        Line(t, mean_torque, f"mean of {worlds} seeds", color=3, width=1.2),
        Line(runs.pair.time_s, runs.pair.torque, "scissored pair", color=2),
    ]
    panels = [
        Panel("tilt [deg]", [Line(t, np.degrees(x1), color=0)], "locked bearing", shaded=push),
        Panel("tilt [deg]", [trace(pushed, "x1_rad", color=0)], "free bearing", shaded=push),
        Panel("gimbal angle [deg]", [Line(t, np.degrees(x3), color=0)], shaded=push),
        Panel("gimbal angle [deg]", [trace(pushed, "x3_rad", color=0)], shaded=push),
        Panel("torque about the\nvertical [N m]", torques, shaded=push),
        Panel("yaw rate [rad/s]", [trace(pushed, "rate/yaw_rad_s", color=1)], shaded=push),
    ]
    free = {
        case: {
            "fell_fraction": result.fell.mean(),
            "end_time_s": mean_interval([trajectory_of(result).world(i)["time_s"][-1] for i in range(worlds)]),
        }
        for case, result in runs.free.items()
    }
    return Claim(
        "Fig. 2, the bearing",
        "The pendulum has one degree of freedom, its tilt: there is no yaw in (1).",
        assumes={**PUSH_AND_NOISE, "bearing": "locked"},
        holds=error < 1e-9 and pair < 1e-6 * peak.mean,
        conditions="It is so with the thrust bearing locked. On a free bearing the tilt turns the rig about the "
        "vertical, and the law lets the rig fall.",
        figures={
            "peak_torque_at_push_n_m": peak,
            "peak_of_the_mean_torque_n_m": largest_size(mean_torque),
            "rms_torque_before_push_n_m": mean_interval([rms(run.torque_between(0.5, 1.0)) for run in runs.locked]),
            "closed_form_error_n_m": error,
            "peak_torque_of_the_pair_n_m": pair,
            **stiffness(),
            "free": free,
            "worlds": worlds,
        },
        picture=Picture(
            "sokolov2019-bearing",
            "sokolov2019, Fig. 2: one gimbal on its thrust bearing, the exact rate in the law, a push at 1 s",
            panels,
            columns=2,
        ),
    )

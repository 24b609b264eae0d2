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
from cmg_mj.experiment import Experiment, prepare
from cmg_mj.intervals import Interval, mean_interval
from cmg_mj.papers.claim import Claim, OnShare, verdict
from cmg_mj.papers.sokolov2019.single_gimbal import Runs, experiment, pushed, runs, servo_of
from cmg_mj.picture import Line, Panel, Picture
from cmg_mj.plant import Plant, load_plant
from cmg_mj.scenario import load_scenario
from cmg_mj.timing import whole_steps

SEED, WORLDS = 84_000, 20
LOCKED_S = 3.0
"""A push at 1 s is over by then [s]."""
FREE_S = 7.0
BIAS = "plant.equilibrium_bias_deg=0.0"
FREE = ("plant.lock_thrust_bearing=false", BIAS, f"duration_s={FREE_S}")
CASES = {
    "a push of the upright rig": ("plant.initial_tilt_deg=0.0",),
    "let go 1 deg off, no push": ("plant.initial_tilt_deg=1.0", "push=[]"),
    "let go upright, no push": ("plant.initial_tilt_deg=0.0", "push=[]"),
}
"""What happens to the rig on a free bearing."""


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


# --- the claim ----------------------------------------------------------------------------------------------


class Study(NamedTuple):
    """Locked and free, over seeds."""

    locked: list[Locked]
    """One run a world."""
    pair: Locked
    """The scissored pair in the same experiment."""
    free: dict[str, Runs]
    """Case -> runs on a free bearing, the law fed with the exact rate."""
    numbers: Free
    worlds: int

    @property
    def peaks(self) -> np.ndarray:
        """Largest torque on the locked bearing from the push to half a second after its end, (n_worlds,) [N m]."""
        return np.array([np.abs(run.torque[(run.time_s >= 1.0) & (run.time_s <= 1.6)]).max() for run in self.locked])

    @property
    def at_rest(self) -> np.ndarray:
        """RMS torque before the push, from the law's noise alone, (n_worlds,) [N m]."""
        return np.array(
            [np.sqrt(np.mean(run.torque[(run.time_s > 0.5) & (run.time_s < 1.0)] ** 2)) for run in self.locked]
        )

    @property
    def mean_torque(self) -> np.ndarray:
        """The torque without most of its noise: the mean over the worlds, (n_ticks,) [N m]."""
        return np.mean([run.torque for run in self.locked], axis=0)

    @property
    def closed_form_error(self) -> float:
        """Largest difference of dH/dt from MuJoCo's torque [N m]."""
        plant = experiment([BIAS]).plant
        return float(max(np.abs(vertical_torque(plant, run.motion) - run.torque).max() for run in self.locked))


def study(on_share: OnShare, worlds: int = WORLDS, seed: int = SEED) -> Study:
    """Run them all."""
    settings = [f"seed={seed}", f"duration_s={LOCKED_S}", BIAS, "plant.initial_tilt_deg=0.0"]
    prepared = experiment(settings, feedback="truth")
    runs_locked = []
    for world in range(worlds):
        runs_locked.append(locked_run(prepared, world))
        on_share(0.6 * (world + 1) / worlds)
    pair = locked([*settings, "controller.feedback=truth"], "scissored_pair.xml")
    free = {
        case: runs("homogeneous", worlds, seed, [*FREE, *settings], feedback="truth")
        for case, settings in CASES.items()
    }
    return Study(runs_locked, pair, free, free_bearing(), worlds)


def _last_times(found: Runs) -> Interval:
    """When the worlds ended [s]."""
    t, x1 = found.trajectory["time_s"], found.trajectory["x1_rad"]
    return mean_interval([float(t[np.isfinite(column)][-1]) for column in x1.T])


def claim(found: Study) -> Claim:
    """The thrust bearing, which the model of one tilt angle leaves out."""
    peak, rest = mean_interval(found.peaks), mean_interval(found.at_rest)
    pair = float(np.abs(found.pair.torque).max())
    error = found.closed_form_error
    n = found.numbers
    ends = {case: (float(r.fell.mean()), _last_times(r)) for case, r in found.free.items()}
    told = "; ".join(
        f"{case}: {share:.0%} fall" + (f", at {time.mean:.2f} s" if share == 1.0 else "")
        for case, (share, time) in ends.items()
    )
    carried = error < 1e-9 and pair < 1e-6 * peak.mean
    falls = ends["a push of the upright rig"][0] > 0.5
    conditions = (
        "the thrust bearing locked; on a free one the tilt turns the rig about the vertical, and the law lets it fall"
        if falls
        else ""
    )
    growing = float(np.real(n.poles).max())
    return Claim(
        place="Fig. 2, the bearing",
        says="The pendulum has one degree of freedom, its tilt: there is no yaw in (1).",
        found=(
            f"One gimbal leaves a torque about the vertical, dH/dt with H = J_d w_d cos x3 cos q_b and smaller terms, "
            f"which MuJoCo's inverse dynamics confirm to {error:.0e} N m. A locked bearing carries up to "
            f"{peak.mean:.3f} +- {peak.half:.3f} N m at a push ({found.worlds} seeds; "
            f"{np.abs(found.mean_torque).max():.3f} in their mean), and {rest.mean:.3f} +- {rest.half:.3f} N m RMS "
            f"that the tilt's noise makes before it; a scissored pair's carries {pair:.0e} N m. On a free "
            f"bearing, with the exact rate in the law: {told}. There the yaw takes up the tilt: (J_d w_d)^2/(2 I_z) = "
            f"{n.gyroscopic_stiffness:.2f} N m/rad against gravity's {n.gravity_stiffness:.2f}, so little is left to "
            f"bring the gimbal back with, and of the wrong sign: the linearised law has a pole at {growing:+.3f} 1/s, "
            "and a start off the upright makes the gimbal run away."
        ),
        verdict=verdict(carried, conditions),
        why=conditions if carried else "What the bearing carries is not what the closed form says.",
        figures={
            "peak_torque_at_push_n_m": list(peak),
            "peak_of_the_mean_torque_n_m": float(np.abs(found.mean_torque).max()),
            "rms_torque_before_push_n_m": list(rest),
            "closed_form_error_n_m": error,
            "peak_torque_of_the_pair_n_m": pair,
            "yaw_inertia_kg_m2": n.yaw_inertia,
            "gyroscopic_stiffness_n_m_rad": n.gyroscopic_stiffness,
            "gravity_stiffness_n_m_rad": n.gravity_stiffness,
            "poles_on_free_bearing_1_s": [[p.real, p.imag] for p in n.poles.tolist()],
            "free": {case: {"fell_fraction": share, "end_time_s": list(time)} for case, (share, time) in ends.items()},
            "worlds": found.worlds,
        },
        pictures=[_picture(found)],
    )


def _picture(found: Study) -> Picture:
    one, free = found.locked[0], found.free["a push of the upright rig"].trajectory.world(0)
    plant = experiment([BIAS]).plant
    t, s = one.time_s, free["time_s"]
    push = pushed(free)
    x1, x3 = one.motion.q[:, 0] - plant.tilt_zero, one.motion.q[:, 1] - plant.cubes[0].gimbal_zero
    panels = [
        Panel("tilt [deg]", [Line(t, np.degrees(x1), color=0)], "locked bearing", shaded=push),
        Panel("tilt [deg]", [Line(s, np.degrees(free["x1_rad"]), color=0)], "free bearing", shaded=push),
        Panel("gimbal angle [deg]", [Line(t, np.degrees(x3), color=0)], shaded=push),
        Panel("gimbal angle [deg]", [Line(s, np.degrees(free["x3_rad"]), color=0)], shaded=push),
        Panel(
            "torque about the\nvertical [N m]",
            [
                Line(t, one.torque, "on the bearing", color=1, width=0.5),
                Line(t, found.mean_torque, f"mean of {found.worlds} seeds", color=3, width=1.2),
                Line(found.pair.time_s, found.pair.torque, "scissored pair", color=2),
            ],
            shaded=push,
        ),
        Panel("yaw rate [rad/s]", [Line(s, free["rate/yaw_rad_s"], color=1)], shaded=push),
    ]
    title = "sokolov2019, Fig. 2: one gimbal on its thrust bearing, the exact rate in the law, a push at 1 s"
    return Picture("sokolov2019-bearing", title, panels, columns=2)

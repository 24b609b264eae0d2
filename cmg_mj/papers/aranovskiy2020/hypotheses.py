"""Section II: Hypotheses 1 to 3 kept, and broken on purpose, and servos that track a velocity.

Pairs whose halves differ turn body A. The controller and the observers do not know the change.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from cmg_mj.papers.claim import Array, Claim
from cmg_mj.papers.linear_check import mass_matrix
from cmg_mj.papers.pair import DURATION_S, PUSH_RECOVERY, push_recovery, run_on_rigs
from cmg_mj.papers.recorded import largest_size, push_intervals, rms, trace, trajectory_of
from cmg_mj.plant.plant import Plant, load_plant
from cmg_mj.results.intervals import Interval, known_interval, ratio_interval
from cmg_mj.results.result import Result
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.view.plots.figure import Line, Panel, Picture

SEED, WORLDS = 75_000, 4

# --- pairs whose halves differ ----------------------------------------------------------------------------------


def spoil(rig: Plant, kind: str, size: float) -> None:
    """Break a rig: its second cube differs by one kind of `MISMATCHES`, of a size."""
    model, key, module = rig.model, rig.key, rig.axis.modules[1]
    if kind == "flywheel speed":  # slower by a share (Hypotheses 2 and 3)
        model.key_ctrl[key, module.motor] *= 1.0 - size
        model.key_qvel[key, module.flywheel] *= 1.0 - size
    elif kind == "gimbal offset":  # off its place at the start, by an angle [deg] (Hypothesis 2)
        offset = module.direction * math.radians(size)
        model.key_qpos[key, module.gimbal] += offset
        model.key_act[key, model.actuator_actadr[module.servo]] += offset
    elif kind == "servo gain":  # the gimbal turns farther than commanded, by a share (Hypothesis 1)
        gear = 1.0 / (1.0 + size)
        # Its setpoint counts in angle times gear, from where the gimbal starts.
        model.actuator_gear[module.servo, 0] = gear
        model.key_act[key, model.actuator_actadr[module.servo]] = gear * model.key_qpos[key, module.gimbal]
    else:  # dry friction, of which the first gimbal has none (Hypothesis 1)
        model.dof_frictionloss[module.gimbal] = size


class Mismatch(NamedTuple):
    """One way in which the second cube differs: see `spoil`."""

    kind: str
    sizes: Sequence[float]
    """Sizes that are tried."""
    unit: str
    display_factor: float = 1.0
    """Number by which a size is multiplied to be shown in that unit."""
    is_predictable: bool = True
    """Whether `predict_yaw_rate` has it."""

    def words(self, size: float) -> str:
        """Write one size of it."""
        return f"{self.kind} {self.display_factor * size:g} {self.unit}"


MISMATCHES = (
    Mismatch("flywheel speed", (0.01, 0.02, 0.05, 0.1), "%", 100.0),
    Mismatch("gimbal offset", (1.0, 2.0, 5.0, 10.0), "deg"),
    Mismatch("servo gain", (0.02, 0.05, 0.1, 0.2), "%", 100.0),
    Mismatch("gimbal friction", (0.1, 0.3, 1.0), "N m", is_predictable=False),
)


class MismatchRuns(NamedTuple):
    """Symmetric and broken rigs on the same noise and push."""

    plant: Plant
    """The symmetric rig."""
    symmetric: Result
    """Run of the symmetric rig, of all worlds."""
    broken: dict[tuple[str, float], Result]
    """(kind, size) -> run."""


def run_all(
    mismatches: Sequence[Mismatch], worlds: int, seed: int, duration_s: float, settings: Sequence[str] = ()
) -> MismatchRuns:
    """Run every mismatch in some worlds, all at once, with (11) in the loop and the push of Figs 5 to 7."""
    # A rig is changed after its step has been chosen, and friction wants a short one to conserve momentum.
    experiment = push_recovery("homogeneous", seed, ["plant.timestep_s=0.001", *settings], duration_s)
    cases = [(mismatch, size) for mismatch in mismatches for size in mismatch.sizes]
    rigs = [load_plant(experiment.scenario.plant) for _ in range(1 + len(cases))]
    for rig, (mismatch, size) in zip(rigs[1:], cases, strict=True):
        spoil(rig, mismatch.kind, size)
    symmetric, *broken = run_on_rigs(experiment, rigs, worlds)
    kinds = [(mismatch.kind, size) for mismatch, size in cases]
    return MismatchRuns(rigs[0], symmetric, dict(zip(kinds, broken, strict=True)))


# --- the turn of body A: conservation of momentum about the vertical --------------------------------------------


def inertias(plant: Plant) -> Array:
    """Read the parts of the momentum about the vertical off the mass matrix at the keyframe.

    Returns:
        Inertia of all that turns with body A, I_c + I_d of a gimbal about its own axis, and J_d, (3,) [kg m^2].
    """
    data = mujoco.MjData(plant.model)
    mujoco.mj_resetDataKeyframe(plant.model, data, plant.key)
    M, module = np.diag(mass_matrix(plant.model, data)), plant.axis.modules[0]
    return M[[plant.yaw or 0, module.gimbal, module.flywheel]]


def balanced_yaw_rate(plant: Plant, trajectory: Trajectory) -> Array:
    """Body A's rate by conservation: no torque acts about the vertical, so I q_a' + what is carried stays [rad/s].

    Gimbals and flywheels carry momentum. The gimbals' axis is b_x, whose vertical part is -sin q_b; the flywheels' is
    b_y cos q_c + b_z sin q_c, whose vertical part is cos q_b sin q_c.
    """
    (yaw, gimbal, spin), names = inertias(plant), plant.joint_names
    tilt = trajectory[f"angle/{names[plant.tilt]}_rad"]
    momentum = np.zeros_like(tilt)
    for module in plant.axis.modules:
        angle = trajectory[f"angle/{names[module.gimbal]}_rad"]
        turning = trajectory[f"rate/{names[module.gimbal]}_rad_s"]
        spinning = trajectory[f"rate/{names[module.flywheel]}_rad_s"]
        momentum = momentum - gimbal * turning * np.sin(tilt)
        momentum = momentum + spin * spinning * np.cos(tilt) * np.sin(angle)
    return (momentum[0] - momentum) / yaw


def predict_yaw_rate(kind: str, size: float, plant: Plant, trajectory: Trajectory) -> Array:
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
    yaw, gimbal, spin = inertias(plant)
    tilt = trajectory[f"angle/{plant.joint_names[plant.tilt]}_rad"]
    x3, turning = trajectory["x3_rad"], np.gradient(trajectory["x3_rad"], trajectory["time_s"], axis=0)
    h = spin * abs(plant.axis.modules[0].speed) * np.cos(tilt)
    if kind == "flywheel speed":
        momentum = size * h * np.cos(x3)
    elif kind == "gimbal offset":
        half = math.radians(size) / 2.0
        momentum = h * (np.cos(x3 - half) - np.cos(x3 + half))
    else:  # servo gain
        first = 2.0 * x3 / (2.0 + size)
        momentum = h * (np.cos(first) - np.cos((1.0 + size) * first)) + gimbal * size * turning * np.sin(tilt)
    return (momentum[0] - momentum) / yaw


# --- the claims -------------------------------------------------------------------------------------------------


def measure_yaw(runs: MismatchRuns, mismatch: Mismatch, size: float) -> dict[str, Any]:
    """Measure the motion of body A under one mismatch.

    Returns:
        Largest turn and rate, means over the worlds; the turn foreseen from the symmetric rig, None if it is not; the
        largest miss of the rate by conservation, by the largest rate; velocity RMS error and tilt RMS by those of the
        symmetric rig, world by world.
    """
    result = runs.broken[mismatch.kind, size]
    run = trajectory_of(result)
    rate = run["rate/yaw_rad_s"]
    largest = np.abs(rate).max(axis=0)
    miss = np.abs(balanced_yaw_rate(runs.plant, run) - rate).max(axis=0)
    foreseen = None
    if mismatch.is_predictable:
        angle = np.cumsum(predict_yaw_rate(mismatch.kind, size, runs.plant, trajectory_of(runs.symmetric)), axis=0)
        foreseen = _largest_deg(angle * float(run["time_s"][1] - run["time_s"][0]))
    return {
        "turn_deg": _largest_deg(run["angle/yaw_rad"]),
        "turn_foreseen_deg": foreseen,
        "largest_rate_rad_s": largest.mean(),
        "conservation_miss": (miss / largest).max(),
        **{
            f"{name}_by_symmetric": ratio_interval(result.values(key), runs.symmetric.values(key))
            for name, key in (("velocity_rms_error", "velocity_rms_error_rad_s"), ("tilt_rms", "tilt_rms_deg"))
        },
    }


def _largest_deg(angle: Array) -> float:
    """Return the largest size of an angle, mean over the worlds, from (n_ticks, n_worlds) [rad]."""
    return np.degrees(np.abs(angle).max(axis=0)).mean()


def symmetric_claim(runs: MismatchRuns) -> Claim:
    """Judge Hypotheses 1 and 2 kept."""
    turn = np.degrees(largest_size(trajectory_of(runs.symmetric)["angle/yaw_rad"]))
    return Claim(
        "Hypotheses 1 and 2",
        "With symmetric gimbals, flywheels and commands no torque acts on body A: it stands still.",
        holds=turn < 1e-6,
        figures={"largest_turn_deg": turn},
    )


def broken_claim(runs: MismatchRuns) -> Claim:
    """Judge Hypotheses 1 and 2 broken."""
    yaws = {m.words(size): measure_yaw(runs, m, size) for m in MISMATCHES for size in m.sizes}
    none_fell = all(result.stood.all() for result in (runs.symmetric, *runs.broken.values()))
    symmetric = trajectory_of(runs.symmetric)
    t, shaded = symmetric["time_s"], push_intervals(symmetric.world(0))
    rates, turns, sweep = [], [], []
    for i, mismatch in enumerate(MISMATCHES):
        size, largest = mismatch.sizes[-2:]
        run = trajectory_of(runs.broken[mismatch.kind, size]).world(0)
        rates.append(trace(run, "rate/yaw_rad_s", mismatch.words(size), color=i))
        turns.append(trace(run, "angle/yaw_rad", color=i))
        x, measured = [s / largest for s in mismatch.sizes], [yaws[mismatch.words(s)] for s in mismatch.sizes]
        label = mismatch.words(largest).replace(mismatch.kind, f"{mismatch.kind}, 1 is")
        sweep.append(Line(x, [yaw["turn_deg"] for yaw in measured], label, "o-", color=i))
        if mismatch.is_predictable:
            predicted_rate = predict_yaw_rate(mismatch.kind, size, runs.plant, symmetric)[:, 0]
            rates.append(Line(t, predicted_rate, "" if i else "foreseen", "k--", width=0.8))
            turns.append(Line(t, np.degrees(np.cumsum(predicted_rate) * (t[1] - t[0])), style="k--", width=0.8))
            sweep.append(Line(x, [yaw["turn_foreseen_deg"] for yaw in measured], style="kx"))
    return Claim(
        "After Hypothesis 3",
        "If Hypotheses 1 and 2 are violated the reduced model is off by an unknown term; the experiments "
        "show the assumptions to be reasonable for the velocity estimation.",
        holds=none_fell and max(abs(yaw["velocity_rms_error_by_symmetric"].mean - 1.0) for yaw in yaws.values()) < 0.1,
        assumes={**PUSH_RECOVERY, "mismatch": ", ".join(f"up to {m.words(m.sizes[-1])}" for m in MISMATCHES)},
        conditions="For the tilt and its estimate, up to the mismatches tried. Body A itself does not stay: on a "
        "bearing without friction it turns while the gimbals are out, and stays where it was left.",
        figures=yaws,
        picture=Picture(
            "aranovskiy2020-hypotheses",
            "aranovskiy2020, Hypotheses 1 and 2 broken: what thrust bearing A does (dashed and x: foreseen)",
            [
                Panel("yaw rate of A [rad/s]", rates, "world 0", shaded=shaded),
                Panel("yaw of A [deg]", turns, shaded=shaded),
                Panel("largest turn [deg]", sweep, "", "mismatch by the largest tried", "log", "log"),
            ],
            share_x=False,
        ),
    )


def hypothesis_3(runs: MismatchRuns) -> Claim:
    """Judge whether the flywheels' speed is constant."""
    plant, run = runs.plant, trajectory_of(runs.symmetric)
    modules, model = plant.axis.modules, plant.reduced

    def rate(joint: int) -> Array:
        return run[f"rate/{plant.joint_names[joint]}_rad_s"]

    speeds = np.stack([np.abs(rate(module.flywheel)) for module in modules])
    nominal = abs(modules[0].speed)
    speed_error = largest_size(speeds - nominal)
    gimbal = max(largest_size(rate(module.gimbal)) for module in modules)
    tilt = largest_size(run["x2_rad_s"])
    spin_up = np.gradient(speeds[0], run["time_s"], axis=0)
    D = model.J1 + model.J2 * np.sin(run["x3_rad"]) ** 2
    omitted_term = model.J_d * np.sin(run["x3_rad"]) * spin_up / D
    acceleration = np.gradient(run["x2_rad_s"], run["time_s"], axis=0)
    share = rms(omitted_term.ravel()) / rms(acceleration.ravel())
    return Claim(
        "Hypothesis 3",
        "The flywheels' speed is held constant and far above the rates of tilt and gimbals.",
        assumes={**PUSH_RECOVERY, "drive": "a speed loop of 0.11 s, at most 0.5 N m"},
        holds=speed_error / nominal < 0.01 and share < 0.01 and nominal > 10.0 * max(gimbal, tilt),
        figures={
            "largest_speed_error_rad_s": speed_error,
            "speed_by_fastest_gimbal_rate": nominal / gimbal,
            "speed_by_fastest_tilt_rate": nominal / tilt,
            "omitted_term_share": share,
        },
    )


def claims() -> list[Claim]:
    """Judge Hypotheses 1 and 2 kept, then broken, and Hypothesis 3."""
    runs = run_all(MISMATCHES, WORLDS, SEED, DURATION_S)
    return [symmetric_claim(runs), broken_claim(runs), hypothesis_3(runs)]


# --- servos that track a velocity, and how far a deadband of theirs may go ----------------------------------------

SERVO_SEED, SERVO_WORLDS = 78_000, 4
LAG_S, SOFT_LAG_S = 0.001, 0.005
"""I/kv, in which a free gimbal comes near a new velocity: a stiff servo and a soft one [s]; the paper has neither."""
COMMAND_LAG_S = 0.0005
"""Half a physics step: Runge-Kutta 4 follows nothing much faster [s]."""
RESOLUTION = 0.0119
"""0.114 rev/min, the unit of the speed command of the MX-106 in wheel mode (e-Manual, MX-106) [rad/s]."""
DEADBANDS = (0.0, RESOLUTION, 0.05, 0.1, 0.2, 0.4)
"""Speeds below which the gimbal stands still [rad/s]; the paper says nothing of one."""
MEANS_S = 0.1
"""Over which rate and command are compared: the command's noise changes from period to period [s]."""
WITHIN = 0.1
"""An estimate and a rig that change by less have not noticed."""


def in_velocity_mode(plant: Plant, deadband: float, lag_s: float = LAG_S) -> None:
    """Give both gimbals a servo with the torque kv (u - rate), and dry friction that makes a deadband of it.

    With the friction kv times the deadband the gimbal stands while |u| is less, and turns slower by it otherwise.
    MuJoCo's velocity servo has no state; here the state that the bench's has is the command, late by `COMMAND_LAG_S`.

    Args:
        plant: A rig of its own, nothing has run on it.
        deadband: Speed below which the gimbal stands still [rad/s].
        lag_s: I/kv [s].
    """
    model = plant.model
    for module in plant.axis.modules:
        i = module.servo
        dof = model.jnt_dofadr[module.gimbal]
        kv = model.dof_M0[dof] / lag_s
        model.actuator_dyntype[i] = mujoco.mjtDyn.mjDYN_FILTEREXACT
        model.actuator_dynprm[i, 0] = COMMAND_LAG_S
        model.actuator_gainprm[i, 0] = kv
        model.actuator_biasprm[i, :3] = 0.0, 0.0, -kv
        model.dof_frictionloss[dof] = kv * deadband
        # MuJoCo's friction creeps, unless it is as hard as the step allows.
        model.dof_solref[dof], model.dof_solimp[dof, :2] = (2.0 * model.opt.timestep, 1.0), 0.9999
        model.key_act[plant.key, model.actuator_actadr[i]] = 0.0


class Servos(NamedTuple):
    """The runs, the same worlds each."""

    position: Result
    """Runs with the bench's servo."""
    velocity: Mapping[float, Result]
    """Deadband [rad/s] -> runs with the servo in velocity mode."""
    soft: Result
    """Runs of the soft servo in velocity mode, without a deadband."""


def run_servos(worlds: int = SERVO_WORLDS, seed: int = SERVO_SEED, duration_s: float = DURATION_S) -> Servos:
    """Close the loop on (11), with the push of Figs 5 to 7, on every servo."""
    experiment = push_recovery("homogeneous", seed, ["plant.timestep_s=0.001"], duration_s)
    cases = [*((deadband, LAG_S) for deadband in DEADBANDS), (0.0, SOFT_LAG_S)]
    rigs = [load_plant(experiment.scenario.plant) for _ in cases]
    for rig, case in zip(rigs, cases, strict=True):
        in_velocity_mode(rig, *case)
    *groups, soft = run_on_rigs(experiment, rigs, worlds)
    return Servos(experiment.run_many(worlds), dict(zip(DEADBANDS, groups, strict=True)), soft)


def measure_tracking(result: Result) -> Interval | None:
    """RMS of the gimbals' rate less the command, means over `MEANS_S`, by that of the command; worlds that stood."""
    run = trajectory_of(result)
    span = round(MEANS_S / float(run["time_s"][1] - run["time_s"][0]))
    ends = np.arange(0, len(run["time_s"]), span)
    rates = np.diff(run["x3_rad"][ends], axis=0) / MEANS_S
    command = np.add.reduceat(run["u_rad_s"], ends[:-1])[: len(rates)] / span
    command[-1] = run["u_rad_s"][ends[-2] : ends[-1]].mean(axis=0)
    relative_errors = np.sqrt(np.mean((rates - command) ** 2, axis=0) / np.mean(command**2, axis=0))
    return known_interval(np.where(result.stood, relative_errors, np.nan))


def servo_claim(servos: Servos) -> Claim:
    """Judge the runs: a deadband of the servo's resolution must be felt neither in the estimate nor in the tilt."""
    results, smooth = servos.velocity, servos.velocity[0.0]
    velocity, tilt = (
        {d: ratio_interval(result.values(key), smooth.values(key)) for d, result in results.items()}
        for key in ("velocity_rms_error_rad_s", "tilt_rms_deg")
    )
    falls = {d: result.fell.mean() for d, result in results.items()}
    errors = {d: measure_tracking(result) for d, result in results.items()}
    error = errors[RESOLUTION]
    changes = [abs(ratios[RESOLUTION].mean - 1.0) for ratios in (velocity, tilt)]
    tilts, turns = [], []
    shown = {"the bench's servo": servos.position} | {
        f"deadband {d:g} rad/s": servos.velocity[d] for d in (0.0, DEADBANDS[3], DEADBANDS[-1])
    }
    for color, (label, result) in enumerate(shown.items()):
        run = trajectory_of(result).world(0)
        tilts.append(trace(run, "x1_rad", label, color=color, width=0.8))
        turns.append(trace(run, "x3_rad", color=color, width=0.8))
    return Claim(
        "After (2), the servos",
        "The gimbals' servos ensure velocity tracking, so that omega_c can be taken for an input.",
        assumes={**PUSH_RECOVERY, "servo": f"a lag of {1e3 * LAG_S:g} ms", "friction": "a deadband"},
        holds=falls[RESOLUTION] == 0.0 and max(changes) < WITHIN and error is not None and error.mean < WITHIN,
        conditions="With a servo that stiff, up to a deadband of 0.05 rad/s, with which the estimate's error and the "
        "tilt stay within 10 %; the paper says nothing of one.",
        figures={
            "deadband_rad_s": DEADBANDS,
            "velocity_rms_error_by_none": list(velocity.values()),
            "tilt_rms_by_none": list(tilt.values()),
            "tracking_error_share": list(errors.values()),
            "tracking_error_share_soft": measure_tracking(servos.soft),
            "fell_fraction": list(falls.values()),
            "bench_servo_velocity_rms_error_by_none": ratio_interval(
                *(result.values("velocity_rms_error_rad_s") for result in (servos.position, smooth))
            ),
        },
        picture=Picture(
            "aranovskiy2020-servo",
            "aranovskiy2020, Section II: the gimbals' servos in velocity mode, with a deadband, world 0",
            [Panel("tilt x1 [deg]", tilts), Panel("gimbal angle x3 [deg]", turns)],
        ),
    )

"""Section II: servos that track a velocity, and how far a deadband of theirs may go."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.papers.aranovskiy2020.rig import DURATION_S, PUSH_RECOVERY, push_recovery, run_on_rigs
from cmg_mj.papers.claim import Claim
from cmg_mj.papers.recorded import trajectory_of
from cmg_mj.plant.plant import Plant, load_plant
from cmg_mj.results.intervals import Interval, known_interval, ratio_interval
from cmg_mj.results.result import Result
from cmg_mj.view.plots.figure import Line, Panel, Picture

SEED, WORLDS = 78_000, 4
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
        dof = int(model.jnt_dofadr[module.gimbal])
        kv = model.dof_M0[dof] / lag_s
        model.actuator_dyntype[i] = int(mujoco.mjtDyn.mjDYN_FILTEREXACT)
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


def run(worlds: int = WORLDS, seed: int = SEED, duration_s: float = DURATION_S) -> Servos:
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


def velocity_servos() -> Claim:
    """Judge whether the commanded velocity can be taken for the gimbal's."""
    return servo_claim(run())


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
    return Claim(
        place="After (2), the servos",
        statement="The gimbals' servos ensure velocity tracking, so that omega_c can be taken for an input.",
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
        pictures=[_picture(servos)],
    )


def _picture(servos: Servos) -> Picture:
    tilts, turns = [], []
    results = {"the bench's servo": servos.position} | {
        f"deadband {d:g} rad/s": servos.velocity[d] for d in (0.0, DEADBANDS[3], DEADBANDS[-1])
    }
    for color, (label, result) in enumerate(results.items()):
        run = trajectory_of(result).world(0)
        tilts.append(Line(run["time_s"], np.degrees(run["x1_rad"]), label, color=color, width=0.8))
        turns.append(Line(run["time_s"], np.degrees(run["x3_rad"]), color=color, width=0.8))
    return Picture(
        "aranovskiy2020-servo",
        "aranovskiy2020, Section II: the gimbals' servos in velocity mode, with a deadband, world 0",
        [Panel("tilt x1 [deg]", tilts), Panel("gimbal angle x3 [deg]", turns)],
    )

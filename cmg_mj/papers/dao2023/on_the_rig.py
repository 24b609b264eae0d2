"""The observer on the scissored pair, as `adaptive`."""

from __future__ import annotations

import numpy as np

from cmg_mj.papers.claim import Claim, OnShare, obtain
from cmg_mj.papers.dao2023 import adaptive_rig as rig
from cmg_mj.papers.recorded import trajectory_of
from cmg_mj.results.intervals import mean_interval
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.view.plots.figure import Line, Panel, Picture

OTHERS = ("linear", "ltv", "homogeneous")
WITHIN_DEG = 0.15
"""The bias counts as found up to this RMS error [deg]."""


def claims(on_share: OnShare) -> list[Claim]:
    """Judge the bias, the velocity, torques."""
    return obtain([bias, velocity, torques], on_share)


def share_within(errors: np.ndarray, bound: float) -> float:
    """Return the share of worlds whose error is at most a bound."""
    return float(np.mean(errors <= bound))


def bias(seed: int = 50_000, worlds: int = 20) -> Claim:
    """Judge the estimate of the equilibrium bias."""
    biases = rig.signed_biases(seed, worlds)
    result = rig.learnt_bias(seed, biases, keep_trajectory=True)
    rms = rig.errors(result, "bias_rms_error_deg")
    offset_mg = (5.0, -3.0)
    offset_run = rig.learnt_bias(seed + 1, biases[:6], offset_mg)
    excess, expected_excess = (offset_run.values(key) - biases[:6] for key in ("bias_estimate_deg", "bias_deg"))
    share = share_within(rms, WITHIN_DEG)
    remark = (
        f"Six bodies, datasheet sensors (400 ug/rtHz), 200 Hz, no push, {worlds} worlds with |e| "
        "from 0.3 to 1.5 degrees; gains from docs/studies/tune_adaptive.py. The servo's lag, which the observer does "
        "not know, does not prevent it."
    )
    return Claim(
        place="On the rig: equilibrium bias",
        statement=f"`adaptive` finds the equilibrium bias together with the state, to {WITHIN_DEG} degrees RMS over "
        "seconds 5 to 10.",
        assumes={"push": "none", "e": "0.3 to 1.5 deg", "noise": "400 ug/rtHz"},
        holds=share >= 0.95 and share_within(rig.errors(offset_run, "bias_rms_error_deg"), WITHIN_DEG) == 1.0,
        conditions=remark,
        otherwise=remark,
        figures={
            "bias_deg": biases,
            "bias_rms_error_deg": rms.tolist(),
            "accelerometer_bias_mg": list(offset_mg),
            "found_less_e_deg": excess.tolist(),
            "expected_less_e_deg": expected_excess.tolist(),
        },
        pictures=[_picture_of_bias(trajectory_of(result).between(0.0, 5.0), biases)],
        is_ours=True,
    )


def _picture_of_bias(trajectory: Trajectory, biases: list[float]) -> Picture:
    estimates = np.degrees(trajectory["estimate/adaptive/bias_rad"])
    lines = [Line(trajectory["time_s"], estimates[:, i], f"e = {biases[i]:.2f} deg", width=0.8) for i in range(6)]
    title = "dao2023, on the six-body rig: the bias that the adaptive observer finds, six worlds"
    return Picture("dao2023-rig-bias", title, (Panel("estimate of e [deg]", lines),))


def velocity(seed: int = 51_000, worlds: int = 5) -> Claim:
    """Judge the velocity's error beside that of observers that take e for zero."""
    biases = (0.0, 0.5, 1.0, 1.5)
    errors = rig.velocity_errors(seed, worlds, ("adaptive", *OTHERS), biases)
    biased_cases = [i for i, value in enumerate(biases) if value >= 0.5]
    intervals = {name: [mean_interval(row) for row in values] for name, values in errors.items()}
    means = {name: [interval.mean for interval in row] for name, row in intervals.items()}
    halves = {name: [interval.half for interval in row] for name, row in intervals.items()}

    remark = (
        f"As above, {worlds} worlds a bias, the observer in the loop, no push. Without bias there "
        "is nothing to learn, and learning costs noise: there, homogeneous has "
        f"{means['homogeneous'][0]:.3f} and adaptive {means['adaptive'][0]:.3f} rad/s."
    )
    picture = Picture(
        "dao2023-rig-velocity",
        f"dao2023, on the six-body rig: velocity RMS error in the loop ({worlds} worlds, 95 % intervals)",
        (
            Panel(
                "velocity RMS error [rad/s]",
                [Line(biases, means[name], name, "o-", name, spread=halves[name]) for name in errors],
                x_label="equilibrium bias e [deg]",
            ),
        ),
    )
    return Claim(
        place="On the rig: velocity",
        statement="From e = 0.5 degrees up, the velocity error of `adaptive` is smaller than that of (9), (10), (11) "
        "of aranovskiy2020, which take e for zero.",
        assumes={"push": "none", "e": "0.5 to 1.5 deg", "noise": "400 ug/rtHz"},
        holds=all((errors["adaptive"] < errors[name])[biased_cases].all() for name in OTHERS),
        conditions=remark,
        otherwise=remark,
        figures={"bias_deg": list(biases)}
        | {f"{name}_velocity_rms_error_rad_s": values for name, values in means.items()}
        | {f"{name}_half_interval_rad_s": values for name, values in halves.items()},
        pictures=[picture],
        is_ours=True,
    )


def torques(seed: int = 52_000, worlds: int = 4) -> Claim:
    """Judge a gait's torque, and a constant one."""
    gait = rig.learnt_gait(seed, rig.signed_biases(seed, worlds))
    torque = rig.learnt_torque(seed + 1, worlds)
    remark = f"As above, {worlds} worlds; a torque of 0.3 N m at 1 Hz with e unknown; 0.1 N m, constant, with e known."
    better = (gait["knowing_rad_s"] < gait["not_knowing_rad_s"]).all()
    return Claim(
        place="On the rig: disturbance torques",
        statement="`adaptive` finds a sinusoidal torque of known frequency, and the state in spite of it; a constant "
        "torque too.",
        assumes={"push": "0.3 N m at 1 Hz, or 0.1 N m", "e": "0.3 to 1.5 deg", "noise": "400 ug/rtHz"},
        holds=bool(better and gait["disturbance_n_m"].max() < 0.06 and torque.max() < 0.02),
        conditions=remark,
        otherwise=remark,
        figures={name: values.tolist() for name, values in gait.items()}
        | {"constant_torque_rms_error_n_m": torque.tolist()},
        is_ours=True,
    )

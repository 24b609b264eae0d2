"""Hypotheses 1 to 3 of aranovskiy2020 kept, and broken on purpose."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cmg_mj.papers.aranovskiy2020.mismatch import MISMATCHES, Mismatch, MismatchRuns, run_all
from cmg_mj.papers.aranovskiy2020.rig import DURATION_S
from cmg_mj.papers.aranovskiy2020.yaw_momentum import balanced_yaw_rate, predict_yaw_rate
from cmg_mj.papers.assumed import PUSH_RECOVERY
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.recorded import push_intervals, rms, trajectory_of
from cmg_mj.results.intervals import Interval, ratio_interval
from cmg_mj.view.plots.figure import Line, Panel, Picture

SEED = 75_000
WORLDS = 4


class Yaw(NamedTuple):
    """The motion of body A under one mismatch."""

    drift_deg: float
    """Largest turn, mean over the worlds."""
    rate_rad_s: float
    """Largest rate, mean over the worlds."""
    predicted_deg: float
    """Largest turn as foreseen from the symmetric rig; NaN if it is not."""
    balance: float
    """Largest miss of the rate by conservation, by the largest rate."""
    velocity: Interval
    """Velocity RMS error by that of the symmetric rig, world by world."""
    tilt: Interval
    """Tilt RMS by that of the symmetric rig."""


def measure_yaw(runs: MismatchRuns, mismatch: Mismatch, size: float) -> Yaw:
    """Measure one mismatch."""
    mismatched = runs.broken[mismatch.kind, size]
    run = trajectory_of(mismatched)
    rate, angle = run["rate/yaw_rad_s"], run["angle/yaw_rad"]
    largest = np.abs(rate).max(axis=0)
    miss = np.abs(balanced_yaw_rate(runs.plant, run) - rate).max(axis=0)
    predicted_deg = math.nan
    if mismatch.is_predictable:
        predicted_rate = predict_yaw_rate(mismatch.kind, size, runs.plant, trajectory_of(runs.symmetric))
        step = float(run["time_s"][1] - run["time_s"][0])
        predicted_deg = float(np.degrees(np.abs(np.cumsum(predicted_rate, axis=0) * step).max(axis=0)).mean())

    def ratio(key: str) -> Interval:
        return ratio_interval(mismatched.values(key), runs.symmetric.values(key))

    return Yaw(
        float(np.degrees(np.abs(angle).max(axis=0)).mean()),
        float(largest.mean()),
        predicted_deg,
        float((miss / largest).max()),
        ratio("velocity_rms_error_rad_s"),
        ratio("tilt_rms_deg"),
    )


# --- claims ---------------------------------------------------------------------------------------------------


def symmetric_claim(runs: MismatchRuns) -> Claim:
    """Judge Hypotheses 1 and 2 kept."""
    turn = float(np.degrees(np.abs(trajectory_of(runs.symmetric)["angle/yaw_rad"]).max()))
    return Claim(
        place="Hypotheses 1 and 2",
        statement="With symmetric gimbals, flywheels and commands no torque acts on body A: it stands still.",
        holds=turn < 1e-6,
        otherwise="It turns.",
        figures={"largest_turn_deg": turn},
    )


def broken_claim(runs: MismatchRuns) -> Claim:
    """Judge Hypotheses 1 and 2 broken."""
    yaws = {(m, size): measure_yaw(runs, m, size) for m in MISMATCHES for size in m.sizes}
    velocity = max(abs(y.velocity.mean - 1.0) for y in yaws.values())
    return Claim(
        place="After Hypothesis 3",
        statement=(
            "If Hypotheses 1 and 2 are violated the reduced model is off by an unknown term; the experiments show the "
            "assumptions to be reasonable for the velocity estimation."
        ),
        holds=runs.fell == 0 and velocity < 0.1,
        assumes={**PUSH_RECOVERY, "mismatch": ", ".join(f"up to {_size(m, m.sizes[-1])}" for m in MISMATCHES)},
        conditions=(
            "For the tilt and its estimate, up to the mismatches tried. Body A itself does not stay: on a bearing "
            "without friction it turns while the gimbals are out, and stays where it was left."
        ),
        otherwise="The estimate or the rig suffers.",
        figures={
            _size(m, size): {
                "turn_deg": y.drift_deg,
                "turn_foreseen_deg": None if math.isnan(y.predicted_deg) else y.predicted_deg,
                "largest_rate_rad_s": y.rate_rad_s,
                "conservation_miss": y.balance,
                "velocity_rms_error_by_symmetric": y.velocity,
                "tilt_rms_by_symmetric": y.tilt,
            }
            for (m, size), y in yaws.items()
        },
        pictures=[_picture(runs, yaws)],
    )


def _size(mismatch: Mismatch, size: float) -> str:
    return f"{mismatch.kind} {mismatch.display_factor * size:g} {mismatch.unit}"


def _picture(runs: MismatchRuns, yaws: dict[tuple[Mismatch, float], Yaw]) -> Picture:
    symmetric = trajectory_of(runs.symmetric)
    t, shaded = symmetric["time_s"], push_intervals(symmetric.world(0))
    rates, turns, sweep = [], [], []
    for i, mismatch in enumerate(MISMATCHES):
        size = mismatch.sizes[-2]
        run = trajectory_of(runs.broken[mismatch.kind, size])
        rates.append(Line(t, run["rate/yaw_rad_s"][:, 0], _size(mismatch, size), color=i))
        turns.append(Line(t, np.degrees(run["angle/yaw_rad"][:, 0]), color=i))
        if mismatch.is_predictable:
            predicted_rate = predict_yaw_rate(mismatch.kind, size, runs.plant, symmetric)[:, 0]
            rates.append(Line(t, predicted_rate, "" if i else "foreseen", "k--", width=0.8))
            turns.append(Line(t, np.degrees(np.cumsum(predicted_rate) * (t[1] - t[0])), style="k--", width=0.8))
        largest = mismatch.sizes[-1]
        x = [s / largest for s in mismatch.sizes]
        label = f"{mismatch.kind}, 1 is {mismatch.display_factor * largest:g} {mismatch.unit}"
        sweep.append(Line(x, [yaws[mismatch, s].drift_deg for s in mismatch.sizes], label, "o-", color=i))
        if mismatch.is_predictable:
            sweep.append(Line(x, [yaws[mismatch, s].predicted_deg for s in mismatch.sizes], style="kx"))
    return Picture(
        "aranovskiy2020-hypotheses",
        "aranovskiy2020, Hypotheses 1 and 2 broken: what thrust bearing A does (dashed and x: foreseen)",
        [
            Panel("yaw rate of A [rad/s]", rates, "world 0", shaded=shaded),
            Panel("yaw of A [deg]", turns, shaded=shaded),
            Panel("largest turn [deg]", sweep, "", "mismatch by the largest tried", "log", "log"),
        ],
        share_x=False,
    )


def hypothesis_3(runs: MismatchRuns) -> Claim:
    """Judge whether the flywheels' speed is constant."""
    plant, run = runs.plant, trajectory_of(runs.symmetric)
    names = plant.joint_names
    speeds = np.stack([np.abs(run[f"rate/{names[module.flywheel]}_rad_s"]) for module in plant.axis.modules])
    nominal = abs(plant.axis.modules[0].speed)
    speed_error = float(np.abs(speeds - nominal).max())
    gimbal = max(float(np.abs(run[f"rate/{names[module.gimbal]}_rad_s"]).max()) for module in plant.axis.modules)
    tilt = float(np.abs(run["x2_rad_s"]).max())
    model = plant.reduced
    spin_up = np.gradient(speeds[0], run["time_s"], axis=0)
    D = model.J1 + model.J2 * np.sin(run["x3_rad"]) ** 2
    omitted_term = model.J_d * np.sin(run["x3_rad"]) * spin_up / D
    acceleration = np.gradient(run["x2_rad_s"], run["time_s"], axis=0)
    share = float(rms(omitted_term.ravel()) / rms(acceleration.ravel()))
    return Claim(
        place="Hypothesis 3",
        statement="The flywheels' speed is held constant and far above the rates of tilt and gimbals.",
        assumes={**PUSH_RECOVERY, "drive": "a speed loop of 0.11 s, at most 0.5 N m"},
        holds=speed_error / nominal < 0.01 and share < 0.01 and nominal > 10.0 * max(gimbal, tilt),
        otherwise="The speed strays too far.",
        figures={
            "largest_speed_error_rad_s": speed_error,
            "speed_by_fastest_gimbal_rate": nominal / gimbal,
            "speed_by_fastest_tilt_rate": nominal / tilt,
            "omitted_term_share": share,
        },
    )


def claims(on_share: OnShare) -> list[Claim]:
    """Judge Hypotheses 1 and 2 kept, then broken, and Hypothesis 3."""
    on_share(0.0)
    runs = run_all(MISMATCHES, WORLDS, SEED, DURATION_S)
    on_share(0.9)
    return [symmetric_claim(runs), broken_claim(runs), hypothesis_3(runs)]

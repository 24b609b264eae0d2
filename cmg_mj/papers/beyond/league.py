"""All observers over a grid of noise and bias, with intervals."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import binomtest

from cmg_mj.experiment import prepare
from cmg_mj.intervals import mean_interval
from cmg_mj.observers import OBSERVERS
from cmg_mj.papers.beyond.character import character, record_motion, update_us
from cmg_mj.papers.beyond.floor import tilt_noise, velocity_floor
from cmg_mj.papers.claim import OnShare
from cmg_mj.plant import load_plant
from cmg_mj.scenario import load_scenario
from cmg_mj.simulate import Outcome

NOISES_UG = (200.0, 400.0, 800.0)
BIASES_DEG = (0.0, 0.5, 1.0)
MEANS = {
    "velocity_rms_error_rad_s": "velocity RMS error [rad/s]",
    "settle_time_s": "settle time [s]",
    "tilt_rms_deg": "tilt RMS [deg]",
    "command_rms_rad_s": "command RMS [rad/s]",
}
"""Of a run's summary, with their headings."""


def league(worlds: int, seed: int, on_share: OnShare, kinds: Sequence[str] = tuple(OBSERVERS)) -> list[dict[str, Any]]:
    """Run every observer in `push_recovery` at every noise and bias.

    World i has the same noise for all observers and biases of one noise level.

    Args:
        worlds: How many a cell.
        seed: Of the sensors' noise.
        on_share: Called with the share done.
        kinds: The observers.

    Returns:
        A row an observer, noise and bias. Means are over the worlds that stood to the end; intervals are of 95 %.
    """
    rows = []
    for i, noise_ug in enumerate(NOISES_UG):
        motion = record_motion(noise_ug, min(worlds, 20), seed + 1)
        for j, kind in enumerate(kinds):
            seen = character(kind, motion)
            cost = update_us(kind, motion)
            for bias_deg, cell in zip(BIASES_DEG, _cells(kind, noise_ug, worlds, seed), strict=True):
                rows.append(
                    {
                        "observer": kind,
                        "noise_ug_rthz": noise_ug,
                        "bias_deg": bias_deg,
                        **cell,
                        "push_lag_s": seen.lag_s,
                        "noise_gain_per_s": seen.noise_gain_per_s,
                        "update_us": cost,
                    }
                )
            on_share((i + (j + 1) / len(kinds)) / len(NOISES_UG))
    return rows


def _cells(kind: str, noise_ug: float, worlds: int, seed: int) -> list[dict[str, Any]]:
    """What an observer does at one noise and every bias, all in one batch."""
    settings = [f"sensors.accelerometer.noise_density_ug_rthz={noise_ug}", f"seed={seed}"]
    experiment = prepare(load_scenario("push_recovery", settings, kind))
    scenario = experiment.scenario
    rigs = [load_plant(dataclasses.replace(scenario.plant, equilibrium_bias_deg=bias)) for bias in BIASES_DEG]
    plants = [rig for rig in rigs for _ in range(worlds)]
    result = experiment.run_many([*range(worlds)] * len(rigs), plants=plants, keep_trajectory=False)
    sigma = tilt_noise(scenario.sensors.accelerometer, experiment.plant.radial_tilt)
    floor = velocity_floor(experiment.plant.reduced, experiment.law.dt, sigma)
    cells = []
    for i in range(len(rigs)):
        of = slice(i * worlds, (i + 1) * worlds)
        cells.append(_cell(result.outcomes[of], result.summaries[of], floor))
    return cells


def _cell(outcomes: Sequence[Outcome], summaries: Sequence[dict[str, Any]], floor: float) -> dict[str, Any]:
    stood = [s for s, outcome in zip(summaries, outcomes, strict=True) if outcome.kind == "done"]
    falls = len(outcomes) - len(stood)
    share = binomtest(falls, len(outcomes)).proportion_ci(0.95)
    cell: dict[str, Any] = {
        "worlds": len(outcomes),
        "stood": len(stood),
        "fell_fraction": falls / len(outcomes),
        "fell_fraction_low": float(share.low),
        "fell_fraction_high": float(share.high),
    }
    for key in MEANS:
        values = np.array([s[key] for s in stood if s[key] is not None])
        cell[f"{key}_worlds"] = len(values)
        if len(values) < 2:
            cell |= {key: None, f"{key}_low": None, f"{key}_high": None}
            continue
        mean, low, high = mean_interval(values)
        cell |= {key: mean, f"{key}_low": low, f"{key}_high": high}
    error = cell["velocity_rms_error_rad_s"]
    return cell | {"floor_rad_s": floor, "ratio_to_floor": None if error is None else error / floor}


def markdown(rows: Sequence[dict[str, Any]]) -> str:
    """The table, one block a noise and bias, the smallest velocity error first."""
    headings = ["observer", MEANS["velocity_rms_error_rad_s"], "over the floor", "push lag [ms]", "noise gain [1/s]"]
    headings += [MEANS[key] for key in ("settle_time_s", "tilt_rms_deg", "command_rms_rad_s")]
    headings += ["falls [%]", "update [us]"]
    lines = []
    for noise, bias in dict.fromkeys((row["noise_ug_rthz"], row["bias_deg"]) for row in rows):
        cell = [row for row in rows if (row["noise_ug_rthz"], row["bias_deg"]) == (noise, bias)]
        cell.sort(key=lambda row: row["velocity_rms_error_rad_s"] or np.inf)
        floor = cell[0]["floor_rad_s"]
        lines += ["", f"**{noise:g} ug/rtHz, e = {bias:g} deg** (floor {floor:.4f} rad/s)", ""]
        lines += ["| " + " | ".join(headings) + " |", "|---|" + "---:|" * (len(headings) - 1)]
        lines += [_line(row) for row in cell]
    return "\n".join(lines).strip("\n")


def _line(row: dict[str, Any]) -> str:
    def mean(key: str, digits: int) -> str:
        if row[key] is None:
            return "-"
        return f"{row[key]:.{digits}f} ± {(row[f'{key}_high'] - row[f'{key}_low']) / 2.0:.{digits}f}"

    ratio, lag = row["ratio_to_floor"], row["push_lag_s"]
    low, high = 100.0 * row["fell_fraction_low"], 100.0 * row["fell_fraction_high"]
    cells = [
        f"`{row['observer']}`",
        mean("velocity_rms_error_rad_s", 4),
        "-" if ratio is None else f"{ratio:.1f}",
        "-" if lag is None else f"{1e3 * lag:.1f}",
        f"{row['noise_gain_per_s']:.1f}",
        mean("settle_time_s", 2),
        mean("tilt_rms_deg", 3),
        mean("command_rms_rad_s", 3),
        f"{100.0 * row['fell_fraction']:.0f} ({low:.0f} to {high:.0f})",
        f"{row['update_us']:.1f}",
    ]
    return "| " + " | ".join(cells) + " |"

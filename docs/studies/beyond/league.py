"""Every observer over a grid of noise and bias, with intervals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import binomtest

from beyond.character import character, record_motion, update_us
from beyond.floor import velocity_floor
from beyond.push_recovery import ERROR, on_rigs, push_recovery
from cmg_mj.observers import OBSERVERS
from cmg_mj.papers.claim import OnShare
from cmg_mj.results.intervals import known_interval
from cmg_mj.results.result import Result

NOISES_UG = (200.0, 400.0, 800.0)
BIASES_DEG = (0.0, 0.5, 1.0)
ON_A_PIVOT_AT_REST = tuple(name for name in OBSERVERS if name != "free_pivot")
"""free_pivot is a second gyro_free while the pivot rests: docs/real_rigs_evidence.md has its own table."""
MEANS = (ERROR, "settle_time_s", "tilt_rms_deg", "command_rms_rad_s")
"""The keys of a run's summary that are shown."""


def league(
    worlds: int,
    seed: int,
    on_share: OnShare,
    kinds: Sequence[str] = ON_A_PIVOT_AT_REST,
    noises_ug: Sequence[float] = NOISES_UG,
    biases_deg: Sequence[float] = BIASES_DEG,
    settings: Sequence[str] = (),
) -> list[dict[str, Any]]:
    """Run every observer in `push_recovery` at every noise and bias.

    World i has the same noise for all observers and biases of one noise level.

    Args:
        worlds: Worlds a cell.
        seed: Seed of the sensors' noise.
        on_share: Called with the share done.
        kinds: The observers.
        noises_ug: Noise densities of the accelerometers [ug/rtHz].
        biases_deg: Equilibrium biases e [deg].
        settings: Settings `section.field=value` that differ in `push_recovery`.

    Returns:
        A row an observer, noise and bias. Means are over the worlds that stood to the end; intervals are of 95 %.
    """
    rows = []
    for i, noise_ug in enumerate(noises_ug):
        motion = record_motion(noise_ug, min(worlds, 20), seed + 1)
        noise = f"sensors.accelerometer.noise_density_ug_rthz={noise_ug}"
        for j, kind in enumerate(kinds):
            traits = character(kind, motion)
            open_loop = {
                "push_lag_s": traits.lag_s,
                "noise_gain_per_s": traits.noise_gain_per_s,
                "update_us": update_us(kind, motion),
            }
            experiment = push_recovery(kind, seed, [noise, *settings])
            sigma = experiment.plant.parameters.noise(experiment.scenario.sensors).tilt
            floor = velocity_floor(experiment.plant.reduced, experiment.law.dt, sigma)
            results = on_rigs(experiment, worlds, "equilibrium_bias_deg", biases_deg)
            for bias_deg, result in zip(biases_deg, results, strict=True):
                place = {"observer": kind, "noise_ug_rthz": noise_ug, "bias_deg": bias_deg}
                rows.append(place | _cell(result, floor) | open_loop)
            on_share((i + (j + 1) / len(kinds)) / len(noises_ug))
    return rows


def _cell(result: Result, floor: float) -> dict[str, Any]:
    """Summarise an observer at one noise and bias."""
    worlds, n_stood = len(result.stood), int(result.stood.sum())
    share = binomtest(worlds - n_stood, worlds).proportion_ci(0.95)
    cell: dict[str, Any] = {
        "worlds": worlds,
        "stood": n_stood,
        "fell_fraction": (worlds - n_stood) / worlds,
        "fell_fraction_low": float(share.low),
        "fell_fraction_high": float(share.high),
    }
    for key in MEANS:
        values = result.values(key)
        mean, low, high = known_interval(values) or (None, None, None)
        cell |= {f"{key}_worlds": int(np.isfinite(values).sum()), key: mean, f"{key}_low": low, f"{key}_high": high}
    error = cell[ERROR]
    return cell | {"floor_rad_s": floor, "ratio_to_floor": None if error is None else error / floor}

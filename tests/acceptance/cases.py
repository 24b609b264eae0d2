"""The runs of the acceptance tests: observers in the loop, and all of them in open loop on the gyro's."""

from __future__ import annotations

import statistics
from functools import cache
from typing import Any

from cmg_mj.observers import OBSERVERS
from cmg_mj.results.result import Result
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario

STANDING = {
    # observer -> settings in which it stands: the headline push at 0.5 degrees of bias, unless it cannot
    "gyro_free": (),
    "free_pivot": (),
    "homogeneous": (),
    "ltv": (),
    "linear": (),
    "linear_high_gain": (),
    "adaptive": (),
    "kalman": (),
    "high_gain": (),
    "homogeneous_adaptive": (),
    "mems_fused": (),
    "luenberger": ("plant.equilibrium_bias_deg=0.1",),
    "finite_difference": ("sensors.accelerometer.noise_density_ug_rthz=100.0",),
    "super_twisting": ("observer.L=15.0",),
}
FALLERS = ("luenberger",)
"""Observers that let the rig fall under the headline push in every world, with their default parameters."""

GROUP = 20

BAND = "metrics.settle_band_deg=2.0"
"""Noise alone takes the tilt out of the default band of one degree now and then: that settle time is erratic."""


@cache
def closed_loop(observer: str, settings: tuple[str, ...], seed: int, worlds: int) -> Result:
    """Push recovery with an observer in the loop."""
    common = [f"observer.kind={observer}", "open_loop_observers=[]", BAND]
    scenario = load_scenario("push_recovery", [*common, *settings, f"seed={seed}"])
    return prepare(scenario).run_many(worlds, keep_trajectory=False)


@cache
def open_loop_run(seed: int, worlds: int) -> Result:
    """Observer tuning: the loop closed on the gyro."""
    return prepare(load_scenario("observer_tuning", [f"seed={seed}"])).run_many(worlds, keep_trajectory=False)


def closed_loop_figures(result: Result, first: int = 0) -> dict[str, float]:
    """Figures of a group of GROUP worlds."""
    group: list[dict[str, Any]] = result.summaries[first : first + GROUP]
    has_bias = "bias_rms_error_deg" in group[0]
    return {
        **({"bias_rms_error_deg": statistics.fmean(s["bias_rms_error_deg"] for s in group)} if has_bias else {}),
        "velocity_rms_error_rad_s": statistics.fmean(s["velocity_rms_error_rad_s"] for s in group),
        "velocity_rms_error_push_rad_s": statistics.fmean(s["velocity_rms_error_push_rad_s"] for s in group),
        "tilt_rms_deg": statistics.fmean(s["tilt_rms_deg"] for s in group),
        "command_rms_rad_s": statistics.fmean(s["command_rms_rad_s"] for s in group),
        # A world that is outside the band at the very end has not settled within the run.
        "settle_time_s": statistics.median(13.0 if s["settle_time_s"] is None else s["settle_time_s"] for s in group),
    }


def open_loop_group(result: Result, first: int = 0) -> dict[str, float]:
    """Each observer's velocity RMS error over a group of GROUP worlds, in the whole run and in the push window."""
    group: list[dict[str, Any]] = result.summaries[first : first + GROUP]
    figures = {}
    for name in OBSERVERS:
        parts = [s["open_loop_observers"][name] if name in s.get("open_loop_observers", {}) else s for s in group]
        figures[name] = statistics.fmean(part["velocity_rms_error_rad_s"] for part in parts)
        figures[f"{name}, push window"] = statistics.fmean(part["velocity_rms_error_push_rad_s"] for part in parts)
    return figures

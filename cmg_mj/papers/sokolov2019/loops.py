"""Figs 4 to 6's experiment: the loop closed on each estimator, with noise and a push, over seeds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.papers.claim import OnShare
from cmg_mj.papers.recorded import trajectory_of
from cmg_mj.papers.sokolov2019.backlash import GAP_ARCMIN
from cmg_mj.papers.sokolov2019.paper import OBSERVERS
from cmg_mj.papers.sokolov2019.rig import NO_NOISE, experiment
from cmg_mj.papers.words import plus_minus
from cmg_mj.results.intervals import Interval, known_interval
from cmg_mj.results.result import Result
from cmg_mj.runs.side_by_side import BatchJob, run_side_by_side

SEED, WORLDS = 83_000, 20
DURATION_S = 15.0
"""Until the push's tail has faded: the law's slowest poles, -0.19 +- 0.29j 1/s, leave a tenth of it after 12 s [s]."""
LATE_S = 4.0
"""The end of a run that counts as after the push [s]."""
BIASES_DEG = (0.0, 0.25, 0.5)
SHOWN_DEG = 0.25
"""The bias of the pictures: all three stand there."""
BEHIND_A_GAP = f"e = {SHOWN_DEG:g} deg, {GAP_ARCMIN:g} arcmin of backlash"


class Loops(NamedTuple):
    """The closed loops over seeds."""

    by_bias: dict[float, dict[str, Result]]
    """Runs without backlash: e [deg] -> observer -> runs."""
    gap: dict[str, Result]
    """Runs with the datasheet's backlash, at the bias of the pictures."""
    quiet: dict[str, Result]
    """Runs without backlash or noise, one world at the bias of the pictures: the rest of the push's motion."""
    gyro: Result
    """The law fed by the gyro, without backlash, at the bias of the pictures."""
    worlds: int

    @property
    def all_settings(self) -> dict[str, Mapping[str, Result]]:
        """All but the gyro's: where, in words -> observer -> runs."""
        by_setting: dict[str, Mapping[str, Result]] = {f"e = {e:g} deg": by_name for e, by_name in self.by_bias.items()}
        return by_setting | {BEHIND_A_GAP: self.gap}


def loops(on_share: OnShare, worlds: int = WORLDS, seed: int = SEED, duration_s: float = DURATION_S) -> Loops:
    """Run them all; those with noise at once, the same seeds for every observer, at every bias and with the gap."""
    settings = [f"seed={seed}", f"duration_s={duration_s}", f"plant.equilibrium_bias_deg={SHOWN_DEG}"]
    by_bias: dict[float, dict[str, Result]] = {e: {} for e in BIASES_DEG}
    gap: dict[str, Result] = {}
    quiet: dict[str, Result] = {}
    cases = len(BIASES_DEG) + 1
    gaps = np.repeat([*[0.0] * len(BIASES_DEG), GAP_ARCMIN], worlds)
    values = {"equilibrium_bias_deg": np.repeat([*BIASES_DEG, SHOWN_DEG], worlds), "gimbal_backlash_arcmin": gaps}
    runs = [BatchJob(experiment(settings, name).with_varied(values), [*range(worlds)] * cases) for name in OBSERVERS]
    for name, result in zip(OBSERVERS, run_side_by_side(runs), strict=True):
        *no_gap, gap[name] = result.split(cases)
        for e, bias_result in zip(BIASES_DEG, no_gap, strict=True):
            by_bias[e][name] = bias_result
    on_share(0.8)
    for name in OBSERVERS:
        quiet[name] = experiment([*settings, *NO_NOISE], name).run()
    return Loops(by_bias, gap, quiet, experiment(settings, feedback="fog").run_many(worlds), worlds)


# --- what is read off the runs ------------------------------------------------------------------------------


def _late_signal(result: Result, name: str) -> np.ndarray:
    """Return a signal over the last `LATE_S` of the worlds that stood, (n_ticks, n_stood)."""
    t = trajectory_of(result)["time_s"]
    return trajectory_of(result)[name].reshape(len(t), -1)[t >= t[-1] - LATE_S][:, result.stood]


def main_frequency(result: Result) -> float:
    """Find the late peak of the tilt rate's spectrum, averaged over the worlds that stood [Hz]."""
    x2, t = _late_signal(result, "x2_rad_s"), trajectory_of(result)["time_s"]
    padded = 8 * len(x2)
    spectrum = (np.abs(np.fft.rfft(x2 - x2.mean(axis=0), padded, axis=0)) ** 2).mean(axis=1)
    return float(np.fft.rfftfreq(padded, t[1] - t[0])[spectrum.argmax()])


def deviations(result: Result) -> np.ndarray:
    """Return the standard deviation of the tilt over the last `LATE_S`, one a world that stood [deg]."""
    return np.degrees(_late_signal(result, "x1_rad")).std(axis=0)


def deviation(result: Result) -> Interval | None:
    """Return the mean of `deviations` [deg]."""
    return known_interval(deviations(result))


def tail(result: Result) -> float:
    """Return the late deviation of a single run without noise: what the push has left behind [deg]."""
    return float(deviations(result).max())


def format_interval(interval: Interval | None) -> str:
    """Write an interval with three digits after the point."""
    return plus_minus(interval, 3)


def numbers(result: Result) -> dict[str, Any]:
    """Return a result's numbers for a claim's figures."""
    intervals = {key: known_interval(result.values(key)) for key in ("velocity_rms_error_rad_s", "tilt_rms_deg")}
    intervals["late_tilt_deviation_deg"] = deviation(result)
    return {
        **{key: None if interval is None else list(interval) for key, interval in intervals.items()},
        "fell_fraction": float(result.fell.mean()),
    }


def is_smaller(a: Result, b: Result, key: str = "velocity_rms_error_rad_s") -> bool | None:
    """Return true if a's numbers are smaller beyond chance, world by world; None if fewer than two stood in both."""
    difference = known_interval(b.values(key) - a.values(key))
    return None if difference is None else difference.low > 0.0


def is_better(a: Result, b: Result, key: str = "velocity_rms_error_rad_s") -> bool:
    """Return true if a's numbers are smaller beyond chance and a falls no more often, or a stands where b fell."""
    beyond_chance = is_smaller(a, b, key)
    if beyond_chance is None:
        return bool(a.stood.all() and b.fell.all())
    return beyond_chance and a.fell.mean() <= b.fell.mean()

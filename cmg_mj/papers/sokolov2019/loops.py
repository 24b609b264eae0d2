"""Figs 4 to 6's experiment: the loop closed on each estimator, with noise and a push, over seeds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.intervals import Interval, known_interval
from cmg_mj.law import Law
from cmg_mj.papers.claim import OnShare
from cmg_mj.papers.recorded import trajectory_of
from cmg_mj.papers.sokolov2019.paper import OBSERVERS
from cmg_mj.papers.sokolov2019.rig import experiment, rig_with, servo_of
from cmg_mj.papers.words import plus_minus
from cmg_mj.simulate import Result

SEED, WORLDS = 83_000, 20
DURATION_S = 7.0
LATE_S = 4.0
"""The end of a run that counts as after the push [s]."""
BIASES_DEG = (0.0, 0.25, 0.5)
SHOWN_DEG = 0.25
"""The bias of the pictures: all three stand there."""
SLOW_LAG_S = 0.025
"""A servo three times as slow as the model's, beyond the threshold of (8) [s]."""


class Loops(NamedTuple):
    """The closed loops over seeds."""

    by_bias: dict[float, dict[str, Result]]
    """With the model's servo: e [deg] -> observer -> runs."""
    slow: dict[str, Result]
    """With the slow servo, at the bias of the pictures."""
    gyro: Result
    """The law fed by the gyro, with the model's servo, at the bias of the pictures."""
    worlds: int

    @property
    def everywhere(self) -> dict[str, Mapping[str, Result]]:
        """All but the gyro's: where, in words -> observer -> runs."""
        by: dict[str, Mapping[str, Result]] = {f"e = {e:g} deg": by_name for e, by_name in self.by_bias.items()}
        return by | {f"e = {SHOWN_DEG:g} deg, servo lag {1e3 * SLOW_LAG_S:.0f} ms": self.slow}


def loops(on_share: OnShare, worlds: int = WORLDS, seed: int = SEED) -> Loops:
    """Run them all; the worlds of an observer at once, the same seeds at every bias and servo."""
    settings = [f"seed={seed}", f"duration_s={DURATION_S}", f"plant.equilibrium_bias_deg={SHOWN_DEG}"]
    by_bias: dict[float, dict[str, Result]] = {e: {} for e in BIASES_DEG}
    slow: dict[str, Result] = {}
    for i, name in enumerate(OBSERVERS):
        prepared = experiment(settings, name)
        slow_rig = rig_with(prepared.scenario.plant, servo_of(prepared.plant).damped(SLOW_LAG_S))
        biased = prepared.rigs({"equilibrium_bias_deg": np.repeat(BIASES_DEG, worlds).tolist()})
        cases = len(BIASES_DEG) + 1
        result = prepared.run_many([*range(worlds)] * cases, plants=[*biased, *[slow_rig] * worlds])
        *own, slow[name] = result.groups(cases)
        for e, found in zip(BIASES_DEG, own, strict=True):
            by_bias[e][name] = found
        on_share((i + 1) / (len(OBSERVERS) + 0.3))
    return Loops(by_bias, slow, experiment(settings, feedback="fog").run_many(worlds), worlds)


# --- what is read off the runs ------------------------------------------------------------------------------


def _late(result: Result, name: str) -> np.ndarray:
    """A signal over the last `LATE_S` of the worlds that stood, (n_ticks, n_stood)."""
    t = trajectory_of(result)["time_s"]
    return trajectory_of(result)[name][t >= t[-1] - LATE_S][:, result.stood]


def main_frequency(result: Result) -> float:
    """Where the tilt rate's spectrum has its late peak, averaged over the worlds that stood [Hz]."""
    x2, t = _late(result, "x2_rad_s"), trajectory_of(result)["time_s"]
    padded = 8 * len(x2)
    spectrum = (np.abs(np.fft.rfft(x2 - x2.mean(axis=0), padded, axis=0)) ** 2).mean(axis=1)
    return float(np.fft.rfftfreq(padded, t[1] - t[0])[spectrum.argmax()])


def limited_share(result: Result) -> float:
    """Share of the late ticks at which the command is at its limit, over the worlds that stood."""
    return float((np.abs(_late(result, "u_rad_s")) >= Law.rate_limit).mean())


def deviation(result: Result) -> Interval | None:
    """Standard deviation of the tilt over the last `LATE_S`, over the worlds that stood [deg]."""
    late = trajectory_of(result).between(result.seconds - LATE_S, result.seconds)
    return known_interval(np.degrees(late["x1_rad"])[:, result.stood].std(axis=0))


def shown(interval: Interval | None) -> str:
    """With three digits after the point, as these claims write them."""
    return plus_minus(interval, 3)


def numbers(result: Result) -> dict[str, Any]:
    """What a claim's figures say of it."""
    intervals = {key: known_interval(result.values(key)) for key in ("velocity_rms_error_rad_s", "tilt_rms_deg")}
    intervals["late_tilt_deviation_deg"] = deviation(result)
    return {
        **{key: None if interval is None else list(interval) for key, interval in intervals.items()},
        "fell_fraction": float(result.fell.mean()),
    }


def smaller(a: Result, b: Result, key: str = "velocity_rms_error_rad_s") -> bool | None:
    """Whether a's numbers are smaller than b's beyond chance, world by world; None if fewer than two stood."""
    difference = known_interval(b.values(key) - a.values(key))
    return None if difference is None else difference.low > 0.0

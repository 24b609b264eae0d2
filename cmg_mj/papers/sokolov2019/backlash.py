"""The cycles that backlash of the servo makes (`cmg_mj.stages.backlash`): on MuJoCo, and by a describing function."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.papers.recorded import trajectory_of
from cmg_mj.papers.sokolov2019.figure_3 import L1, WITH_Y2, stiffness
from cmg_mj.papers.sokolov2019.lag import RELEASE, first_crossing, is_sustained, linearise
from cmg_mj.papers.sokolov2019.paper import OBSERVERS
from cmg_mj.papers.sokolov2019.rig import experiment
from cmg_mj.runs.experiment import Experiment
from cmg_mj.runs.side_by_side import run_jobs, run_of
from cmg_mj.stages.backlash import ARCMIN_A_DEGREE

GAP_ARCMIN = 20.0
"""Backlash of the Dynamixel MX-106 (Robotis e-Manual, MX-106: 20 arcmin), from one side of the gap to the other."""
RELEASE_S, WINDOW_S = 24.0, 6.0
"""A release with the gap, and the windows at its end that are compared: the slowest cycle takes 1.6 s [s]."""


class Cycle(NamedTuple):
    """The loop's motion by itself."""

    sustained: bool
    """True if it oscillates without end."""
    amplitude_deg: float
    """Half of the tilt's range [deg]."""
    frequency_hz: float
    """Frequency of the tilt rate [Hz]."""


class Cycles(NamedTuple):
    """Releases without noise, behind the datasheet's gap."""

    ends: Mapping[str, Cycle]
    """Observer, and (9) with all terms in y2 -> what the loop ends in."""
    predicted: Mapping[str, Cycle | None]
    """Linear observer -> the same by its describing function."""


def make_release(observer: str, arcmin: float = GAP_ARCMIN, **parameters: Any) -> Experiment:
    """Prepare the rig let go with a gap, with an observer whose parameters may differ from Table II's."""
    observer_settings = [f"observer.{name}={value}" for name, value in parameters.items()]
    gap = f"plant.gimbal_backlash_arcmin={arcmin}"
    return experiment([*RELEASE, f"duration_s={RELEASE_S}", gap, *observer_settings], observer)


def find_cycles(releases: Sequence[Experiment]) -> list[Cycle]:
    """Find the cycles that rigs let go end in, one world each: size and main frequency over the last window."""
    found = []
    for trajectory in map(trajectory_of, run_jobs([run_of(release, 1) for release in releases])):
        last = trajectory.between(RELEASE_S - WINDOW_S, RELEASE_S)
        x2, t = last["x2_rad_s"], last["time_s"]
        frequency = peak_frequency(x2 - x2.mean(), t[1] - t[0], np.hanning(len(x2)))
        found.append(Cycle(is_sustained(trajectory, WINDOW_S)[0], np.degrees(np.ptp(last["x1_rad"])) / 2.0, frequency))
    return found


def peak_frequency(signals: np.ndarray, dt: float, taper: np.ndarray | float = 1.0) -> float:
    """Find the peak of the spectrum of signals, (n_ticks, n_worlds), averaged over the worlds [Hz]."""
    padded = 8 * len(signals)
    spectrum = (np.abs(np.fft.rfft((signals.T * taper).T, padded, axis=0)) ** 2).mean(axis=1)
    return float(np.fft.rfftfreq(padded, dt)[spectrum.argmax()])


def cycles() -> Cycles:
    """Find all cycles."""
    releases = {name: make_release(name) for name in OBSERVERS}
    # (9) but for J2, cos y2 and the sine: see `figure_3.nine_with_y2`.
    nine = {"k1": L1, "k2": stiffness(experiment().plant.reduced), "alpha": 1.0}
    releases[WITH_Y2] = make_release("homogeneous", **nine)
    ends = dict(zip(releases, find_cycles(list(releases.values())), strict=True))
    return Cycles(ends, {name: predict_cycle(name) for name in ("linear", "luenberger")})


# --- by the describing function of the linearised, sampled loop -------------------------------------------------


def describing_function(c: float) -> complex:
    """Return the fundamental of the gimbal's angle by that of the motor's, a sine, behind a gap.

    Args:
        c: gap/A - 1, with A the motor's amplitude: -1 without a gap, 1 where the motor only just crosses it.
    """
    root = math.sqrt(max(1.0 - c * c, 0.0))
    return complex(0.5 - (math.asin(c) + c * root) / math.pi, -root * root / math.pi)


def predict_cycle(observer: str) -> Cycle | None:
    """Return the largest motion that neither grows nor decays, of which larger ones decay and smaller ones grow.

    Args:
        observer: A linear one, in the loop.

    Returns:
        The cycle; None if there is none.
    """
    loop, servo, dt = linearise(observer)

    def turning(c: float) -> tuple[complex, np.ndarray]:
        """Return the least damped motion that turns forward faster than 1 rad/s: its factor a period, its shape."""
        factors, shapes = np.linalg.eig(loop(servo, share=describing_function(c)))
        index = np.argmax(np.where(np.angle(factors) > dt, np.abs(factors), 0.0))
        return complex(factors[index]), shapes[:, index]

    def growth(c: float) -> float:
        return math.log(abs(turning(c)[0])) / dt

    c = first_crossing(growth, -1.0, 0.98, 60, 1e-9)
    if c is None:
        return None
    factor, shape = turning(c)
    rate = math.atan2(factor.imag, factor.real) / dt
    motor = math.radians(GAP_ARCMIN / ARCMIN_A_DEGREE) / (1.0 + c)
    amplitude = math.degrees(motor * rate * float(abs(shape[0]) / abs(shape[-1])))
    return Cycle(True, amplitude, rate / (2.0 * math.pi))

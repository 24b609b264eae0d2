"""The cycles that the backlash of the gimbal's servo makes (`cmg_mj.stages.backlash`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.papers.recorded import trajectory_of
from cmg_mj.papers.sokolov2019.release import RELEASE, is_sustained
from cmg_mj.papers.sokolov2019.rig import experiment
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import Experiment
from cmg_mj.runs.side_by_side import run_of, run_side_by_side

GAP_ARCMIN = 20.0
"""Backlash of the Dynamixel MX-106 (Robotis e-Manual, MX-106: 20 arcmin), from one side of the gap to the other."""
RELEASE_S, WINDOW_S = 24.0, 6.0
"""A release with the gap, and the windows at its end that are compared: the slowest cycle takes 1.6 s [s]."""


class Cycle(NamedTuple):
    """The loop's motion by itself, let go without noise."""

    sustained: bool
    """True if it oscillates without end."""
    amplitude_deg: float
    """Half of the tilt's range over the last window [deg]."""
    frequency_hz: float
    """Frequency at which the tilt rate's spectrum has its peak there [Hz]."""

    @property
    def words(self) -> str:
        """The cycle in words."""
        if not self.sustained:
            return "comes to rest"
        return f"goes on oscillating by {self.amplitude_deg:.2f} deg to either side at {self.frequency_hz:.1f} Hz"


def make_release(observer: str, arcmin: float = GAP_ARCMIN, **parameters: Any) -> Experiment:
    """Prepare the rig let go with a gap, with an observer whose parameters may differ from Table II's."""
    observer_settings = [f"observer.{name}={value}" for name, value in parameters.items()]
    gap = f"plant.gimbal_backlash_arcmin={arcmin}"
    return experiment([*RELEASE, f"duration_s={RELEASE_S}", gap, *observer_settings], observer)


def find_cycles(releases: Sequence[Experiment]) -> list[Cycle]:
    """Find the cycles that rigs let go end in, one world each."""
    return [_cycle(trajectory_of(result)) for result in run_side_by_side([run_of(release, 1) for release in releases])]


def _cycle(trajectory: Trajectory) -> Cycle:
    last = trajectory.between(RELEASE_S - WINDOW_S, RELEASE_S)
    x2, t = last["x2_rad_s"][:, 0], last["time_s"]
    spectrum = np.abs(np.fft.rfft((x2 - x2.mean()) * np.hanning(len(x2)), 8 * len(x2)))
    return Cycle(
        bool(is_sustained(trajectory, WINDOW_S)[0]),
        float(np.degrees(np.ptp(last["x1_rad"][:, 0]))) / 2.0,
        float(np.fft.rfftfreq(8 * len(x2), t[1] - t[0])[spectrum.argmax()]),
    )

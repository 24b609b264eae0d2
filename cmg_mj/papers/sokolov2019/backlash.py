"""Backlash of the gimbal's servo, held by friction: the gimbal rests until the motor has crossed the gap.

In velocity mode the servo's motor turns at the commanded rate and does not know of the gap behind it. The observers
know the command, not what the gimbal makes of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.controller import Controller, Tick
from cmg_mj.elementwise import Scalar
from cmg_mj.experiment import Experiment
from cmg_mj.ideal import Ideal
from cmg_mj.papers.recorded import trajectory_of
from cmg_mj.papers.sokolov2019.release import RELEASE, is_sustained
from cmg_mj.papers.sokolov2019.rig import experiment
from cmg_mj.plant import Plant
from cmg_mj.simulate import Result, simulate

GAP_ARCMIN = 20.0
"""Backlash of the Dynamixel MX-106 (Robotis e-Manual, MX-106: 20 arcmin), from one side of the gap to the other."""
RELEASE_S, WINDOW_S = 24.0, 6.0
"""A release with the gap, and the windows at its end that are compared: the slowest cycle takes 1.6 s [s]."""


def gap_rad(arcmin: float = GAP_ARCMIN) -> float:
    """A gap in radians."""
    return math.radians(arcmin / 60.0)


class BehindAGap:
    """A controller whose gimbals follow their motors across a gap; in its ticks u is what the gimbals are turned at.

    Args:
        controller: The controller; what its observers get as u is what it has commanded.
        gap: From one side to the other [rad].
    """

    def __init__(self, controller: Controller, gap: Scalar) -> None:
        self._controller = controller
        self._half = gap / 2.0
        self._motor: Scalar = 0.0
        self._gimbal: Scalar = 0.0
        self.tick: Tick | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._controller, name)

    def update(self, step: int, ideal: Ideal) -> bool:
        """As the controller's own; then the motor moves, and the gimbal as far as it is pushed."""
        if not self._controller.update(step, ideal):
            return False
        tick, dt = self._controller.tick, self._controller.law.dt
        assert tick is not None
        self._motor = self._motor + tick.u * dt
        before = self._gimbal
        self._gimbal = np.minimum(np.maximum(before, self._motor - self._half), self._motor + self._half)
        self.tick = tick._replace(u=(self._gimbal - before) / dt)
        return True


def run_behind_a_gap(
    prepared: Experiment, worlds: Sequence[int], gap: Scalar, plants: Sequence[Plant] | None = None
) -> Result:
    """As `Experiment.run_many`, with a gap before the gimbals.

    Args:
        prepared: The experiment.
        worlds: Their numbers.
        gap: One for all, or one a world [rad].
        plants: A rig a world, if they differ.

    Returns:
        The result.
    """
    controller: Any = BehindAGap(prepared.controller(worlds), gap)
    scenario = prepared.scenario
    return simulate(
        [prepared.plant] * len(worlds) if plants is None else plants,
        controller,
        scenario.duration_s,
        observers=prepared.observer_names,
        pushes=scenario.push,
        settings=scenario.metrics,
    )


class Cycle(NamedTuple):
    """What the loop does by itself, let go without noise."""

    sustained: bool
    """Whether it oscillates without end."""
    amplitude_deg: float
    """Half of the tilt's range over the last window [deg]."""
    frequency_hz: float
    """Where the tilt rate's spectrum has its peak there [Hz]."""

    @property
    def words(self) -> str:
        """What it does."""
        if not self.sustained:
            return "comes to rest"
        return f"goes on oscillating by {self.amplitude_deg:.2f} deg to either side at {self.frequency_hz:.1f} Hz"


def cycle_of(observer: str, gap: float | None = None, **parameters: Any) -> Cycle:
    """Let the rig go with a gap.

    Args:
        observer: In the loop.
        gap: The datasheet's if left out [rad].
        **parameters: The observer's, where they are not Table II's.

    Returns:
        The cycle that it ends in.
    """
    changed = [f"observer.{name}={value}" for name, value in parameters.items()]
    prepared = experiment([*RELEASE, f"duration_s={RELEASE_S}", *changed], observer)
    trajectory = trajectory_of(run_behind_a_gap(prepared, [0], gap_rad() if gap is None else gap))
    last = trajectory.between(RELEASE_S - WINDOW_S, RELEASE_S)
    x2, t = last["x2_rad_s"][:, 0], last["time_s"]
    spectrum = np.abs(np.fft.rfft((x2 - x2.mean()) * np.hanning(len(x2)), 8 * len(x2)))
    return Cycle(
        bool(is_sustained(trajectory, WINDOW_S)[0]),
        float(np.degrees(np.ptp(last["x1_rad"][:, 0]))) / 2.0,
        float(np.fft.rfftfreq(8 * len(x2), t[1] - t[0])[spectrum.argmax()]),
    )

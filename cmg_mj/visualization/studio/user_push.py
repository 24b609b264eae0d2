"""The torques from outside: those of the scenario, and those that a user adds while it runs."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

from cmg_mj.scenario.disturbances import Push, Swing, add_swing_torques
from cmg_mj.sensors.timing import whole_steps

Held = tuple[int, int, float, int]
"""First step, step after the last one, torque [N m], place of the axis; of one that the rig does not have, -1."""


class Pushes:
    """The torques about the tilt axes at every physics step; torques at the same time add up.

    Args:
        scenario: The scenario's pushes.
        swings: Its torques that swing.
        axes: Names of the axes.
        timestep: Physics step [s].
    """

    def __init__(self, scenario: Sequence[Push], swings: Sequence[Swing], axes: Sequence[str], timestep: float) -> None:
        self._timestep = timestep
        self._swings, self._axes = swings, axes
        places = {name: place for place, name in enumerate(axes)}
        self._of_scenario: list[Held] = [
            (self._steps(p.start_s), self._steps(p.end_s), p.torque_n_m, places.get(p.axis or axes[0], -1))
            for p in scenario
        ]
        self._by_hand: list[Held] = []
        self._add_up()

    def _steps(self, seconds: float) -> int:
        return whole_steps(seconds, self._timestep, "push", f"{seconds:g} s")

    def add(self, step: int, torque: float, duration_s: float, axis: int = 0) -> None:
        """Push from a physics step on.

        Args:
            step: The step.
            torque: [N m].
            duration_s: How long, to the next whole step and at least one [s].
            axis: The place of the axis.
        """
        self._by_hand.append((step, step + max(1, round(duration_s / self._timestep)), torque, axis))
        self._add_up()

    def forget(self, step: int) -> None:
        """Of those by hand, keep what began before a step: time has gone back to it."""
        self._by_hand = [push for push in self._by_hand if push[0] < step]
        self._add_up()

    def _add_up(self) -> None:
        changes: dict[int, list[float]] = {}
        for start, end, torque, axis in [*self._of_scenario, *self._by_hand]:
            for step, change in ((start, torque), (end, -torque)):
                changed = changes.setdefault(step, [0.0] * len(self._axes))
                if axis >= 0:
                    changed[axis] += change
        self._edges = sorted(changes)
        sums = [0.0] * len(self._axes)
        self._torques = [sums]
        for step in self._edges:
            sums = [torque + change for torque, change in zip(sums, changes[step], strict=True)]
            self._torques.append([torque if abs(torque) > 1e-12 else 0.0 for torque in sums])  # pushes over are none

    def at(self, step: int, beat: int) -> Sequence[float]:
        """The torques during a physics step.

        Args:
            step: The step.
            beat: Physics steps between the moments at which the runner looks, and holds what swings.

        Returns:
            One an axis [N m].
        """
        place = bisect_right(self._edges, step)
        held = self._torques[place]
        if not self._swings:
            return held
        start = step // beat * beat
        end = start + beat
        start, end = max([start, *self._edges[:place][-1:]]), min([end, *self._edges[place : place + 1]])
        return add_swing_torques(held, self._swings, self._axes, (start + 0.5 * (end - start)) * self._timestep)

"""Adds up the torques from outside: the scenario's, and the user's during a session."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

from cmg_mj.core.sensor import whole_steps
from cmg_mj.stages.push import Push
from cmg_mj.stages.swing import Swing, add_swing_torques

PushSteps = tuple[int, int, float, int]
"""First step, step after the last, torque [N m], index of the axis; -1 for an axis that the plant lacks."""


class Pushes:
    """The torques about the tilt axes at every physics step; torques at the same time add up.

    Args:
        scenario: The scenario's pushes.
        swings: The scenario's swinging torques.
        axes: Names of the axes.
        timestep: Physics step [s].
    """

    def __init__(self, scenario: Sequence[Push], swings: Sequence[Swing], axes: Sequence[str], timestep: float) -> None:
        self._timestep = timestep
        self._swings, self._axes = swings, axes
        indices = {name: index for index, name in enumerate(axes)}
        self._scenario_pushes: list[PushSteps] = [
            (self._steps(p.start_s), self._steps(p.end_s), p.torque_n_m, indices.get(p.axis or axes[0], -1))
            for p in scenario
        ]
        self._user_pushes: list[PushSteps] = []
        self._add_up()

    def _steps(self, seconds: float) -> int:
        return whole_steps(seconds, self._timestep, "push", f"{seconds:g} s")

    def add(self, step: int, torque: float, duration_s: float, axis: int = 0) -> None:
        """Push from a physics step on.

        Args:
            step: The step.
            torque: [N m].
            duration_s: Duration, rounded to whole steps and at least one [s].
            axis: Index of the axis.
        """
        self._user_pushes.append((step, step + max(1, round(duration_s / self._timestep)), torque, axis))
        self._add_up()

    def forget(self, step: int) -> None:
        """Discard the user's pushes from a step on: time has gone back to it."""
        self._user_pushes = [push for push in self._user_pushes if push[0] < step]
        self._add_up()

    def _add_up(self) -> None:
        changes: dict[int, list[float]] = {}
        for start, end, torque, axis in [*self._scenario_pushes, *self._user_pushes]:
            for step, change in ((start, torque), (end, -torque)):
                at_step = changes.setdefault(step, [0.0] * len(self._axes))
                if axis >= 0:
                    at_step[axis] += change
        self._edges = sorted(changes)
        sums = [0.0] * len(self._axes)
        self._torques = [sums]
        for step in self._edges:
            sums = [torque + change for torque, change in zip(sums, changes[step], strict=True)]
            self._torques.append([torque if abs(torque) > 1e-12 else 0.0 for torque in sums])  # no remainders

    def at(self, step: int, steps_per_sample: int) -> Sequence[float]:
        """Return the torques during a physics step.

        Args:
            step: The step.
            steps_per_sample: Physics steps in a sample interval, during which a swinging torque is constant.

        Returns:
            A torque for each axis [N m].
        """
        pushes = self._torques[bisect_right(self._edges, step)]
        if not self._swings:
            return pushes
        start, end = self.interval(step, steps_per_sample)
        return add_swing_torques(pushes, self._swings, self._axes, (start + 0.5 * (end - start)) * self._timestep)

    def interval(self, step: int, steps_per_sample: int) -> tuple[int, int]:
        """Return the steps around a physics step between which the torques are constant: the first, and the next."""
        index = bisect_right(self._edges, step)
        start = step // steps_per_sample * steps_per_sample
        end = start + steps_per_sample
        return max([start, *self._edges[:index][-1:]]), min([end, *self._edges[index : index + 1]])

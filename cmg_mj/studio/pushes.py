"""The torques from outside: those of the scenario, and those that a user adds while it runs."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from itertools import accumulate

from cmg_mj.push import Push
from cmg_mj.timing import whole_steps


class Pushes:
    """The torque about the tilt axis at every physics step; torques at the same time add up.

    Args:
        scenario: The scenario's.
        timestep: Physics step [s].
    """

    def __init__(self, scenario: Iterable[Push], timestep: float) -> None:
        self._timestep = timestep
        self._of_scenario = [(self._steps(p.start_s), self._steps(p.end_s), p.torque_n_m) for p in scenario]
        self._by_hand: list[tuple[int, int, float]] = []
        self._add_up()

    def _steps(self, seconds: float) -> int:
        return whole_steps(seconds, self._timestep, "push", f"{seconds:g} s")

    def add(self, step: int, torque: float, duration_s: float) -> None:
        """Push from a physics step on.

        Args:
            step: The step.
            torque: [N m].
            duration_s: How long, to the next whole step and at least one [s].
        """
        self._by_hand.append((step, step + max(1, round(duration_s / self._timestep)), torque))
        self._add_up()

    def forget(self, step: int) -> None:
        """Of those by hand, keep what began before a step: time has gone back to it."""
        self._by_hand = [push for push in self._by_hand if push[0] < step]
        self._add_up()

    def _add_up(self) -> None:
        changes: dict[int, float] = {}
        for start, end, torque in [*self._of_scenario, *self._by_hand]:
            for step, change in ((start, torque), (end, -torque)):
                changes[step] = changes.get(step, 0.0) + change
        self._edges = sorted(changes)
        sums = accumulate(changes[step] for step in self._edges)
        self._torques = [0.0, *(torque if abs(torque) > 1e-12 else 0.0 for torque in sums)]  # pushes over are none

    def at(self, step: int) -> float:
        """The torque during a physics step [N m]."""
        return self._torques[bisect_right(self._edges, step)]

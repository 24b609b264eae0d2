"""A controller an axis, at the same ticks."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from cmg_mj.core.controller import Controller
from cmg_mj.core.errors import InputError
from cmg_mj.core.types import MultiAxisReading, Setpoints

AxesStage = Callable[[Sequence[Controller], MultiAxisReading], Setpoints | None]
"""An effect between the axes: it turns the gimbals of all of them after their decisions, once a control tick.

It returns what it moves beside the gimbals, if anything.
"""


class MultiAxisController:
    """Runs a controller an axis, tick after tick.

    Args:
        controllers: The controllers, one an axis, of one control period.
        between: Makes the stage between the axes, from the first one; None for axes that know nothing of each other.

    Raises:
        InputError: The control periods differ.
    """

    def __init__(
        self, controllers: Sequence[Controller], between: Callable[[Controller], AxesStage] | None = None
    ) -> None:
        self.axes = tuple(controllers)
        first = self.axes[0]
        if any(part.period != first.period for part in self.axes):
            raise InputError("controller.rate_hz: must be the same on all axes")
        self.period, self.timestep = first.period, first.timestep
        self.seed, self.world_ids = first.seed, first.world_ids
        self.steps_per_sample = math.gcd(*(part.steps_per_sample for part in self.axes))
        """Physics steps between the instants at which anything may be due."""
        self._make_between = between
        for part in self.axes:
            part.turns_gimbals = between is None
        self.reset()

    def reset(self) -> None:
        """Forget everything: the next update is the first tick of a run with the same seed."""
        for part in self.axes:
            part.reset()
        self.setpoints: Setpoints | None = None
        """What the stage between the axes moves beside the gimbals, since the last tick."""
        self.step: int | None = None
        """The physics step of the last update."""
        self._between = None if self._make_between is None else self._make_between(self.axes[0])

    def update(self, step: int, ideals: MultiAxisReading) -> bool:
        """Take the samples and the control decisions that are due at a physics step.

        Args:
            step: Number of the physics step, a multiple of `steps_per_sample`.
            ideals: The ideal readings at that step.

        Returns:
            Whether a control tick was due.

        Raises:
            RunStopped: An observer or a law of an axis failed.
        """
        self.sample(step, ideals)
        if step % self.period:
            return False
        self.control(step)
        return True

    def sample(self, step: int, ideals: MultiAxisReading) -> None:
        """Take the samples that are due at a physics step: see `update`."""
        self.step = step
        self._ideals = ideals
        for part, ideal in zip(self.axes, ideals.axes, strict=True):
            part.sample(step, ideal)

    def control(self, step: int) -> None:
        """Take the control decisions of a tick, a multiple of `period`: see `update`."""
        for part in self.axes:
            part.control(step)
        if self._between is not None:
            self.setpoints = self._between(self.axes, self._ideals)


ControllerLike = Controller | MultiAxisController

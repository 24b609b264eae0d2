"""What the controller was shown and told, so that it can be had again as it was at any earlier moment.

Neither the sensors' noise nor a user's observer can be copied. What both have made of their samples follows from the
samples, and these are kept: a controller for an earlier moment is a fresh one that is shown them once more.
"""

from __future__ import annotations

from array import array
from dataclasses import dataclass

import mujoco
import numpy as np

from cmg_mj.controllers.controller import Controller
from cmg_mj.controllers.multi_axis import MultiAxisController
from cmg_mj.simulation.experiment import Experiment
from cmg_mj.visualization.studio.settings import law_settings

MOST_SAMPLES = 200_000
"""Kept at most, 1000 s at 200 a second: 27 MB for the scissored pair."""


@dataclass(frozen=True)
class HistoryEntry:
    """What a controller was told before one of its samples: to be an experiment's.

    Attributes:
        count: The samples that it had been shown by then.
        experiment: Whose it is from then on.
        afresh: Whether it began anew.
    """

    count: int
    experiment: Experiment
    afresh: bool


class ControllerHistory:
    """Of a session's controller.

    Args:
        experiment: Whose fresh controller it is.
        begin: The physics step at which it begins.

    Attributes:
        whole: Whether everything is kept; once that is too much, nothing is.
    """

    def __init__(self, experiment: Experiment, begin: int) -> None:
        self.begin = begin
        self.whole = True
        self._steps = array("q")
        self._numbers = array("d")
        self._told = [HistoryEntry(0, experiment, True)]

    def show(self, step: int, data: mujoco.MjData) -> None:
        """Keep what the controller has been shown at a physics step: sensordata and joint rates."""
        if not self.whole:
            return
        if len(self._steps) >= MOST_SAMPLES:
            self.whole = False
            self._steps, self._numbers = array("q"), array("d")
            return
        self._steps.append(step)
        self._numbers.extend(data.sensordata.tolist())
        self._numbers.extend(data.qvel.tolist())

    def tell(self, experiment: Experiment, *, afresh: bool) -> None:
        """Keep that from the next sample on the controller is this experiment's."""
        self._told.append(HistoryEntry(len(self._steps), experiment, afresh))

    def has(self, step: int) -> bool:
        """Whether the controller can be had as it was before a physics step; nothing was left out on the way there."""
        return self.whole and self.begin <= step

    def told(self, step: int) -> Experiment:
        """Whose the controller was before its update at a physics step that it `has`."""
        count = self._count(step)
        return next(told.experiment for told in reversed(self._told) if told.count <= count)

    def _count(self, step: int) -> int:
        """How many samples it was shown before a physics step."""
        return int(np.searchsorted(np.asarray(self._steps), step))

    def back_to(self, step: int) -> tuple[Controller | MultiAxisController, Experiment]:
        """The controller as it was before its update at a physics step. What was later is forgotten.

        Args:
            step: A step that it `has`.

        Returns:
            The controller, and the experiment that it was of.

        Raises:
            RunStopped: An observer fails at samples that it did not fail at the first time.
        """
        count = self._count(step)
        width = len(self._numbers) // max(1, len(self._steps))
        del self._steps[count:], self._numbers[count * width :]
        self._told = [told for told in self._told if told.count <= count]
        start = max(i for i, told in enumerate(self._told) if told.afresh)
        since = self._told[start:]
        experiment = since[0].experiment
        controller = experiment.controller()
        plant = experiment.plant
        sensors = plant.model.nsensordata
        for told, after in zip(since, [*since[1:], HistoryEntry(count, experiment, False)], strict=True):
            adopt(controller, experiment, told.experiment)
            experiment = told.experiment
            for i in range(told.count, after.count):
                numbers = self._numbers[i * width : (i + 1) * width].tolist()
                controller.update(self._steps[i], plant.ideal_readings(numbers[:sensors], numbers[sensors:]))
        return controller, experiment


def adopt(controller: Controller | MultiAxisController, was: Experiment, now: Experiment) -> None:
    """Have a controller of one experiment be that of another, which differs from it in what may change while it runs.

    Of a rig of several axes each axis' controller changes in what differs about that axis.

    Args:
        controller: The controller.
        was: Whose it is.
        now: Whose it will be.

    Raises:
        InputError: They differ in more.
    """
    for part, of, own in zip(controller.parts, was.parts, now.parts, strict=True):
        before, after = of.scenario, own.scenario
        part.swap_components(
            observer=own.design.observer() if after.observer != before.observer else None,
            law=own.design.fresh_law() if law_settings(after) != law_settings(before) else None,
            sensors=after.sensors if after.sensors != before.sensors else None,
            feedback=after.controller.feedback,
        )

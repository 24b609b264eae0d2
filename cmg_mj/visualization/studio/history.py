"""Restores the controller of an earlier moment from its samples.

Neither the sensors' noise nor a user's observer can be copied. Their states follow from the samples, which are stored:
a controller of an earlier moment is a fresh one that receives the samples once more.
"""

from __future__ import annotations

from array import array
from dataclasses import dataclass

import mujoco
import numpy as np

from cmg_mj.core.axes import AnyController
from cmg_mj.simulation.experiment import Experiment

MOST_SAMPLES = 200_000
"""Largest number of stored samples, 1000 s at 200 Hz: 27 MB for the scissored pair."""


@dataclass(frozen=True)
class HistoryEntry:
    """A change of a controller between two samples.

    Attributes:
        count: Number of samples before the change.
        experiment: The experiment of the controller after the change.
        afresh: Whether the controller starts afresh.
    """

    count: int
    experiment: Experiment
    afresh: bool


class ControllerHistory:
    """The samples and changes of a session's controller.

    Args:
        experiment: The experiment of the fresh controller.
        begin: The physics step at which the controller begins.

    Attributes:
        whole: Whether all samples are stored; beyond `MOST_SAMPLES` none are.
    """

    def __init__(self, experiment: Experiment, begin: int) -> None:
        self.begin = begin
        self.whole = True
        self._steps = array("q")
        self._numbers = array("d")
        self._entries = [HistoryEntry(0, experiment, True)]

    def add_sample(self, step: int, data: mujoco.MjData) -> None:
        """Store the sample of a physics step: sensordata and joint rates."""
        if not self.whole:
            return
        if len(self._steps) >= MOST_SAMPLES:
            self.whole = False
            self._steps, self._numbers = array("q"), array("d")
            return
        self._steps.append(step)
        self._numbers.extend(data.sensordata.tolist())
        self._numbers.extend(data.qvel.tolist())

    def add_change(self, experiment: Experiment, *, afresh: bool) -> None:
        """Store that the controller is another experiment's from the next sample on."""
        self._entries.append(HistoryEntry(len(self._steps), experiment, afresh))

    def has(self, step: int) -> bool:
        """Return whether the controller before a physics step can be restored."""
        return self.whole and self.begin <= step

    def experiment_at(self, step: int) -> Experiment:
        """Return the controller's experiment before the update at a physics step that the history `has`."""
        count = self._count(step)
        return next(entry.experiment for entry in reversed(self._entries) if entry.count <= count)

    def _count(self, step: int) -> int:
        """Count the samples before a physics step."""
        return int(np.searchsorted(np.asarray(self._steps), step))

    def back_to(self, step: int) -> tuple[AnyController, Experiment]:
        """Restore the controller before the update at a physics step, and discard what came later.

        Args:
            step: A step that the history `has`.

        Returns:
            The controller and its experiment.

        Raises:
            RunStopped: An observer fails at samples at which it did not fail the first time.
        """
        count = self._count(step)
        width = len(self._numbers) // max(1, len(self._steps))
        del self._steps[count:], self._numbers[count * width :]
        self._entries = [entry for entry in self._entries if entry.count <= count]
        start = max(i for i, entry in enumerate(self._entries) if entry.afresh)
        since = self._entries[start:]
        experiment = since[0].experiment
        controller = experiment.controller()
        plant = experiment.plant
        sensors = plant.model.nsensordata
        for entry, following in zip(since, [*since[1:], HistoryEntry(count, experiment, False)], strict=True):
            if entry.experiment is not experiment:
                previous, experiment = controller, entry.experiment
                controller = continued(experiment, previous)
            for i in range(entry.count, following.count):
                numbers = self._numbers[i * width : (i + 1) * width].tolist()
                controller.update(self._steps[i], plant.ideal_readings(numbers[:sensors], numbers[sensors:]))
        return controller, experiment


def continued(experiment: Experiment, previous: AnyController) -> AnyController:
    """Make a fresh controller that starts with the integrators and commands of a previous one."""
    controller = experiment.controller()
    for part, before in zip(controller.parts, previous.parts, strict=True):
        part.continue_from(before)
    return controller

"""A plant as numbers: all that the controller, the observers and the checks of a scenario take from its model."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.tilt import RadialTilt, TiltNoise
from cmg_mj.sensors.sampled import Sensors


class PlantParameters(NamedTuple):
    """The parameters that a scenario's controller and observers are made from.

    Attributes:
        path: The model's file.
        modules: Names of the plant's modules.
        reduced: The reduced model.
        tilt: The tilt estimate for the plant's accelerometers.
        gravity: Gravitational acceleration [m/s^2].
        timestep: The physics step [s].
        largest_step: The largest physics step that is accurate enough [s].
        hints: Clauses on what the reduced model does not know of the plant.
    """

    path: Path
    modules: tuple[str, ...]
    reduced: ReducedModel
    tilt: RadialTilt
    gravity: float
    timestep: float
    largest_step: float
    hints: tuple[str, ...]

    def noise(self, sensors: Sensors) -> TiltNoise:
        """Return the noise of tilt, angular acceleration and y2, the mean of as many encoders as there are gimbals."""
        gimbal = sensors.encoder.sample_sigma / math.sqrt(self.reduced.gimbals)
        return replace(self.tilt.noise(sensors.accelerometer.sample_sigma, self.gravity), gimbal=gimbal)

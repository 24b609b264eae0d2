"""Errors of scale, of mounting and of the axes' independence of the accelerometers."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.core.sensor import SensorStage, Site
from cmg_mj.core.types import Forces, IdealReading
from cmg_mj.inputs.types import STRICT
from cmg_mj.stages.pair import PairSettings

CROSSWISE = [1, 0, 3, 2]
"""Each channel's other axis of the same part."""
Share = Annotated[float, Field(gt=-1.0, lt=1.0)]
Angle = Annotated[float, Field(gt=-45.0, lt=45.0)]


@dataclass(frozen=True, config=STRICT)
class MountingErrorsSettings(PairSettings):
    """Errors of scale and mounting.

    Attributes:
        scale_error: Relative scale errors of the inner and the outer accelerometer, the same for both axes of each.
        misalignment_deg: Angles by which the inner and the outer accelerometer are turned in the tilting plane,
            positive in the direction of a positive tilt [deg].
        cross_axis: Cross-axis sensitivities of the inner and the outer accelerometer: the share of its other axis that
            each axis shows.
    """

    scale_error: tuple[Share, Share] = (0.0, 0.0)
    misalignment_deg: tuple[Angle, Angle] = (0.0, 0.0)
    cross_axis: tuple[Share, Share] = (0.0, 0.0)

    def mounting_weights(self) -> tuple[list[float], list[float]]:
        """Compute the weights of each channel's own axis and of the other axis of the same part."""
        same_axis, other_axis = [], []
        parts = zip(self.scale_error, self.misalignment_deg, self.cross_axis, strict=True)
        for scale, misalignment, cross in parts:
            c, s = math.cos(math.radians(misalignment)), math.sin(math.radians(misalignment))
            same_axis += [(1.0 + scale) * (c + cross * s), (1.0 + scale) * (c - cross * s)]
            other_axis += [(1.0 + scale) * (cross * c - s), (1.0 + scale) * (cross * c + s)]
        return same_axis, other_axis


class MountingErrors:
    """Mixes the two axes of each accelerometer.

    Args:
        same_axis: Weight of each channel's own axis.
        other_axis: Weight of the other axis of the same part.
    """

    def __init__(self, same_axis: list[float], other_axis: list[float]) -> None:
        self._same, self._other = same_axis, other_axis
        self._by_same, self._by_other = np.array([same_axis]).T, np.array([other_axis]).T

    def __call__(self, forces: Forces, ideal: IdealReading | None = None) -> Forces:
        """Return what the parts feel along the axes that they show."""
        if isinstance(forces, np.ndarray):
            return self._by_same * forces + self._by_other * forces[CROSSWISE]
        crossed = [forces[i] for i in CROSSWISE]
        return [a * x + b * z for a, x, b, z in zip(self._same, forces, self._other, crossed, strict=True)]


def mounting_errors(part: MountingErrorsSettings, site: Site) -> SensorStage | None:
    """Make the stage of accelerometers that are not perfectly scaled and mounted."""
    weights = part.mounting_weights()
    return None if weights == ([1.0] * 4, [0.0] * 4) else MountingErrors(*weights)

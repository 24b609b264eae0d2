"""Errors of scale, of mounting and of the axes' independence of the accelerometers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass as settings

from cmg_mj.core.sensor import Memory, SensorStage, Signal, Site
from cmg_mj.core.straight_line import Tables
from cmg_mj.core.types import Forces, IdealReading
from cmg_mj.inputs.types import STRICT
from cmg_mj.stages.pair import PairSettings

CROSSWISE = [1, 0, 3, 2]
"""Each channel's other axis of the same part."""
PERFECT = [1.0] * 4, [0.0] * 4
"""Weights of each channel's own and other axis where parts are perfectly scaled and mounted."""
Share = Annotated[float, Field(gt=-1.0, lt=1.0)]
Angle = Annotated[float, Field(gt=-45.0, lt=45.0)]


@settings(frozen=True, config=STRICT)
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


@dataclass(frozen=True)
class MountingErrors(SensorStage):
    """Mixes the two axes of each accelerometer: what the parts feel along the axes they show.

    Attributes:
        same: Weight of each channel's own axis.
        other: Weight of the other axis of the same part.
    """

    same: Sequence[float]
    other: Sequence[float]

    def step(
        self, memory: Memory, signal: Signal, ideal: IdealReading, sample: int, tables: Tables
    ) -> tuple[Memory, Signal]:
        """See `SensorStage`."""
        return memory, self.mixed(signal)

    def mixed(self, forces: Forces) -> Forces:
        """Return the forces along the axes of the parts."""
        if isinstance(forces, np.ndarray):
            by_same, by_other = np.array([self.same]).T, np.array([self.other]).T
            return by_same * forces + by_other * forces[CROSSWISE]
        crossed = [forces[i] for i in CROSSWISE]
        return [a * x + b * z for a, x, b, z in zip(self.same, forces, self.other, crossed, strict=True)]


def mounting_errors(part: MountingErrorsSettings, site: Site | None = None) -> MountingErrors:
    """Make the stage of errors of scale and mounting."""
    return MountingErrors(*part.mounting_weights())

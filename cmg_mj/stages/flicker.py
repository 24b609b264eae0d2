"""1/f noise of the accelerometers."""

from __future__ import annotations

import numpy as np
from pydantic.dataclasses import dataclass

from cmg_mj.core.noise import CORNERS_HZ, FlickerNoise, NoiseStream
from cmg_mj.core.sensor import SensorStage, Site
from cmg_mj.core.types import STANDARD_GRAVITY, Forces, IdealReading
from cmg_mj.inputs.types import STRICT, NoiseSize
from cmg_mj.stages.pair import PairSettings


@dataclass(frozen=True, config=STRICT)
class FlickerSettings(PairSettings):
    """1/f noise of the accelerometers.

    Attributes:
        bias_instability_ug: Bias instability of each axis: the floor of its Allan deviation, made by 1/f noise [ug].
    """

    bias_instability_ug: NoiseSize = 0.0

    @property
    def flicker_floor(self) -> float:
        """Floor of the Allan deviation of each axis' 1/f noise [m/s^2]."""
        return self.bias_instability_ug * 1e-6 * STANDARD_GRAVITY


def flicker(part: FlickerSettings, site: Site) -> SensorStage:
    """Make the stage of 1/f noise, independent in each axis."""
    noise = site.noise(NoiseStream.FLICKER, len(CORNERS_HZ) * part.channels)

    def drawn() -> np.ndarray:
        numbers = np.asarray(next(noise))
        return numbers.reshape(len(CORNERS_HZ), part.channels, *numbers.shape[1:])

    wander = FlickerNoise(part.flicker_floor, 1.0 / part.raw_rate_hz, drawn())

    def add(forces: Forces, ideal: IdealReading) -> Forces:
        added = wander.advance(drawn()[None])[0]
        if isinstance(forces, np.ndarray):
            return forces + added
        return [force + more for force, more in zip(forces, added.tolist(), strict=True)]

    return add

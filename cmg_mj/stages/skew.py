"""Skew of the accelerometers: the outer one's sample is older than the inner one's."""

from __future__ import annotations

from collections import deque
from typing import Annotated

import numpy as np
from pydantic import ValidationInfo, field_validator
from pydantic.dataclasses import dataclass

from cmg_mj.core.sensor import Site, Timing
from cmg_mj.core.types import Forces, IdealReading
from cmg_mj.inputs.types import STRICT, NonNegative, OnGrid
from cmg_mj.stages.pair import PairSettings


@dataclass(frozen=True, config=STRICT)
class SkewSettings(PairSettings):
    """Skew of the accelerometers.

    Attributes:
        skew_s: Age of the outer accelerometer's sample when the inner one is sampled, at most one sample period [s].
    """

    skew_s: Annotated[NonNegative, OnGrid("s")] = 0.0

    @field_validator("skew_s")
    @classmethod
    def _within_a_period(cls, skew_s: float, info: ValidationInfo) -> float:
        rate = info.data.get("rate_hz")
        if rate and skew_s > (1.0 + 1e-9) / rate:
            raise ValueError(f"{skew_s:g} s: at most one sample period, {1.0 / rate:g} s at rate_hz = {rate:g}")
        return skew_s


class Skew:
    """Combines the inner accelerometer's sample with an older one of the outer, which it keeps.

    Args:
        part: The accelerometers.
        site: Their place in the run.
    """

    def __init__(self, part: SkewSettings, site: Site) -> None:
        self._steps = site.steps(part.skew_s, "skew_s", f"{part.skew_s:g} s")
        self.timing = Timing(grid=self._steps)
        self._outer: deque[tuple[int, Forces]] = deque()

    def watch(self, step: int, period: int, ideal: IdealReading) -> None:
        """Keep the sample of the outer one that is due, and drop those that are too old."""
        if not self._outer or (step + self._steps) % period == 0:
            self._outer.append((step, ideal.accelerations))
        while len(self._outer) > 1 and self._outer[1][0] <= step - self._steps:
            self._outer.popleft()

    def __call__(self, forces: Forces, ideal: IdealReading) -> Forces:
        """Return the inner one's forces and the outer one's of earlier."""
        outer = self._outer[0][1]
        if isinstance(forces, np.ndarray):
            return np.concatenate([forces[:2], outer[2:]])
        return (*forces[:2], *outer[2:])

"""Skew of the accelerometers: the outer one's sample is older than the inner one's."""

from __future__ import annotations

from typing import Annotated

from pydantic import ValidationInfo, field_validator
from pydantic.dataclasses import dataclass

from cmg_mj.core.sensor import Site
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
        if skew_s and info.data.get("averaged"):
            raise ValueError(f"{skew_s:g} s: of means since the sample before there is none; leave out averaged")
        return skew_s

    def skew_steps(self, site: Site) -> int:
        """Count the physics steps by which the outer accelerometer's samples are older: see `Sensor.skew`."""
        return site.steps(self.skew_s, "skew_s", f"{self.skew_s:g} s") if self.skew_s else 0

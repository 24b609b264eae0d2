"""The first-order difference, as used in reference [11] of aranovskiy2020 (Spong, Corke, Lozano 2001)."""

from __future__ import annotations

from typing import ClassVar

from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.types import Estimate, Measurement
from cmg_mj.inputs.types import STRICT, Positive


@dataclass(frozen=True, config=STRICT)
class FiniteDifference:
    """The first-order difference, as used in reference [11] of aranovskiy2020 (Spong, Corke, Lozano 2001).

    x2 = (y1_k - y1_{k-1})/dt: no parameter, no model, no filter.

    Attributes:
        dt: Sample period [s].
        model: The reduced model (not used: this observer is model-free).
    """

    needs: ClassVar[tuple[str, ...]] = ()

    dt: Positive
    model: ReducedModel

    def init(self, y: Measurement) -> Scalar:
        """Remember the measured tilt."""
        return y.y1

    def step(self, state: Scalar, y: Measurement, u: Scalar) -> tuple[Scalar, Estimate]:
        """Advance by one sample period."""
        y1, y2 = y
        return y1, Estimate(y1, (y1 - state) / self.dt, y2)

"""The linear differentiator, aranovskiy2020 (9)."""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar

import numpy as np
from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.types import Estimate, Measurement
from cmg_mj.core.zero_order_hold import Coefficients, FilterState, second_order_rows, second_order_step
from cmg_mj.inputs.types import STRICT, Positive


@dataclass(frozen=True, config=STRICT)
class LinearDifferentiator:
    """The linear differentiator, aranovskiy2020 (9).

    G(s) = s/(tau s + 1)^2: model-free, aranovskiy2020 (9), sokolov2019 (8).

    Discretised exactly for a measurement that runs straight between samples: on a ramp the estimate converges to the
    slope itself.

    Attributes:
        dt: Sample period [s].
        model: The reduced model (not used: this observer is model-free).
        tau: Time constant of the filter [s]. Default: Table 2.
    """

    needs: ClassVar[tuple[str, ...]] = ()

    dt: Positive
    model: ReducedModel
    tau: Positive = 0.02

    @cached_property
    def _rows(self) -> Coefficients:
        tau = self.tau
        A = np.array([[0.0, 1.0], [-1.0 / tau**2, -2.0 / tau]])
        return second_order_rows(A, np.array([[0.0], [1.0 / tau**2]]), self.dt)

    def init(self, y: Measurement) -> FilterState:
        """Start at rest at the measured tilt."""
        return FilterState(y.y1, 0.0 * y.y1, y.y1)

    def step(self, state: FilterState, y: Measurement, u: Scalar) -> tuple[FilterState, Estimate]:
        """Advance by one sample period."""
        state = second_order_step(self._rows, state, y[0])
        return state, Estimate(state[0], state[1], y[1])

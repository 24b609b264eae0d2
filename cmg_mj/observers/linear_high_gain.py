"""The linear high-gain differentiator of Vasiljevic and Khalil, reference [13] of aranovskiy2020.

L. K. Vasiljevic and H. K. Khalil, "Error bounds in differentiation of noisy signals by high-gain
observers", Systems & Control Letters 57 (2008).
"""

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
class LinearHighGain:
    """The linear high-gain differentiator of Vasiljevic and Khalil, reference [13] of aranovskiy2020.

    x1' = x2 + (a1/eps)(y1 - x1), x2' = (a2/eps^2)(y1 - x1): model-free.

    Its estimate of the rate is s/((eps^2/a2) s^2 + (a1 eps/a2) s + 1) y1, which with a1 = 2, a2 = 1 is (9) with
    tau = eps.
    Discretised exactly for a measurement that runs straight between samples.

    Attributes:
        dt: Sample period [s].
        model: The reduced model (not used: this observer is model-free).
        epsilon: Time constant; the gains are its inverse powers [s]. Default: tuned, docs/assumptions.md.
        a1: Coefficient a1 of the polynomial s^2 + a1 s + a2. Default: sqrt(2), Butterworth poles.
        a2: Coefficient a2 of the polynomial s^2 + a1 s + a2.
    """

    needs: ClassVar[tuple[str, ...]] = ()

    dt: Positive
    model: ReducedModel
    epsilon: Positive = 0.0287
    a1: Positive = 1.4142135623730951
    a2: Positive = 1.0

    @cached_property
    def _rows(self) -> Coefficients:
        g1, g2 = self.a1 / self.epsilon, self.a2 / self.epsilon**2
        return second_order_rows(np.array([[-g1, 1.0], [-g2, 0.0]]), np.array([[g1], [g2]]), self.dt)

    def init(self, y: Measurement) -> FilterState:
        """Start at rest at the measured tilt."""
        return FilterState(y.y1, 0.0 * y.y1, y.y1)

    def step(self, state: FilterState, y: Measurement, u: Scalar) -> tuple[FilterState, Estimate]:
        """Advance by one sample period."""
        state = second_order_step(self._rows, state, y[0])
        return state, Estimate(state[0], state[1], y[1])

"""The linear time-varying observer with a Riccati gain, aranovskiy2020 (10)."""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar, clip
from cmg_mj.core.reduced_model import ReducedModel, Terms
from cmg_mj.core.types import Estimate, Measurement
from cmg_mj.inputs.types import STRICT, Positive
from cmg_mj.observers.model_copy import LARGEST_RATE, follow, stages
from cmg_mj.observers.riccati import exact_step, map_of_one

MOST_PIECES = 1000


class State(NamedTuple):
    """The estimate, the independent entries of the Riccati matrix H, the last measurement, the model's terms there."""

    x1: Scalar
    x2: Scalar
    x3: Scalar
    h11: Scalar
    h12: Scalar
    h22: Scalar
    h33: Scalar
    y: Measurement
    terms: Terms


@dataclass(frozen=True, config=STRICT)
class LinearTimeVarying:
    """The linear time-varying observer with a Riccati gain, aranovskiy2020 (10).

    x' = A'(y, u) x + b(y, u) - H C^T (C x - y), H' = H A'^T + A' H - H C^T C H + Q.

    With diagonal Q and H_0 the third state decouples: H13 and H23 stay zero. What is left is the 2x2 block of
    (x1, x2) and the scalar H33.

    H is advanced by its exact solution for an A' held over half a step (`riccati.py`), the estimate by
    `model_copy.follow` with H at the beginning, in the middle and at the end of the step: one step a sample, or more if
    Q makes the observer too fast for one.

    Attributes:
        dt: Sample period [s].
        model: The reduced model.
        Q: Diagonal of the Riccati equation's weight Q. Default: Table 2.
        H0: Diagonal of the Riccati matrix at the start. Default: Table 2.
    """

    dt: Positive
    model: ReducedModel
    Q: tuple[Positive, Positive, Positive] = (1.0, 5e6, 1.0)
    H0: tuple[Positive, Positive, Positive] = (1.0, 1.0, 1.0)

    def init(self, y: Measurement) -> State:
        """Start at rest at the measured angles, with H = H_0."""
        zero = 0.0 * y.y1
        h11, h22, h33 = self.H0
        return State(y.y1, zero, y.y2, h11 + zero, zero, h22 + zero, h33 + zero, y, self.model.terms(*y))

    def __post_init__(self) -> None:
        if self._pieces > MOST_PIECES:
            raise ValueError(f"Q: asks for an observer more than {MOST_PIECES} times as fast as the sample rate")

    @cached_property
    def _pieces(self) -> int:
        """Into how many equal steps a sample period is cut.

        Then the series below converges to rounding, and the estimate's step is well inside its stability region,
        since H11 settles below 2 * fastest.
        """
        q1, q2, q3 = self.Q
        fastest = max(math.sqrt(q1), q2**0.25, math.sqrt(q3))  # bounds |eigenvalue of N| at a = 0
        return max(1, math.ceil(fastest * self.dt))

    @cached_property
    def _third(self) -> tuple[float, float]:
        """The exact map of H33 over half a step."""
        return map_of_one(self.Q[2], 0.5 * self.dt / self._pieces)

    def correction(self, e: Scalar, H: tuple[Scalar, Scalar]) -> tuple[Scalar, Scalar]:
        """H C^T (C x - y), its first two rows."""
        h11, h12 = H
        return h11 * e, h12 * e

    def step(self, state: State, y: Measurement, u: Scalar) -> tuple[State, Estimate]:
        """Advance by one sample period."""
        for left in range(self._pieces, 1, -1):
            along = Measurement(*(a + (b - a) / left for a, b in zip(state.y, y, strict=True)))
            state = self._piece(state, along, u)
        state = self._piece(state, y, u)
        return state, Estimate(state[0], state[1], state[2])

    def _piece(self, state: State, y: Measurement, u: Scalar) -> State:
        """Advance H and the estimate by a part of a sample period."""
        h, (q1, q2, _), (up, down) = self.dt / self._pieces, self.Q, self._third
        x1, x2, x3, h11, h12, h22, h33, before, terms = state
        begin, middle, end, terms = stages(self.model, before, terms, y, u)
        a_begin, a_middle, a_end = -begin[2], -middle[2], -end[2]
        m11, m12, m22 = exact_step(h11, h12, h22, q1, q2, 0.5 * (a_begin + a_middle), 0.5 * h)
        n11, n12, n22 = exact_step(m11, m12, m22, q1, q2, 0.5 * (a_middle + a_end), 0.5 * h)
        m33 = (h33 + up) / (down * h33 + 1.0)
        n33 = (m33 + up) / (down * m33 + 1.0)

        # Only while a large H_0 fades can a gain at the beginning be too large for the step.
        fit, fit3 = clip(LARGEST_RATE / (h * h11), 0.0, 1.0), clip(LARGEST_RATE / (h * h33), 0.0, 1.0)
        gains = (fit * h11, fit * h12), (m11, m12), (n11, n12)
        x1, x2 = follow(self.correction, x1, x2, h, begin, middle, end, gains)
        x3 = _third_row(x3, h, u, before[1], y[1], (fit3 * h33, m33, n33))
        return State(x1, x2, x3, n11, n12, n22, n33, y, terms)


def _third_row(
    x3: Scalar, h: float, u: Scalar, y2_before: Scalar, y2: Scalar, h33: tuple[Scalar, Scalar, Scalar]
) -> Scalar:
    """Take the step of x3' = u - H33 (x3 - y2), which the other two rows do not enter."""
    y2_middle = 0.5 * (y2_before + y2)
    p = u - h33[0] * (x3 - y2_before)
    q = u - h33[1] * (x3 + 0.5 * h * p - y2_middle)
    r = u - h33[1] * (x3 + 0.5 * h * q - y2_middle)
    s = u - h33[2] * (x3 + h * r - y2)
    return x3 + h / 6.0 * (p + 2.0 * (q + r) + s)

"""The linear time-varying observer with a Riccati gain, aranovskiy2020 (10), and the Riccati equation's exact solution.

H' = H A'^T + A' H - H C^T C H + Q: for an A' that is held, the equation is the projection of a linear flow, H = Y X^-1
with [X; Y]' = N [X; Y] and N the Hamiltonian matrix (Davison and Maki 1973). That map keeps H symmetric positive
definite at any step. With A' as it is here, N^4 = p N^2 - q, so the exponential is a polynomial of degree 3 in N whose
coefficients are a short series.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar, clip
from cmg_mj.core.reduced_model import ReducedModel, Terms
from cmg_mj.core.types import Estimate, Measurement
from cmg_mj.inputs.types import STRICT, Positive
from cmg_mj.observers.model_copy import MAX_RATE, follow, stages

MAX_PIECES = 1000


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
        if self._pieces > MAX_PIECES:
            raise ValueError(f"Q: asks for an observer more than {MAX_PIECES} times as fast as the sample rate")

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
            along.contact = y.contact
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
        fit, fit3 = clip(MAX_RATE / (h * h11), 0.0, 1.0), clip(MAX_RATE / (h * h33), 0.0, 1.0)
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


TERMS = 7
"""Number of terms of the series, which converges to rounding while N times the step is below 1/2."""


def exact_step(
    h11: Scalar, h12: Scalar, h22: Scalar, q1: float, q2: float, a: Scalar, span: float
) -> tuple[Scalar, Scalar, Scalar]:
    """Advance the 2x2 block of H over a time in which A' = [[0, 1], [0, a]] and C = [1, 0] are held.

    Args:
        h11: Entry of H.
        h12: Entry of H.
        h22: Entry of H.
        q1: Entry of Q.
        q2: Entry of Q.
        a: The entry of A' [1/s].
        span: Time to advance [s].

    Returns:
        h11, h12, h22 afterwards.
    """
    # N = [[-A'^T, C^T C], [Q, A']] on (x1, x2) has the eigenvalues s^4 - p s^2 + q = 0.
    p, q = a * a + q1, q1 * a * a + q2
    # exp(N t) = c0 + c1 N + c2 N^2 + c3 N^3; N^(2k) = f + g N^2, with (f, g) -> (-q g, f + p g).
    t = span
    f, g = 1.0, 0.0
    c0, c2, c1, c3 = 1.0, 0.0, t, 0.0
    even, odd = 1.0, t
    for k in range(1, TERMS + 1):
        f, g = -q * g, f + p * g
        even = even * t * t / ((2 * k - 1) * (2 * k))
        odd = odd * t * t / ((2 * k) * (2 * k + 1))
        c0, c2, c1, c3 = c0 + even * f, c2 + even * g, c1 + odd * f, c3 + odd * g

    def flow(x1: Scalar, x2: Scalar, y1: Scalar, y2: Scalar) -> tuple[Scalar, Scalar, Scalar, Scalar]:
        """exp(N t) applied to one column of [X; Y]."""
        r = [(x1, x2, y1, y2)]
        for _ in range(3):
            x1, x2, y1, y2 = y1, -x1 - a * x2, q1 * x1 + y2, q2 * x2 + a * y2
            r.append((x1, x2, y1, y2))
        v0, v1, v2, v3 = r
        return (
            c0 * v0[0] + c1 * v1[0] + c2 * v2[0] + c3 * v3[0],
            c0 * v0[1] + c1 * v1[1] + c2 * v2[1] + c3 * v3[1],
            c0 * v0[2] + c1 * v1[2] + c2 * v2[2] + c3 * v3[2],
            c0 * v0[3] + c1 * v1[3] + c2 * v2[3] + c3 * v3[3],
        )

    x11, x21, y11, y21 = flow(1.0, 0.0, h11, h12)
    x12, x22, y12, y22 = flow(0.0, 1.0, h12, h22)
    det = x11 * x22 - x12 * x21
    n11 = (y11 * x22 - y12 * x21) / det
    n12 = 0.5 * (y12 * x11 - y11 * x12 + y21 * x22 - y22 * x21) / det  # both off-diagonals agree up to rounding
    n22 = (y22 * x11 - y21 * x12) / det
    return n11, n12, n22


def map_of_one(q: float, span: float) -> tuple[float, float]:
    """Return the map for one state that only integrates, H' = q - H^2: H -> (H + up)/(down H + 1).

    Args:
        q: Q.
        span: Time to advance [s].

    Returns:
        up, down.
    """
    w = math.sqrt(q)
    t = math.tanh(w * span)
    return w * t, t / w

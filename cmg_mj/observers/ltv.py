"""The linear time-varying observer with a Riccati gain, aranovskiy2020 (10)."""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

from pydantic.dataclasses import dataclass

from cmg_mj.elementwise import Scalar, clip
from cmg_mj.fields import STRICT, Positive
from cmg_mj.observers.protocol import Estimate, Measurement
from cmg_mj.reduced import ReducedModel

MOST_PIECES = 1000
LARGEST_GAIN = 2.5  # the classical Runge-Kutta step is stable up to 2.78


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
    terms: tuple[Scalar, Scalar, Scalar]


@dataclass(frozen=True, config=STRICT)
class LinearTimeVarying:
    """x' = A'(y, u) x + b(y, u) - H C^T (C x - y), H' = H A'^T + A' H - H C^T C H + Q.

    With diagonal Q and H_0 the third state decouples: H13 and H23 stay zero. What is left is the 2x2 block of
    (x1, x2) and the scalar H33.

    H is advanced by the exact solution for an A' held over half a sample period: the Riccati equation is
    the projection of a linear flow, H = Y X^-1 with [X; Y]' = N [X; Y] and N the Hamiltonian matrix
    (Davison and Maki 1973). That map keeps H symmetric positive definite at any step. N^4 = p N^2 - q, so the
    exponential is a polynomial of degree 3 in N whose coefficients are a short series. The estimate
    takes classical Runge-Kutta steps with H at their beginning, middle and end, the measurement running straight
    between samples and the input held: one step a sample, or more if Q asks for a faster observer than that bears.

    Attributes:
        dt: Sample period [s].
        model: The reduced model.
        Q: Diagonal of Q. Default: Table 2.
        H0: Diagonal of H_0. Default: Table 2.
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

    def riccati(self, h11: Scalar, h12: Scalar, h22: Scalar, a: Scalar, span: float) -> tuple[Scalar, Scalar, Scalar]:
        """Advance the 2x2 block of H exactly over a time in which A' = [[0, 1], [0, a]] is held.

        Args:
            h11: Entry of H.
            h12: Entry of H.
            h22: Entry of H.
            a: The entry of A' [1/s].
            span: Time to advance [s].

        Returns:
            h11, h12, h22 afterwards.
        """
        q1, q2, _ = self.Q
        # N = [[-A'^T, C^T C], [Q, A']] on (x1, x2) has the eigenvalues s^4 - p s^2 + q = 0.
        p, q = a * a + q1, q1 * a * a + q2
        # exp(N t) = c0 + c1 N + c2 N^2 + c3 N^3; N^(2k) = f + g N^2, with (f, g) -> (-q g, f + p g).
        t = span
        f, g = 1.0, 0.0
        c0, c2, c1, c3 = 1.0, 0.0, t, 0.0
        even, odd = 1.0, t
        for k in range(1, 8):
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

    @cached_property
    def _third(self) -> tuple[float, float]:
        """Coefficients of the exact map of H33' = q3 - H33^2 over half a step."""
        w = math.sqrt(self.Q[2])
        t = math.tanh(w * self.dt / self._pieces / 2.0)
        return w * t, t / w

    def _model(self, terms: tuple[Scalar, Scalar, Scalar], u: Scalar) -> tuple[Scalar, Scalar]:
        """f2 = a x2 + b: the entry a of A', and the known input b."""
        drift, gain, damping = terms
        return -u * damping, drift + u * gain

    def step(self, state: State, y: Measurement, u: Scalar) -> tuple[State, Estimate]:
        """Advance by one sample period."""
        pieces = self._pieces
        h = self.dt / pieces
        up, down = self._third
        x1, x2, x3, h11, h12, h22, h33, y_before, terms = state
        v1, v2 = y_before
        slope1, slope2 = (y[0] - v1) / pieces, (y[1] - v2) / pieces
        a0, b0 = self._model(terms, u)
        for piece in range(1, pieces + 1):
            last = piece == pieces
            v1_middle, v2_middle = v1 + 0.5 * slope1, v2 + 0.5 * slope2
            v1_end, v2_end = y if last else (v1 + slope1, v2 + slope2)
            am, bm = self._model(self.model.terms(v1_middle, v2_middle), u)
            terms = self.model.terms(v1_end, v2_end)
            a1, b1 = self._model(terms, u)

            m11, m12, m22 = self.riccati(h11, h12, h22, 0.5 * (a0 + am), 0.5 * h)
            n11, n12, n22 = self.riccati(m11, m12, m22, 0.5 * (am + a1), 0.5 * h)
            m33 = (h33 + up) / (down * h33 + 1.0)
            n33 = (m33 + up) / (down * m33 + 1.0)

            # Only while a large H_0 fades can a gain at the beginning be too large for the step.
            fit, fit3 = clip(LARGEST_GAIN / (h * h11), 0.0, 1.0), clip(LARGEST_GAIN / (h * h33), 0.0, 1.0)
            e = v1 - x1
            p1, p2, p3 = x2 + fit * h11 * e, a0 * x2 + b0 + fit * h12 * e, u + fit3 * h33 * (v2 - x3)
            w = x2 + 0.5 * h * p2
            e = v1_middle - x1 - 0.5 * h * p1
            q1, q2, q3 = w + m11 * e, am * w + bm + m12 * e, u + m33 * (v2_middle - x3 - 0.5 * h * p3)
            w = x2 + 0.5 * h * q2
            e = v1_middle - x1 - 0.5 * h * q1
            r1, r2, r3 = w + m11 * e, am * w + bm + m12 * e, u + m33 * (v2_middle - x3 - 0.5 * h * q3)
            w = x2 + h * r2
            e = v1_end - x1 - h * r1
            s1, s2, s3 = w + n11 * e, a1 * w + b1 + n12 * e, u + n33 * (v2_end - x3 - h * r3)

            x1 = x1 + h / 6.0 * (p1 + 2.0 * (q1 + r1) + s1)
            x2 = x2 + h / 6.0 * (p2 + 2.0 * (q2 + r2) + s2)
            x3 = x3 + h / 6.0 * (p3 + 2.0 * (q3 + r3) + s3)
            h11, h12, h22, h33 = n11, n12, n22, n33
            v1, v2, a0, b0 = v1_end, v2_end, a1, b1
        return State(x1, x2, x3, h11, h12, h22, h33, y, terms), Estimate(x1, x2, x3)

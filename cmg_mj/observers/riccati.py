"""The Riccati equation H' = H A'^T + A' H - H C^T C H + Q of aranovskiy2020 (10), advanced by its exact solution.

For an A' that is held, the equation is the projection of a linear flow: H = Y X^-1 with [X; Y]' = N [X; Y] and N the
Hamiltonian matrix (Davison and Maki 1973). That map keeps H symmetric positive definite at any step. With A' as it is
here, N^4 = p N^2 - q, so the exponential is a polynomial of degree 3 in N whose coefficients are a short series.
"""

from __future__ import annotations

import math

from cmg_mj.core.arrays import Scalar

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

"""andrieu2009 as printed: system (1), and the bioreactor's and its observers' parameters of section 3."""

from __future__ import annotations

from cmg_mj.core.arrays import Scalar, signed_power


def f2(g: Scalar, x2: Scalar, u: Scalar, p: float) -> Scalar:
    """Return x2' of (1), with the value of g at x1."""
    return g * x2 + signed_power(x2, 1.0 + p) + u


def Omega(g: Scalar, x2_hat: Scalar, p: float) -> Scalar:
    """Return (9) for (1), section 2.1: Gamma(u, y) = |g(y)| + 1 + p, v_2 = p."""
    return (abs(g) + 1.0 + p) * (1.0 + abs(x2_hat) ** p)


# Section 3.1. Normalised variables and time: no units.
HBAR, HBAR_OF_OBSERVERS = 1.0, 0.8
U_MIN, U_MAX = 0.01, 0.7
NOISE = 0.05
"""Standard deviation of the measurement disturbance; said to be a tenth of the range of eta1, which it is not."""
P, B = 0.9, 0.410
PHI1, PHI2, PHI3 = 0.03, 1.0, 3.0
L1, L2 = 0.01, 0.01


def dilution(t: float) -> float:
    """Return the input u, section 3.1."""
    return 0.410 if t < 10.0 else 0.02 if t < 20.0 else 0.6 if t < 35.0 else 0.1

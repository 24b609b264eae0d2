"""Section 4.2: the correction K along a chain of integrators, and a W with which (19) and (20) hold."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from cmg_mj.core.arrays import Scalar, signed_power
from cmg_mj.papers.andrieu2009.observer import BiLimitCorrection, largest_b, weights
from cmg_mj.papers.claim import Claim


def theorem_2() -> Claim:
    """Judge Theorem 2, and Definition 1."""
    ends, limits = {}, {}
    for n, share in itertools.product((1, 2, 3), (0.0, 0.5, 0.9)):
        d_inf = share / max(n - 1, 1)
        K = BiLimitCorrection(tuple(2.0 ** (n - i) for i in range(1, n + 1)), d_inf)
        ends[f"n={n}, d_inf={d_inf:g}"] = chain_errors(K, (1e-3, 1.0, 1e3))
        if d_inf:
            limits[f"n={n}, d_inf={d_inf:g}"] = [limits_error(K, scale) for scale in (1e4, 1e8, 1e12)]
    by_simulation = (
        "Convergence is shown by simulation from random errors, the construction of W for two dimensions only, by the "
        "claim on (19) and (20)."
    )
    return Claim(
        place="Section 4.2, Theorem 2 (and Definition 1)",
        statement="There is a K, homogeneous in the bi-limit, with which the error of a chain of integrators "
        "converges, for any n and any d_inf in [0, 1/(n-1)).",
        is_general=True,
        holds=max(ends.values()) < 1e-3 and all(a > b > c for a, b, c in limits.values()),
        conditions=by_simulation,
        figures={
            "largest_final_error_ratio": ends,
            "deviation_from_limits_ratio": limits,
            "poor_l_final_error_ratio": chain_errors(BiLimitCorrection((1.0, 2.0, 0.9), 0.2), (1.0,)),
        },
    )


def limits_error(correction: BiLimitCorrection, scale: float) -> float:
    """Measure, by Definition 1, the errors of K, dilated, from its approximations at 0 and at infinity, |e1| <= 1.

    Args:
        correction: K.
        scale: Lambda for infinity; its inverse for 0.

    Returns:
        The largest deviation of a component at 0 or at infinity, over its approximation's largest value.
    """
    e1 = np.linspace(-1.0, 1.0, 41)
    r = weights(correction.n, correction.d_inf)
    errors, linear, power = [], e1, e1
    dilated = correction(e1 / scale), correction(scale ** r[0] * e1)
    for i, l_i in enumerate(correction.l):
        linear, power = l_i * linear, signed_power(l_i * power, r[i + 1] / r[i])
        errors.append(np.abs(scale * dilated[0][i] + linear).max() / np.abs(linear).max())
        errors.append(np.abs(dilated[1][i] / scale ** r[i + 1] + power).max() / np.abs(power).max())
    return float(max(errors))


def chain_errors(correction: BiLimitCorrection, sizes: Sequence[float]) -> float:
    """Let dE/dtau = S E + K(e1) run to tau = 40 from E of the given lengths, three random directions each.

    Args:
        correction: K.
        sizes: Lengths of E at the start.

    Returns:
        The worst length at the end, over the length at the start; infinite if a solution could not be followed.
    """
    rng, largest_ratio = np.random.default_rng(0), 0.0

    def slope(_: float, E: np.ndarray) -> list[float]:
        *numbers, last = correction(float(E[0]))
        if not math.isfinite(last):  # LSODA would go on for ever
            raise OverflowError
        return [*(float(E[i + 1]) + number for i, number in enumerate(numbers)), last]

    for size in np.repeat(sizes, 3).tolist():
        start = rng.normal(size=correction.n)
        start *= size / np.linalg.norm(start)
        try:
            solution = solve_ivp(slope, (0.0, 40.0), start, "LSODA", rtol=1e-6, atol=1e-9 * size)
        except OverflowError:
            return math.inf
        end = float(np.linalg.norm(solution.y[:, -1]))
        largest_ratio = max(largest_ratio, end / size if solution.success and math.isfinite(end) else math.inf)
    return largest_ratio


# --- Section 4.2, (19) and (20): a W for two dimensions with which both hold ---

DEGREES = (0.0, 0.25, 0.5, 0.75, 0.9)
"""d_inf tried, of [0, 1)."""
SPREAD = 0.3
"""A1 and A2 of (17) are anywhere within so much of 1."""
L1 = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0)
"""l1 tried, l2 being 1; the theorem says that some K and W do, so they may be sought."""
SIGMAS = (0.3, 1.0, 3.0, 10.0, 30.0)
SCALES, FINE = (np.geomspace(1e-8, 1e8, count) for count in (65, 641))
"""Scales of the states, from where W is that of its limit at 0 to where it is that at infinity. The search has the
first; what was found is tried again on the others, forty a decade."""
MARGIN = 0.02
"""c1 and c2 must be at least so large, because the states tried leave some out."""


def states(scales: np.ndarray = SCALES, angles: int = 120) -> np.ndarray:
    """Return states on squares of all scales, (2, n), denser where s1 and s2 are nearly alike or one is small."""
    share = np.linspace(-1.0, 1.0, angles)
    shares = np.concatenate([share, np.geomspace(1e-3, 1.0, 40), 1.0 - np.geomspace(1e-3, 1.0, 40)])
    ends = np.ones_like(shares)
    s1, s2 = np.concatenate([ends, -ends, shares, shares]), np.concatenate([shares, shares, ends, -ends])
    return np.array([np.multiply.outer(scales, s).ravel() for s in (s1, s2)])


@dataclass(frozen=True)
class Lyapunov:
    """W for n = 2.

    Attributes:
        K: The correction, of two dimensions.
        sigma: Weight of the part in e2.
        d_W: Its degree, at least 2 + d_inf.
    """

    K: BiLimitCorrection
    sigma: float
    d_W: float

    @property
    def powers(self) -> tuple[float, float]:
        """The two powers in h."""
        return self.d_W - 1.0, self.d_W / (1.0 - self.K.d_inf) - 1.0

    def q1(self, s: Scalar) -> Scalar:
        """Return q1, whose two terms are one if d_inf = 0."""
        return s if not self.K.d_inf else s + signed_power(s, self.K.exponents[0])

    def q1_slope(self, s: Scalar) -> Scalar:
        """Return the derivative of q1."""
        a = self.K.exponents[0]
        return np.ones_like(s) if not self.K.d_inf else 1.0 + a * np.abs(s) ** (a - 1.0)

    def h(self, s: Scalar) -> Scalar:
        """Return the integrand of W."""
        return sum(signed_power(s, power) for power in self.powers)

    def h_slope(self, s: Scalar) -> Scalar:
        """Return the derivative of h."""
        return sum(power * np.abs(s) ** (power - 1.0) for power in self.powers)

    def H(self, s: Scalar) -> Scalar:
        """Return the integral of h."""
        return sum(np.abs(s) ** (power + 1.0) / (power + 1.0) for power in self.powers)

    def E(self, s1: Scalar, s2: Scalar) -> tuple[Scalar, Scalar]:
        """Return e1 and e2."""
        return s1 / self.K.l[0], self.q1(s2)

    def W(self, s1: Scalar, s2: Scalar) -> Scalar:
        """Return W, (n,)."""
        first = self.H(s1) - self.H(s2) - self.h(s2) * (s1 - s2)
        return first + self.sigma * np.abs(self.q1(s2)) ** self.d_W / self.d_W

    def gradient(self, s1: Scalar, s2: Scalar) -> tuple[Scalar, Scalar]:
        """Return dW/de1 and dW/de2, each (n,)."""
        by_s2 = -self.h_slope(s2) * (s1 - s2) / self.q1_slope(s2)
        return (
            self.K.l[0] * (self.h(s1) - self.h(s2)),
            by_s2 + self.sigma * signed_power(self.q1(s2), self.d_W - 1.0),
        )


def decay(W: Lyapunov, b: float, spread: float = 0.0, grid: np.ndarray | None = None) -> tuple[float, float]:
    """Try (19) and (20).

    Args:
        W: The function.
        b: Exponent of the scaling: B = diag(b, 1 + b) in (20).
        spread: A1 and A2 are anywhere in [1 - spread, 1 + spread]; both sides of (19) are linear in them.
        grid: States tried, (2, n); by default on all scales.

    Returns:
        c1 and c2, the largest with which (19) and (20) hold at all states tried; not positive if they do not hold.
    """
    s1, s2 = states() if grid is None else grid
    # Where s1 and s2 are nearer, W is rounding errors.
    distinct = np.abs(s1 - s2) > 1e-9 * np.maximum(np.abs(s1), np.abs(s2))
    s = s1[distinct], s2[distinct]
    (e1, e2), (by_e1, by_e2), value = W.E(*s), W.gradient(*s), W.W(*s)
    k1, k2 = W.K(e1)
    slopes = by_e1 * (e2 + k1), by_e2 * k2
    largest = sum(np.maximum((1.0 - spread) * part, (1.0 + spread) * part) for part in slopes)
    bound = value + value ** ((W.d_W + W.K.d_inf) / W.d_W)
    growth = by_e1 * b * e1 + by_e2 * (1.0 + b) * e2
    return float((-largest / bound).min()), float((growth / value).min())


class Pair(NamedTuple):
    """The first K and W with which both hold, b, half of what (21) and (22) allow with v_2 = d_inf, and c1, c2."""

    W: Lyapunov
    b: float
    c1: float
    c2: float


def search(d_inf: float) -> Pair | None:
    """Look for K and W with d_W = 2 + d_inf."""
    b = min(1.0, 0.5 * largest_b(2, d_inf, (d_inf,)))
    for l1, sigma in itertools.product(L1, SIGMAS):
        W = Lyapunov(BiLimitCorrection((l1, 1.0), d_inf), sigma, 2.0 + d_inf)
        if min(decay(W, b, SPREAD)) > MARGIN:
            return Pair(W, b, *decay(W, b, SPREAD, states(FINE)))
    return None


def claim() -> Claim:
    """Judge (19) and (20)."""
    pairs = {str(d_inf): pair for d_inf in DEGREES if (pair := search(d_inf)) is not None}
    return Claim(
        place="Section 4.2, (19) and (20)",
        statement="There are K and a proper W, homogeneous in the bi-limit, that satisfy (19) and (20) for all A(t) "
        "within (17) and the B of section 4.3.",
        is_general=True,
        holds=len(pairs) == len(DEGREES) and all(min(pair.c1, pair.c2) > 0.0 for pair in pairs.values()),
        conditions="For two dimensions, by numbers; a d_inf near its limit asks for a larger l1.",
        otherwise="For some d_inf none was found, which does not say that there is none.",
        figures={
            "c1_by_d_inf": {d_inf: pair.c1 for d_inf, pair in pairs.items()},
            "c2_by_d_inf": {d_inf: pair.c2 for d_inf, pair in pairs.items()},
            "l1_by_d_inf": {d_inf: pair.W.K.l[0] for d_inf, pair in pairs.items()},
        },
    )

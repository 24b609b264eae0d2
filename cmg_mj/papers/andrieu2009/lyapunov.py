"""Section 4.2: the correction K along a chain of integrators."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from cmg_mj.core.arrays import signed_power
from cmg_mj.papers.andrieu2009.observer import BiLimitCorrection, largest_b, weights
from cmg_mj.papers.claim import Claim

# --- Section 4.2: the correction K along a chain of integrators ---


def theorem_2() -> Claim:
    """Judge Theorem 2, and Definition 1."""
    sizes, dimensions = (1e-3, 1.0, 1e3), (1, 2, 3)
    ends, limits = {}, {}
    for n in dimensions:
        for share in (0.0, 0.5, 0.9):
            d_inf = share / (n - 1) if n > 1 else share
            K = BiLimitCorrection(recursive_l(n), d_inf)
            ends[f"n={n}, d_inf={d_inf:g}"] = chain_errors(K, sizes, 3, 40.0)
            if d_inf:
                limits[f"n={n}, d_inf={d_inf:g}"] = [max(limits_error(K, scale)) for scale in (1e4, 1e8, 1e12)]
    largest_end = max(ends.values())
    limits_shrink = all(a > b > c for a, b, c in limits.values())
    growth = chain_errors(BiLimitCorrection((1.0, 2.0, 0.9), 0.2), (1.0,), 3, 40.0)
    by_simulation = (
        "Convergence is shown by simulation from random errors, the construction of W for two dimensions only, by the "
        "claim on (19) and (20)."
    )
    return Claim(
        place="Section 4.2, Theorem 2 (and Definition 1)",
        statement="There is a K, homogeneous in the bi-limit, with which the error of a chain of integrators "
        "converges, for any n and any d_inf in [0, 1/(n-1)).",
        is_general=True,
        holds=largest_end < 1e-3 and limits_shrink,
        conditions=by_simulation,
        otherwise=by_simulation,
        figures={
            "largest_final_error_ratio": ends,
            "deviation_from_limits_ratio": limits,
            "poor_l_final_error_ratio": growth,
        },
    )


def limits_error(correction: BiLimitCorrection, scale: float) -> tuple[float, float]:
    """Measure, by Definition 1, the errors of K, dilated, from its approximations at 0 and at infinity, |e1| <= 1.

    Args:
        correction: K.
        scale: Lambda for infinity; its inverse for 0.

    Returns:
        The largest deviation of a component at 0 and at infinity, over its approximation's largest value.
    """
    e1 = np.linspace(-1.0, 1.0, 41)
    r = weights(correction.n, correction.d_inf)
    zero_error = inf_error = 0.0
    linear, power = e1, e1
    dilated = correction(e1 / scale), correction(scale ** r[0] * e1)
    for i in range(correction.n):
        linear = correction.l[i] * linear
        power = signed_power(correction.l[i] * power, r[i + 1] / r[i])
        zero_error = max(zero_error, float(np.abs(scale * dilated[0][i] + linear).max() / np.abs(linear).max()))
        inf_error = max(inf_error, float(np.abs(dilated[1][i] / scale ** r[i + 1] + power).max() / np.abs(power).max()))
    return zero_error, inf_error


def chain_errors(
    correction: BiLimitCorrection, sizes: Sequence[float], count: int, span: float, seed: int = 0
) -> float:
    """Let dE/dtau = S E + K(e1) run from random E of the given sizes.

    Args:
        correction: K.
        sizes: Lengths of E at the start.
        count: Random directions for each.
        span: Time tau to run.
        seed: Seed of the directions.

    Returns:
        The worst length at the end, over the length at the start; infinite if a solution could not be followed.
    """
    rng = np.random.default_rng(seed)
    n, largest_ratio = correction.n, 0.0

    def slope(_: float, E: np.ndarray) -> list[float]:
        *numbers, last = correction(float(E[0]))
        if not math.isfinite(last):  # LSODA would go on for ever
            raise OverflowError
        return [*(float(E[i + 1]) + number for i, number in enumerate(numbers)), last]

    for size in sizes:
        for _ in range(count):
            start = rng.normal(size=n)
            start *= size / np.linalg.norm(start)
            try:
                solution = solve_ivp(slope, (0.0, span), start, "LSODA", rtol=1e-6, atol=1e-9 * size)
            except OverflowError:
                return math.inf
            end = float(np.linalg.norm(solution.y[:, -1]))
            largest_ratio = max(largest_ratio, end / size if solution.success and math.isfinite(end) else math.inf)
    return largest_ratio


def recursive_l(n: int, ratio: float = 2.0) -> tuple[float, ...]:
    """Return l_i = ratio^(n - i)."""
    return tuple(ratio ** (n - i) for i in range(1, n + 1))


# --- Section 4.2, (19) and (20) ---

SCALES = np.geomspace(1e-8, 1e8, 65)
"""Scales of the states, from where W is that of its limit at 0 to where it is that at infinity."""
ANGLES = 120


class States(NamedTuple):
    """Points of the plane, each (n,)."""

    s1: np.ndarray
    s2: np.ndarray


def states(scales: np.ndarray = SCALES, angles: int = ANGLES) -> States:
    """Return states on squares of all scales, denser where s1 and s2 are nearly alike or one of them is small."""
    share = np.linspace(-1.0, 1.0, angles)
    shares = np.concatenate([share, np.geomspace(1e-3, 1.0, 40), 1.0 - np.geomspace(1e-3, 1.0, 40)])
    ends = np.ones_like(shares)
    s1 = np.concatenate([ends, -ends, shares, shares])
    s2 = np.concatenate([shares, shares, ends, -ends])
    return States(*(np.multiply.outer(scales, s).ravel() for s in (s1, s2)))


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
        r1 = 1.0 - self.K.d_inf
        return self.d_W - 1.0, self.d_W / r1 - 1.0

    def q1(self, s: np.ndarray) -> np.ndarray:
        """Return q1, whose two terms are one if d_inf = 0."""
        return s if not self.K.d_inf else s + signed_power(s, self.K.exponents[0])

    def q1_slope(self, s: np.ndarray) -> np.ndarray:
        """Return the derivative of q1."""
        a = self.K.exponents[0]
        return np.ones_like(s) if not self.K.d_inf else 1.0 + a * np.abs(s) ** (a - 1.0)

    def h(self, s: np.ndarray) -> np.ndarray:
        """Return the integrand of W."""
        first, second = self.powers
        return signed_power(s, first) + signed_power(s, second)

    def h_slope(self, s: np.ndarray) -> np.ndarray:
        """Return the derivative of h."""
        first, second = self.powers
        return first * np.abs(s) ** (first - 1.0) + second * np.abs(s) ** (second - 1.0)

    def H(self, s: np.ndarray) -> np.ndarray:
        """Return the integral of h."""
        first, second = (power + 1.0 for power in self.powers)
        return np.abs(s) ** first / first + np.abs(s) ** second / second

    def E(self, grid: States) -> tuple[np.ndarray, np.ndarray]:
        """Return e1 and e2."""
        return grid.s1 / self.K.l[0], self.q1(grid.s2)

    def W(self, grid: States) -> np.ndarray:
        """Return W, (n,)."""
        first = self.H(grid.s1) - self.H(grid.s2) - self.h(grid.s2) * (grid.s1 - grid.s2)
        return first + self.sigma * np.abs(self.q1(grid.s2)) ** self.d_W / self.d_W

    def gradient(self, grid: States) -> tuple[np.ndarray, np.ndarray]:
        """Return dW/de1 and dW/de2, each (n,)."""
        by_s2 = -self.h_slope(grid.s2) * (grid.s1 - grid.s2) / self.q1_slope(grid.s2)
        return (
            self.K.l[0] * (self.h(grid.s1) - self.h(grid.s2)),
            by_s2 + self.sigma * signed_power(self.q1(grid.s2), self.d_W - 1.0),
        )


class Decay(NamedTuple):
    """The largest constants with which (19) and (20) hold at all states tried; not positive if they do not hold."""

    c1: float
    c2: float


def decay(W: Lyapunov, b: float, spread: float = 0.0, grid: States | None = None) -> Decay:
    """Try (19) and (20).

    Args:
        W: The function.
        b: Exponent of the scaling: B = diag(b, 1 + b) in (20).
        spread: A1 and A2 are anywhere in [1 - spread, 1 + spread]; both sides of (19) are linear in them.
        grid: States tried; by default on all scales.

    Returns:
        c1 and c2.
    """
    grid = states() if grid is None else grid
    # Where s1 and s2 are nearer, W is rounding errors.
    distinct = np.abs(grid.s1 - grid.s2) > 1e-9 * np.maximum(np.abs(grid.s1), np.abs(grid.s2))
    grid = States(grid.s1[distinct], grid.s2[distinct])
    (e1, e2), (by_e1, by_e2), value = W.E(grid), W.gradient(grid), W.W(grid)
    k1, k2 = W.K(e1)
    slopes = by_e1 * (e2 + k1), by_e2 * k2
    largest = sum(np.maximum((1.0 - spread) * part, (1.0 + spread) * part) for part in slopes)
    bound = value + value ** ((W.d_W + W.K.d_inf) / W.d_W)
    growth = by_e1 * b * e1 + by_e2 * (1.0 + b) * e2
    return Decay(float((-largest / bound).min()), float((growth / value).min()))


# --- Section 4.2, (19) and (20): a W for two dimensions with which both hold ---

DEGREES = (0.0, 0.25, 0.5, 0.75, 0.9)
"""d_inf tried, of [0, 1)."""
SPREAD = 0.3
"""A1 and A2 of (17) are anywhere within so much of 1."""
L1 = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0)
"""l1 tried, l2 being 1; the theorem says that some K and W do, so they may be sought."""
SIGMAS = (0.3, 1.0, 3.0, 10.0, 30.0)
FINE = np.geomspace(1e-8, 1e8, 641)
"""Scales on which what was found is tried again, forty a decade."""
MARGIN = 0.02
"""c1 and c2 must be at least so large, because the states tried leave some out."""


class SearchResult(NamedTuple):
    """The first pair with which both hold."""

    d_inf: float
    b: float
    l1: float
    sigma: float
    decay: Decay


def exponent_of_scaling(d_inf: float) -> float:
    """Return b, half of what (21) and (22) allow with v_2 = d_inf, and 1 at most."""
    return min(1.0, 0.5 * largest_b(2, d_inf, (d_inf,)))


def search(d_inf: float) -> SearchResult | None:
    """Look for K and W with d_W = 2 + d_inf."""
    b = exponent_of_scaling(d_inf)
    for l1 in L1:
        for sigma in SIGMAS:
            W = Lyapunov(BiLimitCorrection((l1, 1.0), d_inf), sigma, 2.0 + d_inf)
            if min(decay(W, b, SPREAD)) > MARGIN:
                return SearchResult(d_inf, b, l1, sigma, decay(W, b, SPREAD, states(FINE, ANGLES)))
    return None


def claim() -> Claim:
    """Judge (19) and (20)."""
    results = {d_inf: search(d_inf) for d_inf in DEGREES}
    pairs = [pair for pair in results.values() if pair is not None]
    return Claim(
        place="Section 4.2, (19) and (20)",
        statement="There are K and a proper W, homogeneous in the bi-limit, that satisfy (19) and (20) for all A(t) "
        "within (17) and the B of section 4.3.",
        is_general=True,
        holds=len(pairs) == len(results) and all(min(pair.decay) > 0.0 for pair in pairs),
        conditions="For two dimensions, by numbers; a d_inf near its limit asks for a larger l1.",
        otherwise="For some d_inf none was found, which does not say that there is none.",
        figures={
            "c1_by_d_inf": {str(pair.d_inf): pair.decay.c1 for pair in pairs},
            "c2_by_d_inf": {str(pair.d_inf): pair.decay.c2 for pair in pairs},
            "l1_by_d_inf": {str(pair.d_inf): pair.l1 for pair in pairs},
        },
    )

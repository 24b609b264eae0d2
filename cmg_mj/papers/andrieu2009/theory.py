"""Sections 1, 2 and 4: inequalities, theorems and remarks, checked by numbers; a W with which (19) and (20) hold."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from cmg_mj.core.arrays import Scalar, signed_power
from cmg_mj.observers.high_gain import updated_gain
from cmg_mj.papers.andrieu2009 import bioreactor
from cmg_mj.papers.andrieu2009.bioreactor import B, P
from cmg_mj.papers.andrieu2009.observer import BiLimitCorrection, largest_b, list_violations, weights
from cmg_mj.papers.claim import Array, Claim
from cmg_mj.papers.recorded import largest_size

# --- Sections 1 and 2: the increments of f2 of system (1), their bounds (2), (3), and the exponent in (6) ---


def increments_of_2(p: float, seed: int = 0) -> float:
    """Return the worst quotient of |f2(x2) - f2(x2_hat)| and |g + 1| |x2 - x2_hat| at random g, x2, x2_hat, u."""
    rng, count = np.random.default_rng(seed), 4000
    g, u = rng.normal(size=(2, count))
    x2, x2_hat = rng.normal(size=(2, count)) * 10.0 ** rng.uniform(-2.0, 2.0, (2, count))
    left_side = np.abs(bioreactor.f2(g, x2, u, p) - bioreactor.f2(g, x2_hat, u, p))
    right_side = np.abs(g + 1.0) * np.abs(x2 - x2_hat)
    reliable = right_side > 1e-3 * (np.abs(x2) + np.abs(x2_hat) + np.abs(u))  # nearer, the left side is rounding errors
    return (left_side[reliable] / right_side[reliable]).max()


def linear_increments() -> Claim:
    """Judge (2)."""
    quotient = increments_of_2(0.0)
    return Claim(
        "Section 1, (2)",
        "For p = 0 the increments of f2 are bounded by |g(x1) + 1| |x2 - x2_hat|.",
        holds=quotient <= 1.0 + 1e-9,
        figures={"worst_quotient": quotient, "worst_quotient_p_0_1": increments_of_2(0.1)},
    )


def worst_quotient(p: float, size: float, bound: Callable[[Array, Array], Array]) -> float:
    """Return the worst quotient of an increment of x2^(1+p) and its bound, over both signs and sizes up to one.

    With g = 0: |g| |x2 - x2_hat| adds to both sides at most.

    Args:
        p: Power of (1).
        size: Largest size of x2 and x2_hat.
        bound: The right side, of x2_hat and |x2 - x2_hat|.
    """
    positive = np.geomspace(1e-4, size, 161)
    x2, x2_hat = np.meshgrid(*[np.concatenate([-positive, [0.0], positive])] * 2)
    d = np.abs(x2 - x2_hat)
    left_side = np.abs(signed_power(x2, 1.0 + p) - signed_power(x2_hat, 1.0 + p))
    distinct = d > 1e-6 * np.maximum(np.abs(x2), np.abs(x2_hat))  # nearer, the left side is rounding errors
    return (left_side[distinct] / bound(x2_hat, d)[distinct]).max()


def increments() -> Claim:
    """Judge (2), (3)."""
    quotients = {
        p: worst_quotient(p, 1e4, lambda x2_hat, d, p=p: (1.0 + p) * np.abs(x2_hat) ** p * d + d ** (1.0 + p))
        for p in (0.1, 0.5, 0.9, 1.0, 1.5, 2.0)
    }
    return Claim(
        "Section 1, (3)",
        "For 0 < p < 1 the increments of f2 = g(x1) x2 + x2^(1+p) + u are bounded by (|g| + (1+p) "
        "|x2_hat|^p) |x2 - x2_hat| + |x2 - x2_hat|^(1+p).",
        is_general=True,
        holds=max(quotient for p, quotient in quotients.items() if p < 1.0) <= 1.0 + 1e-9,
        conditions="For all p in (0, 1), of which three were tried.",
        figures={"worst_quotient_by_p": quotients},
    )


def quotient_of_6(exponent: float, p: float, size: float) -> float:
    """Return the worst quotient of the sides of (6) for (1), c_inf = 1, Gamma, v_2 of section 2.1, up to a size."""
    return worst_quotient(p, size, lambda x2_hat, d: bioreactor.Omega(0.0, x2_hat, p) * d + d**exponent)


def exponent_of_6() -> Claim:
    """Judge the exponent in (6), (1 - d_inf (n - i))/(1 - d_inf (n - j)) as printed: for n = i = j = 2 it is 1."""
    n = i = j = 2
    quotients, printed = {}, {}
    for p in (0.1, 0.5, 0.9):
        d_inf = p
        exponent = (1.0 - d_inf * (n - i - 1)) / (1.0 - d_inf * (n - j))  # of section 2.1 and (28)
        printed_exponent = (1.0 - d_inf * (n - i)) / (1.0 - d_inf * (n - j))
        quotients[p] = quotient_of_6(exponent, p, 1e8)
        printed[p] = [quotient_of_6(printed_exponent, p, size) for size in (1e4, 1e8)]
    corrected = (
        "With the exponent that section 2.1 and (28) have, (1 - d_inf (n - i - 1))/(1 - d_inf (n - j)). In the copy at "
        "hand (6) has n - i for n - i - 1. "
    )
    is_misprint = any(b > 2.0 * a for a, b in printed.values())
    return Claim(
        "Section 2, the exponent of (6)",
        "For system (1), (3) has the form (6) with d_inf = p, Gamma = |g| + 1 + p and v_2 = p.",
        is_general=True,
        holds=max(quotients.values()) <= 1.0 + 1e-9,
        conditions=(corrected if is_misprint else "") + "For all p in (0, 1), of which three were tried.",
        figures={"worst_quotient_by_p": quotients, "worst_quotient_as_printed_by_p": printed},
    )


# --- (13), (21) and (22) ---


def scaling_conditions() -> Claim:
    """Judge (21), (22), which a small enough b must satisfy; section 3.1's b is beside them."""
    bound = largest_b(2, P, (P,))
    # (21) is (i + 1 - j)(1 - d (n - 1) - b d) > 0, once multiplied out. Both sides have at most the degree 2 in each of
    # n, i, j, b and d = d_inf: equal at four values of each, they are the same.
    is_a_bound_on_b = all(
        (i + b) * (1 - d * (n - j)) - (j - 1 + b) * (1 - d * (n - i - 1)) == (i + 1 - j) * (1 - d * (n - 1) - b * d)
        for n, i, j, b, d in itertools.product(range(4), repeat=5)
    )
    return Claim(
        "Section 4.3, (21), (22)",
        "Every small enough b satisfies (21) and (22), whichever d_inf and v_j Theorem 1 allows.",
        holds=is_a_bound_on_b and math.isclose(bound, 1.0 / P - 1.0, rel_tol=1e-9),
        figures={"b": B, "largest_b": bound, "violated_count": len(list_violations(2, P, B, (P,)))},
    )


def tracking_error(rate: float) -> tuple[float, float]:
    """Track Omega = 2 + sin(rate t): return the largest |L - phi2 - phi3/phi1 Omega| and the least L - phi2."""
    dt, phi1, phi2, phi3 = 0.01, 0.5, 1.0, 1.0
    t = np.arange(0.0, 20.0 + 4.0 * math.pi / rate, dt)
    Omega = 2.0 + np.sin(rate * t)
    gains = itertools.accumulate(
        Omega[:-1].tolist(), lambda L, held: updated_gain(L, held, dt, phi1, phi2, phi3), initial=phi2
    )
    L = np.array([*gains])
    return np.abs(L - phi2 - phi3 / phi1 * Omega)[t > 20.0].max(), (L - phi2).min()


def gain_tracking() -> Claim:
    """Judge (13) and the remark that L does not fall below phi2."""
    rates = (0.4, 0.2, 0.1, 0.05)
    errors, least = zip(*map(tracking_error, rates), strict=True)
    is_proportional = all(1.6 < a / b < 2.4 for a, b in itertools.pairwise(errors))
    return Claim(
        "Section 2.2, (13)",
        "L tracks phi2 + (phi3/phi1) Omega up to an error proportional to |Omega'|, and from L(0) >= phi2 "
        "stays at or above phi2.",
        is_general=True,
        assumes={"signal": "Omega = 2 + sin(w t)", "gains": "phi1 = 0.5, phi2 = 1, phi3 = 1"},
        holds=is_proportional and min(least) >= 0.0,
        conditions="For any Omega along a solution, of which one was tried.",
        figures={"omega_rate_rad_per_time": rates, "largest_error_of_L": errors},
    )


# --- Section 4.2: the correction K along a chain of integrators ---


def theorem_2() -> Claim:
    """Judge Theorem 2, and Definition 1."""
    ends, limits = {}, {}
    for n, share in itertools.product((1, 2, 3), (0.0, 0.5, 0.9)):
        d_inf = share / max(n - 1, 1)
        K = BiLimitCorrection(tuple(2.0 ** (n - i) for i in range(1, n + 1)), d_inf)
        ends[f"n={n}, d_inf={d_inf:g}"] = chain_errors(K, (1e-3, 1.0, 1e3))
        if d_inf:
            limits[f"n={n}, d_inf={d_inf:g}"] = [limits_error(K, scale) for scale in (1e4, 1e8, 1e12)]
    return Claim(
        "Section 4.2, Theorem 2 (and Definition 1)",
        "There is a K, homogeneous in the bi-limit, with which the error of a chain of integrators "
        "converges, for any n and any d_inf in [0, 1/(n-1)).",
        is_general=True,
        holds=max(ends.values()) < 1e-3 and all(a > b > c for a, b, c in limits.values()),
        conditions="Convergence is shown by simulation from random errors, the construction of W for two dimensions "
        "only, by the claim on (19) and (20).",
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
        errors.append(largest_size(scale * dilated[0][i] + linear) / largest_size(linear))
        errors.append(largest_size(dilated[1][i] / scale ** r[i + 1] + power) / largest_size(power))
    return max(errors)


def chain_errors(correction: BiLimitCorrection, sizes: Sequence[float]) -> float:
    """Let dE/dtau = S E + K(e1) run to tau = 40 from E of the given lengths, three random directions each.

    Args:
        correction: K.
        sizes: Lengths of E at the start.

    Returns:
        The worst length at the end, over the length at the start; infinite if a solution could not be followed.
    """
    rng, largest_ratio = np.random.default_rng(0), 0.0

    def slope(_: float, E: Array) -> list[float]:
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
        end = np.linalg.norm(solution.y[:, -1])
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


def states(scales: Array = SCALES, angles: int = 120) -> Array:
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


def decay(W: Lyapunov, b: float, spread: float = 0.0, grid: Array | None = None) -> tuple[float, float]:
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
    e1, e2, (by_e1, by_e2), value = s[0] / W.K.l[0], W.q1(s[1]), W.gradient(*s), W.W(*s)
    k1, k2 = W.K(e1)
    slopes = by_e1 * (e2 + k1), by_e2 * k2
    largest = sum(np.maximum((1.0 - spread) * part, (1.0 + spread) * part) for part in slopes)
    bound = value + value ** ((W.d_W + W.K.d_inf) / W.d_W)
    growth = by_e1 * b * e1 + by_e2 * (1.0 + b) * e2
    return (-largest / bound).min(), (growth / value).min()


def search(d_inf: float) -> tuple[Lyapunov, float, float, float] | None:
    """Look for K and W with d_W = 2 + d_inf.

    Returns:
        The first W, with its K, with which both hold; b, half of what (21) and (22) allow with v_2 = d_inf; c1 and c2.
    """
    b = min(1.0, 0.5 * largest_b(2, d_inf, (d_inf,)))
    for l1, sigma in itertools.product(L1, SIGMAS):
        W = Lyapunov(BiLimitCorrection((l1, 1.0), d_inf), sigma, 2.0 + d_inf)
        if min(decay(W, b, SPREAD)) > MARGIN:
            return W, b, *decay(W, b, SPREAD, states(FINE))
    return None


def equations_19_20() -> Claim:
    """Judge (19) and (20)."""
    pairs = {d_inf: pair for d_inf in DEGREES if (pair := search(d_inf)) is not None}
    return Claim(
        "Section 4.2, (19) and (20)",
        "There are K and a proper W, homogeneous in the bi-limit, that satisfy (19) and (20) for all A(t) "
        "within (17) and the B of section 4.3.",
        is_general=True,
        holds=len(pairs) == len(DEGREES) and all(min(c1, c2) > 0.0 for _, _, c1, c2 in pairs.values()),
        conditions="For two dimensions, by numbers; a d_inf near its limit asks for a larger l1.",
        otherwise="For some d_inf none was found, which does not say that there is none.",
        figures={
            "c1_by_d_inf": {d_inf: c1 for d_inf, (_, _, c1, _) in pairs.items()},
            "c2_by_d_inf": {d_inf: c2 for d_inf, (*_, c2) in pairs.items()},
            "l1_by_d_inf": {d_inf: W.K.l[0] for d_inf, (W, *_) in pairs.items()},
        },
    )

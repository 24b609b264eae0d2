"""Sections 1, 2 and 4: inequalities, theorems and remarks, checked by numbers."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np

from cmg_mj.core.arrays import signed_power
from cmg_mj.observers.high_gain import updated_gain
from cmg_mj.papers.andrieu2009 import bioreactor, lyapunov
from cmg_mj.papers.andrieu2009.bioreactor import B, P
from cmg_mj.papers.andrieu2009.observer import largest_b, list_violations
from cmg_mj.papers.andrieu2009.theorem_1 import equations_11_12_claims, no_observer_beyond_1, theorem_1
from cmg_mj.papers.claim import Claim, OnShare, obtain


def theory_claims(on_share: OnShare) -> list[Claim]:
    """Judge sections 1, 2 and 4."""
    parts = [linear_increments, increments, exponent_of_6, no_observer_beyond_1, scaling_conditions, gain_tracking]
    parts += [lyapunov.theorem_2, lyapunov.claim, theorem_1]
    return [*obtain(parts, on_share), *equations_11_12_claims()]


# --- Sections 1 and 2: the increments of f2 of system (1), their bounds (2), (3), and the exponent in (6) ---


def increments_of_2(p: float, seed: int = 0) -> float:
    """Return the worst quotient of |f2(x2) - f2(x2_hat)| and |g + 1| |x2 - x2_hat| at random g, x2, x2_hat, u."""
    rng, count = np.random.default_rng(seed), 4000
    g, u = rng.normal(size=(2, count))
    x2, x2_hat = rng.normal(size=(2, count)) * 10.0 ** rng.uniform(-2.0, 2.0, (2, count))
    left_side = np.abs(bioreactor.f2(g, x2, u, p) - bioreactor.f2(g, x2_hat, u, p))
    right_side = np.abs(g + 1.0) * np.abs(x2 - x2_hat)
    reliable = right_side > 1e-3 * (np.abs(x2) + np.abs(x2_hat) + np.abs(u))  # nearer, the left side is rounding errors
    return float((left_side[reliable] / right_side[reliable]).max())


def linear_increments() -> Claim:
    """Judge (2)."""
    quotient = increments_of_2(0.0)
    return Claim(
        place="Section 1, (2)",
        statement="For p = 0 the increments of f2 are bounded by |g(x1) + 1| |x2 - x2_hat|.",
        holds=quotient <= 1.0 + 1e-9,
        figures={"worst_quotient": quotient, "worst_quotient_p_0_1": increments_of_2(0.1)},
    )


def worst_quotient(p: float, size: float, bound: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> float:
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
    return float((left_side[distinct] / bound(x2_hat, d)[distinct]).max())


def quotient_of_3(p: float) -> float:
    """Return the worst quotient of the two sides of (3), over sizes from 1e-4 to 1e4."""
    return worst_quotient(p, 1e4, lambda x2_hat, d: (1.0 + p) * np.abs(x2_hat) ** p * d + d ** (1.0 + p))


def increments() -> Claim:
    """Judge (2), (3)."""
    quotients = {str(p): quotient_of_3(p) for p in (0.1, 0.5, 0.9, 1.0, 1.5, 2.0)}
    return Claim(
        place="Section 1, (3)",
        statement="For 0 < p < 1 the increments of f2 = g(x1) x2 + x2^(1+p) + u are bounded by (|g| + (1+p) "
        "|x2_hat|^p) |x2 - x2_hat| + |x2 - x2_hat|^(1+p).",
        is_general=True,
        holds=max(quotients[p] for p in ("0.1", "0.5", "0.9")) <= 1.0 + 1e-9,
        conditions="For all p in (0, 1), of which three were tried.",
        figures={"worst_quotient_by_p": quotients},
    )


def quotient_of_6(exponent: float, p: float, size: float) -> float:
    """Return the worst quotient of the sides of (6) for (1), c_inf = 1, Gamma, v_2 of section 2.1, up to a size."""
    return worst_quotient(p, size, lambda x2_hat, d: bioreactor.Omega(0.0, x2_hat, p) * d + d**exponent)


def exponent_of_6() -> Claim:
    """Judge the exponent in (6), (1 - d_inf (n - i))/(1 - d_inf (n - j)) as printed: for n = i = j = 2 it is 1."""
    powers = (0.1, 0.5, 0.9)
    quotients = {str(p): quotient_of_6(1.0 + p, p, 1e8) for p in powers}
    printed = {str(p): [quotient_of_6(1.0, p, size) for size in (1e4, 1e8)] for p in powers}
    corrected = (
        "With the exponent that section 2.1 and (28) have, (1 - d_inf (n - i - 1))/(1 - d_inf (n - j)). In the copy at "
        "hand (6) has n - i for n - i - 1. "
    )
    is_misprint = any(b > 2.0 * a for a, b in printed.values())
    return Claim(
        place="Section 2, the exponent of (6)",
        statement="For system (1), (3) has the form (6) with d_inf = p, Gamma = |g| + 1 + p and v_2 = p.",
        is_general=True,
        holds=max(quotients.values()) <= 1.0 + 1e-9,
        conditions=(corrected if is_misprint else "") + "For all p in (0, 1), of which three were tried.",
        figures={"worst_quotient_by_p": quotients, "worst_quotient_as_printed_by_p": printed},
    )


# --- (13), (21) and (22) ---


def is_a_bound_on_b() -> bool:
    """Check exactly that (21) is (i + 1 - j)(1 - d (n - 1) - b d) > 0, once multiplied out.

    Both sides have at most the degree 2 in each of n, i, j, b and d = d_inf: equal at four values of each, they are
    the same.
    """
    return all(
        (i + b) * (1 - d * (n - j)) - (j - 1 + b) * (1 - d * (n - i - 1)) == (i + 1 - j) * (1 - d * (n - 1) - b * d)
        for n, i, j, b, d in itertools.product(range(4), repeat=5)
    )


def scaling_conditions() -> Claim:
    """Judge (21), (22), which a small enough b must satisfy; section 3.1's b is beside them."""
    bound = largest_b(2, P, (P,))
    return Claim(
        place="Section 4.3, (21), (22)",
        statement="Every small enough b satisfies (21) and (22), whichever d_inf and v_j Theorem 1 allows.",
        holds=is_a_bound_on_b() and math.isclose(bound, 1.0 / P - 1.0, rel_tol=1e-9),
        figures={"b": B, "largest_b": bound, "violated_count": len(list_violations(2, P, B, (P,)))},
    )


def tracking_error(rate: float) -> tuple[float, float]:
    """Track Omega = 2 + sin(rate t): return the largest |L - phi2 - phi3/phi1 Omega| and the least L - phi2."""
    dt, phi1, phi2, phi3 = 0.01, 0.5, 1.0, 1.0
    t = np.arange(0.0, 20.0 + 4.0 * math.pi / rate, dt)
    Omega = 2.0 + np.sin(rate * t)
    gains = [phi2]
    for value in Omega[:-1].tolist():
        gains.append(updated_gain(gains[-1], value, dt, phi1, phi2, phi3))
    L = np.array(gains)
    return float(np.abs(L - phi2 - phi3 / phi1 * Omega)[t > 20.0].max()), float((L - phi2).min())


def gain_tracking() -> Claim:
    """Judge (13) and the remark that L does not fall below phi2."""
    rates = (0.4, 0.2, 0.1, 0.05)
    errors, least = zip(*map(tracking_error, rates), strict=True)
    is_proportional = all(1.6 < a / b < 2.4 for a, b in itertools.pairwise(errors))
    return Claim(
        place="Section 2.2, (13)",
        statement="L tracks phi2 + (phi3/phi1) Omega up to an error proportional to |Omega'|, and from L(0) >= phi2 "
        "stays at or above phi2.",
        is_general=True,
        assumes={"signal": "Omega = 2 + sin(w t)", "gains": "phi1 = 0.5, phi2 = 1, phi3 = 1"},
        holds=is_proportional and min(least) >= 0.0,
        conditions="For any Omega along a solution, of which one was tried.",
        figures={"omega_rate_rad_per_time": list(rates), "largest_error_of_L": list(errors)},
    )

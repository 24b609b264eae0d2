"""Sections 1 and 2: the increments of f2 of system (1), their bounds (2), (3), and the exponent in (6)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cmg_mj.core.arrays import signed_power
from cmg_mj.papers.andrieu2009 import paper
from cmg_mj.papers.claim import Claim

CORRECTED = "With the exponent that section 2.1 and (28) have, (1 - d_inf (n - i - 1))/(1 - d_inf (n - j))."


def increments_of_2(p: float, count: int = 4000, seed: int = 0) -> float:
    """Return the worst quotient of |f2(x2) - f2(x2_hat)| and |g + 1| |x2 - x2_hat| at random g, x2, x2_hat, u."""
    rng = np.random.default_rng(seed)
    g, u = rng.normal(size=(2, count))
    x2, x2_hat = rng.normal(size=(2, count)) * 10.0 ** rng.uniform(-2.0, 2.0, (2, count))
    left_side = np.abs(paper.f2(g, x2, u, p) - paper.f2(g, x2_hat, u, p))
    right_side = np.abs(g + 1.0) * np.abs(x2 - x2_hat)
    reliable = right_side > 1e-3 * (np.abs(x2) + np.abs(x2_hat) + np.abs(u))  # nearer, the left side is rounding errors
    return float((left_side[reliable] / right_side[reliable]).max())


def linear_increments() -> Claim:
    """Judge (2)."""
    quotient, quotient_above_0 = increments_of_2(0.0), increments_of_2(0.1)
    return Claim(
        place="Section 1, (2)",
        statement="For p = 0 the increments of f2 are bounded by |g(x1) + 1| |x2 - x2_hat|.",
        holds=quotient <= 1.0 + 1e-9,
        figures={"worst_quotient": quotient, "worst_quotient_p_0_1": quotient_above_0},
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


def largest_increment(p: float) -> float:
    """Return the worst quotient of the two sides of (3), over sizes from 1e-4 to 1e4."""
    return worst_quotient(p, 1e4, lambda x2_hat, d: (1.0 + p) * np.abs(x2_hat) ** p * d + d ** (1.0 + p))


def increments() -> Claim:
    """Judge (2), (3)."""
    quotients = {p: largest_increment(p) for p in (0.1, 0.5, 0.9, 1.0, 1.5, 2.0)}
    largest_inside = max(quotient for p, quotient in quotients.items() if p < 1.0)
    return Claim(
        place="Section 1, (3)",
        statement="For 0 < p < 1 the increments of f2 = g(x1) x2 + x2^(1+p) + u are bounded by (|g| + (1+p) "
        "|x2_hat|^p) |x2 - x2_hat| + |x2 - x2_hat|^(1+p).",
        is_general=True,
        holds=largest_inside <= 1.0 + 1e-9,
        conditions="For all p in (0, 1), of which three were tried.",
        figures={"worst_quotient_by_p": {str(p): quotient for p, quotient in quotients.items()}},
    )


def printed_exponent(n: int, i: int, j: int, d_inf: float) -> float:
    """Return the exponent of |x_j_hat - x_j| in (6), as printed there."""
    return (1.0 - d_inf * (n - i)) / (1.0 - d_inf * (n - j))


def exponent_of_section_2_1(n: int, i: int, j: int, d_inf: float) -> float:
    """Return the exponent where section 2.1 discusses it, and in the proof, (28)."""
    return (1.0 - d_inf * (n - i - 1)) / (1.0 - d_inf * (n - j))


def quotient_of_6(exponent: float, p: float, size: float) -> float:
    """Return the worst quotient of the sides of (6) for (1), c_inf = 1, Gamma, v_2 of section 2.1, up to a size."""
    return worst_quotient(p, size, lambda x2_hat, d: paper.Omega(0.0, x2_hat, p) * d + d**exponent)


def exponent_of_6() -> Claim:
    """Judge the exponent in (6), for system (1)."""
    powers, sizes = (0.1, 0.5, 0.9), (1e4, 1e8)
    quotients = {p: quotient_of_6(exponent_of_section_2_1(2, 2, 2, p), p, sizes[-1]) for p in powers}
    printed_quotients = {p: [quotient_of_6(printed_exponent(2, 2, 2, p), p, size) for size in sizes] for p in powers}
    misprint = any(b > 2.0 * a for a, b in printed_quotients.values())
    return Claim(
        place="Section 2, the exponent of (6)",
        statement="For system (1), (3) has the form (6) with d_inf = p, Gamma = |g| + 1 + p and v_2 = p.",
        is_general=True,
        holds=max(quotients.values()) <= 1.0 + 1e-9,
        conditions=(f"{CORRECTED} In the copy at hand (6) has n - i for n - i - 1. " if misprint else "")
        + "For all p in (0, 1), of which three were tried.",
        otherwise="Neither exponent bounds the increments.",
        figures={
            "worst_quotient_by_p": {str(p): value for p, value in quotients.items()},
            "worst_quotient_as_printed_by_p": {str(p): values for p, values in printed_quotients.items()},
        },
    )

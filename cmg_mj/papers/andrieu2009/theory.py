"""Sections 1, 2 and 4: inequalities, theorems and remarks, checked by numbers; here (13), (21) and (22)."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import numpy as np

from cmg_mj.observers.high_gain import updated_gain
from cmg_mj.papers.andrieu2009 import equations_11_12, equations_19_20
from cmg_mj.papers.andrieu2009.bi_limit import largest_b, list_violations
from cmg_mj.papers.andrieu2009.chain_of_integrators import theorem_2
from cmg_mj.papers.andrieu2009.finite_escape import no_observer_beyond_1
from cmg_mj.papers.andrieu2009.increments import exponent_of_6, increments, linear_increments
from cmg_mj.papers.andrieu2009.paper import B, P
from cmg_mj.papers.andrieu2009.theorem_1 import theorem_1
from cmg_mj.papers.claim import Claim, OnShare, obtain


def claims(on_share: OnShare) -> list[Claim]:
    """Judge sections 1, 2 and 4."""
    parts = [linear_increments, increments, exponent_of_6, no_observer_beyond_1, scaling_conditions, gain_tracking]
    parts += [theorem_2, equations_19_20.claim, theorem_1]
    return [*obtain(parts, on_share), *equations_11_12.claims()]


def is_a_bound_on_b(values: int = 4) -> bool:
    """Check exactly that (21) is (i + 1 - j)(1 - d (n - 1) - b d) > 0, once multiplied out.

    Both sides have at most the degree 2 in each of n, i, j, b and d = d_inf: equal at four values of each, they are
    the same.
    """
    numbers = [Fraction(k) for k in range(values)]
    sides = (
        ((i + b) * (1 - d * (n - j)) - (j - 1 + b) * (1 - d * (n - i - 1)), (i + 1 - j) * (1 - d * (n - 1) - b * d))
        for n, i, j, b, d in itertools.product(numbers, repeat=5)
    )
    return all(product == factors for product, factors in sides)


def scaling_conditions() -> Claim:
    """Judge (21), (22), which a small enough b must satisfy; section 3.1's b is beside them."""
    lines = list_violations(2, P, B, (P,))
    bound = largest_b(2, P, (P,))
    agrees = math.isclose(bound, 1.0 / P - 1.0, rel_tol=1e-9)
    return Claim(
        place="Section 4.3, (21), (22)",
        statement="Every small enough b satisfies (21) and (22), whichever d_inf and v_j Theorem 1 allows.",
        holds=is_a_bound_on_b() and agrees,
        otherwise="(21) is no bound on b, or not this one.",
        figures={"b": B, "largest_b": bound, "violated_count": len(lines)},
    )


def tracking_error(rate: float, phi1: float = 0.5, phi2: float = 1.0, phi3: float = 1.0) -> tuple[float, float]:
    """Track Omega = 2 + sin(rate t): return the largest |L - phi2 - phi3/phi1 Omega| and the least L - phi2."""
    dt = 0.01
    t = np.arange(0.0, 20.0 + 4.0 * math.pi / rate, dt)
    Omega = 2.0 + np.sin(rate * t)
    L, gains = phi2, []
    for value in Omega.tolist():
        gains.append(L)
        L = updated_gain(L, value, dt, phi1, phi2, phi3)
    L = np.array(gains)
    late = t > 20.0
    return float(np.abs(L - phi2 - phi3 / phi1 * Omega)[late].max()), float((L - phi2).min())


def gain_tracking() -> Claim:
    """Judge (13) and the remark that L does not fall below phi2."""
    rates = (0.4, 0.2, 0.1, 0.05)
    errors, least = zip(*(tracking_error(rate) for rate in rates), strict=True)
    quotients = [a / b for a, b in itertools.pairwise(errors)]
    proportional = all(1.6 < quotient < 2.4 for quotient in quotients)
    stays_above = min(least) >= 0.0
    return Claim(
        place="Section 2.2, (13)",
        statement="L tracks phi2 + (phi3/phi1) Omega up to an error proportional to |Omega'|, and from L(0) >= phi2 "
        "stays at or above phi2.",
        is_general=True,
        assumes={"signal": "Omega = 2 + sin(w t)", "gains": "phi1 = 0.5, phi2 = 1, phi3 = 1"},
        holds=proportional and stays_above,
        conditions="For any Omega along a solution, of which one was tried.",
        figures={"omega_rate_rad_per_time": list(rates), "largest_error_of_L": list(errors)},
    )

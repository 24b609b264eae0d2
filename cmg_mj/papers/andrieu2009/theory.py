"""Sections 1, 2 and 4: inequalities, theorems and remarks, checked by numbers; here (13), (21) and (22)."""

from __future__ import annotations

import itertools
import math

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
from cmg_mj.results import markdown


def claims(on_share: OnShare) -> list[Claim]:
    """Judge sections 1, 2 and 4."""
    parts = [linear_increments, increments, exponent_of_6, no_observer_beyond_1, scaling_conditions, gain_tracking]
    parts += [theorem_2, equations_19_20.claim, theorem_1]
    return [*obtain(parts, on_share), *equations_11_12.claims()]


def scaling_conditions() -> Claim:
    """Judge (21), (22) and the parameters of section 3.1."""
    lines = list_violations(2, P, B, (P,))
    bound = largest_b(2, P, (P,))
    return Claim(
        place="Section 4.3, (21), (22)",
        statement=f"b satisfies (21), (22), and section 3.1 uses b = {B} with p = {P}.",
        result=f"For n = 2 both ask for b < (1 - p)/p = {bound:.4f}. With the printed values {len(lines)} "
        "inequalities do not hold.",
        table=markdown.table(("inequality", "is not so"), [line.split(": ", 1) for line in lines], text_columns=2),
        holds=not lines,
        otherwise="The parameters of the simulation are outside the theorem's proof. It does no harm there: the "
        "argument of the correction is so small that b and p have no effect (see the claim on the correction). With "
        "the limited x2_hat Omega_2 is bounded, so that (22) could be dropped, but not (21).",
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
        result=f"For Omega = 2 + sin(w t) the largest error falls from {errors[0]:.3f} at w = {rates[0]} by factors "
        f"{', '.join(f'{quotient:.2f}' for quotient in quotients)} as w is halved; the least L - phi2 is "
        f"{min(least):.2g}.",
        holds=proportional and stays_above,
        figures={"omega_rate_rad_per_time": list(rates), "largest_error_of_L": list(errors)},
    )

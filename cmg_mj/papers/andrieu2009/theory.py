"""Section 2, (11) and (12): what disturbances and errors at the start do to the scaled error and to the gain."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from cmg_mj.core.arrays import signed_power
from cmg_mj.observers.high_gain import updated_gain
from cmg_mj.papers.andrieu2009 import bioreactor, lyapunov
from cmg_mj.papers.andrieu2009.bioreactor import B, P
from cmg_mj.papers.andrieu2009.lyapunov import theorem_2
from cmg_mj.papers.andrieu2009.observer import largest_b, list_violations
from cmg_mj.papers.andrieu2009.theorem_1 import HOMOGENEOUS, no_observer_beyond_1, system_1, theorem_1
from cmg_mj.papers.claim import Claim, OnShare, obtain

# --- Section 2, (11) and (12) ---

P_12, DT, END, LATE = 0.5, 2e-3, 10.0, 6.0
SIZES = (1e-1, 1e-2, 1e-3)
"""Amplitudes of the disturbances."""
KINDS = ("delta_1", "delta_2", "delta_y")
ERRORS = (1.0, 10.0, 100.0, 1000.0)
"""Errors of x2 at the start."""
GAINS = (1.0, 10.0, 50.0)
"""L(0) over phi2."""
SOLUTIONS = (1.0, 2.0, 4.0)
"""Amplitudes of x1."""
TURNS = 20.0
"""Angular frequency of the disturbances."""


class Column(NamedTuple):
    """One run: what it starts from, and what disturbs it."""

    error: float = 0.0
    gain: float = 1.0
    amplitude: float = 1.0
    delta_1: float = 0.0
    delta_2: float = 0.0
    delta_y: float = 0.0


class Response(NamedTuple):
    """The observer's answer to the runs, each (n_times, n_runs)."""

    scaled_error: np.ndarray
    """|L^-1 e| with the matrix of (10)."""
    gain: np.ndarray
    t: np.ndarray
    """(n_times,)."""


def follow(columns: list[Column]) -> Response:
    """Let (7), (8) follow x1 = a sin t along (1) with disturbances in the sense of (4), for the u that makes it so."""
    error, gain, a, d1, d2, dy = np.array(columns).T
    t = np.arange(0.0, END + 0.5 * DT, DT)
    s, c = np.sin(t)[:, None], np.cos(t)[:, None]
    wave, wave_slope = np.sin(TURNS * t)[:, None], TURNS * np.cos(TURNS * t)[:, None]
    x1, x2 = a * s, a * c - d1 * wave
    y = x1 + dy * wave
    u = -a * s - d1 * wave_slope - d2 * wave - (y - 1.0) * x2 - signed_power(x2, 1.0 + P_12)
    observer = system_1(HOMOGENEOUS, DT, P_12)
    state = observer.init((y[0], u[0]), (x1[0], x2[0] + error))
    state = state._replace(L=gain * observer.phi2)
    scaled_errors, gains = [], []
    for k in range(len(t)):
        if k:
            state, _ = observer.step(state, (y[k], u[k]), None)
        L, e1, e2 = state.L, state.x[0] - x1[k], state.x[1] - x2[k]
        scaled_errors.append(np.hypot(e1 / L**observer.b, e2 / L ** (1.0 + observer.b)))
        gains.append(L)
    return Response(np.array(scaled_errors), np.array(gains), t)


def equations_11_12_claims() -> list[Claim]:
    """Judge (11), then (12)."""
    disturbance_columns = [Column(**{kind: size}) for kind in KINDS for size in SIZES]
    columns = [*disturbance_columns, *(Column(error=e) for e in ERRORS), *(Column(gain=g) for g in GAINS)]
    columns += [Column(amplitude=a) for a in SOLUTIONS]
    response = follow(columns)
    parts = np.cumsum([len(disturbance_columns), len(ERRORS), len(GAINS)])
    late = response.t > LATE
    scaled_errors, gains = np.split(response.scaled_error, parts, axis=1), np.split(response.gain, parts, axis=1)
    balls = scaled_errors[0][late].max(axis=0).reshape(len(KINDS), len(SIZES))
    return [
        scaled_error(balls, scaled_errors[1]),
        gain_bound(gains[1], gains[2][late].max(axis=0), gains[3][late].max(axis=0), late),
    ]


def scaled_error(balls: np.ndarray, from_errors: np.ndarray) -> Claim:
    """Judge (11).

    Args:
        balls: Largest late scaled error under each of `KINDS` with each of `SIZES`, (3, 3).
        from_errors: Scaled error from each of `ERRORS` without disturbance, (n_times, 4).
    """
    balls_shrink = all(a > 3.0 * b for row in balls for a, b in itertools.pairwise(row))
    ends = from_errors[-1]
    return Claim(
        place="Section 2, (11)",
        statement="The scaled error is bounded by a function of its start that fades, plus one of the disturbances "
        "that is zero at zero.",
        is_general=True,
        holds=balls_shrink and bool(ends.max() < 1e-5),
        conditions="By simulation of system (1), p = 0.5, x1 = sin t, one observer: see Theorem 1.",
        otherwise="It does not fade, or does not shrink with the disturbance.",
        figures={
            "late_scaled_error": {kind: row.tolist() for kind, row in zip(KINDS, balls, strict=True)},
            "final_scaled_error": ends.tolist(),
        },
    )


def gain_bound(from_errors: np.ndarray, from_gains: np.ndarray, of_solutions: np.ndarray, late: np.ndarray) -> Claim:
    """Judge (12).

    Args:
        from_errors: L from each of `ERRORS`, (n_times, 4).
        from_gains: Its largest late value from each of `GAINS`, (3,).
        of_solutions: The same along each of `SOLUTIONS`, (3,).
        late: True for late times, (n_times,).
    """
    peaks, ends = from_errors.max(axis=0), from_errors[late].max(axis=0)
    relative_spread = max(np.ptp(ends) / ends[0], np.ptp(from_gains) / from_gains[0])
    return Claim(
        place="Section 2, (12)",
        statement="L is bounded by 4 phi2, a function of the start that fades, and one of the disturbances, Gamma and "
        "x.",
        is_general=True,
        holds=bool(relative_spread < 1e-3 and np.isfinite(peaks).all() and np.isfinite(of_solutions).all()),
        conditions="By simulation of system (1), p = 0.5, x1 = sin t, one observer: see Theorem 1.",
        otherwise="L does not forget its start.",
        figures={
            "largest_gain_by_error": peaks.tolist(),
            "largest_late_gain_by_error": ends.tolist(),
            "largest_late_gain_by_start": from_gains.tolist(),
            "largest_late_gain_by_amplitude": of_solutions.tolist(),
        },
    )


# --- Sections 1 and 2: the increments of f2 of system (1), their bounds (2), (3), and the exponent in (6) ---

CORRECTED = "With the exponent that section 2.1 and (28) have, (1 - d_inf (n - i - 1))/(1 - d_inf (n - j))."


def increments_of_2(p: float, count: int = 4000, seed: int = 0) -> float:
    """Return the worst quotient of |f2(x2) - f2(x2_hat)| and |g + 1| |x2 - x2_hat| at random g, x2, x2_hat, u."""
    rng = np.random.default_rng(seed)
    g, u = rng.normal(size=(2, count))
    x2, x2_hat = rng.normal(size=(2, count)) * 10.0 ** rng.uniform(-2.0, 2.0, (2, count))
    left_side = np.abs(bioreactor.f2(g, x2, u, p) - bioreactor.f2(g, x2_hat, u, p))
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
    return worst_quotient(p, size, lambda x2_hat, d: bioreactor.Omega(0.0, x2_hat, p) * d + d**exponent)


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


# --- Sections 1, 2 and 4: inequalities, theorems and remarks, checked by numbers; here (13), (21) and (22) ---


def theory_claims(on_share: OnShare) -> list[Claim]:
    """Judge sections 1, 2 and 4."""
    parts = [linear_increments, increments, exponent_of_6, no_observer_beyond_1, scaling_conditions, gain_tracking]
    parts += [theorem_2, lyapunov.claim, theorem_1]
    return [*obtain(parts, on_share), *equations_11_12_claims()]


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

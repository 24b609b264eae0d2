"""Section 2, system (1): Theorem 1, solutions beyond p = 1 that end before an observer finds them; (11) and (12)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from cmg_mj.core.arrays import Scalar, signed_power
from cmg_mj.papers.andrieu2009 import bioreactor
from cmg_mj.papers.andrieu2009.observer import BiLimitCorrection, UpdatedHighGain
from cmg_mj.papers.claim import Array, Claim
from cmg_mj.view.plots.figure import Line, Panel, Picture

PLAIN, UPDATED, HOMOGENEOUS = "constant gain, linear", "updated gain, linear", "updated gain, homogeneous"
P, B, PHI2 = 0.5, 0.5, 2.0
"""b is half of what (21) and (22) allow for p = d_inf = 0.5."""
DT = 2e-3
TIMES = np.arange(0.0, 10.0 + 0.5 * DT, DT)


def system_1(kind: str, p: float = P, g_is_0: bool = False) -> UpdatedHighGain:
    """Make an observer for (1) with g(y) = y - 1, or 0, u being measured along with y.

    Its d_inf is 0.5 whatever p is, as Theorem 1 wants it; 0 if its correction is linear.
    """

    def g(x1: Scalar) -> Scalar:
        return 0.0 if g_is_0 else x1 - 1.0

    def Omega(u: Any, y: tuple, x: tuple) -> Scalar:
        return bioreactor.Omega(g(y[0]), x[0], p)

    f = (lambda u, y, x: 0.0 * y[0], lambda u, y, x: bioreactor.f2(g(y[0]), x[0], y[1], p))
    K = BiLimitCorrection((2.0, 1.0), 0.5 if kind == HOMOGENEOUS else 0.0)
    if kind == PLAIN:  # about the gain that the others reach along x1 = sin t
        return UpdatedHighGain(DT, f, K, lambda u, y, x: 0.0 * y[0], 1.0, 1.0, 12.0, 1.0)
    return UpdatedHighGain(DT, f, K, Omega, B, 0.5, PHI2, 1.0)


# --- Section 2.1, system (1) beyond p = 1: solutions that end before an observer has found them ---

INSIDE, BEYOND = 0.5, 1.5
"""One p on each side of 1."""
STARTS = (1.0, 10.0, 100.0, 1e3, 1e4)
"""x2(0)."""
FOUND, MISSED = 1e-3, 0.5
"""Relative errors of x2 at the end, below and above which a solution counts as found and as missed."""
LAST = 14.0
"""-ln of the share of the time of existence that is left at the end: about a millionth."""


def solution(p: float, x2: float, share_left: Array | float) -> tuple[Array, Array]:
    """Solve x2' = x2^(1+p), x1(0) = 0 for x1 and x2, in closed form.

    Args:
        p: Power, not 1.
        x2: x2(0) > 0.
        share_left: Share left of the time of existence x2(0)^-p/p.
    """
    end = x2**-p / p
    power = 1.0 - 1.0 / p
    x1 = p ** (-1.0 / p) * end**power * (1.0 - np.asarray(share_left) ** power) / power
    return x1, (p * end * np.asarray(share_left)) ** (-1.0 / p)


def escape(p: float, x2: float, x2_hat: float = 0.0, tolerance: float = 1e-6) -> tuple[Array, Array]:
    """Let (7), (8) for (1) with g = 0, u = 0 follow a solution to its end, over s = -ln of the share left.

    Args:
        p: Power.
        x2: x2(0).
        x2_hat: Its estimate at the start; x1 is known.
        tolerance: Tolerance of the integrator.

    Returns:
        The share of the solution's time of existence that is left, and |x2_hat - x2|/x2, each (n,).
    """
    follower, end = system_1(HOMOGENEOUS, p, g_is_0=True), x2**-p / p

    def slope(s: float, z: Array) -> list[float]:
        share_left = math.exp(-s)
        y, L = (float(solution(p, x2, share_left)[0]), 0.0), math.exp(z[2])
        first, second = follower.slope((z[0], z[1]), L, y, None)
        growth = follower.phi1 * (PHI2 - L) + follower.phi3 * follower.Omega(None, y, (z[1],))
        return [end * share_left * first, end * share_left * second, end * share_left * growth]

    start = [0.0, x2_hat, math.log(PHI2)]
    result = solve_ivp(slope, (0.0, LAST), start, "Radau", rtol=tolerance, atol=1e-3 * tolerance)
    assert result.success, result.message
    share_left = np.exp(-result.t)
    return share_left, np.abs(result.y[1] / solution(p, x2, share_left)[1] - 1.0)


def no_observer_beyond_1() -> Claim:
    """Judge the remark on p > 1."""
    runs = {p: [escape(p, start) for start in STARTS] for p in (INSIDE, BEYOND)}
    ends = {p: [error[-1] for _, error in escapes] for p, escapes in runs.items()}
    misses = [error > MISSED for error in ends[BEYOND]]
    panels = [
        Panel(
            "|error of x2|/x2 [-]",
            [
                Line(1.0 / share_left, error, f"x2(0) = {start:g}")
                for start, (share_left, error) in zip(STARTS, escapes, strict=True)
            ],
            f"({letter}) p = {p}",
            "time of existence over what is left of it [-]",
            x_scale="log",
            y_scale="log",
            y_range=(1e-9, 10.0),
        )
        for letter, (p, escapes) in zip("ab", runs.items(), strict=True)
    ]
    return Claim(
        "Section 2.1",
        "Once p exceeds 1, and with u = 0, no observer whatever can be sure to find x2 before the solution "
        "of (1) ends.",
        is_general=True,
        holds=max(ends[INSIDE]) < FOUND and misses[-1],
        conditions="One observer, (7) and (8) with d_inf = 0.5, l = (2, 1), phi1 = 0.5, phi2 = 2, phi3 = 1, g = 0, "
        "without input, started at the measured x1 and x2_hat = 0. The statement is about all observers and is proved "
        "elsewhere (Astolfi and Praly 2006). This example shows the obstacle, and is no proof.",
        figures={
            "x2_at_start": STARTS,
            "relative_error_of_x2_at_the_end_by_p": ends,
            "escape_time_by_p": {p: [start**-p / p for start in STARTS] for p in runs},
            "output_moves_by_p_1_5": [start ** (1.0 - BEYOND) / (BEYOND - 1.0) for start in STARTS],
            "missed_count": sum(misses),
        },
        picture=Picture(
            "andrieu2009-escape",
            "andrieu2009, section 2.1: relative error of x2 along solutions of (1) that escape",
            panels,
        ),
    )


# --- Theorem 1 on system (1) ---

START_ERRORS = (-1e3, -1e2, -10.0, -1.0, 1.0, 10.0, 1e2, 1e3)
"""Errors of x2 at the start."""
AMPLITUDES = (1e-1, 1e-2, 1e-3)
"""Amplitudes of the disturbances."""
TURNS = 20.0
"""Angular frequency of the disturbances."""


class Column(NamedTuple):
    """One run: what it starts from, and what disturbs it."""

    error: float = 0.0
    """Error of x2 at the start."""
    gain: float = 1.0
    """L(0) over phi2."""
    amplitude: float = 1.0
    """Amplitude of x1."""
    noise: float = 0.0
    """Amplitude of a disturbance sin(20 t) of the measurement alone."""
    delta_1: float = 0.0
    delta_2: float = 0.0
    delta_y: float = 0.0
    """Amplitudes of the same in the sense of (4), where the system has y for x1."""


def follow(kind: str, columns: Sequence[Column]) -> tuple[Array, Array]:
    """Let an observer follow x1 = a sin t, which solves (1) for the right u, known to the observer.

    Args:
        kind: PLAIN, UPDATED or HOMOGENEOUS.
        columns: The runs.

    Returns:
        The errors (2, n_times, n_columns), and L, (n_times, n_columns).
    """
    error, gain, a, noise, d1, d2, dy = np.array(columns).T
    s, c = np.sin(TIMES)[:, None], np.cos(TIMES)[:, None]
    wave, wave_slope = np.sin(TURNS * TIMES)[:, None], TURNS * np.cos(TURNS * TIMES)[:, None]
    x = np.array([a * s, a * c - d1 * wave])
    y = x[0] + dy * wave
    u = -a * s - d1 * wave_slope - d2 * wave - (y - 1.0) * x[1] - signed_power(x[1], 1.0 + P)
    with np.errstate(all="ignore"):  # one of them may diverge
        estimates, L = system_1(kind).follow((y + noise * wave, u), (x[0, 0], x[1, 0] + error), gain=gain)
    return estimates - x, L


def theorem_1() -> Claim:
    """Judge the three observers from large errors, and with a disturbance."""
    n = len(START_ERRORS)
    columns = [*(Column(error=error) for error in START_ERRORS), *(Column(noise=size) for size in AMPLITUDES)]
    results = {kind: follow(kind, columns) for kind in (PLAIN, UPDATED, HOMOGENEOUS)}
    errors = {kind: np.abs(error) for kind, ((_, error), _) in results.items()}
    gains = {kind: L[:, :n] for kind, (_, L) in results.items()}
    ends = {kind: error[-1, :n] for kind, error in errors.items()}
    failures = {kind: np.sum(~(row <= 1e-3)) for kind, row in ends.items()}
    largest = {kind: np.nanmax(L) for kind, L in gains.items()}
    balls = errors[HOMOGENEOUS][TIMES > 5.0, n:].max(axis=0)
    shrinks = all(a > 5.0 * b for a, b in itertools.pairwise(balls))
    styles = zip(errors.items(), ("--", "-", "-"), strict=True)
    error_lines = [Line(TIMES, error[:, n - 1], kind, style) for (kind, error), style in styles]
    gain_lines = [Line(TIMES, L[:, -1], kind) for kind, L in gains.items()]
    time, top = "time [normalised]", 1.1 * max(largest.values())
    panels = [
        Panel("|error of x2| [-]", error_lines, "(a) from an error of 1000", time, y_scale="log", y_range=(1e-8, 1e6)),
        Panel("gain L [-]", gain_lines, "(b) its gain", time, y_range=(0.0, top)),
    ]
    return Claim(
        "Section 2, Theorem 1 on system (1)",
        "For p in [0, 1) the observer (7), (8) converges along bounded solutions of (1), to a ball that "
        "shrinks with the disturbances.",
        is_general=True,
        holds=failures[HOMOGENEOUS] == 0 and shrinks,
        conditions="By simulation, for one p, one g and one solution, with phi1 = 0.5, phi2 = 2, phi3 = 1, l = (2, 1), "
        "b = 0.5.",
        figures={
            "final_error_x2": ends,
            "largest_gain": largest,
            "failed_count": failures,
            "error_bound_by_disturbance": dict(zip(AMPLITUDES, balls, strict=True)),
        },
        picture=Picture(
            "andrieu2009-theorem-1",
            "andrieu2009, Theorem 1 on system (1): |error of x2| after the largest errors at the start",
            panels,
        ),
    )


# --- Section 2, (11) and (12): what disturbances and errors at the start do to the scaled error and to the gain ---

KINDS = ("delta_1", "delta_2", "delta_y")
ERRORS = (1.0, 10.0, 100.0, 1000.0)
"""Errors of x2 at the start."""
GAINS = (1.0, 10.0, 50.0)
"""L(0) over phi2."""
SOLUTIONS = (1.0, 2.0, 4.0)
"""Amplitudes of x1."""


def respond(columns: Sequence[Column]) -> tuple[Array, Array]:
    """Return |L^-1 e| with the matrix of (10), and L, each (n_times, n_columns)."""
    (e1, e2), L = follow(HOMOGENEOUS, columns)
    return np.hypot(e1 / L**B, e2 / L ** (1.0 + B)), L


def equations_11_12_claims() -> list[Claim]:
    """Judge (11), then (12)."""
    late = TIMES > 6.0
    disturbed, _ = respond([Column(**{kind: size}) for kind in KINDS for size in AMPLITUDES])
    fading, L = respond([Column(error=error) for error in ERRORS])
    balls, ends = disturbed[late].max(axis=0).reshape(len(KINDS), -1), fading[-1]
    peaks, by_error = L.max(axis=0), L[late].max(axis=0)
    by_gain = respond([Column(gain=gain) for gain in GAINS])[1][late].max(axis=0)
    by_solution = respond([Column(amplitude=amplitude) for amplitude in SOLUTIONS])[1][late].max(axis=0)
    shrink = all(a > 3.0 * b for row in balls for a, b in itertools.pairwise(row))
    relative_spread = max(np.ptp(by_error) / by_error[0], np.ptp(by_gain) / by_gain[0])
    one_observer = "By simulation of system (1), p = 0.5, x1 = sin t, one observer: see Theorem 1."
    return [
        Claim(
            "Section 2, (11)",
            "The scaled error is bounded by a function of its start that fades, plus one of the disturbances "
            "that is zero at zero.",
            is_general=True,
            holds=shrink and ends.max() < 1e-5,
            conditions=one_observer,
            figures={
                "late_scaled_error": dict(zip(KINDS, balls, strict=True)),
                "final_scaled_error": ends,
            },
        ),
        Claim(
            "Section 2, (12)",
            "L is bounded by 4 phi2, a function of the start that fades, and one of the disturbances, Gamma and x.",
            is_general=True,
            holds=relative_spread < 1e-3 and np.isfinite(peaks).all() and np.isfinite(by_solution).all(),
            conditions=one_observer,
            figures={
                "largest_gain_by_error": peaks,
                "largest_late_gain_by_error": by_error,
                "largest_late_gain_by_start": by_gain,
                "largest_late_gain_by_amplitude": by_solution,
            },
        ),
    ]

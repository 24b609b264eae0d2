"""Section 2.1, system (1) beyond p = 1: solutions that end before an observer has found them."""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from cmg_mj.papers.andrieu2009 import paper
from cmg_mj.papers.andrieu2009.bi_limit import BiLimitCorrection, largest_b
from cmg_mj.papers.andrieu2009.updated_high_gain import UpdatedHighGain
from cmg_mj.papers.claim import Claim
from cmg_mj.view.plots.figure import Line, Panel, Picture

INSIDE, BEYOND = 0.5, 1.5
"""One p on each side of 1."""
STARTS = (1.0, 10.0, 100.0, 1e3, 1e4)
"""x2(0)."""
D_INF = 0.5
FOUND, MISSED = 1e-3, 0.5
"""Relative errors of x2 at the end, below and above which a solution counts as found and as missed."""
LAST = 14.0
"""-ln of the share of the time of existence that is left at the end: about a millionth."""


class Escape(NamedTuple):
    """An observer beside a solution that escapes."""

    share_left: np.ndarray
    """Share of the solution's time of existence that is left, (n,)."""
    error: np.ndarray
    """|x2_hat - x2|/x2, (n,)."""
    end_time: float
    """Time at which the solution ends."""
    moved: float
    """Distance that y has moved until then; infinite if without bound."""


def solution(p: float, x2: float, share_left: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
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


def observer(p: float) -> UpdatedHighGain:
    """Make (7), (8) for (1) with g = 0, u = 0, in continuous time; d_inf = 0.5 whatever p is, as Theorem 1 wants it."""
    return UpdatedHighGain(
        1e-3,
        (lambda u, y, x: 0.0 * y[0], lambda u, y, x: paper.f2(0.0, x[0], 0.0, p)),
        BiLimitCorrection((2.0, 1.0), D_INF),
        lambda u, y, x: paper.Omega(0.0, x[0], p),
        0.5 * largest_b(2, D_INF),
        0.5,
        2.0,
        1.0,
    )


@functools.cache
def escape(p: float, x2: float, x2_hat: float = 0.0, tolerance: float = 1e-6) -> Escape:
    """Let the observer follow a solution to its end, over s = -ln of the share left.

    Args:
        p: Power.
        x2: x2(0).
        x2_hat: Its estimate at the start; x1 is known.
        tolerance: Tolerance of the integrator.

    Returns:
        The errors.
    """
    follower, end = observer(p), x2**-p / p

    def slope(s: float, z: np.ndarray) -> list[float]:
        share_left = math.exp(-s)
        x1, _ = solution(p, x2, share_left)
        L = math.exp(z[2])
        first, second = follower.slope((z[0], z[1]), L, (float(x1),), None)
        growth = follower.phi1 * (follower.phi2 - L) + follower.phi3 * follower.Omega(None, (float(x1),), (z[1],))
        return [end * share_left * first, end * share_left * second, end * share_left * growth]

    result = solve_ivp(
        slope, (0.0, LAST), [0.0, x2_hat, math.log(follower.phi2)], "Radau", rtol=tolerance, atol=1e-3 * tolerance
    )
    assert result.success, result.message
    share_left = np.exp(-result.t)
    error = np.abs(result.y[1] / solution(p, x2, share_left)[1] - 1.0)
    return Escape(share_left, error, end, x2 ** (1.0 - p) / (p - 1.0) if p > 1.0 else math.inf)


def no_observer_beyond_1() -> Claim:
    """Judge the remark on p > 1."""
    runs = {p: [escape(p, start) for start in STARTS] for p in (INSIDE, BEYOND)}
    ends = {p: [float(run.error[-1]) for run in escapes] for p, escapes in runs.items()}
    moved = [run.moved for run in runs[BEYOND]]
    misses = [error > MISSED for error in ends[BEYOND]]
    count = sum(misses)
    one_observer = (
        "One observer, (7) and (8) with d_inf = 0.5, l = (2, 1), phi1 = 0.5, phi2 = 2, phi3 = 1, g = 0, without input, "
        "started at the measured x1 and x2_hat = 0. The statement is about all observers and is proved "
        "elsewhere (Astolfi and Praly 2006). This example shows the obstacle, and is no proof."
    )
    return Claim(
        place="Section 2.1",
        statement="Once p exceeds 1, and with u = 0, no observer whatever can be sure to find x2 before the solution "
        "of (1) ends.",
        is_general=True,
        holds=max(ends[INSIDE]) < FOUND and misses[-1],
        conditions=one_observer,
        otherwise=one_observer,
        figures={
            "x2_at_start": list(STARTS),
            "relative_error_of_x2_at_the_end_by_p": {str(p): values for p, values in ends.items()},
            "escape_time_by_p": {str(p): [run.end_time for run in escapes] for p, escapes in runs.items()},
            "output_moves_by_p_1_5": moved,
            "missed_count": count,
        },
        pictures=[_picture(runs)],
    )


def _picture(runs: dict[float, list[Escape]]) -> Picture:
    panels = [
        Panel(
            "|error of x2|/x2 [-]",
            [
                Line(1.0 / run.share_left, run.error, f"x2(0) = {start:g}", color=i)
                for i, (start, run) in enumerate(zip(STARTS, runs[p], strict=True))
            ],
            f"({letter}) p = {p}",
            "time of existence over what is left of it [-]",
            x_scale="log",
            y_scale="log",
            y_range=(1e-9, 10.0),
        )
        for letter, p in zip("ab", (INSIDE, BEYOND), strict=True)
    ]
    title = "andrieu2009, section 2.1: relative error of x2 along solutions of (1) that escape"
    return Picture("andrieu2009-escape", title, panels)

"""Section 2.1, system (1) beyond p = 1: solutions that end before an observer has found them."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from cmg_mj.core.arrays import signed_power
from cmg_mj.papers.andrieu2009 import bioreactor
from cmg_mj.papers.andrieu2009.observer import BiLimitCorrection, UpdatedHighGain, largest_b
from cmg_mj.papers.claim import Claim
from cmg_mj.view.plots.figure import Line, Panel, Picture

# --- Section 2.1, system (1) beyond p = 1: solutions that end before an observer has found them ---

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
        (lambda u, y, x: 0.0 * y[0], lambda u, y, x: bioreactor.f2(0.0, x[0], 0.0, p)),
        BiLimitCorrection((2.0, 1.0), D_INF),
        lambda u, y, x: bioreactor.Omega(0.0, x[0], p),
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
        pictures=[_finite_escape_picture(runs)],
    )


def _finite_escape_picture(runs: dict[float, list[Escape]]) -> Picture:
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


# --- Theorem 1 on system (1) ---

START_ERRORS = (-1e3, -1e2, -10.0, -1.0, 1.0, 10.0, 1e2, 1e3)
NOISE_AMPLITUDES = (1e-1, 1e-2, 1e-3)
PLAIN, UPDATED, HOMOGENEOUS = "constant gain, linear", "updated gain, linear", "updated gain, homogeneous"

Runs = dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]
"""Observer -> time, errors of x2 and gains."""


def theorem_1() -> Claim:
    """Judge the three observers from large errors, and with a disturbance."""
    runs = {kind: recoveries(kind, START_ERRORS) for kind in (PLAIN, UPDATED)}
    t, error, L = recoveries(HOMOGENEOUS, START_ERRORS, NOISE_AMPLITUDES)
    n = len(START_ERRORS)
    runs[HOMOGENEOUS] = t, error[:, :n], L[:, :n]
    ends = {kind: [_finite(value) for value in np.abs(error[-1])] for kind, (_, error, _) in runs.items()}
    failures = {kind: sum(value is None or value > 1e-3 for value in values) for kind, values in ends.items()}
    largest = {kind: float(np.nanmax(L)) for kind, (_, _, L) in runs.items()}
    balls = [float(np.abs(error[t > 5.0, n + i]).max()) for i in range(len(NOISE_AMPLITUDES))]
    shrinks = all(a > 5.0 * b for a, b in itertools.pairwise(balls))
    by_simulation = (
        "By simulation, for one p, one g and one solution, with phi1 = 0.5, phi2 = 2, phi3 = 1, l = (2, 1), b = 0.5."
    )
    return Claim(
        place="Section 2, Theorem 1 on system (1)",
        statement="For p in [0, 1) the observer (7), (8) converges along bounded solutions of (1), to a ball that "
        "shrinks with the disturbances.",
        is_general=True,
        holds=failures[HOMOGENEOUS] == 0 and shrinks,
        conditions=by_simulation,
        otherwise=by_simulation,
        figures={
            "final_error_x2": ends,
            "largest_gain": largest,
            "failed_count": failures,
            "error_bound_by_disturbance": dict(zip(map(str, NOISE_AMPLITUDES), balls, strict=True)),
        },
        pictures=[_theorem_1_picture(runs, max(largest.values()))],
    )


def _theorem_1_picture(runs: Runs, largest: float) -> Picture:
    return Picture(
        "andrieu2009-theorem-1",
        "andrieu2009, Theorem 1 on system (1): |error of x2| after the largest errors at the start",
        [
            Panel(
                "|error of x2| [-]",
                [
                    Line(t, np.abs(error[:, -1]), kind, color=i, style=("--", "-", "-")[i])
                    for i, (kind, (t, error, _)) in enumerate(runs.items())
                ],
                title="(a) from an error of 1000",
                y_scale="log",
                y_range=(1e-8, 1e6),
            ),
            Panel(
                "gain L [-]",
                [Line(t, L[:, -1], kind, color=i) for i, (kind, (t, _, L)) in enumerate(runs.items())],
                title="(b) its gain",
                x_label="time [normalised]",
                y_range=(0.0, 1.1 * largest),
            ),
        ],
    )


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def system_1(kind: str, dt: float, p: float = 0.5) -> UpdatedHighGain:
    """Make an observer for (1) with g(y) = y - 1, u being measured along with y."""

    def g(y: np.ndarray) -> np.ndarray:
        return y - 1.0

    def f2(u: None, y: tuple, x: tuple) -> Any:
        return bioreactor.f2(g(y[0]), x[0], y[1], p)

    def Omega(u: None, y: tuple, x: tuple) -> Any:
        return bioreactor.Omega(g(y[0]), x[0], p)

    l, phi1, phi2, phi3 = (2.0, 1.0), 0.5, 2.0, 1.0  # noqa: E741
    f = (lambda u, y, x: 0.0 * y[0], f2)
    if kind == PLAIN:  # about the gain that the others reach along this solution
        return UpdatedHighGain.plain(dt=dt, f=f, l=l, L=12.0)
    if kind == UPDATED:
        return UpdatedHighGain.updated(dt=dt, f=f, l=l, Omega=Omega, phi1=phi1, phi2=phi2, phi3=phi3, v=(p,))
    b = 0.5 * largest_b(2, p, (p,))
    return UpdatedHighGain(dt, f, BiLimitCorrection(l, p), Omega, b, phi1, phi2, phi3, v=(p,))


@functools.cache
def recoveries(
    kind: str, errors: Sequence[float], noises: Sequence[float] = (), dt: float = 2e-3, p: float = 0.5
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Let an observer follow x1 = sin t, x2 = cos t, which solves (1) for the right u.

    Args:
        kind: PLAIN, UPDATED or HOMOGENEOUS.
        errors: Errors of x2 at the start, one run each.
        noises: Amplitudes of a measurement disturbance sin(20 t), one more run each, without error at the start.
        dt: Sample period.
        p: Power of (1).

    Returns:
        Time (n,), the error of x2 (n, runs), and L (n, runs).
    """
    t = np.arange(0.0, 10.0 + 0.5 * dt, dt)
    start = np.array([*errors, *(0.0 for _ in noises)])
    amplitude = np.array([*(0.0 for _ in errors), *noises])
    x1, x2 = np.sin(t), np.cos(t)
    u = -x1 - (x1 - 1.0) * x2 - signed_power(x2, 1.0 + p)
    y = x1[:, None] + amplitude * np.sin(20.0 * t)[:, None]
    observer = system_1(kind, dt, p)
    ones = np.ones_like(start)
    state = observer.init((y[0], u[0] * ones), (x1[0] * ones, x2[0] + start))
    x2_errors, gains = [state.x[1] - x2[0]], [state.L]
    with np.errstate(all="ignore"):  # one of them may diverge
        for k in range(1, len(t)):
            state, x = observer.step(state, (y[k], u[k] * ones), None)
            x2_errors.append(x[1] - x2[k])
            gains.append(state.L)
    return t, np.array(x2_errors), np.array(gains)

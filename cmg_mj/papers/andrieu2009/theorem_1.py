"""Theorem 1 on system (1): the observer (7), (8) beside one without the correction and one without the update."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from cmg_mj.core.arrays import signed_power
from cmg_mj.papers.andrieu2009 import paper
from cmg_mj.papers.andrieu2009.bi_limit import BiLimitCorrection, largest_b
from cmg_mj.papers.andrieu2009.updated_high_gain import UpdatedHighGain
from cmg_mj.papers.claim import Claim
from cmg_mj.view.plots.figure import Line, Panel, Picture

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
        pictures=[_picture(runs, max(largest.values()))],
    )


def _picture(runs: Runs, largest: float) -> Picture:
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
        return paper.f2(g(y[0]), x[0], y[1], p)

    def Omega(u: None, y: tuple, x: tuple) -> Any:
        return paper.Omega(g(y[0]), x[0], p)

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

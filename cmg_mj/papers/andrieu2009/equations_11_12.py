"""Section 2, (11) and (12): what disturbances and errors at the start do to the scaled error and to the gain."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from cmg_mj.core.arrays import signed_power
from cmg_mj.papers.andrieu2009.theorem_1 import HOMOGENEOUS, system_1
from cmg_mj.papers.claim import Claim

P, DT, END, LATE = 0.5, 2e-3, 10.0, 6.0
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
    u = -a * s - d1 * wave_slope - d2 * wave - (y - 1.0) * x2 - signed_power(x2, 1.0 + P)
    observer = system_1(HOMOGENEOUS, DT, P)
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


def claims() -> list[Claim]:
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

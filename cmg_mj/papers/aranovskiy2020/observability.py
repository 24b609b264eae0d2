"""Is the pair (A', C) of aranovskiy2020 (10) uniformly observable?"""

from __future__ import annotations

import math

import numpy as np

from cmg_mj.laws.state_feedback import StateFeedback
from cmg_mj.papers.aranovskiy2020.paper import A_prime, C, damping
from cmg_mj.papers.aranovskiy2020.rig import DT, SEED_OF_10, run_of_10
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.linear_check import rank_margin


def observability_margin(a: float, outputs: np.ndarray = C) -> float:
    """Return the rank margin of [C; C A'; C A'^2], for the outputs C."""
    A = A_prime(a)
    return rank_margin(np.vstack([outputs, outputs @ A, outputs @ A @ A]))


def gramian_bounds(a: np.ndarray, dt: float, span_s: float) -> tuple[float, float]:
    """Return the least and largest eigenvalue of the observability Gramian over every span of a run.

    Phi(t, s) of A' has the first row [1, phi, 0] with phi' = exp(integral of a): Simpson's rule over the span, a held
    between ticks.

    Args:
        a: The entry of A' tick by tick, (n_ticks,) [1/s].
        dt: Between ticks [s].
        span_s: T_0 [s], an even number of ticks.

    Returns:
        delta_1 and delta_2 of the condition after (10) [s], [s^3].
    """
    n = round(span_s / dt)
    weights = np.ones(n + 1)
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    weights *= dt / 3.0
    least, largest = math.inf, 0.0
    for start in range(len(a) - n):
        a_span = a[start : start + n]
        growth = np.exp(np.concatenate([[0.0], np.cumsum(a_span * dt)]))
        with np.errstate(invalid="ignore", divide="ignore"):
            step = np.where(np.abs(a_span) < 1e-9, dt, np.expm1(a_span * dt) / a_span)
        phi = np.concatenate([[0.0], np.cumsum(growth[:-1] * step)])
        gramian = np.array([[span_s, weights @ phi], [weights @ phi, weights @ phi**2]])
        values = np.linalg.eigvalsh(gramian)
        least, largest = min(least, float(values[0]), span_s), max(largest, float(values[1]), span_s)
    return least, largest


def observability(seed: int = SEED_OF_10, span_s: float = 0.5) -> Claim:
    """Judge the uniform observability that (10) needs."""
    grid = [
        (u, y2)
        for u in np.linspace(-StateFeedback.rate_limit, StateFeedback.rate_limit, 21)
        for y2 in np.linspace(-math.pi, math.pi, 41)
    ]
    dampings = [float(damping(u, float(y2))) for u, y2 in grid]
    margin = min(observability_margin(a) for a in dampings)
    margin_without_tilt = max(observability_margin(a, C[1:]) for a in dampings)
    run = run_of_10(seed)
    least, largest = gramian_bounds(np.asarray(damping(run["u_rad_s"], run["y2_rad"])), DT, span_s)
    extremes = [gramian_bounds(np.full(round(span_s / DT) + 1, a), DT, span_s) for a in (min(dampings), max(dampings))]
    bound = min(pair[0] for pair in extremes), max(pair[1] for pair in extremes)
    return Claim(
        place="After (10)",
        statement="(A', C) is observable for all u and y2, which makes the error of (10) converge exponentially.",
        assumes={"servo": f"at most {StateFeedback.rate_limit:g} rad/s"},
        holds=margin > 0.1 and margin_without_tilt < 1e-12 and bound[0] > 0.0 and math.isfinite(bound[1]),
        conditions=(
            "Pointwise observability alone is not uniform; a bounded u, as the servos have it, closes the gap."
        ),
        otherwise="The pair is not observable for some u and y2, or not uniformly.",
        figures={
            "rank_margin": margin,
            "rank_margin_without_tilt": margin_without_tilt,
            "largest_damping_1_s": max(map(abs, dampings)),
            "span_s": span_s,
            "gramian_along_run": [least, largest],
            "gramian_any_u": list(bound),
        },
    )


def claims(on_share: OnShare) -> list[Claim]:
    """Judge the uniform observability that (10) needs."""
    return [observability()]

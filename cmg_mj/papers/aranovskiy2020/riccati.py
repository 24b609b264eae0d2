"""Remark 1 and the Riccati equation of (10): cost, delicacy, misprint, and whether (A', C) is observable."""

from __future__ import annotations

import json
import math
import statistics
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import expm

from cmg_mj.laws.state_feedback import StateFeedback
from cmg_mj.observers import Measurement, make_observer
from cmg_mj.papers.aranovskiy2020.forms_of_10 import (
    METHODS,
    Comparison,
    Method,
    Plain,
    compare,
    euler,
    make_exact,
    matrix_of,
    rk4,
    rk4_as_printed,
)
from cmg_mj.papers.aranovskiy2020.paper import H_0, OBSERVERS, A_prime, C, Q, damping, printed_model, settled_gains
from cmg_mj.papers.claim import Array, Claim
from cmg_mj.papers.linear_check import rank_margin
from cmg_mj.papers.pair import DT, SEED_OF_10, run_of_10
from cmg_mj.papers.recorded import largest_size
from cmg_mj.runs.benchmark import time_of_update
from cmg_mj.view.plots.figure import Line, Panel, Picture

# --- delicacy ---------------------------------------------------------------------------------------------------

RATES_HZ = np.geomspace(20.0, 2000.0, 41).tolist()


class Transient(NamedTuple):
    """H from H_0 at rest, by one method at one rate."""

    least: float
    """Least eigenvalue met; minus infinity if H was lost."""
    error: float
    """Largest error of H12, which weighs the measurement in the rate's estimate, by its steady value."""
    path: Array
    """H12 sample by sample, (n_samples,)."""


def transient(method: str, rate_hz: float, kind: type = np.float64) -> Transient:
    """Integrate the Riccati equation beside its exact solution, over 0.2 s but at least 50 steps.

    Args:
        method: One of `METHODS`.
        rate_hz: Steps a second.
        kind: Precision; single is what the paper's STM32F746 computes in hardware.

    Returns:
        What was met.
    """
    h, A = 1.0 / rate_hz, A_prime()
    E = expm(h * np.block([[-A.T, C.T @ C], [Q, A]]))
    H, truth = H_0.astype(kind), H_0
    _, steady = settled_gains()
    least, error, path = math.inf, 0.0, []
    for _ in range(max(50, round(0.2 * rate_hz))):
        with np.errstate(all="ignore"):
            H = METHODS[method](H, A, h)
        truth = (E[3:, :3] + E[3:, 3:] @ truth) @ np.linalg.inv(E[:3, :3] + E[:3, 3:] @ truth)
        path.append(H[0, 1])
        if not np.isfinite(H).all():
            return Transient(-math.inf, math.inf, np.array(path))
        least = min(least, np.linalg.eigvalsh(H.astype(float))[0])
        error = max(error, abs(H[0, 1] - truth[0, 1]) / steady)
    return Transient(least, error, np.array(path))


def lowest_rate(method: str, sweep: Mapping[float, Transient], passes: Callable[[Transient], bool]) -> float | None:
    """Return the rate above which a method passes, by bisection to 0.1 Hz; None if it does at the lowest tried [Hz]."""
    failing_rates = [rate for rate, result in sweep.items() if not passes(result)]
    if not failing_rates:
        return None
    low, high = max(failing_rates), min(rate for rate in sweep if rate > max(failing_rates))
    while high - low > 0.1:
        middle = (low + high) / 2.0
        low, high = (low, middle) if passes(transient(method, middle)) else (middle, high)
    return high


def delicacy() -> Claim:
    """Judge the condition and definiteness of H over step size and method."""
    sweeps = {name: {rate: transient(name, rate) for rate in RATES_HZ} for name in METHODS}
    definite = {name: lowest_rate(name, sweep, lambda t: t.least > 0.0) for name, sweep in sweeps.items()}
    finite = {name: lowest_rate(name, sweep, lambda t: math.isfinite(t.error)) for name, sweep in sweeps.items()}
    at_200 = {name: transient(name, 1.0 / DT) for name in METHODS}
    errors, least, paths = [], [], []
    for i, (name, by_rate) in enumerate(sweeps.items()):
        met = [t.error if math.isfinite(t.error) else math.nan for t in by_rate.values()]
        positive = [t.least if t.least > 0.0 else math.nan for t in by_rate.values()]
        path = np.concatenate([[0.0], at_200[name].path[:24]])
        errors.append(Line(RATES_HZ, met, name, color=i))
        least.append(Line(RATES_HZ, positive, name, color=i, style="o-" if i < 2 else "--"))
        paths.append(Line(np.arange(len(path)) * 5.0, path, name, color=i, style="--" if i == 2 else "o-"))
    rate, span = "steps a second [Hz]", "largest in the first 0.2 s or 50 steps"
    float32 = {name: transient(name, 1.0 / DT, np.float32) for name in ("explicit Euler", "Runge-Kutta 4")}
    run, observer = run_of_10(SEED_OF_10), make_exact()
    comparison = compare(observer, Plain(euler), SEED_OF_10)
    y1, y2, u = (run[name].tolist() for name in ("y1_rad", "y2_rad", "u_rad_s"))
    state, matrices = observer.init(Measurement(y1[0], y2[0])), []
    for k in range(1, len(y1)):
        state, _ = observer.step(state, Measurement(y1[k], y2[k]), u[k - 1])
        matrices.append(matrix_of(state))
    return Claim(
        "Remark 1, delicacy",
        "The Riccati equation is sensitive to the numerical method; six decades between Q's entries amplify it.",
        assumes={"control rate": f"{1.0 / DT:g} Hz", "method": "explicit Euler, Runge-Kutta 4, the exact step"},
        holds=at_200["explicit Euler"].error > 0.1
        and at_200["Runge-Kutta 4"].error < 1e-2
        and at_200["exact step (ours)"].error < 1e-8
        and definite["exact step (ours)"] is None,
        conditions="At 200 Hz the equation is delicate for explicit Euler alone: H until it has settled, the estimate "
        "throughout. Runge-Kutta 4 does well enough even in single precision. The exact (Davison-Maki) step does so at "
        "any rate.",
        figures={
            "definite_above_hz": definite,
            "finite_above_hz": finite,
            "error_of_H12_at_200_hz": {name: t.error for name, t in at_200.items()},
            "error_of_H12_at_200_hz_single": {name: t.error for name, t in float32.items()},
            "rate_changed_by_euler_rad_s": comparison.difference,
            "rate_error_euler_rad_s": comparison.other_error,
            "rate_error_exact_rad_s": comparison.error,
            "condition_along_run": np.linalg.cond(matrices).max(),
            "least_eigenvalue_along_run": np.linalg.eigvalsh(matrices).min(),
        },
        picture=Picture(
            "aranovskiy2020-remark-1",
            "aranovskiy2020, Remark 1: the Riccati equation of (10) from H(0) = I, Q of Table 2",
            [
                Panel("error of H12\nby its steady value", errors, span, rate, "log", "log"),
                Panel("least eigenvalue\nof H", least, "none where negative", rate, "log", y_range=(0.0, 1.1)),
                Panel("H12 [1/s]", paths, "at 200 Hz", "time [ms]"),
            ],
            share_x=False,
        ),
    )


# --- the misprint -----------------------------------------------------------------------------------------------

SETTLING_S = 8.0
"""The slowest entry, H33, takes 1 s to fall by e^2 [s]."""
HARMLESS = 0.05
"""Share of the rate's error: if the misprint changes the rate by less, either equation may have been run."""


def settle(method: Method) -> Array:
    """Return H where a method settles at rest, (3, 3)."""
    H, h = H_0, 1e-3
    for _ in range(round(SETTLING_S / h)):
        H = method(H, A_prime(), h)
    return H


def misprint() -> Claim:
    """Judge the Riccati equation as printed: symmetric, or as good as what is."""
    rates = compare(Plain(rk4), Plain(rk4_as_printed), SEED_OF_10)
    return misprint_claim(settle(rk4), settle(rk4_as_printed), rates)


def misprint_claim(H: Array, printed_H: Array, rate: Comparison) -> Claim:
    """Judge by H where either equation settles at rest, and by the rates that they estimate."""
    is_symmetric = abs(printed_H[0, 1] - printed_H[1, 0]) < 1e-6 * printed_H[1, 0]
    return Claim(
        "After (10), the Riccati equation",
        "The symmetric gain matrix of (10) is the solution of H' = H A^T + A' H - H C^T C H + Q.",
        holds=is_symmetric or rate.difference < HARMLESS * rate.error,
        conditions=""
        if is_symmetric
        else "With A'^T for the printed A^T, which is that of (6): a misprint. The observer's rate is the same to less "
        "than a hundredth of its error, whichever of them was run.",
        figures={
            "H12_printed": printed_H[0, 1],
            "H21_printed": printed_H[1, 0],
            "H12": H[0, 1],
            "largest_change_of_gain_share": largest_size((printed_H - H)[:, ::2]) / largest_size(H[:, ::2]),
            "rate_changed_rad_s": rate.difference,
            "rate_error_rad_s": rate.error,
            "rate_error_printed_rad_s": rate.other_error,
        },
    )


# --- observability ----------------------------------------------------------------------------------------------


def observability_margin(a: float, outputs: Array = C) -> float:
    """Return the rank margin of [C; C A'; C A'^2], for the outputs C."""
    A = A_prime(a)
    return rank_margin(np.vstack([outputs, outputs @ A, outputs @ A @ A]))


def gramian_bounds(a: Array, dt: float, span_s: float) -> tuple[float, float]:
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
        least, largest = min(least, values[0], span_s), max(largest, values[1], span_s)
    return least, largest


def observability(seed: int = SEED_OF_10) -> Claim:
    """Judge the uniform observability that (10) needs."""
    limit, span_s = StateFeedback.rate_limit, 0.5
    u, y2 = np.meshgrid(np.linspace(-limit, limit, 21), np.linspace(-math.pi, math.pi, 41))
    dampings = np.ravel(damping(u, y2)).tolist()
    margin = min(observability_margin(a) for a in dampings)
    margin_without_tilt = max(observability_margin(a, C[1:]) for a in dampings)
    run = run_of_10(seed)
    along_run = gramian_bounds(np.asarray(damping(run["u_rad_s"], run["y2_rad"])), DT, span_s)
    extremes = [gramian_bounds(np.full(round(span_s / DT) + 1, a), DT, span_s) for a in (min(dampings), max(dampings))]
    bounds = min(pair[0] for pair in extremes), max(pair[1] for pair in extremes)
    return Claim(
        "After (10)",
        "(A', C) is observable for all u and y2, which makes the error of (10) converge exponentially.",
        assumes={"servo": f"at most {limit:g} rad/s"},
        holds=margin > 0.1 and margin_without_tilt < 1e-12 and bounds[0] > 0.0 and math.isfinite(bounds[1]),
        conditions="Pointwise observability alone is not uniform; a bounded u, as the servos have it, closes the gap.",
        figures={
            "rank_margin": margin,
            "rank_margin_without_tilt": margin_without_tilt,
            "largest_damping_1_s": max(map(abs, dampings)),
            "span_s": span_s,
            "gramian_along_run": along_run,
            "gramian_any_u": bounds,
        },
    )


CLOCK_MHZ = 216.0
"""Clock of the rig's processor, an STM32F746 [MHz]."""

RECORDED = Path(__file__).with_name("on_the_board.json")
"""Instructions of an update of the observer alone, by observer, as far as an emulator of that processor can say;
`python benchmarks/board.py --paper` writes it."""

PLAIN = {"ltv, plain Euler": euler, "ltv, plain Runge-Kutta 4": rk4}
"""(10) written out with 3x3 matrices, by the method for H."""


def update_times(worlds: int | None, turns: int, updates: int) -> dict[str, float]:
    """Measure the median time of an update [us], the observers taking turns.

    With worlds, arrays of so many; without (None) floats, and then the plain forms of (10) too.
    """
    cases: dict[str, Any] = {name: make_observer(name, DT, printed_model()) for name in OBSERVERS}
    if worlds is None:
        cases |= {name: Plain(method) for name, method in PLAIN.items()}
    value: Any = 0.01 if worlds is None else np.full(worlds, 0.01)
    y1, y2, acceleration, u = ([factor * value] * updates for factor in (1.0, 2.0, 0.0, 3.0))
    times = [
        {name: time_of_update(observer, y1, y2, acceleration, u) for name, observer in cases.items()}
        for _ in range(turns)
    ]
    return {name: statistics.median(turn[name] for turn in times) for name in cases}


def cost(recorded: Path = RECORDED) -> Claim:
    """Instructions of an update of (10) beside those of (9) and (11) on the rig's processor; times on this one."""
    board = json.loads(recorded.read_text(encoding="utf-8"))
    single_times, batch_times = update_times(None, turns=3, updates=200), update_times(4096, turns=1, updates=4)
    dearest = max(board[name] for name in ("ltv", *PLAIN))
    return Claim(
        "Remark 1, cost",
        "The observer (10) is computationally heavy in embedded systems: its gain takes differential "
        "equations solved online.",
        holds=dearest > board["homogeneous"] > board["linear"],
        otherwise="Read as heavier than (11), it turns round on this processor: the powers in (11) cost more than a "
        "step of the equations of H, whichever way that is taken, once a sample in single precision. Two Runge-Kutta "
        "steps a sample would cost more than (11). Against (9) it is heavy, against the sample period neither is.",
        figures={
            "instructions": board,
            "share_of_period": dearest / CLOCK_MHZ / (1e6 * DT),
            "update_us": single_times,
            "update_by_linear": {name: time / single_times["linear"] for name, time in single_times.items()},
            "update_by_linear_4096_worlds": {name: time / batch_times["linear"] for name, time in batch_times.items()},
        },
    )

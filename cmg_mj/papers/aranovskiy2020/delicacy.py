"""Remark 1 of aranovskiy2020: how delicate the Riccati equation of (10) is, by method and step."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from cmg_mj.observers import Measurement
from cmg_mj.papers.aranovskiy2020.forms_of_10 import METHODS, compare_euler, make_exact, matrix_of
from cmg_mj.papers.aranovskiy2020.paper import H_0, A_prime, C, Q, settled_gains
from cmg_mj.papers.aranovskiy2020.rig import DT, SEED_OF_10, run_of_10
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.view.plots.figure import Line, Panel, Picture

RATES_HZ = tuple(float(rate) for rate in np.geomspace(20.0, 2000.0, 41))


class Transient(NamedTuple):
    """H from H_0 at rest, by one method at one rate."""

    least: float
    """Least eigenvalue met; minus infinity if H was lost."""
    error: float
    """Largest error of H12, which weighs the measurement in the rate's estimate, by its steady value."""
    path: np.ndarray
    """H12 sample by sample, (n_samples,)."""


def transient(method: str, rate_hz: float, span_s: float = 0.2, single_precision: bool = False) -> Transient:
    """Integrate the Riccati equation beside its exact solution.

    Args:
        method: One of `METHODS`.
        rate_hz: Steps a second.
        span_s: Simulated time [s], but at least 50 steps.
        single_precision: Whether in single precision, which is what the paper's STM32F746 computes in hardware.

    Returns:
        What was met.
    """
    h, A = 1.0 / rate_hz, A_prime()
    E = expm(h * np.block([[-A.T, C.T @ C], [Q, A]]))
    H, truth = H_0.astype(np.float32 if single_precision else np.float64), H_0
    _, steady = settled_gains()
    least, error, path = math.inf, 0.0, []
    for _ in range(max(50, round(span_s * rate_hz))):
        with np.errstate(all="ignore"):
            H = METHODS[method](H, A, h)
        truth = (E[3:, :3] + E[3:, 3:] @ truth) @ np.linalg.inv(E[:3, :3] + E[:3, 3:] @ truth)
        path.append(float(H[0, 1]))
        if not np.isfinite(H).all():
            return Transient(-math.inf, math.inf, np.array(path))
        least = min(least, float(np.linalg.eigvalsh(H.astype(float))[0]))
        error = max(error, abs(float(H[0, 1]) - truth[0, 1]) / steady)
    return Transient(least, error, np.array(path))


Sweeps = Mapping[str, Mapping[float, Transient]]
"""Method -> rate [Hz] -> what was met."""


def lowest_rate(method: str, sweep: Mapping[float, Transient], passes: Callable[[Transient], bool]) -> float | None:
    """Return the rate above which a method passes, by bisection to 0.1 Hz; None if it does at the lowest tried [Hz]."""
    failing_rates = [rate for rate, result in sweep.items() if not passes(result)]
    if not failing_rates:
        return None
    low, high = max(failing_rates), min((rate for rate in sweep if rate > max(failing_rates)), default=math.inf)
    while math.isfinite(high) and high - low > 0.1:
        middle = (low + high) / 2.0
        low, high = (low, middle) if passes(transient(method, middle)) else (middle, high)
    return high


def matrices_along(run: Trajectory) -> np.ndarray:
    """Return H of this package's observer along a run, from the second sample on, (n_ticks - 1, 3, 3)."""
    observer = make_exact()
    y1, y2, u = (run[name].tolist() for name in ("y1_rad", "y2_rad", "u_rad_s"))
    state, matrices = observer.init(Measurement(y1[0], y2[0])), []
    for k in range(1, len(y1)):
        state, _ = observer.step(state, Measurement(y1[k], y2[k]), u[k - 1])
        matrices.append(matrix_of(state))
    return np.array(matrices)


def delicacy(seed: int = SEED_OF_10) -> Claim:
    """Judge the condition and definiteness of H over step size and method."""
    sweeps = {name: {rate: transient(name, rate) for rate in RATES_HZ} for name in METHODS}
    definite = {name: lowest_rate(name, sweeps[name], lambda t: t.least > 0.0) for name in METHODS}
    finite = {name: lowest_rate(name, sweeps[name], lambda t: math.isfinite(t.error)) for name in METHODS}
    at_200 = {name: transient(name, 1.0 / DT) for name in METHODS}
    float32 = {name: transient(name, 1.0 / DT, single_precision=True) for name in ("explicit Euler", "Runge-Kutta 4")}
    comparison = compare_euler(seed)
    matrices = matrices_along(run_of_10(seed))
    condition = float(np.linalg.cond(matrices).max())
    least = float(np.linalg.eigvalsh(matrices).min())
    euler_first = at_200["explicit Euler"].error > 0.1
    rk4_fine = at_200["Runge-Kutta 4"].error < 1e-2
    ours_fine = at_200["exact step (ours)"].error < 1e-8 and definite["exact step (ours)"] is None
    return Claim(
        place="Remark 1, delicacy",
        statement="The Riccati equation is sensitive to the numerical method; six decades between Q's entries amplify "
        "it.",
        assumes={"control rate": f"{1.0 / DT:g} Hz", "method": "explicit Euler, Runge-Kutta 4, the exact step"},
        holds=euler_first and rk4_fine and ours_fine,
        conditions=(
            "At 200 Hz the equation is delicate for explicit Euler alone: H until it has settled, the estimate "
            "throughout. Runge-Kutta 4 does well enough even in single precision. The exact (Davison-Maki) step does "
            "so at any rate."
        ),
        otherwise="It is not the method by which they are told apart.",
        figures={
            "definite_above_hz": definite,
            "finite_above_hz": finite,
            "error_of_H12_at_200_hz": {name: t.error for name, t in at_200.items()},
            "error_of_H12_at_200_hz_single": {name: t.error for name, t in float32.items()},
            "rate_changed_by_euler_rad_s": comparison.difference,
            "rate_error_euler_rad_s": comparison.other_error,
            "rate_error_exact_rad_s": comparison.error,
            "condition_along_run": condition,
            "least_eigenvalue_along_run": least,
        },
        pictures=[_picture(sweeps, at_200)],
    )


def _picture(sweeps: Sweeps, at_200: Mapping[str, Transient]) -> Picture:
    errors, least, paths = [], [], []
    for i, (name, by_rate) in enumerate(sweeps.items()):
        transients = by_rate.values()
        finite = [t.error if math.isfinite(t.error) else math.nan for t in transients]
        positive = [t.least if t.least > 0.0 else math.nan for t in transients]
        path = np.concatenate([[0.0], at_200[name].path[:24]])
        errors.append(Line(RATES_HZ, finite, name, color=i))
        least.append(Line(RATES_HZ, positive, name, color=i, style="o-" if i < 2 else "--"))
        paths.append(Line(np.arange(len(path)) * 5.0, path, name, color=i, style="--" if i == 2 else "o-"))
    rate, span = "steps a second [Hz]", "largest in the first 0.2 s or 50 steps"
    return Picture(
        "aranovskiy2020-remark-1",
        "aranovskiy2020, Remark 1: the Riccati equation of (10) from H(0) = I, Q of Table 2",
        [
            Panel("error of H12\nby its steady value", errors, span, rate, "log", "log"),
            Panel("least eigenvalue\nof H", least, "none where negative", rate, "log", y_range=(0.0, 1.1)),
            Panel("H12 [1/s]", paths, "at 200 Hz", "time [ms]"),
        ],
        share_x=False,
    )


def claims(on_share: OnShare) -> list[Claim]:
    """Judge the delicacy."""
    return [delicacy()]

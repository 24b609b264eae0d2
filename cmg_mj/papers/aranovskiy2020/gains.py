"""The gains K_e: are they those of an LQR, and where does the closed loop rest with them on the six-body model?"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, solve_continuous_are
from scipy.optimize import minimize

from cmg_mj.observers import make_observer
from cmg_mj.papers.aranovskiy2020.paper import K_E, K_E_ROUNDING, printed_model
from cmg_mj.papers.claim import Array, Claim
from cmg_mj.papers.pair import DT, PUSH_RECOVERY, replay_at_rest, run_loops
from cmg_mj.papers.recorded import trace, trajectory_of
from cmg_mj.results.intervals import Interval, mean_interval
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.view.plots.figure import Panel, Picture

# --- inverse optimality -----------------------------------------------------------------------------------------


def inverse_optimality(A: Array, B: Array, K: Array) -> tuple[float, Array, Array | None, float | None]:
    """Decide whether K is the LQR gain of x' = A x + B u for some cost x' Q x + u^2.

    With d the open-loop and p the closed-loop polynomial and n_i/d the transfer function to x_i, a cost Q = diag(q)
    gives |p(jw)|^2 - |d(jw)|^2 = sum of q_i |n_i(jw)|^2, and Q = c c' gives |sum of c_i n_i|^2.

    Args:
        A: State matrix, (n, n).
        B: Input matrix, (n, 1).
        K: Gain, (n,).

    Returns:
        The answer of the return difference: the least |1 + K (jw - A)^-1 B| over w; the one diagonal of Q that would
        give K, which no diagonal Q >= 0 does if it has a negative entry; a Q >= 0 of rank 1 that makes K the LQR gain,
        (n, n), None if there is none (Kalman 1964: the least is below 1); relative error of the Riccati equation's gain
        for that Q.
    """
    d, p = np.poly(A), np.poly(A - B @ K[None, :])
    numerators = np.array(
        [np.poly(A - B @ unit[None, :]) - d for unit in np.eye(len(A))]
    )  # d + n_i is that of u = -x_i
    gap = (_squared(p) - _squared(d))[1:]  # in w^2, degree n - 1
    roots = np.roots(gap)
    crossings = [w for w in roots if abs(w.imag) < 1e-9 * (1.0 + abs(w)) and w.real > 0.0]
    grid = np.concatenate([np.logspace(-6, 8, 4001), [abs(w.real) for w in crossings]])
    least = np.sqrt((np.polyval(_squared(p), grid) / np.polyval(_squared(d), grid)).min())
    basis = np.column_stack([_squared(row) for row in numerators])[1:]
    diagonal = np.linalg.lstsq(basis, gap, rcond=None)[0]
    if np.polyval(gap, grid).min() < 0.0 or gap[-1] < 0.0:
        return least, diagonal, None, None
    # Spectral factor: the half of the roots of gap(-s^2) to the left.
    left_roots = [-np.sqrt(-w) if np.sqrt(-w).real > 0.0 else np.sqrt(-w) for w in roots.astype(complex)]
    factor = math.sqrt(abs(gap[0])) * np.real(np.poly(left_roots))
    c = np.linalg.solve(numerators[:, 1:].T, factor)
    Q = np.outer(c, c)
    return least, diagonal, Q, np.abs(lqr_gain(A, B, Q) / K - 1.0).max()


def _squared(polynomial: Array) -> Array:
    """Return |p(jw)|^2 as a polynomial in w^2, highest power first."""
    n = len(polynomial) - 1
    signs = (-1.0) ** (n - np.arange(n + 1))
    even = np.convolve(polynomial, polynomial * signs)[::2]  # p(s) p(-s) in s^2
    return even * signs  # s^2 = -w^2


def lqr_gain(A: Array, B: Array, Q: Array) -> Array:
    """Return the LQR gain for Q and R = 1, (n,)."""
    return (B.T @ solve_continuous_are(A, B, Q, np.eye(1)))[0]


MIN_WEIGHT = 1e-3
"""Least weight in a diagonal Q: a state that hardly counts."""
SEARCHES = 3
"""Number of starts of a search, each from where it ended: a simplex may collapse."""


def nearest_diagonal(A: Array, B: Array, K: Array, rounding: Sequence[float], start: Array) -> tuple[Array, float]:
    """Search the diagonal Q whose LQR gain with R = 1 comes nearest to K.

    Args:
        A: State matrix, (n, n).
        B: Input matrix, (n, 1).
        K: The gain as printed, (n,).
        rounding: Half a unit of the digit that each entry of it is printed with, (n,).
        start: A diagonal near the one sought, (n,); entries below 0.01 count as 0.01.

    Returns:
        The diagonal, (n,), and the largest difference of its gain from K by the rounding: 1 is rounding's.
    """

    def weights(logarithms: Array) -> Array:
        return np.maximum(np.exp(logarithms), MIN_WEIGHT)

    def off(logarithms: Array) -> float:
        try:
            return (np.abs(lqr_gain(A, B, np.diag(weights(logarithms))) - K) / rounding).max()
        except LinAlgError:  # Q with entries too far apart for the solver
            return math.inf

    optimum = np.log(np.maximum(start, 0.01))
    for _ in range(SEARCHES):
        optimum = minimize(off, optimum, method="Nelder-Mead", options={"maxiter": 150, "xatol": 1e-3, "fatol": 1e-3}).x
    return weights(optimum), off(optimum)


def lqr_gains() -> Claim:
    """Judge whether Table 2's K_e is an LQR gain."""
    A, B, K = printed_model().A_e, printed_model().B_e, np.array(K_E)
    least, candidate, Q, recovered = inverse_optimality(A, B, K)
    diagonal, off = nearest_diagonal(A, B, K, K_E_ROUNDING, candidate)
    return Claim(
        "Table 2, K_e",
        "K_e = [35, 4, -1, 0.3] are LQR gains; the weights are not given.",
        holds=recovered is not None and recovered < 1e-6,
        conditions="" if off < 1.0 else "The cost is not a weighted sum of squares of the single states.",
        figures={
            "least_return_difference": least,
            "recovered_gain_relative_error": recovered,
            "Q": Q,
            "diagonal_candidate": candidate,
            "diagonal_within_rounding": diagonal,
            "gain_within_rounding": lqr_gain(A, B, np.diag(diagonal)),
            "difference_by_rounding": off,
        },
    )


# --- the rest ---------------------------------------------------------------------------------------------------

SEED, WORLDS = 73_000, 6
DURATION_S = 26.0
AVERAGED_S = 6.0
"""The last so many seconds are averaged [s]; the slowest poles, -0.2 +- 0.29j 1/s, have then faded to 2 %."""
BIAS_DEG = 0.5
ASSUMED = {"e": f"{BIAS_DEG:g} deg", "noise": PUSH_RECOVERY["noise"]}

TRUE_RATE = "the true rate, (8)"
ESTIMATED = ['controller.angle_source="estimated"']
CASES = {
    TRUE_RATE: ("homogeneous", ['controller.feedback="truth"']),
    "(10), estimated angles": ("ltv", ESTIMATED),
    "(11), estimated angles": ("homogeneous", ESTIMATED),
}
"""The law's inputs -> the observer, and the settings."""


class Rest(NamedTuple):
    """Means over the last seconds, over the worlds."""

    x1: Interval
    """Tilt [deg]."""
    x3: Interval
    """Gimbal angle [deg]."""
    x_e: Interval
    """Integrator [rad s]."""
    x2_estimated: Interval
    """The observer's rate, whose true mean is zero [rad/s]."""
    example: Trajectory
    """World 0."""

    def is_at_zero(self, expected_x_e: float) -> bool:
        """Return true if x rests at zero and the integrator where it should, to a twentieth of e and of the offset."""
        return abs(self.x1.mean) < BIAS_DEG / 20.0 and abs(self.x_e.mean / expected_x_e - 1.0) < 0.05


def find_rests(cases: Iterable[str], worlds: int, seed: int, *extra: str) -> dict[str, Rest]:
    """Let the rig come to rest, without a push, in some of `CASES`, with settings beside their own."""
    common = ["push=[]", "plant.initial_tilt_deg=0.0", f"plant.equilibrium_bias_deg={BIAS_DEG}"]
    loops = {case: (CASES[case][0], [*common, *CASES[case][1], *extra]) for case in cases}
    results = run_loops(loops, worlds, seed, DURATION_S)
    degree, rests = math.degrees(1.0), {}
    for case, result in results.items():
        run = trajectory_of(result)
        late = run["time_s"] >= DURATION_S - AVERAGED_S
        rate = f"estimate/{CASES[case][0]}/x2_rad_s"
        factors = {"x1_rad": degree, "x3_rad": degree, "x_e_rad_times_s": 1.0, rate: 1.0}
        x1, x3, x_e, x2 = (mean_interval(factor * run[name][late].mean(axis=0)) for name, factor in factors.items())
        rests[case] = Rest(x1, x3, x_e, x2, run.world(0))
    return rests


def steady(observer: str, e_deg: float, sigma: float) -> tuple[float, float]:
    """Replay an observer on the rig at rest on average: y2 = 0, u = 0, y1 = -e and white noise.

    The noise matters to (11) alone: its gains fall with the size of its error, so that noise adds to its bias.

    Args:
        observer: Its name.
        e_deg: The bias [deg].
        sigma: Standard deviation of y1's noise [rad].

    Returns:
        The means of its x1 [rad] and x2 [rad/s].
    """
    ticks, settling, copies = 1200, 400, 64
    noise = np.random.default_rng(SEED).normal(0.0, sigma, (ticks, copies))
    noise = np.hstack([noise, -noise])  # whose mean is zero
    estimate = replay_at_rest(make_observer(observer, DT, printed_model()), noise - math.radians(e_deg))
    return estimate.x1[settling:].mean(), estimate.x2[settling:].mean()


def expected_integrator(observer: str, sigma: float) -> float:
    """x_e at which the command of the law on an observer's estimates is zero: 0 = k1 x1 + k2 x2 + k4 x_e [rad s]."""
    k1, k2, _, k4 = K_E
    x1, x2 = steady(observer, BIAS_DEG, sigma)
    return -(k1 * x1 + k2 * x2) / k4


def laws_claim(rest: Rest, static: Rest) -> Claim:
    """Judge (8), and (7), which has no integrator."""
    k1, _, k3, k4 = K_E
    x_e, x3 = k1 / k4 * math.radians(BIAS_DEG), k1 / k3 * BIAS_DEG
    return Claim(
        "(7), (8) on the rig",
        "Without the integrator the gimbal rests away from zero; with it x converges to zero.",
        assumes=ASSUMED,
        holds=rest.is_at_zero(x_e) and abs(static.x3.mean / x3 - 1.0) < 0.05,
        conditions="With the signs that follow from y1 = x1 - e: k1/k3 e and +k_e1/k_e4 e.",
        figures={
            "gimbal_rest_without_integrator_deg": static.x3.mean,
            "gimbal_rest_expected_deg": x3,
            "tilt_rest_deg": rest.x1,
            "gimbal_rest_deg": rest.x3,
            "integrator_rest_rad_s": rest.x_e,
            "integrator_expected_rad_s": x_e,
        },
    )


def observers_claim(rests: Mapping[str, Rest]) -> Claim:
    """Judge the rests by case, with an observer in the law, which the bias biases."""
    example = rests[TRUE_RATE].example
    sigma = float(np.std(example["y1_rad"] - example["x1_rad"]))
    figures, at_zero, integrators, tilts = {}, [], [], []
    for i, (case, rest) in enumerate(rests.items()):
        integrators.append(trace(rest.example, "x_e_rad_times_s", case, color=i))
        tilts.append(trace(rest.example, "x1_rad", color=i, width=0.5))
        if case == TRUE_RATE:
            continue
        expected = expected_integrator(CASES[case][0], sigma)
        at_zero.append(rest.is_at_zero(expected))
        figures |= {
            f"tilt_rest {case}_deg": rest.x1,
            f"integrator_rest {case}_rad_s": rest.x_e,
            f"integrator_expected {case}_rad_s": expected,
            f"rate_estimated {case}_rad_s": rest.x2_estimated,
        }
    return Claim(
        "After (10), the equilibrium",
        "The integral action makes x = 0 the equilibrium even with an observer whose estimate e biases.",
        assumes=ASSUMED,
        holds=all(at_zero),
        figures=figures,
        picture=Picture(
            "aranovskiy2020-equilibrium",
            "aranovskiy2020, Section III and after (10): the way to rest from the upright, "
            f"e = {BIAS_DEG:g} deg, world 0",
            [Panel("integrator x_e [rad s]", integrators), Panel("tilt x1 [deg]", tilts)],
        ),
    )


def rest_claims() -> list[Claim]:
    """Judge the laws with the true rate, then with observers."""
    static = find_rests([TRUE_RATE], 2, SEED, "controller.gains=[35.0, 4.0, -1.0, 0.0]")
    rests = find_rests(CASES, WORLDS, SEED)
    return [laws_claim(rests[TRUE_RATE], static[TRUE_RATE]), observers_claim(rests)]

"""The gains K_e: are they those of an LQR, and where does the closed loop rest with them on the six-body model?"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, solve_continuous_are
from scipy.optimize import minimize

from cmg_mj.observers import make_observer
from cmg_mj.papers.aranovskiy2020.paper import K_E, K_E_ROUNDING, gimbal_rest, integrator_rest, printed_model
from cmg_mj.papers.aranovskiy2020.rig import DT, push_recovery, replay_at_rest
from cmg_mj.papers.assumed import PUSH_RECOVERY
from cmg_mj.papers.claim import Assumption, Claim, OnShare
from cmg_mj.papers.recorded import trajectory_of
from cmg_mj.results.intervals import Interval, mean_interval
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.side_by_side import run_of, run_side_by_side
from cmg_mj.view.plots.figure import Line, Panel, Picture


class Inverse(NamedTuple):
    """The answer of the return difference for a gain."""

    least: float
    """min over w of |1 + K (jw - A)^-1 B|."""
    optimal: bool
    """True if some Q >= 0 makes K the LQR gain (Kalman 1964: the minimum is not below 1)."""
    Q: np.ndarray | None
    """A Q of that kind, (n, n), of rank 1."""
    recovered: float
    """Relative error of the Riccati equation's gain for that Q."""
    diagonal: np.ndarray
    """The one diagonal of Q that would give K: with a negative entry no diagonal Q >= 0 does."""


def inverse_optimality(A: np.ndarray, B: np.ndarray, K: np.ndarray) -> Inverse:
    """Decide whether K is the LQR gain of x' = A x + B u for some cost x' Q x + u^2.

    With d the open-loop and p the closed-loop polynomial and n_i/d the transfer function to x_i, a cost Q = diag(q)
    gives |p(jw)|^2 - |d(jw)|^2 = sum of q_i |n_i(jw)|^2, and Q = c c' gives |sum of c_i n_i|^2.

    Args:
        A: State matrix, (n, n).
        B: Input matrix, (n, 1).
        K: Gain, (n,).

    Returns:
        The answer.
    """
    n = len(A)
    d, p = np.poly(A), np.poly(A - B @ K[None, :])
    unit = np.eye(n)
    numerators = np.array([np.poly(A - B @ unit[i][None, :]) - d for i in range(n)])  # d + n_i is that of u = -x_i
    gap = (_squared(p) - _squared(d))[1:]  # in w^2, degree n - 1
    roots = np.roots(gap)
    crossings = [w for w in roots if abs(w.imag) < 1e-9 * (1.0 + abs(w)) and w.real > 0.0]
    grid = np.concatenate([np.logspace(-6, 8, 4001), [abs(w.real) for w in crossings]])
    ratio = np.polyval(_squared(p), grid) / np.polyval(_squared(d), grid)
    optimal = bool(np.polyval(gap, grid).min() >= 0.0 and gap[-1] >= 0.0)
    basis = np.column_stack([_squared(row) for row in numerators])[1:]
    diagonal = np.linalg.lstsq(basis, gap, rcond=None)[0]
    if not optimal:
        return Inverse(float(np.sqrt(ratio.min())), False, None, math.inf, diagonal)
    # Spectral factor: the half of the roots of gap(-s^2) to the left.
    left_roots = [-np.sqrt(-w) if np.sqrt(-w).real > 0.0 else np.sqrt(-w) for w in roots.astype(complex)]
    factor = math.sqrt(abs(gap[0])) * np.real(np.poly(left_roots))
    c = np.linalg.solve(numerators[:, 1:].T, factor)
    Q = np.outer(c, c)
    P = solve_continuous_are(A, B, Q, np.eye(1))
    recovered = float(np.abs((B.T @ P)[0] / K - 1.0).max())
    return Inverse(float(np.sqrt(ratio.min())), True, Q, recovered, diagonal)


def _squared(polynomial: np.ndarray) -> np.ndarray:
    """Return |p(jw)|^2 as a polynomial in w^2, highest power first."""
    n = len(polynomial) - 1
    mirrored = polynomial * (-1.0) ** (n - np.arange(n + 1))
    even = np.convolve(polynomial, mirrored)[::2]  # p(s) p(-s) in s^2
    return even * (-1.0) ** (n - np.arange(n + 1))  # s^2 = -w^2


class Diagonal(NamedTuple):
    """The diagonal Q whose LQR gain comes nearest to a printed one."""

    Q: np.ndarray
    """Entries of the diagonal, none below 0, (n,)."""
    gain: np.ndarray
    """LQR gain with R = 1, (n,)."""
    off: float
    """Largest difference from the printed gain, by half a unit of the digit it is printed with: 1 is rounding's."""


def lqr_gain(A: np.ndarray, B: np.ndarray, diagonal: np.ndarray) -> np.ndarray:
    """Return the gain for Q = diag(diagonal), R = 1, (n,)."""
    return (B.T @ solve_continuous_are(A, B, np.diag(diagonal), np.eye(1)))[0]


LEAST_WEIGHT = 1e-3
"""Least weight in a diagonal Q: a state that hardly counts."""


def nearest_diagonal(
    A: np.ndarray, B: np.ndarray, K: np.ndarray, rounding: np.ndarray, start: np.ndarray, searches: int = 3
) -> Diagonal:
    """Search the diagonal Q whose gain comes nearest to K.

    Args:
        A: State matrix, (n, n).
        B: Input matrix, (n, 1).
        K: The gain as printed, (n,).
        rounding: Half a unit of the digit that each entry of it is printed with, (n,).
        start: A diagonal near the one sought, (n,); entries below 0.01 count as 0.01.
        searches: Number of starts of the search, each from where it ended: a simplex may collapse.

    Returns:
        The best that was found.
    """

    def weights(logarithms: np.ndarray) -> np.ndarray:
        return np.maximum(np.exp(logarithms), LEAST_WEIGHT)

    def off(logarithms: np.ndarray) -> float:
        try:
            return float((np.abs(lqr_gain(A, B, weights(logarithms)) - K) / rounding).max())
        except LinAlgError:  # Q with entries too far apart for the solver
            return math.inf

    optimum = np.log(np.maximum(start, 0.01))
    for _ in range(searches):
        optimum = minimize(off, optimum, method="Nelder-Mead", options={"maxiter": 150, "xatol": 1e-3, "fatol": 1e-3}).x
    return Diagonal(weights(optimum), lqr_gain(A, B, weights(optimum)), off(optimum))


def lqr_gains() -> Claim:
    """Judge whether Table 2's K_e is an LQR gain."""
    model = printed_model()
    K = np.array(K_E)
    inverse = inverse_optimality(model.A_e, model.B_e, K)
    nearest = nearest_diagonal(model.A_e, model.B_e, K, np.array(K_E_ROUNDING), inverse.diagonal)
    return Claim(
        place="Table 2, K_e",
        statement="K_e = [35, 4, -1, 0.3] are LQR gains; the weights are not given.",
        holds=inverse.optimal and inverse.recovered < 1e-6,
        conditions=(
            ""
            if nearest.off < 1.0
            else "The cost is not a weighted sum of squares of the single states, not even to the digits printed."
        ),
        otherwise="They are no LQR gains.",
        figures={
            "least_return_difference": inverse.least,
            "recovered_gain_relative_error": inverse.recovered if inverse.optimal else None,
            "Q": None if inverse.Q is None else inverse.Q.tolist(),
            "diagonal_candidate": inverse.diagonal.tolist(),
            "diagonal_within_rounding": nearest.Q.tolist(),
            "gain_within_rounding": nearest.gain.tolist(),
            "difference_by_rounding": nearest.off,
        },
    )


def optimality_claims(on_share: OnShare) -> list[Claim]:
    """Judge the gains of (8)."""
    return [lqr_gains()]


SEED = 73_000
WORLDS = 6
DURATION_S = 26.0
AVERAGED_S = 6.0
"""The last so many seconds are averaged [s]; the slowest poles, -0.2 +- 0.29j 1/s, have then faded to 2 %."""
BIAS_DEG = 0.5
ASSUMED: Mapping[Assumption, str] = {"e": f"{BIAS_DEG:g} deg", "noise": PUSH_RECOVERY["noise"]}

TRUE_RATE = "the true rate, (8)"


class Case(NamedTuple):
    """The law's inputs in one case."""

    observer: str
    settings: Sequence[str]
    true_rate: bool = False
    estimated_angles: bool = False


ESTIMATED = ['controller.angle_source="estimated"']
CASES = {
    TRUE_RATE: Case("homogeneous", ['controller.feedback="truth"'], true_rate=True),
    "(10), estimated angles": Case("ltv", ESTIMATED, estimated_angles=True),
    "(11), estimated angles": Case("homogeneous", ESTIMATED, estimated_angles=True),
}


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


def find_rests(cases: Sequence[tuple[str, int, Sequence[str]]], seed: int) -> list[Rest]:
    """Let the rig come to rest, without a push: a case of `CASES`, how many worlds, and settings beside its own."""
    common = ["push=[]", "plant.initial_tilt_deg=0.0", f"plant.equilibrium_bias_deg={BIAS_DEG}"]
    runs = []
    for case, worlds, extra in cases:
        observer, settings, *_ = CASES[case]
        runs.append(run_of(push_recovery(observer, seed, [*common, *settings, *extra], DURATION_S), worlds))
    results = run_side_by_side(runs)
    return [
        _average(CASES[case].observer, trajectory_of(result)) for (case, *_), result in zip(cases, results, strict=True)
    ]


def _average(observer: str, trajectory: Trajectory) -> Rest:
    late = trajectory["time_s"] >= DURATION_S - AVERAGED_S

    def mean(name: str, factor: float = 1.0) -> Interval:
        return mean_interval(factor * trajectory[name][late].mean(axis=0))

    degrees = math.degrees(1.0)
    rate = mean(f"estimate/{observer}/x2_rad_s")
    return Rest(mean("x1_rad", degrees), mean("x3_rad", degrees), mean("x_e_rad_times_s"), rate, trajectory.world(0))


def steady(observer: str, e_deg: float, sigma: float, seed: int = SEED) -> tuple[float, float]:
    """Replay an observer on the rig at rest on average: y2 = 0, u = 0, y1 = -e and white noise.

    The noise matters to (11) alone: its gains fall with the size of its error, so that noise adds to its bias.

    Args:
        observer: Its name.
        e_deg: The bias [deg].
        sigma: Standard deviation of y1's noise [rad].
        seed: Seed of the noise.

    Returns:
        The means of its x1 [rad] and x2 [rad/s].
    """
    ticks, settling, copies = 1200, 400, 64
    noise = np.random.default_rng(seed).normal(0.0, sigma, (ticks, copies))
    noise = np.hstack([noise, -noise])  # whose mean is zero
    estimate = replay_at_rest(make_observer(observer, DT, printed_model()), noise - math.radians(e_deg))
    return float(estimate.x1[settling:].mean()), float(estimate.x2[settling:].mean())


def expected_integrator(case: str, e_deg: float, sigma: float, seed: int = SEED) -> float:
    """x_e at which the law's command is zero [rad s]: 0 = k1 x1 + k2 x2 + k4 x_e, of what the law is fed with."""
    observer, _, true_rate, estimated_angles = CASES[case]
    k1, k2, _, k4 = K_E
    x1, x2 = steady(observer, e_deg, sigma, seed)
    x1 = x1 if estimated_angles else -math.radians(e_deg)
    x2 = 0.0 if true_rate else x2
    return -(k1 * x1 + k2 * x2) / k4


def laws_claim(rest: Rest, static: Rest) -> Claim:
    """Judge (8), and (7), which has no integrator."""
    x_e, x3 = integrator_rest(math.radians(BIAS_DEG)), gimbal_rest(BIAS_DEG)
    return Claim(
        place="(7), (8) on the rig",
        statement="Without the integrator the gimbal rests away from zero; with it x converges to zero.",
        assumes=ASSUMED,
        holds=rest.is_at_zero(x_e) and abs(static.x3.mean / x3 - 1.0) < 0.05,
        conditions="With the signs that follow from y1 = x1 - e: k1/k3 e and +k_e1/k_e4 e.",
        otherwise="They rest elsewhere.",
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
    observer_rests = {case: rest for case, rest in rests.items() if case != TRUE_RATE}
    example = rests[TRUE_RATE].example
    sigma = float(np.std(example["y1_rad"] - example["x1_rad"]))
    expected_x_e = {case: expected_integrator(case, BIAS_DEG, sigma) for case in observer_rests}
    return Claim(
        place="After (10), the equilibrium",
        statement="The integral action makes x = 0 the equilibrium even with an observer whose estimate e biases.",
        assumes=ASSUMED,
        holds=all(rest.is_at_zero(expected_x_e[case]) for case, rest in observer_rests.items()),
        otherwise="The rest is not where it should be.",
        figures={
            key: value
            for case, rest in observer_rests.items()
            for key, value in (
                (f"tilt_rest {case}_deg", rest.x1),
                (f"integrator_rest {case}_rad_s", rest.x_e),
                (f"integrator_expected {case}_rad_s", expected_x_e[case]),
                (f"rate_estimated {case}_rad_s", rest.x2_estimated),
            )
        },
        pictures=[_picture(rests)],
    )


def _picture(rests: Mapping[str, Rest]) -> Picture:
    integrators, tilts = [], []
    for i, (case, rest) in enumerate(rests.items()):
        t = rest.example["time_s"]
        integrators.append(Line(t, rest.example["x_e_rad_times_s"], case, color=i))
        tilts.append(Line(t, np.degrees(rest.example["x1_rad"]), color=i, width=0.5))
    return Picture(
        "aranovskiy2020-equilibrium",
        f"aranovskiy2020, Section III and after (10): the way to rest from the upright, e = {BIAS_DEG:g} deg, world 0",
        [Panel("integrator x_e [rad s]", integrators), Panel("tilt x1 [deg]", tilts)],
    )


def rest_claims(on_share: OnShare) -> list[Claim]:
    """Judge the laws with the true rate, then with observers."""
    without_integrator = (TRUE_RATE, 2, ["controller.gains=[35.0, 4.0, -1.0, 0.0]"])
    *case_rests, static = find_rests([*((case, WORLDS, ()) for case in CASES), without_integrator], SEED)
    on_share(0.9)
    rests = dict(zip(CASES, case_rests, strict=True))
    return [laws_claim(rests[TRUE_RATE], static), observers_claim(rests)]

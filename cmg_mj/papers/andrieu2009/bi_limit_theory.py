"""Sections 1, 2 and 4 of andrieu2009: its inequalities, theorems and remarks, checked by numbers."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence

import numpy as np
from scipy.integrate import solve_ivp

from cmg_mj.elementwise import signed_power
from cmg_mj.papers.andrieu2009.bi_limit import BiLimitCorrection, largest_b, violated_conditions, weights
from cmg_mj.papers.andrieu2009.bioreactor_study import B, P
from cmg_mj.papers.andrieu2009.finite_escape import no_observer_beyond_1
from cmg_mj.papers.andrieu2009.updated_high_gain import UpdatedHighGain, updated_gain
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.picture import Line, Panel, Picture

START_ERRORS = (-1e3, -1e2, -10.0, -1.0, 1.0, 10.0, 1e2, 1e3)
NOISE_AMPLITUDES = (1e-1, 1e-2, 1e-3)
PLAIN, UPDATED, HOMOGENEOUS = "constant gain, linear", "updated gain, linear", "updated gain, homogeneous"


def claims(on_share: OnShare) -> list[Claim]:
    """Sections 1, 2 and 4."""
    parts = [increments, no_observer_beyond_1, scaling_conditions, gain_tracking, chain_of_integrators, theorem_1]
    found = []
    for i, part in enumerate(parts):
        on_share(i / len(parts))
        found.append(part())
    return found


def largest_increment(p: float) -> float:
    """Worst quotient of the two sides of (3) for g = 0, over both signs and sizes from 1e-4 to 1e4.

    g adds |g| |x2 - x2_hat| to both sides at most.
    """
    positive = np.geomspace(1e-4, 1e4, 161)
    x2 = np.concatenate([-positive, [0.0], positive])
    x2, x2_hat = np.meshgrid(x2, x2)
    d = np.abs(x2 - x2_hat)
    left = np.abs(signed_power(x2, 1.0 + p) - signed_power(x2_hat, 1.0 + p))
    right = (1.0 + p) * np.abs(x2_hat) ** p * d + d ** (1.0 + p)
    apart = d > 1e-6 * np.maximum(np.abs(x2), np.abs(x2_hat))  # nearer, the left side is rounding errors
    return float((left[apart] / right[apart]).max())


def increments() -> Claim:
    """(2), (3)."""
    worst = {p: largest_increment(p) for p in (0.1, 0.5, 0.9, 1.0, 1.5, 2.0)}
    inside = max(quotient for p, quotient in worst.items() if p < 1.0)
    return Claim(
        place="Section 1, (3)",
        says="For 0 < p < 1 the increments of f2 = g(x1) x2 + x2^(1+p) + u are bounded by (|g| + (1+p) |x2_hat|^p) "
        "|x2 - x2_hat| + |x2 - x2_hat|^(1+p).",
        found=f"Over both signs and sizes from 1e-4 to 1e4 the left side is at most {inside:.6f} of the right side "
        f"for p = 0.1, 0.5, 0.9. The check can fail: for p = 1.5 and 2 the quotient is {worst[1.5]:.3f} and "
        f"{worst[2.0]:.3f}.",
        verdict=verdict(inside <= 1.0 + 1e-9),
        figures={"worst_quotient_by_p": {str(p): quotient for p, quotient in worst.items()}},
    )


def scaling_conditions() -> Claim:
    """(21), (22) and the parameters of section 3.1."""
    lines = violated_conditions(2, P, B, (P,))
    bound = largest_b(2, P, (P,))
    kept = not lines
    return Claim(
        place="Section 4.3, (21), (22)",
        says=f"b satisfies (21), (22), and section 3.1 uses b = {B} with p = {P}.",
        found=f"For n = 2 both ask for b < (1 - p)/p = {bound:.4f}. With the printed values {len(lines)} inequalities "
        f"do not hold: {'; '.join(lines)}.",
        verdict=verdict(kept),
        why=""
        if kept
        else "The parameters of the simulation are outside the theorem's proof. It does no harm there: the argument "
        "of the correction is so small that b and p have no effect (see the claim on the correction). With the "
        "limited x2_hat Omega_2 is bounded, so that (22) could be dropped, but not (21).",
        figures={"b": B, "largest_b": bound, "violated_count": len(lines)},
    )


def tracking_error(rate: float, phi1: float = 0.5, phi2: float = 1.0, phi3: float = 1.0) -> tuple[float, float]:
    """L behind phi2 + phi3/phi1 Omega for Omega = 2 + sin(rate t): the largest error, and the least L - phi2."""
    dt = 0.01
    t = np.arange(0.0, 20.0 + 4.0 * math.pi / rate, dt)
    Omega = 2.0 + np.sin(rate * t)
    L, gains = phi2, []
    for value in Omega.tolist():
        gains.append(L)
        L = updated_gain(L, value, dt, phi1, phi2, phi3)
    L = np.array(gains)
    late = t > 20.0
    return float(np.abs(L - phi2 - phi3 / phi1 * Omega)[late].max()), float((L - phi2).min())


def gain_tracking() -> Claim:
    """(13) and the remark that L does not fall below phi2."""
    rates = (0.4, 0.2, 0.1, 0.05)
    errors, least = zip(*(tracking_error(rate) for rate in rates), strict=True)
    quotients = [a / b for a, b in itertools.pairwise(errors)]
    proportional = all(1.6 < quotient < 2.4 for quotient in quotients)
    above = min(least) >= 0.0
    return Claim(
        place="Section 2.2, (13)",
        says="L tracks phi2 + (phi3/phi1) Omega up to an error proportional to |Omega'|, and from L(0) >= phi2 stays "
        "at or above phi2.",
        found=f"For Omega = 2 + sin(w t) the largest error falls from {errors[0]:.3f} at w = {rates[0]} by factors "
        f"{', '.join(f'{quotient:.2f}' for quotient in quotients)} as w is halved; the least L - phi2 is "
        f"{min(least):.2g}.",
        verdict=verdict(proportional and above),
        figures={"omega_rate_rad_per_time": list(rates), "largest_error_of_L": list(errors)},
    )


def limits_error(correction: BiLimitCorrection, scale: float) -> tuple[float, float]:
    """Definition 1: how far K, dilated, is from its approximations at 0 and at infinity, on |e1| <= 1.

    Args:
        correction: K.
        scale: Lambda for infinity; its inverse for 0.

    Returns:
        The largest deviation of a component at 0 and at infinity, over its approximation's largest value.
    """
    e1 = np.linspace(-1.0, 1.0, 41)
    r = weights(correction.n, correction.d_inf)
    near = far = 0.0
    linear, power = e1, e1
    dilated = correction(e1 / scale), correction(scale ** r[0] * e1)
    for i in range(correction.n):
        linear = correction.l[i] * linear
        power = signed_power(correction.l[i] * power, r[i + 1] / r[i])
        near = max(near, float(np.abs(scale * dilated[0][i] + linear).max() / np.abs(linear).max()))
        far = max(far, float(np.abs(dilated[1][i] / scale ** r[i + 1] + power).max() / np.abs(power).max()))
    return near, far


def chain_errors(
    correction: BiLimitCorrection, sizes: Sequence[float], count: int, span: float, seed: int = 0
) -> float:
    """Let dE/dtau = S E + K(e1) run from random E of the given sizes.

    Args:
        correction: K.
        sizes: Lengths of E at the start.
        count: Random directions for each.
        span: Time tau to run.
        seed: Of the directions.

    Returns:
        The worst length at the end, over the length at the start; infinite if a solution could not be followed.
    """
    rng = np.random.default_rng(seed)
    n, worst = correction.n, 0.0

    def slope(_: float, E: np.ndarray) -> list[float]:
        *numbers, last = correction(float(E[0]))
        if not math.isfinite(last):  # LSODA would go on for ever
            raise OverflowError
        return [*(float(E[i + 1]) + number for i, number in enumerate(numbers)), last]

    for size in sizes:
        for _ in range(count):
            start = rng.normal(size=n)
            start *= size / np.linalg.norm(start)
            try:
                solution = solve_ivp(slope, (0.0, span), start, "LSODA", rtol=1e-6, atol=1e-9 * size)
            except OverflowError:
                return math.inf
            end = float(np.linalg.norm(solution.y[:, -1]))
            worst = max(worst, end / size if solution.success and math.isfinite(end) else math.inf)
    return worst


def recursive_l(n: int, ratio: float = 2.0) -> tuple[float, ...]:
    """l_i = ratio^(n - i)."""
    return tuple(ratio ** (n - i) for i in range(1, n + 1))


def chain_of_integrators() -> Claim:
    """Definition 1 and Theorem 2."""
    sizes, dimensions = (1e-3, 1.0, 1e3), (1, 2, 3)
    ends, limits = {}, {}
    for n in dimensions:
        for share in (0.0, 0.5, 0.9):
            d_inf = share / (n - 1) if n > 1 else share
            K = BiLimitCorrection(recursive_l(n), d_inf)
            ends[f"n={n}, d_inf={d_inf:g}"] = chain_errors(K, sizes, 3, 40.0)
            if d_inf:
                limits[f"n={n}, d_inf={d_inf:g}"] = [max(limits_error(K, scale)) for scale in (1e4, 1e8, 1e12)]
    worst = max(ends.values())
    shrinking = all(a > b > c for a, b, c in limits.values())
    growing = chain_errors(BiLimitCorrection((1.0, 2.0, 0.9), 0.2), (1.0,), 3, 40.0)
    why = (
        "Convergence is shown by simulation from random errors. The Lyapunov function W, and with it (19) and (20), "
        "is not constructed: its proof is in another report."
    )
    return Claim(
        place="Section 4.2, Theorem 2 (and Definition 1)",
        says="There is a K, homogeneous in the bi-limit, with which the error of a chain of integrators converges, "
        "for any n and any d_inf in [0, 1/(n-1)).",
        found="With l_i = 2^(n-i), n = 1, 2, 3, d_inf = 0 and half and 0.9 of its limit, errors of 1e-3, 1 and 1e3 "
        f"shrink to at most {worst:.1e} of their length within tau = 40. K, dilated by 1e4, 1e8, 1e12, approaches its "
        "approximations at 0 and infinity every time. Not every l will do: with l = (1, 2, 0.9), whose linear part "
        f"is Hurwitz, and d_inf = 0.2, an error of 1 is {growing:.0f} times as long by then.",
        verdict=verdict(worst < 1e-3 and shrinking, why),
        why=why,
        figures={
            "largest_final_error_ratio": ends,
            "deviation_from_limits_ratio": limits,
            "poor_l_final_error_ratio": growing,
        },
    )


def system_1(kind: str, dt: float, p: float = 0.5) -> UpdatedHighGain:
    """An observer for (1) with g(y) = y - 1, u being measured along with y."""

    def g(y: np.ndarray) -> np.ndarray:
        return y - 1.0

    def f2(u: None, y: tuple, x: tuple) -> np.ndarray:
        return g(y[0]) * x[0] + signed_power(x[0], 1.0 + p) + y[1]

    def Omega(u: None, y: tuple, x: tuple) -> np.ndarray:
        return (abs(g(y[0])) + 1.0 + p) * (1.0 + abs(x[0]) ** p)

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
    one = np.ones_like(start)
    state = observer.init((y[0], u[0] * one), (x1[0] * one, x2[0] + start))
    found, gains = [state.x[1] - x2[0]], [state.L]
    with np.errstate(all="ignore"):  # one of them may diverge
        for k in range(1, len(t)):
            state, x = observer.step(state, (y[k], u[k] * one), None)
            found.append(x[1] - x2[k])
            gains.append(state.L)
    return t, np.array(found), np.array(gains)


def theorem_1() -> Claim:
    """Theorem 1 on system (1)."""
    runs = {kind: recoveries(kind, START_ERRORS) for kind in (PLAIN, UPDATED)}
    t, error, L = recoveries(HOMOGENEOUS, START_ERRORS, NOISE_AMPLITUDES)
    n = len(START_ERRORS)
    runs[HOMOGENEOUS] = t, error[:, :n], L[:, :n]
    ends = {kind: [_finite(value) for value in np.abs(error[-1])] for kind, (_, error, _) in runs.items()}
    failed = {kind: sum(value is None or value > 1e-3 for value in values) for kind, values in ends.items()}
    largest = {kind: float(np.nanmax(L)) for kind, (_, _, L) in runs.items()}
    balls = [float(np.abs(error[t > 5.0, n + i]).max()) for i in range(len(NOISE_AMPLITUDES))]
    shrinks = all(a > 5.0 * b for a, b in itertools.pairwise(balls))
    why = "By simulation, for one p, one g and one solution, with phi1 = 0.5, phi2 = 2, phi3 = 1, l = (2, 1), b = 0.5."
    picture = Picture(
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
                y_range=(0.0, 1.1 * max(largest.values())),
            ),
        ],
    )
    return Claim(
        place="Section 2, Theorem 1 on system (1)",
        says="For p in [0, 1) the observer (7), (8) converges along bounded solutions of (1), to a ball that shrinks "
        "with the disturbances.",
        found=f"p = 0.5, x1 = sin t, errors of x2 from 1 to 1000 at the start: all {n} runs end below 1e-3, the worst "
        f"at {max(value or 0.0 for value in ends[HOMOGENEOUS]):.1e} at t = 10. With a measurement disturbance of "
        f"amplitude 0.1, 0.01, 0.001 the error stays below {balls[0]:.2g}, {balls[1]:.2g}, {balls[2]:.2g}. A constant "
        f"gain of 12 with linear correction fails in {failed[PLAIN]} of {n}; updated, with linear correction, in "
        f"{failed[UPDATED]}, but its gain has to rise to {largest[UPDATED]:.0f}, against {largest[HOMOGENEOUS]:.0f} "
        "with the homogeneous one.",
        verdict=verdict(failed[HOMOGENEOUS] == 0 and shrinks, why),
        why=why,
        figures={
            "final_error_x2": ends,
            "largest_gain": largest,
            "failed_count": failed,
            "error_bound_by_disturbance": dict(zip(map(str, NOISE_AMPLITUDES), balls, strict=True)),
        },
        pictures=[picture],
    )


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None

"""The misprints, and the settings of the simulation that the paper leaves open."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.dao2023 import paper
from cmg_mj.papers.dao2023.observer import FriedlandTacker
from cmg_mj.papers.dao2023.robot import follow, make_proposed, make_single, motion, starts

# --- The misprints, and the settings of the simulation that the paper leaves open ---

DT, DURATION_S = 0.005, 80.0


def as_printed_claims(on_share: OnShare) -> list[Claim]:
    """Judge the sampling and the misprints."""
    return [sampling_claim(lambda share: on_share(0.6 * share)), misprint_claim()]


def sampling_claim(on_share: OnShare) -> Claim:
    """Judge a sampled observer at Sigma = 1000; an explicit step is shown beside it, and does not count."""
    t = DT * np.arange(round(DURATION_S / DT) + 1)
    x = motion(starts(1, 4), t)
    rms = follow(make_proposed(DT, (1000.0,)), t, x, on_share).tail_rms()[0]
    escape = explicit_escape(1000.0, DT, 10.0)
    return Claim(
        place="Section 3.2, simulation",
        statement="The observer is simulated at Sigma = 1000 (the paper does not say how).",
        assumes={"initial values": f"{len(rms)} motions", "control rate": "200 Hz", "method": "our implicit step"},
        holds=bool(rms.max() < 0.1),
        figures={
            "state_rms_64_80_s": rms.tolist(),
            "explicit_step_escapes_after_s": escape if math.isfinite(escape) else None,
        },
    )


def explicit_escape(sigma: float, dt: float, duration: float, seed: int = 0) -> float:
    """Find when a Runge-Kutta step of (7) to (9) at a sample rate has left every bound: infinite if never [s].

    Args:
        sigma: The weight Sigma.
        dt: Sample period [s].
        duration: Time to try [s].
        seed: Seed of the initial values.

    Returns:
        The time at which an estimate passes 1e9.
    """
    observer = make_single(dt, sigma)
    t = dt * np.arange(round(duration / dt) + 1)
    q = motion(starts(seed, 1), t)[:, 0, 0]

    def slope(time: float, s: np.ndarray, y: float) -> np.ndarray:
        system = paper.system(y, paper.torque(time))
        parts = observer.slope(time, s[:2], s[2:6], s[6:].reshape(2, 4), system, np.zeros(1), np.array([y]))
        return np.concatenate([part.ravel() for part in parts])

    s = np.zeros(14)
    for k, time in enumerate(t[:-1].tolist()):
        middle = (q[k] + q[k + 1]) / 2.0
        k1 = slope(time, s, q[k])
        k2 = slope(time + dt / 2.0, s + dt / 2.0 * k1, middle)
        k3 = slope(time + dt / 2.0, s + dt / 2.0 * k2, middle)
        s = s + dt / 6.0 * (k1 + 2.0 * (k2 + k3) + slope(time + dt, s + dt * k3, q[k + 1]))
        if not np.abs(s).max() < 1e9:
            return time + dt
    return math.inf


def misprint_claim() -> Claim:
    """Judge L as a row, and (10) against (14)."""
    row, column = (L.shape[1] == paper.system(0.0, 0.0).C2.shape[0] for L in (paper.L_PRINTED, paper.L))
    polynomial, amplitude = np.poly(paper.error_matrix()), amplitude_under_10()
    by_10, by_14 = abs(amplitude / paper.THETA[1] - 1.0).max(), abs(amplitude - 1.0).max()
    return Claim(
        place="L, (7), (10), (14) as printed",
        statement="L = -[1 1] makes A + L C2 Hurwitz, and (14) is (10) rearranged.",
        holds=column and bool(np.all(polynomial > 0.0)) and bool(min(by_10, by_14) < 0.025),
        conditions=" ".join(_corrections(row=row, rearranged=bool(by_14 < by_10))),
        otherwise="L does not make it Hurwitz, or the observer finds another disturbance than (10) or (14) has.",
        figures={
            "polynomial_of_A_plus_L_C2": polynomial.tolist(),
            "disturbance_amplitude_found_if_10_holds_rad_s2": amplitude.tolist(),
        },
    )


def _corrections(*, row: bool, rearranged: bool) -> list[str]:
    """List the corrections to the printed equations."""
    sentences = [
        "(7) needs B2 u and the hats of its estimates; the example has B2 = 0, so that it does not show there."
    ]
    if not rearranged:
        sentences.insert(0, "(14), not (10), scales d.")
    if not row:
        sentences.insert(0, "L is the column -[1; 1].")
    return sentences


def amplitude_under_10() -> np.ndarray:
    """Estimate the amplitude of the disturbance on an arm that moves by (10), one a motion [rad/s^2]."""
    t = DT * np.arange(round(DURATION_S / DT) + 1)
    x = motion(starts(3, 3), t, coefficient=paper.THETA[1])
    late = t >= 0.8 * DURATION_S
    error = follow(make_proposed(DT, (1000.0,)), t, x).exogenous[late, 0, :, 2]
    return np.sqrt(2.0 * np.mean((error + paper.disturbance(t[late])[:, None]) ** 2, axis=0))


# --- The consequences of (7) to (9) along the robot ---


def identities_claims(on_share: OnShare) -> list[Claim]:
    """Judge the separated errors and Upsilon."""
    return [separated_errors(on_share), upsilon()]


def separated_errors(on_share: OnShare) -> Claim:
    """Judge whether the error of the state parts from that of the exosystem."""
    errors, sizes = {}, []
    for i, (sigma, duration) in enumerate(((0.1, 6.0), (10.0, 6.0), (1000.0, 1.5))):
        errors[f"continuous_sigma_{sigma:g}"], size = continuous_deviation(sigma, duration)
        sizes.append(size)
        on_share(0.2 * (i + 1))
    errors["200_hz_sigma_1000"], size = sampled_deviation(1000.0, 0.005, 40.0)
    largest = max(errors.values())
    return Claim(
        place="Equations (7) to (9)",
        statement="With T from (8), the error of the state decouples from that of the exosystem.",
        is_general=True,
        assumes={"initial values": "one motion", "control rate": "200 Hz"},
        holds=largest < 1e-8,
        conditions="On the pendulum robot. The paper has (7) to (9) for any system, and does not say that they "
        "decouple the errors.",
        is_ours=True,
        figures={"identity_error": errors, "largest_z": max(*sizes, size)},
    )


def continuous_run(
    sigma: float, start: np.ndarray, state: np.ndarray, t: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Integrate the arm and (7) to (9) in continuous time, as one.

    Args:
        sigma: The weight Sigma.
        start: q and its rate, (2,).
        state: The observer's x and xm, (6,); T starts at zero.
        t: Times, (n_times,) [s].
        tolerance: Tolerance of the integrator, relative and absolute.

    Returns:
        The arm's x (n_times, 2), the observer's x (n_times, 2), xm (n_times, 4) and T (n_times, 2, 4).
    """
    observer = make_single(1.0, sigma)
    no_input = np.zeros(1)

    def slope(time: float, s: np.ndarray) -> np.ndarray:
        system = paper.system(s[0], paper.torque(time))
        parts = observer.slope(time, s[2:4], s[4:8], s[8:].reshape(2, 4), system, no_input, s[:1])
        return np.concatenate([[s[1], paper.acceleration(s[0], time)], *(part.ravel() for part in parts)])

    begin = np.concatenate([start, state, np.zeros(8)])
    s = solve_ivp(slope, (t[0], t[-1]), begin, "DOP853", t, rtol=tolerance, atol=tolerance).y.T
    return s[:, :2], s[:, 2:4], s[:, 4:8], s[:, 8:].reshape(-1, 2, 4)


def continuous_deviation(sigma: float, duration: float, seed: int = 0, tolerance: float = 1e-11) -> tuple[float, float]:
    """Measure the deviation of z = (x^ - x) - T (xm^ - xm) from exp((A + L C2) t) z(0), along the chaotic arm.

    Args:
        sigma: The weight Sigma.
        duration: Simulated time [s].
        seed: Seed of the initial values.
        tolerance: Tolerance of the integrator.

    Returns:
        The largest deviation, and the largest |z| for comparison.
    """
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, duration, 21)
    x, x_hat, xm, T = continuous_run(sigma, starts(seed, 1)[0], rng.normal(0.0, 1.0, 6), t, tolerance)
    z = x_hat - x - np.einsum("kij,kj->ki", T, xm - paper.exosystem_state(t))
    exact_z = np.array([expm(paper.error_matrix() * time) @ z[0] for time in t])
    return float(np.abs(z - exact_z).max()), float(np.abs(z).max())


def sampled_deviation(sigma: float, dt: float, duration: float, seed: int = 0) -> tuple[float, float]:
    """Measure the deviation in discrete time: z+ = (I - h/2 M)^-1 (I + h/2 M) z for the arm by the midpoint rule.

    Args:
        sigma: The weight Sigma.
        dt: Sample period [s].
        duration: Simulated time [s].
        seed: Seed of the initial values.

    Returns:
        The largest deviation, and the largest |z| for comparison.
    """
    rng = np.random.default_rng(seed)
    observer = make_single(dt, sigma)
    q, rate = starts(seed, 1)[0].tolist()
    state = observer.init(np.array([q]), x=rng.normal(0.0, 1.0, 2), xm=rng.normal(0.0, 1.0, 4))
    F, half = expm(paper.A_M * dt), dt / 2.0 * paper.error_matrix()
    onward = np.linalg.solve(np.eye(2) - half, np.eye(2) + half)
    xm = paper.exosystem_state(0.0)
    z = state.x - [q, rate] - state.T @ (state.xm - xm)
    largest, size = 0.0, float(np.abs(z).max())
    for k in range(round(duration / dt)):
        u = float(paper.torque((k + 0.5) * dt))
        input_acceleration = paper.THETA[1] * u + float((paper.C_M @ (xm + F @ xm))[2]) / 2.0
        q_next, rate_next = _midpoint_step(q, rate, input_acceleration, dt)
        state = observer.step(state, paper.system((q + q_next) / 2.0, u), np.zeros(1), np.array([q_next]))
        q, rate, xm = q_next, rate_next, F @ xm
        z = onward @ z
        largest = max(largest, float(np.abs(state.x - [q, rate] - state.T @ (state.xm - xm) - z).max()))
    return largest, size


def _midpoint_step(q: float, rate: float, input_acceleration: float, dt: float) -> tuple[float, float]:
    """Take one step of the implicit midpoint rule, the input's share of the arm's acceleration held."""
    q_next, rate_next = q, rate
    for _ in range(12):  # a contraction by dt^2 theta1/4 each time
        rate_next = rate + dt * (input_acceleration - paper.THETA[0] * math.sin((q + q_next) / 2.0))
        q_next = q + dt * (rate + rate_next) / 2.0
    return q_next, rate_next


def upsilon() -> Claim:
    """Judge the relation between Upsilon and T."""
    matrix_gap, estimate_gap = upsilon_gaps(10.0, 0.005, 15.0)
    correction = (
        "For any system, of which the pendulum robot was tried. Upsilon's equation must have "
        "(B0 + L D20) Cm exp(Am t), not (B0 + L D20), unless Am = 0. So read, the proposed observer is the "
        "conventional one of the constant xm(0): its estimate of x is the same."
    )
    return Claim(
        place="Section 2.2, last equation",
        statement="The conventional observer's Upsilon is T exp(Am t).",
        is_general=True,
        holds=matrix_gap < 1e-9 and estimate_gap < 1e-9,
        conditions=correction,
        otherwise=correction,
        figures={"upsilon_gap": matrix_gap, "state_gap": estimate_gap},
    )


def upsilon_gaps(sigma: float, dt: float, duration: float, seed: int = 0) -> tuple[float, float]:
    """Run the observer beside the conventional one of the constant xm(0), whose regressor is B0 Cm exp(Am t).

    Args:
        sigma: The weight Sigma.
        dt: Sample period [s].
        duration: Simulated time [s].
        seed: Seed of the initial values.

    Returns:
        The largest |Upsilon - T exp(Am t)| and the largest difference of the estimates of x.
    """
    t = dt * np.arange(round(duration / dt) + 1)
    y = motion(starts(seed, 1), t)[:, 0, :1]
    proposed = make_single(dt, sigma)
    plain = FriedlandTacker.conventional(dt, paper.L, paper.GAMMA, proposed.Sigma)
    a, b = proposed.init(y[0]), plain.init(y[0])
    mean = paper.C_M @ (expm(paper.A_M * dt) + np.eye(4)) / 2.0
    largest = [0.0, 0.0]
    for k in range(1, len(t)):
        system = paper.system((y[k - 1, 0] + y[k, 0]) / 2.0, paper.torque(t[k] - dt / 2.0))
        turned_system = replace(system, B0=system.B0 @ mean @ expm(paper.A_M * t[k - 1]), D20=np.zeros((1, 4)))
        a, b = proposed.step(a, system, np.zeros(1), y[k]), plain.step(b, turned_system, np.zeros(1), y[k])
        gaps = np.abs(b.T - a.T @ expm(paper.A_M * t[k])).max(), np.abs(a.x - b.x).max()
        largest = [max(old, float(new)) for old, new in zip(largest, gaps, strict=True)]
    return largest[0], largest[1]

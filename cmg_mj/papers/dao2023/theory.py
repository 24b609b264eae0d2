"""The misprints, and the settings of the simulation that the paper leaves open."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from cmg_mj.papers.claim import Claim
from cmg_mj.papers.dao2023 import paper
from cmg_mj.papers.dao2023.figures import Errors, follow, make_proposed, make_single, motion, starts
from cmg_mj.papers.dao2023.observer import Array, FriedlandTacker
from cmg_mj.papers.recorded import largest_size, runge_kutta

# --- The misprints, and the settings of the simulation that the paper leaves open ---

DT, DURATION_S = 0.005, 80.0


def follow_at_1000(start: Array, coefficient: float = 1.0) -> Errors:
    """Let the observer with Sigma = 1000 follow the arm from its starts (n, 2) at 200 Hz; see `motion`."""
    t = DT * np.arange(round(DURATION_S / DT) + 1)
    return follow(make_proposed(DT, 1000.0), t, motion(start, t, coefficient))


def sampling_claim() -> Claim:
    """Judge a sampled observer at Sigma = 1000; an explicit step is shown beside it, and does not count."""
    rms = follow_at_1000(starts(1, 4)).tail_rms()[0]
    return Claim(
        "Section 3.2, simulation",
        "The observer is simulated at Sigma = 1000 (the paper does not say how).",
        assumes={"initial values": f"{len(rms)} motions", "control rate": "200 Hz", "method": "our implicit step"},
        holds=rms.max() < 0.1,
        figures={
            "state_rms_64_80_s": rms,
            "explicit_step_escapes_after_s": explicit_escape(),
        },
    )


def observer_slope(observer: FriedlandTacker, t: float, s: Array, q: float) -> Array:
    """Evaluate (7) to (9) on the arm at the angle q; s is x, xm and T in a row, (14,)."""
    system = paper.system(q, paper.torque(t))
    parts = observer.slope(t, s[:2], s[2:6], s[6:].reshape(2, 4), system, np.zeros(1), np.array([q]))
    return np.concatenate([part.ravel() for part in parts])


def explicit_escape() -> float:
    """Find when a Runge-Kutta step of (7) to (9) at Sigma = 1000, 200 Hz takes an estimate past 1e9 [s].

    Returns:
        The time; infinite if it does not within 10 s.
    """
    observer = make_single(DT, 1000.0)
    t = DT * np.arange(round(10.0 / DT) + 1)
    q = motion(starts(0, 1), t)[:, 0, 0]
    s = np.zeros(14)
    for k, time in enumerate(t[:-1].tolist()):
        angles = {0.0: q[k], 0.5: (q[k] + q[k + 1]) / 2.0, 1.0: q[k + 1]}

        def slope(share: float, s: Array, time: float = time, angles: dict[float, float] = angles) -> Array:
            return observer_slope(observer, time + share * DT, s, angles[share])

        s = runge_kutta(slope, s, DT)
        if not largest_size(s) < 1e9:
            return time + DT
    return math.inf


def misprint_claim() -> Claim:
    """Judge L as a row, and (10) against (14)."""
    outputs = len(paper.system(0.0, 0.0).C2)
    polynomial, amplitude = np.poly(paper.error_matrix()), amplitude_under_10()
    by_10, by_14 = abs(amplitude / paper.THETA[1] - 1.0).max(), abs(amplitude - 1.0).max()
    corrections = [
        "" if paper.L_PRINTED.shape[1] == outputs else "L is the column -[1; 1].",
        "" if by_14 < by_10 else "(14), not (10), scales d.",
        "(7) needs B2 u and the hats of its estimates; the example has B2 = 0, so that it does not show there.",
    ]
    return Claim(
        "L, (7), (10), (14) as printed",
        "L = -[1 1] makes A + L C2 Hurwitz, and (14) is (10) rearranged.",
        holds=paper.L.shape[1] == outputs and np.all(polynomial > 0.0) and min(by_10, by_14) < 0.025,
        conditions=" ".join(filter(None, corrections)),
        figures={
            "polynomial_of_A_plus_L_C2": polynomial,
            "disturbance_amplitude_found_if_10_holds_rad_s2": amplitude,
        },
    )


def amplitude_under_10() -> Array:
    """Estimate the amplitude of the disturbance on an arm that moves by (10), one a motion [rad/s^2]."""
    t, _, exogenous = follow_at_1000(starts(3, 3), paper.THETA[1])
    late = t >= 0.8 * DURATION_S
    amplitude = exogenous[late, 0, :, 2] + paper.disturbance(t[late])[:, None]
    return np.sqrt(2.0 * np.mean(amplitude**2, axis=0))


# --- The consequences of (7) to (9) along the robot ---


def separated_errors() -> Claim:
    """Judge whether the error of the state parts from that of the exosystem."""
    found = {
        f"continuous_sigma_{sigma:g}": continuous_deviation(sigma, duration)
        for sigma, duration in ((0.1, 6.0), (10.0, 6.0), (1000.0, 1.5))
    }
    found["200_hz_sigma_1000"] = sampled_deviation(40.0)
    errors = {name: error for name, (error, _) in found.items()}
    return Claim(
        "Equations (7) to (9)",
        "With T from (8), the error of the state decouples from that of the exosystem.",
        is_general=True,
        assumes={"initial values": "one motion", "control rate": "200 Hz"},
        holds=max(errors.values()) < 1e-8,
        conditions="On the pendulum robot. The paper has (7) to (9) for any system, and does not say that they "
        "decouple the errors.",
        is_ours=True,
        figures={"identity_error": errors, "largest_z": max(size for _, size in found.values())},
    )


def continuous_deviation(sigma: float, duration: float, seed: int = 0) -> tuple[float, float]:
    """Measure the deviation of z = (x^ - x) - T (xm^ - xm) from exp((A + L C2) t) z(0), along the chaotic arm.

    Args:
        sigma: The weight Sigma.
        duration: Simulated time [s].
        seed: Seed of the initial values.

    Returns:
        The largest deviation, and the largest |z| for comparison.
    """
    observer, t = make_single(1.0, sigma), np.linspace(0.0, duration, 21)

    def slope(time: float, s: Array) -> Array:
        arm = [s[1], paper.acceleration(s[0], time)]
        return np.concatenate([arm, observer_slope(observer, time, s[2:], s[0])])

    begin = np.concatenate([starts(seed, 1)[0], np.random.default_rng(seed).normal(0.0, 1.0, 6), np.zeros(8)])
    s = solve_ivp(slope, (0.0, duration), begin, "DOP853", t, rtol=1e-11, atol=1e-11).y.T
    T, xm_errors = s[:, 8:].reshape(-1, 2, 4), s[:, 4:8] - paper.exosystem_state(t)
    z = s[:, 2:4] - s[:, :2] - np.einsum("kij,kj->ki", T, xm_errors)
    exact_z = np.array([expm(paper.error_matrix() * time) @ z[0] for time in t])
    return largest_size(z - exact_z), largest_size(z)


def sampled_deviation(duration: float, seed: int = 0) -> tuple[float, float]:
    """Measure the deviation at 200 Hz, Sigma = 1000: z+ = (I - h/2 M)^-1 (I + h/2 M) z, the arm by the midpoint rule.

    Args:
        duration: Simulated time [s].
        seed: Seed of the initial values.

    Returns:
        The largest deviation, and the largest |z| at the start for comparison.
    """
    rng = np.random.default_rng(seed)
    observer = make_single(DT, 1000.0)
    q, rate = starts(seed, 1)[0].tolist()
    state = observer.init(np.array([q]), x=rng.normal(0.0, 1.0, 2), xm=rng.normal(0.0, 1.0, 4))
    F, half = expm(paper.A_M * DT), DT / 2.0 * paper.error_matrix()
    onward = np.linalg.solve(np.eye(2) - half, np.eye(2) + half)
    xm = paper.exosystem_state(0.0)
    z = state.x - [q, rate] - state.T @ (state.xm - xm)
    largest, size = 0.0, largest_size(z)
    for k in range(round(duration / DT)):
        u = float(paper.torque((k + 0.5) * DT))
        input_acceleration = paper.THETA[1] * u + float((paper.C_M @ (xm + F @ xm))[2]) / 2.0
        q_before, rate_before = q, rate
        for _ in range(12):  # a contraction by dt^2 theta1/4 each time
            rate = rate_before + DT * (input_acceleration - paper.THETA[0] * math.sin((q_before + q) / 2.0))
            q = q_before + DT * (rate_before + rate) / 2.0
        state = observer.step(state, paper.system((q_before + q) / 2.0, u), np.zeros(1), np.array([q]))
        xm, z = F @ xm, onward @ z
        largest = max(largest, largest_size(state.x - [q, rate] - state.T @ (state.xm - xm) - z))
    return largest, size


def upsilon(duration: float = 15.0, seed: int = 0) -> Claim:
    """Judge the relation between Upsilon and T at Sigma = 10, 200 Hz.

    Beside the observer runs the conventional one of the constant xm(0), whose regressor is B0 Cm exp(Am t).

    Args:
        duration: Simulated time [s].
        seed: Seed of the initial values.
    """
    t = DT * np.arange(round(duration / DT) + 1)
    y = motion(starts(seed, 1), t)[:, 0, :1]
    proposed = make_single(DT, 10.0)
    plain = FriedlandTacker.conventional(DT, paper.L, paper.GAMMA, proposed.Sigma)
    a, b = proposed.init(y[0]), plain.init(y[0])
    mean = paper.C_M @ (expm(paper.A_M * DT) + np.eye(4)) / 2.0
    gaps = []
    for k in range(1, len(t)):
        system = paper.system((y[k - 1, 0] + y[k, 0]) / 2.0, paper.torque(t[k] - DT / 2.0))
        turned_system = system._replace(B0=system.B0 @ mean @ expm(paper.A_M * t[k - 1]), D20=np.zeros((1, 4)))
        a, b = proposed.step(a, system, np.zeros(1), y[k]), plain.step(b, turned_system, np.zeros(1), y[k])
        gaps.append((largest_size(b.T - a.T @ expm(paper.A_M * t[k])), largest_size(a.x - b.x)))
    matrix_gap, estimate_gap = np.max(gaps, axis=0).tolist()
    return Claim(
        "Section 2.2, last equation",
        "The conventional observer's Upsilon is T exp(Am t).",
        is_general=True,
        holds=matrix_gap < 1e-9 and estimate_gap < 1e-9,
        conditions="For any system, of which the pendulum robot was tried. Upsilon's equation must have "
        "(B0 + L D20) Cm exp(Am t), not (B0 + L D20), unless Am = 0. So read, the proposed observer is the "
        "conventional one of the constant xm(0): its estimate of x is the same.",
        figures={"upsilon_gap": matrix_gap, "state_gap": estimate_gap},
    )

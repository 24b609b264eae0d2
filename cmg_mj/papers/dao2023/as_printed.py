"""What is printed otherwise than it can be meant, and what the paper leaves open of its simulation."""

from __future__ import annotations

import math

import numpy as np

from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.dao2023 import paper
from cmg_mj.papers.dao2023.friedland_tacker import FriedlandTacker
from cmg_mj.papers.dao2023.pendulum_robot import follow, motion, one, proposed, starts

DT, DURATION_S = 0.005, 80.0


def claims(on_share: OnShare) -> list[Claim]:
    """The sampling and the misprints."""
    return [sampled(lambda share: on_share(0.6 * share)), printed()]


def sampled(on_share: OnShare) -> Claim:
    """An implicit step is stable at Sigma = 1000, an explicit one is not."""
    t = DT * np.arange(round(DURATION_S / DT) + 1)
    x = motion(starts(1, 4), t)
    rms = follow(proposed(DT, (1000.0,)), t, x, on_share).tail_rms()[0]
    escape = explicit_escape(1000.0, DT, 10.0)
    return Claim(
        place="Section 3.2, simulation",
        says="The observer is simulated at Sigma = 1000 (the paper does not say how).",
        found=f"Sampled at 200 Hz, our implicit step stays stable: state RMS error {rms.max():.1e} at worst over "
        f"64-80 s in {len(rms)} motions. A classical Runge-Kutta step of (7) to (9) at that rate has left every bound "
        f"after {escape:.1f} s.",
        holds=bool(rms.max() < 0.1) and math.isfinite(escape),
        figures={"state_rms_64_80_s": rms.tolist(), "explicit_step_escapes_after_s": escape},
    )


def explicit_escape(sigma: float, dt: float, duration: float, seed: int = 0) -> float:
    """When a classical Runge-Kutta step of (7) to (9) at a sample rate has left every bound: infinite if never [s].

    Args:
        sigma: The weight Sigma.
        dt: Sample period [s].
        duration: How long to try [s].
        seed: Of the initial values.

    Returns:
        The time at which an estimate passes 1e9.
    """
    observer = one(dt, sigma)
    t = dt * np.arange(round(duration / dt) + 1)
    q = motion(starts(seed, 1), t)[:, 0, 0]

    def slope(time: float, s: np.ndarray, y: float) -> np.ndarray:
        here = paper.system(y, paper.torque(time))
        parts = observer.slope(time, s[:2], s[2:6], s[6:].reshape(2, 4), here, np.zeros(1), np.array([y]))
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


def printed() -> Claim:
    """L as a row, and (10) against (14)."""
    refused, polynomial = refusal_of_the_row(), np.poly(paper.error_matrix())
    amplitude = amplitude_found_if_10_holds()
    corrected = (
        "Corrected: L is the column -[1; 1]; (7) needs B2 u and the hats of its estimates; (14), not (10), scales d. "
        "The example has B2 = 0, so the missing term does not show there."
    )
    return Claim(
        place="L, (7), (10), (14) as printed",
        says="L = -[1 1], the observer (7), and the motion (10) from which (14) follows.",
        found=f"A row L does not fit ({refused.split(';')[0]}); the column gives A + L C2 the polynomial s^2 + "
        f"{polynomial[1]:.0f} s + {polynomial[2]:.0f}. From (10) follows theta2 d in (14): the observer then finds a "
        f"disturbance of amplitude {amplitude.mean():.3f}, theta2 times that of d.",
        holds=bool(refused) and bool(np.all(polynomial > 0.0)) and bool(np.abs(amplitude - 2.0).max() < 0.05),
        conditions=corrected,
        otherwise=corrected,
        figures={
            "polynomial_of_A_plus_L_C2": polynomial.tolist(),
            "disturbance_amplitude_found_if_10_holds_rad_s2": amplitude.tolist(),
        },
    )


def refusal_of_the_row() -> str:
    """What the general form says to the L that is printed; empty if it takes it."""
    row = FriedlandTacker(DT, paper.A_M, paper.C_M, paper.L_PRINTED, paper.GAMMA, np.eye(2))
    try:
        row.step(row.init(np.zeros(2)), paper.system(0.0, 0.0), np.zeros(1), np.zeros(1))
    except ValueError as error:
        return str(error)
    return ""


def amplitude_found_if_10_holds() -> np.ndarray:
    """Amplitude of the disturbance that the observer finds of an arm that moves by (10), one a motion [rad/s^2]."""
    t = DT * np.arange(round(DURATION_S / DT) + 1)
    x = motion(starts(3, 3), t, coefficient=paper.THETA[1])
    late = t >= 0.8 * DURATION_S
    error = follow(proposed(DT, (1000.0,)), t, x).exogenous[late, 0, :, 2]
    return np.sqrt(2.0 * np.mean((error + paper.disturbance(t[late])[:, None]) ** 2, axis=0))

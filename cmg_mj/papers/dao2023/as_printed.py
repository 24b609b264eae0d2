"""The misprints, and the settings of the simulation that the paper leaves open."""

from __future__ import annotations

import math

import numpy as np

from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.dao2023 import paper
from cmg_mj.papers.dao2023.pendulum_robot import follow, make_proposed, make_single, motion, starts

DT, DURATION_S = 0.005, 80.0


def claims(on_share: OnShare) -> list[Claim]:
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

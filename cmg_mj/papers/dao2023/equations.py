"""The equations: the separated errors, Upsilon, sampling, and what is printed otherwise."""

from __future__ import annotations

import math

import numpy as np

from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.dao2023 import pendulum_robot as robot
from cmg_mj.papers.dao2023.figures import tail_rms
from cmg_mj.papers.dao2023.friedland_tacker import FriedlandTacker


def run(on_share: OnShare) -> list[Claim]:
    """The claims, in the order of the report."""
    claims = [_identity(on_share)]
    on_share(0.4)
    claims.append(_upsilon())
    on_share(0.5)
    claims.append(_sampled(on_share))
    claims.append(_printed())
    return claims


def _identity(on_share: OnShare) -> Claim:
    errors, sizes = {}, []
    for i, (sigma, duration) in enumerate(((0.1, 6.0), (10.0, 6.0), (1000.0, 1.5))):
        errors[f"continuous_sigma_{sigma:g}"], size = robot.identity_error(sigma, duration)
        sizes.append(size)
        on_share(0.1 * (i + 1))
    errors["200_hz_sigma_1000"], size = robot.discrete_identity_error(1000.0, 0.005, 40.0)
    worst = max(errors.values())
    return Claim(
        "Equations (7) to (9)",
        "With T from (8), the error of the state parts from that of the exosystem.",
        "z = (x^ - x) - T (xm^ - xm) obeys z' = (A + L C2) z whatever Gamma and Sigma, along a motion that is "
        f"chaotic: to {worst:.0e} at worst, in continuous time (6 s; 1.5 s at Sigma = 1000) and, sampled at 200 Hz, "
        "for 40 s.",
        verdict(worst < 1e-8),
        "",
        {"identity_error": errors, "largest_z": max(*sizes, size)},
    )


def _upsilon() -> Claim:
    matrix_gap, estimate_gap = robot.upsilon_errors(10.0, 0.005, 15.0)
    why = (
        "Upsilon's equation must have (B0 + L D20) Cm exp(Am t), not (B0 + L D20), unless Am = 0. So read, the "
        "proposed observer is the conventional one of the constant xm(0): its estimate of x is the same."
    )
    return Claim(
        "Section 2.2, last equation",
        "The conventional observer's Upsilon is T exp(Am t).",
        f"To {matrix_gap:.0e} over 15 s at 200 Hz; the estimates of x of both observers agree to {estimate_gap:.0e}.",
        verdict(matrix_gap < 1e-9 and estimate_gap < 1e-9, why),
        why,
        {"upsilon_gap": matrix_gap, "state_gap": estimate_gap},
    )


def _sampled(on_share: OnShare) -> Claim:
    t = np.arange(16_001) * 0.005
    x = robot.motion(robot.starts(1, 4), t)
    errors = robot.follow(robot.proposed(0.005, (1000.0,)), t, x, lambda share: on_share(0.55 + 0.3 * share))
    rms = tail_rms(errors)[0]
    escape = robot.explicit_escape(1000.0, 0.005, 10.0)
    return Claim(
        "Section 3.2, simulation",
        "The observer is simulated at Sigma = 1000 (the paper does not say how).",
        f"Sampled at 200 Hz, our implicit step stays stable: state RMS error {rms.max():.1e} at worst over 64-80 s in "
        f"{len(rms)} motions. A classical Runge-Kutta step of (7) to (9) at that rate has left every bound after "
        f"{escape:.1f} s.",
        verdict(bool(rms.max() < 0.1) and math.isfinite(escape)),
        "",
        {"state_rms_64_80_s": rms.tolist(), "explicit_step_escapes_after_s": escape},
    )


def _printed() -> Claim:
    here = robot.system(0.0, 0.0)
    row = FriedlandTacker(0.005, robot.A_M, robot.C_M, -np.ones((1, 2)), robot.GAMMA, np.eye(2))
    try:
        row.step(row.init(np.zeros(2)), here, np.zeros(1), np.zeros(1))
        refused = ""
    except ValueError as error:
        refused = str(error)
    polynomial = np.poly(here.A + robot.L @ here.C2)
    t = np.arange(16_001) * 0.005
    x = robot.motion(robot.starts(3, 3), t, coefficient=robot.THETA[1])
    errors = robot.follow(robot.proposed(0.005, (1000.0,)), t, x)
    tail = errors.exogenous[12_800:, 0, :, 2] + robot.disturbance(t[12_800:])[:, None]
    amplitude = np.sqrt(2.0 * np.mean(tail**2, axis=0))
    why = (
        "Corrected: L is the column -[1; 1]; (7) needs B2 u and the hats of its estimates; (14), not (10), scales d. "
        "The example has B2 = 0, so the missing term does not show there."
    )
    return Claim(
        "L, (7), (10), (14) as printed",
        "L = -[1 1], the observer (7), and the motion (10) from which (14) follows.",
        f"A row L does not fit ({refused.split(';')[0]}); the column gives A + L C2 the polynomial s^2 + "
        f"{polynomial[1]:.0f} s + {polynomial[2]:.0f}. From (10) follows theta2 d in (14): the observer then finds a "
        f"disturbance of amplitude {amplitude.mean():.3f}, theta2 times that of d.",
        verdict(bool(refused) and bool(np.all(polynomial > 0.0)) and bool(np.abs(amplitude - 2.0).max() < 0.05), why),
        why,
        {
            "polynomial_of_A_plus_L_C2": polynomial.tolist(),
            "disturbance_amplitude_found_if_10_holds_rad_s2": amplitude.tolist(),
        },
    )

"""Sections II to IV: Table I, (1), (5), the rests of (6) and (7), and what a bias e does to (9) and (10)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.papers.claim import Claim
from cmg_mj.papers.linear_check import (
    constants_of,
    controllability_margin,
    finite_difference_error,
    law_rests,
    model_difference,
    poles_as_pairs,
)
from cmg_mj.papers.recorded import largest_size, trajectory_of
from cmg_mj.papers.sokolov2019 import paper
from cmg_mj.papers.sokolov2019.rig import NO_NOISE, experiment, read_servo
from cmg_mj.plant.plant import Plant


def table_i() -> Claim:
    """Judge the constants of the compiled rig beside those of Table I."""
    table = paper.printed_model()
    error = model_difference(experiment().plant.reduced, table)
    return Claim(
        "Table I",
        "Mass, pivot distance and inertias; J1 = I_d + J_b + K_c + m l^2, J2 = J_c - I_d + J_d - K_c.",
        holds=error < 1e-9,
        figures={**constants_of(table), "largest_relative_difference": error},
    )


def equation_residual(plant: Plant, model: ReducedModel, states: int, seed: int) -> float:
    """Return the largest difference between (1), with a model's constants, and MuJoCo's inverse dynamics [N m]."""
    I_cd = read_servo(plant).inertia
    rng, data, largest = np.random.default_rng(seed), mujoco.MjData(plant.model), 0.0
    for _ in range(states):
        q = rng.uniform(-math.pi, math.pi, 3)
        w = np.array([*rng.uniform(-5.0, 5.0, 2), rng.uniform(200.0, 400.0)])
        dw = rng.uniform(-100.0, 100.0, 3)
        data.qpos[:], data.qvel[:], data.qacc[:] = q, w, dw
        mujoco.mj_inverse(plant.model, data)
        largest = max(largest, largest_size(data.qfrc_inverse - paper.torques(model, I_cd, q, w, dw)))
    return largest


def equations_of_motion(states: int = 300, seed: int = 81_000) -> Claim:
    """Judge (1) against the compiled bodies."""
    plant = experiment(["plant.equilibrium_bias_deg=0.0"]).plant
    model = plant.reduced
    residual = equation_residual(plant, model, states, seed)
    opposite = equation_residual(plant, replace(model, J2=-model.J2), states, seed)
    return Claim(
        "(1)",
        "The Euler-Lagrange equations of frame, gimbal and wheel.",
        holds=residual < 1e-9 and opposite > 1e3 * residual,
        figures={"largest_residual_n_m": residual, "largest_residual_with_J2_turned_n_m": opposite, "states": states},
    )


def law_equilibria() -> Claim:
    """Judge section III: linearisation, controllability, and where (6) and (7) rest."""
    model = paper.printed_model()
    error, margin = finite_difference_error(model), controllability_margin(model.A_e, model.B_e)
    is_so, figures = law_rests(model, paper.K_E, 6, 7)
    return Claim(
        "(5), (6), (7)",
        "A, B linearise (3) and (A_e, B_e) is controllable; (6) leaves the gimbal at -k1/k3 e, (7) brings x "
        "to zero with x_e at -k_e1/k_e4 e.",
        holds=error < 1e-6 and margin > 1e-9 and is_so,
        conditions="With y1 = x1 - e the bias enters (6) and (7) as +k1 e: both offsets have a plus where a minus is "
        "printed.",
        figures={"finite_difference_error": error, "controllability_margin": margin, **figures},
    )


REST_S = 35.0
"""Time until the law's slowest poles, -0.19 +- 0.29j 1/s, have faded to 1e-3 [s]."""


def find_rest(observer: str, e_deg: float, angles: str) -> tuple[float, float, float]:
    """Release the rig with a bias and wait; the law on `estimated` or `measured` angles.

    Returns:
        The largest of |x1| [rad], |x2| [rad/s] and |x3| [rad] over the last second, NaN after a fall; the means there
        of the observer's rate [rad/s] and of the integrator [rad s].
    """
    settings = [*NO_NOISE, f"plant.equilibrium_bias_deg={e_deg}", "plant.initial_tilt_deg=0.1", "push=[]"]
    result = experiment([*settings, f"duration_s={REST_S}", f"controller.angle_source={angles}"], observer).run()
    last = trajectory_of(result).between(REST_S - 1.0, REST_S)
    x = max(largest_size(last[name]) for name in ("x1_rad", "x2_rad_s", "x3_rad"))
    return x, last[f"estimate/{observer}/x2_rad_s"].mean(), last["x_e_rad_times_s"].mean()


def biased_luenberger(e_deg: float = 0.25) -> Claim:
    """Judge section IV-B: the integrator compensates the offset even if (9) is biased."""
    model, e = paper.printed_model(), math.radians(e_deg)
    poles = np.linalg.eigvals(paper.error_matrix(model))
    x_hat = paper.rest_of_9(model, e).tolist()
    k1, k2, _, k4 = paper.K_E
    forms = {"estimated": -(k1 * x_hat[0] + k2 * x_hat[1]) / k4, "measured": (k1 * e - k2 * x_hat[1]) / k4}
    rests = {angles: find_rest("luenberger", e_deg, angles) for angles in forms}
    is_as_foreseen = all(
        x < 2e-3 and abs(rate / x_hat[1] - 1.0) < 0.02 and abs(x_e / forms[angles] - 1.0) < 0.02
        for angles, (x, rate, x_e) in rests.items()
    )
    return Claim(
        "Section IV-B",
        "A - L C is Hurwitz; with a bias e the estimate of (9) is off, but the integrator still brings x to zero.",
        assumes={"e": f"{e_deg:g} deg"},
        holds=is_as_foreseen and np.real(poles).max() < 0.0,
        conditions="With y1 = x1 - e the bias enters y as -C_e e and the error as +L C_e e; the other sign is printed.",
        figures={
            "largest_rest_state": max(x for x, _, _ in rests.values()),
            "rate_estimate_rad_s": rests["estimated"][1],
            "rate_estimate_closed_form_rad_s": x_hat[1],
            "integrator_rad_s": {angles: x_e for angles, (_, _, x_e) in rests.items()},
            "integrator_closed_form_rad_s": forms,
            "poles_of_A_LC_1_s": poles_as_pairs(poles),
        },
    )


def homogeneous_vicinity(biases_deg: Sequence[float] = (0.0, 0.25, 0.5)) -> Claim:
    """Judge section IV-C: the error of (10) ends in a vicinity of the origin, whose size e decides."""
    model = paper.printed_model()
    rates = {f"{e:g}_deg": find_rest("homogeneous", e, "measured")[1] for e in biases_deg}
    forms = {f"{e:g}_deg": paper.rest_of_10(model, math.radians(e)) for e in biases_deg}
    return Claim(
        "Section IV-C",
        "With alpha in (1/2, 1] the error of (10) converges to a vicinity of the origin: sin(y1) replaces sin(x1).",
        is_general=True,
        assumes={"e": f"{', '.join(f'{e:g}' for e in biases_deg)} deg"},
        holds=max(abs(rates[e] - forms[e]) / max(abs(forms[e]), 5e-3) for e in rates) < 0.1,
        conditions="Tried with the k1, k2 and alpha = 0.85 of Table II.",
        figures={"rate_estimate_rad_s": rates, "rate_estimate_closed_form_rad_s": forms},
    )

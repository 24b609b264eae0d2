"""Sections II and III: Table I, the equations (1), the linearisation (5), and the rests of (6) and (7)."""

from __future__ import annotations

import math
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
)
from cmg_mj.papers.sokolov2019 import paper
from cmg_mj.papers.sokolov2019.rig import experiment, read_servo
from cmg_mj.plant.plant import Plant


def table_i() -> Claim:
    """Judge the constants of the compiled rig beside those of Table I."""
    table = paper.printed_model()
    error = model_difference(experiment().plant.reduced, table)
    return Claim(
        place="Table I",
        statement="Mass, pivot distance and inertias; J1 = I_d + J_b + K_c + m l^2, J2 = J_c - I_d + J_d - K_c.",
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
        largest = max(largest, np.abs(data.qfrc_inverse - paper.torques(model, I_cd, q, w, dw)).max())
    return largest


def equations_of_motion(states: int = 300, seed: int = 81_000) -> Claim:
    """Judge (1) against the compiled bodies."""
    plant = experiment(["plant.equilibrium_bias_deg=0.0"]).plant
    model = plant.reduced
    residual = equation_residual(plant, model, states, seed)
    opposite = equation_residual(plant, replace(model, J2=-model.J2), states, seed)
    return Claim(
        place="(1)",
        statement="The Euler-Lagrange equations of frame, gimbal and wheel.",
        holds=residual < 1e-9 and opposite > 1e3 * residual,
        figures={"largest_residual_n_m": residual, "largest_residual_with_J2_turned_n_m": opposite, "states": states},
    )


def law_equilibria() -> Claim:
    """Judge section III: linearisation, controllability, and where (6) and (7) rest."""
    model = paper.printed_model()
    error, margin = finite_difference_error(model), controllability_margin(model.A_e, model.B_e)
    is_so, figures = law_rests(model, paper.K_E, 6, 7)
    return Claim(
        place="(5), (6), (7)",
        statement="A, B linearise (3) and (A_e, B_e) is controllable; (6) leaves the gimbal at -k1/k3 e, (7) brings x "
        "to zero with x_e at -k_e1/k_e4 e.",
        holds=error < 1e-6 and margin > 1e-9 and is_so,
        conditions="With y1 = x1 - e the bias enters (6) and (7) as +k1 e: both offsets have a plus where a minus is "
        "printed.",
        figures={"finite_difference_error": error, "controllability_margin": margin, **figures},
    )

"""Sections II to IV: Table I, the equations (1), the linearisation (5), the rests of (6) and (7), Proposition 1."""

from __future__ import annotations

import math
from dataclasses import replace

import mujoco
import numpy as np

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.papers import plvcc
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.linear_check import (
    controllability_margin,
    equilibrium,
    finite_difference_error,
    model_difference,
    poles_as_pairs,
)
from cmg_mj.papers.sokolov2019 import paper
from cmg_mj.papers.sokolov2019.rig import experiment, read_servo
from cmg_mj.plant.plant import Plant


def claims(on_share: OnShare) -> list[Claim]:
    """Judge sections II and III."""
    return [table_i(), equations_of_motion(), law_equilibria()]


def table_i() -> Claim:
    """Judge the constants of the compiled rig beside those of Table I."""
    table = paper.printed_model()
    error = model_difference(experiment().plant.reduced, table)
    return Claim(
        place="Table I",
        statement="Mass, pivot distance and inertias; J1 = I_d + J_b + K_c + m l^2, J2 = J_c - I_d + J_d - K_c.",
        holds=error < 1e-9,
        otherwise="The model file has other numbers.",
        figures={
            "J1_kg_m2": table.J1,
            "J2_kg_m2": table.J2,
            "spin_momentum_n_m_s": table.J_d * table.omega_d,
            "gravity_torque_n_m": table.gravity_torque,
            "largest_relative_difference": error,
        },
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
        largest = max(largest, float(np.abs(data.qfrc_inverse - paper.torques(model, I_cd, q, w, dw)).max()))
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
        otherwise="The bodies obey other equations.",
        figures={"largest_residual_n_m": residual, "largest_residual_with_J2_turned_n_m": opposite, "states": states},
    )


def law_equilibria() -> Claim:
    """Judge section III: linearisation, controllability, and where (6) and (7) rest."""
    model, K_e = paper.printed_model(), np.array(paper.K_E)
    K = K_e[:3]
    error, margin = finite_difference_error(model), controllability_margin(model.A_e, model.B_e)
    rest_6, poles_6 = equilibrium(model.A, model.B, K, 1.0)
    rest_7, poles_7 = equilibrium(model.A_e, model.B_e, K_e, 1.0)
    x3, x_e = K[0] / K[2], K_e[0] / K_e[3]
    miss = max(np.abs(rest_6 - [0.0, 0.0, x3]).max() / abs(x3), np.abs(rest_7 - [0.0, 0.0, 0.0, x_e]).max() / x_e)
    slowest = float(max(np.real(poles_6).max(), np.real(poles_7).max()))
    return Claim(
        place="(5), (6), (7)",
        statement=(
            "A, B linearise (3) and (A_e, B_e) is controllable; (6) leaves the gimbal at -k1/k3 e, (7) brings x to "
            "zero with x_e at -k_e1/k_e4 e."
        ),
        holds=error < 1e-6 and margin > 1e-9 and miss < 1e-9 and slowest < 0.0,
        conditions="With y1 = x1 - e the bias enters (6) and (7) as +k1 e: both offsets have a plus where a minus is "
        "printed.",
        otherwise="The linear equations rest elsewhere, or are not what (3) linearises to.",
        figures={
            "finite_difference_error": error,
            "controllability_margin": margin,
            "gimbal_rest_of_6_rad_per_rad": rest_6[2],
            "integrator_rest_of_7_s_per_rad": rest_7[3],
            "poles_of_6_1_s": poles_as_pairs(poles_6),
            "poles_of_7_1_s": poles_as_pairs(poles_7),
        },
    )


def proposition_1_claims(on_share: OnShare) -> list[Claim]:
    """Judge Proposition 1."""
    return [plvcc.claim("sokolov2019")]

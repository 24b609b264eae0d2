"""Section III of aranovskiy2020: the linearisation (6), and where the laws (7) and (8) rest on it."""

from __future__ import annotations

import dataclasses

import numpy as np

from cmg_mj.papers.aranovskiy2020.paper import K_E, gimbal_rest, integrator_rest, printed_model
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.linear_check import (
    controllability_margin,
    equilibrium,
    finite_difference_error,
    poles_as_pairs,
)


def linearisation() -> Claim:
    """Judge (6) and the controllability of (A_e, B_e)."""
    model = printed_model()
    error = finite_difference_error(model)
    margin = controllability_margin(model.A_e, model.B_e)
    still_model = dataclasses.replace(model, omega_d=0.0)
    no_spin = controllability_margin(still_model.A_e, still_model.B_e)
    return Claim(
        place="(6), Section III",
        statement="A and B linearise (4); the pair (A_e, B_e) with the integrator is controllable.",
        holds=error < 1e-6 and margin > 1e-9 and no_spin < 1e-15,
        figures={"finite_difference_error": error, "rank_margin": margin, "rank_margin_flywheels_at_rest": no_spin},
    )


def law_equilibria() -> Claim:
    """Judge equilibria of (7) and (8) on the linearisation."""
    model = printed_model()
    rest_7, poles_7 = equilibrium(model.A, model.B, np.array(K_E[:3]), 1.0)
    rest_8, poles_8 = equilibrium(model.A_e, model.B_e, np.array(K_E), 1.0)
    x3, x_e = gimbal_rest(1.0), integrator_rest(1.0)
    error = max(np.abs(rest_7 - [0.0, 0.0, x3]).max() / abs(x3), np.abs(rest_8 - [0.0, 0.0, 0.0, x_e]).max() / x_e)
    stable = max(np.real(poles_7).max(), np.real(poles_8).max()) < 0.0
    return Claim(
        place="(7), (8)",
        statement=(
            "Static feedback leaves the gimbal off by k1/k3 e; with the integrator x goes to zero and x_e settles at "
            "k_e1/k_e4 e (both printed with a minus)."
        ),
        holds=error < 1e-9 and stable,
        conditions=(
            "With y1 = x1 - e the bias enters (7) and (8) as +k1 e: both offsets have a plus where a minus is printed."
        ),
        otherwise="The laws rest elsewhere, or do not rest.",
        figures={
            "gimbal_rest_of_7_rad_per_rad": rest_7[2],
            "integrator_rest_of_8_s_per_rad": rest_8[3],
            "poles_of_7_1_s": poles_as_pairs(poles_7),
            "poles_of_8_1_s": poles_as_pairs(poles_8),
        },
    )


def claims(on_share: OnShare) -> list[Claim]:
    """Judge (6), and (7) with (8)."""
    return [linearisation(), law_equilibria()]

"""Sections II and III: the constants of Table 1, the reduced model beside six bodies, (6), the rests of (7) and (8)."""

from __future__ import annotations

import dataclasses
import math
from copy import copy
from functools import cache
from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.papers import plvcc
from cmg_mj.papers.aranovskiy2020.paper import K_E, gimbal_rest, gimbal_torque, integrator_rest, printed_model
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.linear_check import (
    controllability_margin,
    equilibrium,
    finite_difference_error,
    model_difference,
    poles_as_pairs,
)
from cmg_mj.plant.plant import Plant, load_plant

SEED = 70_000


@cache
def balanced_rig() -> Plant:
    """Return the scissored pair without a bias."""
    return load_plant(equilibrium_bias_deg=0.0)


def table_1() -> Claim:
    """Judge the constants of the compiled six-body model beside those of Table 1."""
    paper = printed_model()
    error = model_difference(balanced_rig().reduced, paper)
    pole = math.sqrt(paper.gravity_torque / paper.J1)
    return Claim(
        place="Table 1",
        statement="Masses, lengths and inertias of the rig, from which J1 and J2 below (2) follow.",
        holds=error < 1e-9,
        conditions=(
            "m is printed as the total mass, but T and P use it as the mass of each half; read so, they fit together."
        ),
        otherwise="The model file has other numbers.",
        figures={
            "J1_kg_m2": paper.J1,
            "J2_kg_m2": paper.J2,
            "spin_momentum_n_m_s": paper.J_d * paper.omega_d,
            "gravity_torque_n_m": paper.gravity_torque,
            "unstable_pole_1_s": pole,
            "largest_relative_difference": error,
        },
    )


class Residuals(NamedTuple):
    """The six-body model's accelerations less the reduced model's, RMS over random states [rad/s^2]; then torques."""

    tilt: float
    """The tilt's, with the flywheels' own acceleration counted."""
    tilt_as_printed: float
    """The tilt's, by (3) as printed, which takes omega_d' for zero (Hypothesis 3)."""
    tilt_turned_J2: float
    """The tilt's, with J2's sign turned: a difference that the comparison must see."""
    yaw: float
    """Acceleration of body A, which Hypotheses 1 and 2 say is zero."""
    size: float
    """RMS of the tilt acceleration itself."""
    torque: float
    """The gimbal's torque less tau_c of (2) [N m]."""
    torque_turned_J2: float
    """That difference with the sign of the last term turned [N m]."""
    torque_without_flywheel: float
    """The torque without the flywheel's term: the servo supplies that term [N m]."""
    torque_size: float
    """RMS of the torque itself [N m]."""


def residuals(states: int, seed: int) -> Residuals:
    """Compare (3) with MuJoCo at random symmetric states, under random symmetric torques."""
    plant = balanced_rig()
    model = copy(plant.model)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    data = mujoco.MjData(model)
    rng = np.random.default_rng(seed)
    reduced = plant.reduced
    rows = []
    for _ in range(states):
        x1, x3 = rng.uniform(-0.4, 0.4), rng.uniform(-1.2, 1.2)
        x2, u = rng.uniform(-2.0, 2.0), rng.uniform(-4.7, 4.7)
        speed = rng.uniform(280.0, 340.0)
        gimbal_torque_n_m, motor_torque = rng.uniform(-1.0, 1.0), rng.uniform(-0.2, 0.2)
        mujoco.mj_resetDataKeyframe(model, data, plant.key)
        data.qpos[plant.tilt], data.qvel[plant.tilt] = plant.tilt_zero + x1, x2
        for module in plant.axis.modules:
            data.qpos[module.gimbal], data.qvel[module.gimbal] = (
                module.gimbal_zero + module.direction * x3,
                module.direction * u,
            )
            data.qvel[module.flywheel] = math.copysign(speed, module.speed)
            data.qfrc_applied[module.gimbal] = module.direction * gimbal_torque_n_m
            data.qfrc_applied[module.flywheel] = math.copysign(1.0, module.speed) * motor_torque
        mujoco.mj_forward(model, data)
        spin_up = data.qacc[plant.axis.modules[0].flywheel] * math.copysign(1.0, plant.axis.modules[0].speed)

        def f2(J2: float, state: tuple = (x1, x2, x3, u), speed: float = speed) -> float:
            return ReducedModel(reduced.J1, J2, reduced.J_d, speed, reduced.gravity_torque).tilt_acceleration(*state)

        q = float(data.qacc[plant.tilt])
        # d/dt of J_d omega_d sin x3, of which (3) has the part with x3'.
        by_spin_up = reduced.J_d * math.sin(x3) * float(spin_up) / (reduced.J1 + reduced.J2 * math.sin(x3) ** 2)
        difference, difference_turned = q - f2(reduced.J2), q - f2(-reduced.J2)
        module = plant.axis.modules[0]
        turning = module.direction * float(data.qacc[module.gimbal])
        miss = gimbal_torque_n_m - gimbal_torque(x2, x3, turning, speed)
        last = gimbal_torque(x2, x3, 0.0, 0.0)  # that of J2 alone
        flywheel = gimbal_torque(x2, x3, 0.0, speed) - last
        rows.append(
            (
                *(difference - by_spin_up, difference, difference_turned - by_spin_up, data.qacc[plant.yaw], q),
                *(miss, miss + 2.0 * last, miss + flywheel, gimbal_torque_n_m),
            )
        )
    return Residuals(*(float(value) for value in np.sqrt(np.mean(np.square(rows), axis=0))))


def equations_2_to_4(r: Residuals, states: int) -> Claim:
    """Judge (3) and (4) against MuJoCo's six bodies."""
    return Claim(
        place="(2) to (4)",
        statement="Under Hypotheses 1 to 3 the six bodies move as one pendulum with one gimbal, and body A stands "
        "still.",
        holds=r.tilt < 1e-9 * r.size and r.yaw < 1e-9 * r.size and r.tilt_turned_J2 > 1e3 * r.tilt,
        otherwise="The six bodies move otherwise.",
        figures={
            f"{name}_rad_s2": getattr(r, name) for name in ("tilt", "tilt_as_printed", "tilt_turned_J2", "yaw", "size")
        },
    )


def gimbals_line(r: Residuals, states: int) -> Claim:
    """Judge the second line of (2), which the velocity servos make superfluous later."""
    return Claim(
        place="(2), tau_c",
        statement="A gimbal's torque is (I_c + I_d) omega_c' + J_d omega_b omega_d sin q_c + J2 sin(2 q_c) "
        "omega_b^2/2.",
        holds=r.torque < 1e-9 * r.torque_size and r.torque_turned_J2 > 1e3 * r.torque,
        otherwise="The gimbals need another torque.",
        figures={
            f"{name}_n_m": getattr(r, name)
            for name in ("torque", "torque_turned_J2", "torque_without_flywheel", "torque_size")
        },
    )


def claims(on_share: OnShare) -> list[Claim]:
    """Judge Table 1, and (2) to (4)."""
    states = 500
    rms = residuals(states, SEED)
    return [table_1(), equations_2_to_4(rms, states), gimbals_line(rms, states)]


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


def linearisation_claims(on_share: OnShare) -> list[Claim]:
    """Judge (6), and (7) with (8)."""
    return [linearisation(), law_equilibria()]


def appendix_claims(on_share: OnShare) -> list[Claim]:
    """Judge the proof, checked symbolically."""
    return [plvcc.claim("aranovskiy2020")]

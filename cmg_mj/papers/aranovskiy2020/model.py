"""Sections II and III: the constants of Table 1, the reduced model beside six bodies, (6), the rests of (7) and (8)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from copy import copy
from dataclasses import replace

import mujoco
import numpy as np

from cmg_mj.papers.aranovskiy2020.paper import K_E, gimbal_torque, printed_model
from cmg_mj.papers.claim import Claim
from cmg_mj.papers.linear_check import (
    constants_of,
    controllability_margin,
    finite_difference_error,
    law_rests,
    model_difference,
)
from cmg_mj.plant.plant import load_plant

SEED, STATES = 70_000, 500


def table_1() -> Claim:
    """Judge the constants of the compiled six-body model beside those of Table 1."""
    paper = printed_model()
    error = model_difference(load_plant(equilibrium_bias_deg=0.0).reduced, paper)
    return Claim(
        "Table 1",
        "Masses, lengths and inertias of the rig, from which J1 and J2 below (2) follow.",
        holds=error < 1e-9,
        conditions="m is printed as the total mass, but T and P use it as the mass of each half; read so, they fit "
        "together.",
        figures={
            **constants_of(paper),
            "unstable_pole_1_s": math.sqrt(paper.gravity_torque / paper.J1),
            "largest_relative_difference": error,
        },
    )


def residuals(states: int = STATES, seed: int = SEED) -> dict[str, float]:
    """Compare (3) and (2) with MuJoCo at random symmetric states, under random symmetric torques.

    Returns:
        RMS over the states. Accelerations [rad/s^2]: `tilt`, the six bodies' less the reduced model's with the
        flywheels' own acceleration counted; `tilt_as_printed`, by (3), which takes omega_d' for zero (Hypothesis 3);
        `tilt_turned_J2`, a difference that the comparison must see; `yaw`, that of body A, which Hypotheses 1 and 2 say
        is zero; `size`, the tilt's itself. Torques [N m]: `torque`, the gimbal's less tau_c of (2);
        `torque_turned_J2`, with the sign of the last term turned; `torque_without_flywheel`, without the flywheel's
        term, which the servo supplies; `torque_size`, the torque itself.
    """
    plant = load_plant(equilibrium_bias_deg=0.0)
    model, reduced, first = copy(plant.model), plant.reduced, plant.axis.modules[0]
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    data, rng, rows = mujoco.MjData(model), np.random.default_rng(seed), []
    for _ in range(states):
        x1, x3 = rng.uniform(-0.4, 0.4), rng.uniform(-1.2, 1.2)
        x2, u = rng.uniform(-2.0, 2.0), rng.uniform(-4.7, 4.7)
        speed = rng.uniform(280.0, 340.0)
        torque, motor_torque = rng.uniform(-1.0, 1.0), rng.uniform(-0.2, 0.2)
        mujoco.mj_resetDataKeyframe(model, data, plant.key)
        data.qpos[plant.tilt], data.qvel[plant.tilt] = plant.tilt_zero + x1, x2
        for module in plant.axis.modules:
            data.qpos[module.gimbal] = module.gimbal_zero + module.direction * x3
            data.qvel[module.gimbal] = module.direction * u
            data.qvel[module.flywheel] = math.copysign(speed, module.speed)
            data.qfrc_applied[module.gimbal] = module.direction * torque
            data.qfrc_applied[module.flywheel] = math.copysign(1.0, module.speed) * motor_torque
        mujoco.mj_forward(model, data)
        q, spin_up = float(data.qacc[plant.tilt]), float(data.qacc[first.flywheel]) * math.copysign(1.0, first.speed)
        at_speed = replace(reduced, omega_d=speed)
        off, off_turned = (
            q - replace(at_speed, J2=J2).tilt_acceleration(x1, x2, x3, u) for J2 in (reduced.J2, -reduced.J2)
        )
        # d/dt of J_d omega_d sin x3, of which (3) has the part with x3'.
        by_spin_up = reduced.J_d * math.sin(x3) * spin_up / (reduced.J1 + reduced.J2 * math.sin(x3) ** 2)
        miss = torque - gimbal_torque(x2, x3, first.direction * float(data.qacc[first.gimbal]), speed)
        last = gimbal_torque(x2, x3, 0.0, 0.0)  # that of J2 alone
        flywheel = gimbal_torque(x2, x3, 0.0, speed) - last
        rows.append(
            {
                "tilt": off - by_spin_up,
                "tilt_as_printed": off,
                "tilt_turned_J2": off_turned - by_spin_up,
                "yaw": data.qacc[plant.yaw],
                "size": q,
                "torque": miss,
                "torque_turned_J2": miss + 2.0 * last,
                "torque_without_flywheel": miss + flywheel,
                "torque_size": torque,
            }
        )
    rms = np.sqrt(np.mean(np.square([list(row.values()) for row in rows]), axis=0))
    return dict(zip(rows[0], rms, strict=True))


def equations_2_to_4(r: Mapping[str, float]) -> Claim:
    """Judge (3) and (4) against MuJoCo's six bodies."""
    return Claim(
        "(2) to (4)",
        "Under Hypotheses 1 to 3 the six bodies move as one pendulum with one gimbal, and body A stands still.",
        holds=max(r["tilt"], r["yaw"]) < 1e-9 * r["size"] and r["tilt_turned_J2"] > 1e3 * r["tilt"],
        figures={f"{name}_rad_s2": size for name, size in r.items() if "torque" not in name},
    )


def gimbals_line(r: Mapping[str, float]) -> Claim:
    """Judge the second line of (2), which the velocity servos make superfluous later."""
    return Claim(
        "(2), tau_c",
        "A gimbal's torque is (I_c + I_d) omega_c' + J_d omega_b omega_d sin q_c + J2 sin(2 q_c) omega_b^2/2.",
        holds=r["torque"] < 1e-9 * r["torque_size"] and r["torque_turned_J2"] > 1e3 * r["torque"],
        figures={f"{name}_n_m": size for name, size in r.items() if "torque" in name},
    )


def claims() -> list[Claim]:
    """Judge Table 1, and (2) to (4)."""
    r = residuals()
    return [table_1(), equations_2_to_4(r), gimbals_line(r)]


def linearisation() -> Claim:
    """Judge (6) and the controllability of (A_e, B_e)."""
    model = printed_model()
    still_model = replace(model, omega_d=0.0)
    error, margin = finite_difference_error(model), controllability_margin(model.A_e, model.B_e)
    no_spin = controllability_margin(still_model.A_e, still_model.B_e)
    return Claim(
        "(6), Section III",
        "A and B linearise (4); the pair (A_e, B_e) with the integrator is controllable.",
        holds=error < 1e-6 and margin > 1e-9 and no_spin < 1e-15,
        figures={"finite_difference_error": error, "rank_margin": margin, "rank_margin_flywheels_at_rest": no_spin},
    )


def law_equilibria() -> Claim:
    """Judge equilibria of (7) and (8) on the linearisation."""
    is_so, figures = law_rests(printed_model(), K_E, 7, 8)
    return Claim(
        "(7), (8)",
        "Static feedback leaves the gimbal off by k1/k3 e; with the integrator x goes to zero and x_e "
        "settles at k_e1/k_e4 e (both printed with a minus).",
        holds=is_so,
        conditions="With y1 = x1 - e the bias enters (7) and (8) as +k1 e: both offsets have a plus where a minus is "
        "printed.",
        figures=figures,
    )

"""Sections II to IV of sokolov2019: constants, equations of motion, the law's equilibria, the observers' biases."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.law import TABLE_2_GAINS
from cmg_mj.observers import make_observer
from cmg_mj.observers.luenberger import Luenberger
from cmg_mj.papers.aranovskiy2020.linearisation import (
    TABLE_1,
    controllability_margin,
    equilibrium,
    finite_difference_error,
    shown,
)
from cmg_mj.papers.claim import Claim, OnShare, verdict
from cmg_mj.papers.sokolov2019.single_gimbal import NO_NOISE, experiment, servo_of
from cmg_mj.plant import Plant
from cmg_mj.reduced import ReducedModel

TABLE_I = TABLE_1 | {"l": 0.13}
"""sokolov2019 Table I as printed: that of aranovskiy2020 but for l, from the pivot to the centre of mass [m]."""

K_E = np.array(TABLE_2_GAINS)
"""sokolov2019 Table II has the gains of aranovskiy2020 Table 2."""

REST_S = 35.0
"""So long until the law's slowest poles, -0.19 +- 0.29j 1/s, have faded to 1e-3 [s]."""


def printed_model() -> ReducedModel:
    """J1, J2, J_d w_d and m g l by the closed forms below (1), from Table I's numbers alone."""
    t = TABLE_I
    return ReducedModel(
        J1=t["I_d"] + t["J_b"] + t["K_c"] + t["m"] * t["l"] ** 2,
        J2=t["J_c"] - t["I_d"] + t["J_d"] - t["K_c"],
        J_d=t["J_d"],
        omega_d=t["omega_d"],
        gravity_torque=t["m"] * t["g"] * t["l"],
    )


def table_i() -> Claim:
    """The constants of the compiled rig beside those of Table I."""
    ours, paper = experiment().plant.reduced, printed_model()
    names = ("J1", "J2", "J_d", "omega_d", "gravity_torque")
    off = max(abs(getattr(ours, name) / getattr(paper, name) - 1.0) for name in names)
    return Claim(
        place="Table I",
        says="Mass, pivot distance and inertias; J1 = I_d + J_b + K_c + m l^2, J2 = J_c - I_d + J_d - K_c.",
        found=(
            f"J1 = {paper.J1:.6f}, J2 = {paper.J2:.2e} kg m^2, J_d w_d = {paper.J_d * paper.omega_d:.4f} N m s, m g l "
            f"= {paper.gravity_torque:.4f} N m; the compiled model has the same to {off:.0e}. Unstable pole "
            f"{math.sqrt(paper.gravity_torque / paper.J1):.2f} 1/s."
        ),
        verdict=verdict(off < 1e-9),
        why="" if off < 1e-9 else "The model file has other numbers.",
        figures={
            "J1_kg_m2": paper.J1,
            "J2_kg_m2": paper.J2,
            "spin_momentum_n_m_s": paper.J_d * paper.omega_d,
            "gravity_torque_n_m": paper.gravity_torque,
            "largest_relative_difference": off,
        },
    )


def equation_residual(plant: Plant, states: int, seed: int, J2_sign: float = 1.0) -> float:
    """Largest difference between (1) and MuJoCo's inverse dynamics at random states [N m].

    Args:
        plant: The rig on a locked bearing.
        states: How many.
        seed: Of the states.
        J2_sign: -1 for a J2 with its sign turned, which must be seen.
    """
    r, rotor = plant.reduced, servo_of(plant).inertia
    J2 = J2_sign * r.J2
    rng, data, worst = np.random.default_rng(seed), mujoco.MjData(plant.model), 0.0
    for _ in range(states):
        q_b, q_c, q_d = rng.uniform(-math.pi, math.pi, 3)
        w_b, w_c = rng.uniform(-5.0, 5.0, 2)
        w_d = rng.uniform(200.0, 400.0)
        dw = rng.uniform(-100.0, 100.0, 3)
        data.qpos[:], data.qvel[:], data.qacc[:] = [q_b, q_c, q_d], [w_b, w_c, w_d], dw
        mujoco.mj_inverse(plant.model, data)
        tilt = (r.J1 + J2 * math.cos(q_c) ** 2) * dw[0] - J2 * math.sin(2.0 * q_c) * w_c * w_b
        tilt += r.J_d * dw[2] * math.cos(q_c) - r.J_d * math.sin(q_c) * w_c * w_d
        tilt -= r.gravity_torque * math.sin(q_b + math.pi / 4.0)
        gimbal = rotor * dw[1] + r.J_d * w_b * w_d * math.sin(q_c) + 0.5 * J2 * math.sin(2.0 * q_c) * w_b**2
        flywheel = r.J_d * (dw[2] + math.cos(q_c) * dw[0] - math.sin(q_c) * w_c * w_b)
        worst = max(worst, float(np.abs(data.qfrc_inverse - [tilt, gimbal, flywheel]).max()))
    return worst


def equations_of_motion(states: int = 300, seed: int = 81_000) -> Claim:
    """(1) against the compiled bodies."""
    plant = experiment(["plant.equilibrium_bias_deg=0.0"]).plant
    residual, turned = (equation_residual(plant, states, seed, sign) for sign in (1.0, -1.0))
    holds = residual < 1e-9 and turned > 1e3 * residual
    return Claim(
        place="(1)",
        says="The Euler-Lagrange equations of frame, gimbal and wheel.",
        found=(
            f"At {states} random states all three are those of the compiled bodies to {residual:.0e} N m; with J2's "
            f"sign turned they are off by {turned:.1e} N m."
        ),
        verdict=verdict(holds),
        why="" if holds else "The bodies obey other equations.",
        figures={"largest_residual_n_m": residual, "largest_residual_with_J2_turned_n_m": turned, "states": states},
    )


def law_equilibria() -> Claim:
    """Section III: linearisation, controllability, and where (6) and (7) rest."""
    model, K = printed_model(), K_E[:3]
    error, margin = finite_difference_error(model), controllability_margin(model.A_e, model.B_e)
    rest_6, poles_6 = equilibrium(model.A, model.B, K, 1.0)
    rest_7, poles_7 = equilibrium(model.A_e, model.B_e, K_E, 1.0)
    off = max(
        np.abs(rest_6 - [0.0, 0.0, K[0] / K[2]]).max() / abs(K[0] / K[2]),
        np.abs(rest_7 - [0.0, 0.0, 0.0, K_E[0] / K_E[3]]).max() / (K_E[0] / K_E[3]),
    )
    slowest = float(max(np.real(poles_6).max(), np.real(poles_7).max()))
    return Claim(
        place="(5), (6), (7)",
        says=(
            "A, B linearise (3) and (A_e, B_e) is controllable; (6) leaves the gimbal at -k1/k3 e, (7) brings x to "
            "zero with x_e at -k_e1/k_e4 e."
        ),
        found=(
            f"Central differences give A and B to {error:.0e}; the controllability matrix has rank 4 (least singular "
            f"value {margin:.1e} of the largest). Per radian of e, (6) rests at x3 = {rest_6[2]:+.1f} = +k1/k3 and (7) "
            f"at x = 0, x_e = {rest_7[3]:+.1f} s = +k_e1/k_e4. Poles of (6): {shown(poles_6)}; of (7): "
            f"{shown(poles_7)} 1/s."
        ),
        verdict=verdict(error < 1e-6 and margin > 1e-9 and off < 1e-9 and slowest < 0.0, "sign"),
        why="With y1 = x1 - e the bias enters (6) and (7) as +k1 e: both offsets have a plus where a minus is printed.",
        figures={
            "finite_difference_error": error,
            "controllability_margin": margin,
            "gimbal_rest_of_6_rad_per_rad": rest_6[2],
            "integrator_rest_of_7_s_per_rad": rest_7[3],
            "poles_of_6_1_s": [[p.real, p.imag] for p in poles_6],
            "poles_of_7_1_s": [[p.real, p.imag] for p in poles_7],
        },
    )


# --- the observers' biases ----------------------------------------------------------------------------------


class Rest(NamedTuple):
    """Where a run without noise comes to rest."""

    x: np.ndarray
    """Largest |x1| [rad], |x2| [rad/s], |x3| [rad] over the last second, (3,)."""
    x2_estimate: float
    """The observer's rate [rad/s]."""
    x_e: float
    """The integrator [rad s]."""


def rest_of(observer: str, e_deg: float, angles: str, settings: Sequence[str] = ()) -> Rest:
    """Release the rig with a bias and wait."""
    fields = [*NO_NOISE, f"plant.equilibrium_bias_deg={e_deg}", "plant.initial_tilt_deg=0.1", "push=[]"]
    fields += [f"duration_s={REST_S}", f'controller.angles="{angles}"', *settings]
    result = experiment(fields, observer).run()
    assert result.trajectory is not None
    t = result.trajectory
    last = t["time_s"] >= REST_S - 1.0
    if result.outcomes[0].kind != "done":
        return Rest(np.full(3, math.inf), math.nan, math.nan)
    x = np.array([np.abs(t[name][last]).max() for name in ("x1_rad", "x2_rad_s", "x3_rad")])
    return Rest(x, float(t[f"estimate/{observer}/x2_rad_s"][last].mean()), float(t["x_e_rad_times_s"][last].mean()))


def luenberger_rest(model: ReducedModel, e: float) -> np.ndarray:
    """What (9) estimates at x = 0, u = 0, y1 = -e: the solution of (A - L C) xhat + L y = 0, (3,)."""
    observer = make_observer("luenberger", 0.005, model)
    assert isinstance(observer, Luenberger)
    return np.linalg.solve(observer.error_matrix, -np.array(observer.L) @ [-e, 0.0])


def homogeneous_rest(model: ReducedModel, e: float, k1: float = 20.0, k2: float = 150.0, alpha: float = 0.85) -> float:
    """The rate that (10) estimates at x = u = 0, y1 = -e: k1 [e_b]^alpha, k2 [e_b]^(2 alpha - 1) = f2(y) [rad/s]."""
    drift = float(model.terms(-e, 0.0)[0])
    e_b = math.copysign((abs(drift) / k2) ** (1.0 / (2.0 * alpha - 1.0)), drift)
    return k1 * math.copysign(abs(e_b) ** alpha, e_b)


def biased_observer(e_deg: float = 0.25) -> Claim:
    """Section IV-B: the integrator compensates the offset even if (9) is biased."""
    model, e = printed_model(), math.radians(e_deg)
    poles = np.linalg.eigvals(model.A - np.array([[20.0, 0.0], [150.0, 0.0], [0.0, 20.0]]) @ model.C)
    x_hat = luenberger_rest(model, e)
    rests = {angles: rest_of("luenberger", e_deg, angles) for angles in ("estimated", "measured")}
    k1, k2, _, k4 = K_E
    expected_x_e = {"estimated": -(k1 * x_hat[0] + k2 * x_hat[1]) / k4, "measured": (k1 * e - k2 * x_hat[1]) / k4}
    still = max(float(rest.x.max()) for rest in rests.values())
    off = max(abs(rest.x2_estimate / x_hat[1] - 1.0) for rest in rests.values())
    off_x_e = max(abs(rest.x_e / expected_x_e[angles] - 1.0) for angles, rest in rests.items())
    holds = still < 2e-3 and off < 0.02 and off_x_e < 0.02 and float(np.real(poles).max()) < 0.0
    return Claim(
        place="Section IV-B",
        says="A - L C is Hurwitz; with a bias e the estimate of (9) is off, but the integrator still brings x to zero.",
        found=(
            f"Poles of A - L C: {shown(poles)} 1/s. At e = {e_deg} deg and without noise, |x| ends below {still:.1e} "
            f"after {REST_S:.0f} s, the law on estimated angles or on measured ones, while the estimated rate rests at "
            f"{rests['estimated'].x2_estimate:.4f} rad/s (closed form {x_hat[1]:.4f})."
        ),
        verdict=verdict(holds, "sign" if holds else ""),
        why=(
            "With y1 = x1 - e the bias enters y as -C_e e and the error as +L C_e e; the other sign is printed."
            if holds
            else "It does not come to rest as the linear equations say."
        ),
        figures={
            "largest_rest_state": still,
            "rate_estimate_rad_s": rests["estimated"].x2_estimate,
            "rate_estimate_closed_form_rad_s": float(x_hat[1]),
            "integrator_rad_s": {angles: rest.x_e for angles, rest in rests.items()},
            "integrator_closed_form_rad_s": {angles: float(value) for angles, value in expected_x_e.items()},
            "poles_of_A_LC_1_s": [[p.real, p.imag] for p in poles],
        },
    )


def homogeneous_vicinity(biases_deg: Sequence[float] = (0.0, 0.25, 0.5)) -> Claim:
    """Section IV-C: the error of (10) ends in a vicinity of the origin, whose size e decides."""
    model = printed_model()
    found = {e: rest_of("homogeneous", e, "measured").x2_estimate for e in biases_deg}
    expected = {e: homogeneous_rest(model, math.radians(e)) for e in biases_deg}
    off = max(abs(found[e] - expected[e]) / max(abs(expected[e]), 5e-3) for e in biases_deg)
    holds = off < 0.1
    listed = ", ".join(f"{found[e]:.4f} at e = {e:g} deg (closed form {expected[e]:.4f})" for e in biases_deg)
    return Claim(
        place="Section IV-C",
        says=(
            "With alpha in (1/2, 1] the error of (10) converges to a vicinity of the origin: sin(y1) replaces sin(x1)."
        ),
        found=f"Without noise the estimated rate comes to rest at [rad/s] {listed}, the true one being zero.",
        verdict=verdict(holds),
        why="" if holds else "The vicinity is not of the size that the equations give.",
        figures={
            "rate_estimate_rad_s": {f"{e:g}_deg": found[e] for e in biases_deg},
            "rate_estimate_closed_form_rad_s": {f"{e:g}_deg": expected[e] for e in biases_deg},
        },
    )


def run(on_share: OnShare) -> list[Claim]:
    """All of them."""
    parts = (table_i, equations_of_motion, law_equilibria, biased_observer, homogeneous_vicinity)
    claims = []
    for i, part in enumerate(parts):
        claims.append(part())
        on_share((i + 1) / len(parts))
    return claims

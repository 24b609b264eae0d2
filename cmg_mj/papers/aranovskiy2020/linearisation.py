"""Sections II and III of aranovskiy2020: the constants, the reduced model, its linearisation, the law's equilibria."""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import copy
from functools import cache
from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.law import TABLE_2_GAINS
from cmg_mj.papers.claim import Claim, OnShare, verdict
from cmg_mj.plant import Plant, load_plant
from cmg_mj.reduced import ReducedModel

TABLE_1 = {
    "m": 2.62,
    "l": 0.19,
    "J_b": 13e-3,
    "J_c": 2.6e-4,
    "K_c": 9.9e-4,
    "I_d": 5.6e-4,
    "J_d": 11e-4,
    "omega_d": 314.0,
    "g": 9.81,
}
"""aranovskiy2020 Table 1 as printed [kg, m, kg m^2, rad/s], and the standard gravity that it does not give [m/s^2]."""


@cache
def rig() -> Plant:
    """The scissored pair, balanced."""
    return load_plant(equilibrium_bias_deg=0.0)


def printed_model() -> ReducedModel:
    """J1, J2, J_d omega_d and m g l/sqrt(2) by the closed forms below (2), from Table 1's numbers alone."""
    t = TABLE_1
    return ReducedModel(
        J1=t["I_d"] + t["J_b"] + t["K_c"] + t["m"] * t["l"] ** 2 / 2.0,
        J2=t["J_c"] - t["I_d"] + t["J_d"] - t["K_c"],
        J_d=t["J_d"],
        omega_d=t["omega_d"],
        gravity_torque=t["m"] * t["g"] * t["l"] / math.sqrt(2.0),
    )


def table_1() -> Claim:
    """The constants of the compiled six-body model beside those of Table 1."""
    ours, paper = rig().reduced, printed_model()
    names = ("J1", "J2", "J_d", "omega_d", "gravity_torque")
    off = max(abs(getattr(ours, name) / getattr(paper, name) - 1.0) for name in names)
    pole = math.sqrt(paper.gravity_torque / paper.J1)
    return Claim(
        place="Table 1",
        says="Masses, lengths and inertias of the rig, from which J1 and J2 below (2) follow.",
        found=(
            f"J1 = {paper.J1:.6f} kg m^2, J2 = {paper.J2:.2e} kg m^2, "
            f"J_d omega_d = {paper.J_d * paper.omega_d:.4f} N m s, m g l/sqrt(2) = {paper.gravity_torque:.4f} N m, "
            f"unstable pole {pole:.2f} 1/s. Read off the compiled six-body model they agree to {off:.1e}."
        ),
        verdict=verdict(off < 1e-9, "reading"),
        why="m is printed as the total mass, but T and P use it as the mass of each half; read so, they fit together.",
        figures={
            "J1_kg_m2": paper.J1,
            "J2_kg_m2": paper.J2,
            "spin_momentum_n_m_s": paper.J_d * paper.omega_d,
            "gravity_torque_n_m": paper.gravity_torque,
            "unstable_pole_1_s": pole,
            "largest_relative_difference": off,
        },
    )


# --- (3) and (4) against the six bodies ---------------------------------------------------------------------


class Residuals(NamedTuple):
    """The six-body model's accelerations less the reduced model's, RMS over random states [rad/s^2]."""

    tilt: float
    """With the flywheels' own acceleration counted."""
    tilt_as_printed: float
    """As (3) is printed, which takes omega_d' for zero (Hypothesis 3)."""
    tilt_turned_J2: float
    """With J2's sign turned: what the comparison can tell apart."""
    yaw: float
    """Acceleration of body A, which Hypotheses 1 and 2 say is zero."""
    size: float
    """RMS of the tilt acceleration itself."""


def residuals(states: int, seed: int) -> Residuals:
    """Compare (3) with MuJoCo at random symmetric states, under random symmetric torques.

    Args:
        states: How many.
        seed: Of the random numbers.

    Returns:
        The residuals.
    """
    plant = rig()
    model = copy(plant.model)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    data = mujoco.MjData(model)
    rng = np.random.default_rng(seed)
    reduced = plant.reduced
    turned = ReducedModel(reduced.J1, -reduced.J2, reduced.J_d, reduced.omega_d, reduced.gravity_torque)
    rows = []
    for _ in range(states):
        x1, x3 = rng.uniform(-0.4, 0.4), rng.uniform(-1.2, 1.2)
        x2, u = rng.uniform(-2.0, 2.0), rng.uniform(-4.7, 4.7)
        speed = rng.uniform(280.0, 340.0)
        gimbal_torque, motor_torque = rng.uniform(-1.0, 1.0), rng.uniform(-0.2, 0.2)
        mujoco.mj_resetDataKeyframe(model, data, plant.key)
        data.qpos[plant.tilt], data.qvel[plant.tilt] = plant.tilt_zero + x1, x2
        for cube in plant.cubes:
            data.qpos[cube.gimbal], data.qvel[cube.gimbal] = cube.gimbal_zero + cube.direction * x3, cube.direction * u
            data.qvel[cube.flywheel] = math.copysign(speed, cube.speed)
            data.qfrc_applied[cube.gimbal] = cube.direction * gimbal_torque
            data.qfrc_applied[cube.flywheel] = math.copysign(1.0, cube.speed) * motor_torque
        mujoco.mj_forward(model, data)
        spin = data.qacc[plant.cubes[0].flywheel] * math.copysign(1.0, plant.cubes[0].speed)
        D = reduced.J1 + reduced.J2 * math.sin(x3) ** 2

        def f2(m: ReducedModel, at: tuple = (x1, x2, x3, u), speed: float = speed) -> float:
            return ReducedModel(m.J1, m.J2, m.J_d, speed, m.gravity_torque).tilt_acceleration(*at)

        q = float(data.qacc[plant.tilt])
        # d/dt of J_d omega_d sin x3, of which (3) has the part with x3'.
        by_spin = reduced.J_d * math.sin(x3) * float(spin) / D
        rows.append((q - f2(reduced) - by_spin, q - f2(reduced), q - f2(turned) - by_spin, data.qacc[plant.yaw], q))
    return Residuals(*(float(value) for value in np.sqrt(np.mean(np.square(rows), axis=0))))


def equations_3_and_4(states: int = 500, seed: int = 70_000) -> Claim:
    """(3) and (4) against MuJoCo's six bodies."""
    r = residuals(states, seed)
    holds = r.tilt < 1e-9 * r.size and r.yaw < 1e-9 * r.size and r.tilt_turned_J2 > 1e3 * r.tilt
    return Claim(
        place="(2) to (4)",
        says="Under Hypotheses 1 to 3 the six bodies move as one pendulum with one gimbal, and body A stands still.",
        found=(
            f"At {states} random symmetric states the six-body model's tilt acceleration (RMS {r.size:.1f} rad/s^2) "
            f"equals (3) to {r.tilt:.1e} once J_d omega_d' sin x3 is added, and body A's is {r.yaw:.1e}. With motor "
            f"torques up to 0.2 N m what (3) leaves out is {r.tilt_as_printed:.2f} rad/s^2; J2's sign turned would be "
            f"{r.tilt_turned_J2:.1e} off."
        ),
        verdict=verdict(holds),
        figures={f"{name}_rad_s2": value for name, value in r._asdict().items()},
    )


# --- (6) ----------------------------------------------------------------------------------------------------


def rank_margin(matrix: np.ndarray) -> float:
    """Least singular value by the largest: zero for a matrix without full rank."""
    values = np.linalg.svd(matrix, compute_uv=False)
    return float(values[-1] / values[0])


def controllability_margin(A: np.ndarray, B: np.ndarray) -> float:
    """Rank margin of [B, A B, ..., A^(n-1) B]."""
    columns = [B]
    for _ in range(len(A) - 1):
        columns.append(A @ columns[-1])
    return rank_margin(np.hstack(columns))


def finite_difference_error(model: ReducedModel, h: float = 1e-5) -> float:
    """Largest error of (6) against central differences of (4), by the largest entry."""

    def f(x: np.ndarray, u: float) -> np.ndarray:
        return np.array([x[1], model.tilt_acceleration(float(x[0]), float(x[1]), float(x[2]), u), u])

    zero = np.zeros(3)
    A = np.column_stack([(f(h * axis, 0.0) - f(-h * axis, 0.0)) / (2.0 * h) for axis in np.eye(3)])
    B = ((f(zero, h) - f(zero, -h)) / (2.0 * h))[:, None]
    return float(max(np.abs(A - model.A).max() / np.abs(A).max(), np.abs(B - model.B).max() / np.abs(B).max()))


def linearisation() -> Claim:
    """(6) and the controllability of (A_e, B_e)."""
    model = printed_model()
    error = finite_difference_error(model)
    margin = controllability_margin(model.A_e, model.B_e)
    still = ReducedModel(model.J1, model.J2, model.J_d, 0.0, model.gravity_torque)
    without = controllability_margin(still.A_e, still.B_e)
    return Claim(
        place="(6), Section III",
        says="A and B linearise (4); the pair (A_e, B_e) with the integrator is controllable.",
        found=(
            f"Central differences of (4) give A and B to {error:.1e}. The controllability matrix of (A_e, B_e) has "
            f"full rank: its least singular value is {margin:.1e} of the largest; with the flywheels at rest it is "
            f"{without:.0e}."
        ),
        verdict=verdict(error < 1e-6 and margin > 1e-9 and without < 1e-15),
        figures={"finite_difference_error": error, "rank_margin": margin, "rank_margin_flywheels_at_rest": without},
    )


# --- (7) and (8) --------------------------------------------------------------------------------------------


def equilibrium(A: np.ndarray, B: np.ndarray, K: np.ndarray, e: float) -> tuple[np.ndarray, np.ndarray]:
    """Where x' = A x + B u, u = -K x + k1 e rests, and its poles. With y1 = x1 - e the bias enters with a plus."""
    closed = A - B @ K[None, :]
    return np.linalg.solve(closed, -B[:, 0] * K[0] * e), np.linalg.eigvals(closed)


def law_equilibria() -> Claim:
    """Equilibria of (7) and (8) on the linearisation."""
    model, K_e = printed_model(), np.array(TABLE_2_GAINS)
    K = K_e[:3]
    rest_7, poles_7 = equilibrium(model.A, model.B, K, 1.0)
    rest_8, poles_8 = equilibrium(model.A_e, model.B_e, K_e, 1.0)
    expected_7, expected_8 = np.array([0.0, 0.0, K[0] / K[2]]), np.array([0.0, 0.0, 0.0, K_e[0] / K_e[3]])
    off = max(np.abs(rest_7 - expected_7).max() / abs(expected_7[2]), np.abs(rest_8 - expected_8).max() / expected_8[3])
    stable = max(np.real(poles_7).max(), np.real(poles_8).max()) < 0.0
    return Claim(
        place="(7), (8)",
        says=(
            "Static feedback leaves the gimbal off by k1/k3 e; with the integrator x goes to zero and x_e settles at "
            "k_e1/k_e4 e (both printed with a minus)."
        ),
        found=(
            f"Per radian of e, (7) rests at x3 = {rest_7[2]:+.1f} and (8) at x = 0 with x_e = {rest_8[3]:+.1f} s; the "
            f"closed forms agree to {off:.0e}. Poles of (7): {shown(poles_7)}; of (8): {shown(poles_8)} 1/s."
        ),
        verdict=verdict(off < 1e-9 and stable, "sign"),
        why="With y1 = x1 - e the bias enters (7) and (8) as +k1 e: both offsets have a plus where a minus is printed.",
        figures={
            "gimbal_rest_of_7_rad_per_rad": rest_7[2],
            "integrator_rest_of_8_s_per_rad": rest_8[3],
            "poles_of_7_1_s": [[p.real, p.imag] for p in poles_7],
            "poles_of_8_1_s": [[p.real, p.imag] for p in poles_8],
        },
    )


def shown(poles: np.ndarray) -> str:
    """Poles in words, each pair once."""
    upper = sorted((p for p in poles if p.imag >= -1e-9), key=lambda p: p.real)
    return ", ".join(f"{p.real:.3g}+-{p.imag:.3g}j" if p.imag > 1e-9 else f"{p.real:.3g}" for p in upper)


def run(on_share: OnShare) -> list[Claim]:
    """All claims of this module."""
    claims: list[Claim] = []
    makers: list[Callable[[], Claim]] = [table_1, equations_3_and_4, linearisation, law_equilibria]
    for i, make in enumerate(makers):
        claims.append(make())
        on_share((i + 1) / len(makers))
    return claims

"""Conservation laws and the balance of work of the motion, in terms of the paper's own T and P.

The flywheels spin with 54 J each, which would hide everything else, so the energy watched is the platform's:
T + P without 1/2 J_d (axial absolute angular velocity)^2 of each flywheel. P is counted from the hanging
position, so that this energy is positive and its drift can be stated relative to its initial value.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import mujoco
import numpy as np
import pytest

from cmg_mj.plant.plant import Plant, load_plant
from cmg_mj.scenario.plant_settings import PlantSettings
from tests.plant import paper_model as paper
from tests.plant.full_model import Motion, motion, passive
from tests.tiers import slow_but

N_WORLDS = 10
FLYWHEELS = [3, 5]
MOMENTUM = paper.J_d * paper.omega_d
NAMES = ("platform energy", "vertical momentum", "flywheel 1 momentum", "flywheel 2 momentum")


def initial_states(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Tilted by up to 30 degrees, gimbals by 60; all rates but the flywheels' up to 3 rad/s.

    Half of the worlds have the flywheels spin oppositely at nominal speed, the other half unequally.
    """
    rng = np.random.default_rng(seed)
    qpos, qvel = np.zeros((N_WORLDS, 6)), rng.uniform(-3.0, 3.0, (N_WORLDS, 6))
    qpos[:, 0] = rng.uniform(-math.pi, math.pi, N_WORLDS)
    qpos[:, 1] = -math.pi / 4.0 + rng.uniform(-0.5, 0.5, N_WORLDS)
    qpos[:, [2, 4]] = math.pi / 2.0 + rng.uniform(-1.0, 1.0, (N_WORLDS, 2))
    qvel[:, FLYWHEELS] = [paper.omega_d, -paper.omega_d]
    half = N_WORLDS // 2
    qvel[half:, 3] = rng.uniform(200.0, 400.0, N_WORLDS - half)
    qvel[half:, 5] = rng.uniform(-400.0, 400.0, N_WORLDS - half)
    return qpos, qvel


def energy(run: Motion, plant: Plant, *, gravity: bool = True) -> np.ndarray:
    """T + P, (n_worlds, n_samples) [J]."""
    exact = paper.scissored_pair(float(plant.model.body("thrust_bearing").inertia[2]))
    lowest_energy = math.sqrt(2.0) * paper.m * paper.g * paper.l
    return exact.kinetic(run.qpos, run.qvel) + gravity * (exact.potential(run.qpos) + lowest_energy)


def drifts(run: Motion, plant: Plant, *, gravity: bool) -> np.ndarray:
    """Drifts, (4, n_worlds, n_samples): the platform's energy by its first value, momenta by J_d omega_d.

    q_a, q_d1 and q_d2 appear in neither T nor P. Their momenta dT/d(dq) are the angular momentum about the
    vertical and J_d times each flywheel's axial absolute angular velocity.
    """
    exact = paper.scissored_pair(float(plant.model.body("thrust_bearing").inertia[2]))
    momenta = exact.momenta(run.qpos, run.qvel)[..., [0, *FLYWHEELS]]
    spin = np.sum(momenta[..., 1:] ** 2, axis=-1) / (2.0 * paper.J_d)
    platform = energy(run, plant, gravity=gravity) - spin
    relative = platform / platform[:, :1] - 1.0
    return np.stack([relative, *np.moveaxis((momenta - momenta[:, :1]) / MOMENTUM, -1, 0)])


def free_motion(duration_s: float, timestep_s: float, *, gravity: bool, seed: int, every_s: float) -> np.ndarray:
    """Drifts of a rig without friction whose motors and servos are dead, sampled at every_s."""
    plant = load_plant(equilibrium_bias_deg=0.0, timestep_s=timestep_s)
    run = motion(passive(plant, gravity=gravity), *initial_states(seed), round(duration_s / timestep_s))
    stride = round(every_s / timestep_s)
    return drifts(Motion(*(samples[:, ::stride] for samples in run)), plant, gravity=gravity)


@pytest.mark.daily_cases("False-1e-07-2.0")
@pytest.mark.parametrize("duration_s", slow_but([2.0, 10.0], 2.0))
@pytest.mark.parametrize(("gravity", "momentum_bound"), [(False, 1e-7), (True, 3e-6)])
def test_free_motion_conserves_energy_and_momenta(gravity: bool, momentum_bound: float, duration_s: float) -> None:
    worst = np.abs(free_motion(duration_s, 1e-3, gravity=gravity, seed=0, every_s=1e-3)).max(axis=(1, 2))
    print(f"gravity {gravity}:", ", ".join(f"{name} {d:.1e}" for name, d in zip(NAMES, worst, strict=True)))
    assert worst[0] < 1e-6
    assert np.all(worst[1:] < momentum_bound)


@pytest.mark.daily_cases("True")
@pytest.mark.parametrize("gravity", [False, True])
def test_drifts_shrink_with_the_fourth_power_of_the_step(gravity: bool) -> None:
    """Orders of root mean squares over worlds and a common grid; a maximum jumps between instants.

    A drift is an oscillation of order 4 and a steady loss of order 5. Over ten seconds the loss rules:
    halving 2 ms divides all but the vertical momentum's drift by 28 to 38. Where the two are alike they may
    cancel, and the order seems to dip to 3.8. A quarter of a second keeps the loss small and every drift
    above rounding.
    """
    steps_s = (1e-3, 5e-4, 2.5e-4)
    runs = [free_motion(0.25, h, gravity=gravity, seed=1, every_s=1e-3) for h in steps_s]
    sizes = np.array([np.sqrt(np.mean(run**2, axis=(1, 2))) for run in runs])
    orders = np.log2(sizes[:-1] / sizes[1:])
    for name, size, order in zip(NAMES, sizes.T, orders.T, strict=True):
        print(f"gravity {gravity}: {name}", *(f"{d:.1e}" for d in size), "order", *(f"{o:.2f}" for o in order))
    assert np.all(orders > 3.9)
    assert np.all(sizes[-1] > 5e-14)  # rounding is below 1e-14


# --- the balance of work ------------------------------------------------------------------------------------

CONTROL_PERIOD_S = 5e-3
STEPS = 5  # physics steps of 1 ms a control period
NEWTON_COTES = np.array([19.0, 75.0, 50.0, 50.0, 75.0, 19.0]) / 288.0  # on six points, of order six


def sinusoidal_commands(n_periods: int, plant: Plant, seed: int) -> np.ndarray:
    """Gimbal rates of 1.5 rad/s, flywheels 20 rad/s about nominal, (n_worlds, n_periods, n_actuators)."""
    rng = np.random.default_rng(seed)
    frequency_hz = rng.uniform(0.3, 1.5, (N_WORLDS, 1, 4))
    phase = rng.uniform(0.0, 2.0 * math.pi, (N_WORLDS, 1, 4))
    time_s = CONTROL_PERIOD_S * np.arange(n_periods)[:, None]
    wave = np.sin(2.0 * math.pi * frequency_hz * time_s + phase)
    amplitude, mean = np.zeros(4), np.zeros(4)
    for module in plant.axis.modules:
        amplitude[[module.servo, module.motor]] = 1.5, 20.0
        mean[module.motor] = module.speed
    return mean + amplitude * wave


def actuator_torques(model: mujoco.MjModel, run: Motion, command: np.ndarray) -> np.ndarray:
    """Servo: kp (setpoint - angle) - kv rate. Flywheel: kv (command - rate). Each within its limits [N m]."""
    torques = np.zeros_like(run.qvel)
    for actuator in range(model.nu):
        joint = model.actuator_trnid[actuator, 0]
        setpoint = model.actuator_actadr[actuator]
        setpoints = command[..., actuator] if setpoint < 0 else run.act[..., setpoint]
        _, stiffness, damping = model.actuator_biasprm[actuator, :3]
        torque = model.actuator_gainprm[actuator, 0] * setpoints
        torque = torque + stiffness * run.qpos[..., joint] + damping * run.qvel[..., joint]
        torques[..., joint] = np.clip(torque, *model.actuator_forcerange[actuator])
    return torques


class Balance(NamedTuple):
    """Energy gained against the work of motors and friction."""

    residual: float
    """The worst |gain - work| along any world's run, by that world's whole integral of |torque x rate|."""
    lost_j: float
    """The least that any world lost: work of the motors that did not become energy [J]."""
    torque_used: float
    """The largest torque as a fraction of its actuator's limit."""


def work_balance(settings: PlantSettings, duration_s: float, seed: int) -> Balance:
    """Drive ten worlds, and add up the work in every control period.

    The commands jump between periods, and the torques with them, so each period is integrated by itself, both
    its ends with its own command.
    """
    plant = load_plant(settings)
    model = plant.model
    n_periods = round(duration_s / CONTROL_PERIOD_S)
    command = sinusoidal_commands(n_periods, plant, seed)
    qpos, qvel = initial_states(seed)
    for module in plant.axis.modules:
        qvel[:, module.flywheel] = module.speed
    run = motion(model, qpos, qvel, n_periods * STEPS, np.repeat(command, STEPS, axis=1))

    samples = STEPS * np.arange(n_periods)[:, None] + np.arange(STEPS + 1)
    segments = Motion(*(field[:, samples] for field in run))  # (n_worlds, n_periods, 6, ...)
    driving = actuator_torques(model, segments, command[:, :, None])
    braking = -model.dof_damping * segments.qvel - model.dof_frictionloss * np.sign(segments.qvel)
    weights = CONTROL_PERIOD_S * NEWTON_COTES

    def integral(power: np.ndarray) -> np.ndarray:
        return np.sum(power, axis=-1) @ weights

    change = np.diff(energy(run, plant)[:, ::STEPS], axis=1)
    residual = np.cumsum(change - integral((driving + braking) * segments.qvel), axis=1)
    turnover = np.sum(integral((np.abs(driving) + np.abs(braking)) * np.abs(segments.qvel)), axis=1)
    loss = np.sum(integral(driving * segments.qvel) - change, axis=1)
    torque_share = np.abs(driving)[..., model.actuator_trnid[:, 0]] / model.actuator_forcerange[:, 1]
    return Balance(float((np.abs(residual).max(axis=1) / turnover).max()), float(loss.min()), float(torque_share.max()))


@pytest.mark.parametrize("duration_s", slow_but([2.5, 5.0], 2.5))
def test_energy_changes_by_the_work_of_motors_and_viscous_friction(duration_s: float) -> None:
    viscous = PlantSettings(
        equilibrium_bias_deg=0.0, timestep_s=1e-3, tilt_damping_n_m_s=0.05, gimbal_damping_n_m_s=0.02
    )
    balance = work_balance(viscous, duration_s=duration_s, seed=0)
    print(f"viscous friction: {balance}")
    assert balance.torque_used < 1.0  # no kinks from saturation, and a quadrature of full order
    assert balance.lost_j > 0.1 * duration_s
    assert balance.residual < 1e-6


@pytest.mark.parametrize("duration_s", slow_but([2.5, 5.0], 2.5))
def test_dry_friction_takes_about_what_coulomb_says(duration_s: float) -> None:
    """MuJoCo's dry friction is a soft constraint: it creeps where Coulomb's sticks, and jumps at reversals.

    The balance is therefore only as good as the model of friction: its error is stated, not made small.
    """
    dry = PlantSettings(equilibrium_bias_deg=0.0, timestep_s=1e-3, tilt_friction_n_m=0.05, gimbal_friction_n_m=0.05)
    balance = work_balance(dry, duration_s=duration_s, seed=0)
    print(f"dry friction: {balance}")
    assert balance.lost_j > 0.1 * duration_s
    assert balance.residual < 1e-4

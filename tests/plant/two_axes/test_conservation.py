"""Conservation laws and the balance of work of the two-axis rig's motion, by the derivation of `chain.py`.

The wheels spin with 54 J each, which would hide everything else: the energy watched is the platform's, T + P without
1/2 J_d (axial absolute angular velocity)^2 of each wheel, P counted from the hanging position.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from cmg_mj.plant.plant import Plant, load_plant
from tests.plant.full_model import Motion, motion, passive
from tests.plant.test_conservation import CONTROL_PERIOD_S, NEWTON_COTES, STEPS
from tests.plant.two_axes.chain import Chain, G, N
from tests.tiers import slow_but

N_WORLDS = 6
WHEELS = [4, 6, 8, 10]
GIMBALS = [3, 5, 7, 9]
J_D, SPEED = 1.1e-3, 314.0
NAMES = ("platform energy", "vertical momentum", *(f"wheel {i}'s momentum" for i in (1, 2, 3, 4)))
CHAIN = Chain()
LOWEST_ENERGY = 10.9 * G * 0.1327


def initial_states(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Tilted by up to 17 degrees, gimbals by 57; all rates but the wheels' up to 2 rad/s.

    Half of the worlds have alike wheels, the other half unequal ones.
    """
    rng = np.random.default_rng(seed)
    qpos, qvel = np.zeros((N_WORLDS, N)), rng.uniform(-2.0, 2.0, (N_WORLDS, N))
    qpos[:, 0] = rng.uniform(-math.pi, math.pi, N_WORLDS)
    qpos[:, 1:3] = rng.uniform(-0.3, 0.3, (N_WORLDS, 2))
    qpos[:, GIMBALS] = math.pi / 2.0 + rng.uniform(-1.0, 1.0, (N_WORLDS, 4))
    qvel[:, WHEELS] = np.array([1.0, -1.0, 1.0, -1.0]) * SPEED
    half = N_WORLDS // 2
    qvel[half:, WHEELS] *= rng.uniform(0.6, 1.3, (N_WORLDS - half, 4))
    return qpos, qvel


def energy(run: Motion, *, gravity: bool = True) -> np.ndarray:
    """T + P, (n_worlds, n_samples) [J]."""
    return CHAIN.kinetic(run.qpos, run.qvel) + gravity * (CHAIN.potential(run.qpos) + LOWEST_ENERGY)


def drifts(run: Motion, *, gravity: bool) -> np.ndarray:
    """(6, n_worlds, n_samples): the platform's energy by its first value, momenta by J_d omega_d.

    Yaw and the wheels' angles appear in neither T nor P: their momenta are constant.
    """
    momenta = CHAIN.momenta(run.qpos, run.qvel)[..., [0, *WHEELS]]
    platform = energy(run, gravity=gravity) - np.sum(momenta[..., 1:] ** 2, axis=-1) / (2.0 * J_D)
    return np.stack([platform / platform[:, :1] - 1.0, *np.moveaxis((momenta - momenta[:, :1]) / (J_D * SPEED), -1, 0)])


def rig(timestep_s: float) -> Plant:
    return load_plant(model="two_axes.xml", equilibrium_bias_deg=0.0, timestep_s=timestep_s)


def free_motion(duration_s: float, timestep_s: float, *, gravity: bool, seed: int, every_s: float) -> np.ndarray:
    """Drifts of the rig whose motors and servos, yaw's too, are dead, sampled at every_s."""
    model = passive(rig(timestep_s), gravity=gravity)
    run = motion(model, *initial_states(seed), round(duration_s / timestep_s))
    stride = round(every_s / timestep_s)
    return drifts(Motion(*(samples[:, ::stride] for samples in run)), gravity=gravity)


@pytest.mark.daily_cases("True-1e-05-2.5")
@pytest.mark.parametrize("duration_s", slow_but([2.5, 5.0], 2.5))
@pytest.mark.parametrize(("gravity", "momentum_bound"), [(False, 1e-7), (True, 1e-5)])
def test_free_motion_conserves_energy_and_momenta(gravity: bool, momentum_bound: float, duration_s: float) -> None:
    worst = np.abs(free_motion(duration_s, 1e-3, gravity=gravity, seed=0, every_s=5e-3)).max(axis=(1, 2))
    print(f"gravity {gravity}:", ", ".join(f"{name} {d:.1e}" for name, d in zip(NAMES, worst, strict=True)))
    assert worst[0] < 1e-6
    assert np.all(worst[1:] < momentum_bound)


@pytest.mark.daily_cases("True")
@pytest.mark.parametrize("gravity", [False, True])
def test_drifts_shrink_with_the_fourth_power_of_the_step(gravity: bool) -> None:
    steps_s = (1e-3, 5e-4, 2.5e-4)
    runs = [free_motion(0.25, h, gravity=gravity, seed=1, every_s=5e-3) for h in steps_s]
    sizes = np.array([np.sqrt(np.mean(run**2, axis=(1, 2))) for run in runs])
    orders = np.log2(sizes[:-1] / sizes[1:])
    for name, size, order in zip(NAMES, sizes.T, orders.T, strict=True):
        print(f"gravity {gravity}: {name}", *(f"{d:.1e}" for d in size), "order", *(f"{o:.2f}" for o in order))
    assert np.all(orders > 3.9)


@pytest.mark.parametrize("n_periods", slow_but([200, 400], 200))
def test_energy_changes_by_the_work_of_servos_and_motors(n_periods: int) -> None:
    """Gimbals, wheels and yaw are driven, the tilts have friction; every control period is integrated by itself."""
    plant = load_plant(model="two_axes.xml", equilibrium_bias_deg=0.0, timestep_s=5e-4, tilt_damping_n_m_s=0.05)
    model = plant.model
    command = _sinusoidal(plant, n_periods)
    qpos, qvel = initial_states(2)
    qvel[:, WHEELS] = np.array([1.0, -1.0, 1.0, -1.0]) * SPEED  # no motor at its limit, which would be a kink
    fine = 2  # it tumbles, so steps are half as long as the quadrature's
    run = motion(model, qpos, qvel, n_periods * STEPS * fine, np.repeat(command, STEPS * fine, axis=1))
    run = Motion(*(samples[:, ::fine] for samples in run))
    samples = STEPS * np.arange(n_periods)[:, None] + np.arange(STEPS + 1)
    segments = Motion(*(field[:, samples] for field in run))  # (n_worlds, n_periods, 6, ...)
    driving = _torques(plant, segments, command[:, :, None])
    braking = -model.dof_damping * segments.qvel
    power = np.sum((driving + braking) * segments.qvel, axis=-1)
    turnover = np.sum((np.abs(driving) + np.abs(braking)) * np.abs(segments.qvel), axis=-1)
    weights = CONTROL_PERIOD_S * NEWTON_COTES
    change = np.diff(energy(run)[:, ::STEPS], axis=1)
    residual = np.abs(np.cumsum(change - power @ weights, axis=1)).max(axis=1)
    relative = (residual / np.sum(turnover @ weights, axis=1)).max()
    yaw = np.abs(driving[..., 0] * segments.qvel[..., 0]).max()
    has_limit = model.actuator_forcelimited.astype(bool)
    torque_share = np.abs(driving)[..., model.actuator_trnid[has_limit, 0]] / model.actuator_forcerange[has_limit, 1]
    print(f"residual {relative:.1e} of the turnover; yaw's servo gave up to {yaw:.1f} W")
    assert torque_share.max() < 1.0  # a quadrature of full order
    assert relative < 1e-6
    assert yaw > 1.0


def _sinusoidal(plant: Plant, n_periods: int) -> np.ndarray:
    """Yaw and gimbals 1 rad/s, wheels 20 rad/s about nominal, (n_worlds, n_periods, n_actuators)."""
    rng = np.random.default_rng(3)
    nu = plant.model.nu
    frequency_hz, phase = rng.uniform(0.3, 1.5, (N_WORLDS, 1, nu)), rng.uniform(0.0, 2.0 * math.pi, (N_WORLDS, 1, nu))
    wave = np.sin(2.0 * math.pi * frequency_hz * CONTROL_PERIOD_S * np.arange(n_periods)[:, None] + phase)
    amplitude, mean = np.ones(nu), np.zeros(nu)
    for axis in plant.axes:
        for module in axis.modules:
            amplitude[module.motor], mean[module.motor] = 20.0, module.speed
    return mean + amplitude * wave


def _torques(plant: Plant, run: Motion, command: np.ndarray) -> np.ndarray:
    """Servos: kp (setpoint - angle) - kv rate. Wheels and yaw: kv (command - rate). None at its limit [N m]."""
    model = plant.model
    torques = np.zeros_like(run.qvel)
    for actuator in range(model.nu):
        joint, setpoint = model.actuator_trnid[actuator, 0], model.actuator_actadr[actuator]
        setpoints = command[..., actuator] if setpoint < 0 else run.act[..., setpoint]
        _, stiffness, damping = model.actuator_biasprm[actuator, :3]
        torque = model.actuator_gainprm[actuator, 0] * setpoints
        torque = torque + stiffness * run.qpos[..., joint] + damping * run.qvel[..., joint]
        torques[..., joint] = torque
    return torques

"""Conservation laws and the balance of work of the motion, in terms of T and P as the papers or `chain.py` derive them.

The flywheels spin with 54 J each, which would hide everything else, so the energy watched is the platform's:
T + P without 1/2 J_d (axial absolute angular velocity)^2 of each flywheel. P is counted from the hanging
position, so that this energy is positive and its drift can be stated relative to its initial value.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any, NamedTuple

import mujoco
import numpy as np
import pytest

from cmg_mj.plant.plant import Plant, load_plant
from tests.plant import paper_model as paper
from tests.plant.full_model import Motion, motion, passive
from tests.plant.two_axes.chain import Chain, G

MOMENTUM = paper.J_d * paper.omega_d


class Rig:
    """A bundled rig, its derivation, and the states that it starts from: yaw, tilts, then gimbal and flywheel by turns.

    Attributes:
        every_s: Sampling interval of drifts [s]; the chain's energy is slow to compute.
        fine: Physics steps of a work balance in one of its quadrature's; the two axes tumble.
    """

    def __init__(
        self,
        model: str,
        *,
        tilts: int,
        worlds: int,
        upright: float,
        lean: float,
        rate: float,
        lowest: float,
        every_s: float,
        fine: int,
    ) -> None:
        self.model, self.worlds, self.upright, self.lean, self.rate = model, worlds, upright, lean, rate
        self.lowest, self.every_s, self.fine = lowest, every_s, fine
        n_modules = 2 * tilts
        self.n, self.tilts = 1 + tilts + 2 * n_modules, slice(1, 1 + tilts)
        self.gimbals, self.wheels = list(range(1 + tilts, self.n, 2)), list(range(2 + tilts, self.n, 2))

    def load(self, **settings: Any) -> Plant:
        return load_plant(model=self.model, equilibrium_bias_deg=0.0, **settings)

    @cached_property
    def exact(self) -> Any:
        """T, P and momenta; K_a is the one number that Table 1 does not give."""
        if self.model == "two_axes.xml":
            return Chain()
        return paper.scissored_pair(float(self.load().model.body("thrust_bearing").inertia[2]))

    def initial_states(self, seed: int, *, alike: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Tilted and turning anyhow, gimbals by 57 degrees; half of the worlds may have unequal flywheels."""
        rng, n_worlds = np.random.default_rng(seed), self.worlds
        qpos, qvel = np.zeros((n_worlds, self.n)), rng.uniform(-self.rate, self.rate, (n_worlds, self.n))
        qpos[:, 0] = rng.uniform(-math.pi, math.pi, n_worlds)
        qpos[:, self.tilts] = self.upright
        qpos[:, self.tilts] += rng.uniform(-self.lean, self.lean, qpos[:, self.tilts].shape)
        qpos[:, self.gimbals] = math.pi / 2.0 + rng.uniform(-1.0, 1.0, (n_worlds, len(self.gimbals)))
        qvel[:, self.wheels] = paper.omega_d * (-1.0) ** np.arange(len(self.wheels))
        if not alike:
            half = n_worlds // 2
            qvel[half:, self.wheels] *= rng.uniform(0.6, 1.3, (n_worlds - half, len(self.wheels)))
        return qpos, qvel

    def energy(self, run: Motion, *, gravity: bool = True) -> np.ndarray:
        """T + P, (n_worlds, n_samples) [J]."""
        return self.exact.kinetic(run.qpos, run.qvel) + gravity * (self.exact.potential(run.qpos) + self.lowest)

    def drifts(self, duration_s: float, timestep_s: float, *, gravity: bool, seed: int) -> np.ndarray:
        """Drifts of the rig without friction whose motors and servos are dead, (2 + n_wheels, n_worlds, n_samples).

        The platform's energy by its first value, momenta by J_d omega_d. Yaw and the flywheels' angles appear in
        neither T nor P: momentum about the vertical, and J_d times each flywheel's axial rate, are constant.
        """
        model = passive(self.load(timestep_s=timestep_s), gravity=gravity)
        run = motion(model, *self.initial_states(seed), round(duration_s / timestep_s))
        run = Motion(*(samples[:, :: round(self.every_s / timestep_s)] for samples in run))
        momenta = self.exact.momenta(run.qpos, run.qvel)[..., [0, *self.wheels]]
        platform = self.energy(run, gravity=gravity) - np.sum(momenta[..., 1:] ** 2, axis=-1) / (2.0 * paper.J_d)
        relative = platform / platform[:, :1] - 1.0
        return np.stack([relative, *np.moveaxis((momenta - momenta[:, :1]) / MOMENTUM, -1, 0)])


PAIR = Rig(
    "scissored_pair.xml",
    tilts=1,
    worlds=10,
    upright=-math.pi / 4.0,
    lean=0.5,
    rate=3.0,
    lowest=math.sqrt(2.0) * paper.m * paper.g * paper.l,
    every_s=1e-3,
    fine=1,
)
TWO_AXES = Rig(
    "two_axes.xml",
    tilts=2,
    worlds=6,
    upright=0.0,
    lean=0.3,
    rate=2.0,
    lowest=10.9 * G * 0.1327,
    every_s=5e-3,
    fine=2,
)


def slow(*case: Any) -> Any:
    return pytest.param(*case, marks=pytest.mark.slow)


@pytest.mark.parametrize(
    ("rig", "gravity", "momentum_bound", "duration_s"),
    [
        (PAIR, False, 1e-7, 2.0),
        slow(PAIR, False, 1e-7, 10.0),
        slow(PAIR, True, 3e-6, 10.0),
        (TWO_AXES, True, 1e-5, 2.5),
        slow(TWO_AXES, False, 1e-7, 5.0),
        slow(TWO_AXES, True, 1e-5, 5.0),
    ],
)
def test_free_motion_conserves_energy_and_momenta(
    rig: Rig, gravity: bool, momentum_bound: float, duration_s: float
) -> None:
    energy, *momenta = np.abs(rig.drifts(duration_s, 1e-3, gravity=gravity, seed=0)).max(axis=(1, 2))
    assert energy < 1e-6
    assert max(momenta) < momentum_bound


@pytest.mark.parametrize(("rig", "gravity"), [(PAIR, True), slow(PAIR, False), (TWO_AXES, True), slow(TWO_AXES, False)])
def test_drifts_shrink_with_the_fourth_power_of_the_step(rig: Rig, gravity: bool) -> None:
    """Orders of root mean squares over worlds and a common grid; a maximum jumps between instants.

    A drift is an oscillation of order 4 and a steady loss of order 5. Over ten seconds the loss rules:
    halving 2 ms divides all but the vertical momentum's drift by 28 to 38. Where the two are alike they may
    cancel, and the order seems to dip to 3.8. A quarter of a second keeps the loss small and every drift
    above rounding.
    """
    runs = [rig.drifts(0.25, h, gravity=gravity, seed=1) for h in (1e-3, 5e-4, 2.5e-4)]
    sizes = np.array([np.sqrt(np.mean(run**2, axis=(1, 2))) for run in runs])
    orders = np.log2(sizes[:-1] / sizes[1:])
    assert np.all(orders > 3.9)
    assert rig is TWO_AXES or np.all(sizes[-1] > 5e-14)  # rounding is below 1e-14


# --- the balance of work ------------------------------------------------------------------------------------

CONTROL_PERIOD_S = 5e-3
STEPS = 5  # steps of the quadrature a control period
NEWTON_COTES = np.array([19.0, 75.0, 50.0, 50.0, 75.0, 19.0]) / 288.0  # on six points, of order six


def sinusoidal_commands(plant: Plant, n_worlds: int, n_periods: int, rate: float) -> np.ndarray:
    """Servos turn at up to a rate [rad/s], flywheels 20 rad/s about nominal, (n_worlds, n_periods, n_actuators)."""
    rng, nu = np.random.default_rng(3), plant.model.nu
    frequency_hz, phase = rng.uniform(0.3, 1.5, (n_worlds, 1, nu)), rng.uniform(0.0, 2.0 * math.pi, (n_worlds, 1, nu))
    wave = np.sin(2.0 * math.pi * frequency_hz * CONTROL_PERIOD_S * np.arange(n_periods)[:, None] + phase)
    amplitude, mean = np.full(nu, rate), np.zeros(nu)
    for axis in plant.axes:
        for module in axis.modules:
            amplitude[module.motor], mean[module.motor] = 20.0, module.speed
    return mean + amplitude * wave


def actuator_torques(model: mujoco.MjModel, run: Motion, command: np.ndarray) -> np.ndarray:
    """Servo: kp (setpoint - angle) - kv rate. Flywheel, yaw: kv (command - rate). Each within its limits [N m]."""
    torques = np.zeros_like(run.qvel)
    for actuator in range(model.nu):
        joint, setpoint = model.actuator_trnid[actuator, 0], model.actuator_actadr[actuator]
        setpoints = command[..., actuator] if setpoint < 0 else run.act[..., setpoint]
        _, stiffness, damping = model.actuator_biasprm[actuator, :3]
        torque = model.actuator_gainprm[actuator, 0] * setpoints
        torque = torque + stiffness * run.qpos[..., joint] + damping * run.qvel[..., joint]
        low, high = model.actuator_forcerange[actuator] if model.actuator_forcelimited[actuator] else (-np.inf, np.inf)
        torques[..., joint] = np.clip(torque, low, high)
    return torques


class Balance(NamedTuple):
    """Energy gained against the work of motors and friction."""

    residual: float
    """The worst |gain - work| along any world's run, by that world's whole integral of |torque x rate|."""
    lost_j: float
    """The least that any world lost: work of the motors that did not become energy [J]."""
    torque_used: float
    """The largest torque as a fraction of its actuator's limit."""
    yaw_w: float
    """The largest power about the vertical [W]."""


def work_balance(rig: Rig, duration_s: float, rate: float, **settings: float) -> Balance:
    """Drive some worlds, and add up the work in every control period.

    The commands jump between periods, and the torques with them, so each period is integrated by itself, both
    its ends with its own command.
    """
    plant = rig.load(timestep_s=1e-3 / rig.fine, **settings)
    model, n_periods = plant.model, round(duration_s / CONTROL_PERIOD_S)
    command = sinusoidal_commands(plant, rig.worlds, n_periods, rate)
    steps = STEPS * rig.fine
    run = motion(model, *rig.initial_states(2, alike=True), n_periods * steps, np.repeat(command, steps, axis=1))
    run = Motion(*(samples[:, :: rig.fine] for samples in run))

    samples = STEPS * np.arange(n_periods)[:, None] + np.arange(STEPS + 1)
    segments = Motion(*(field[:, samples] for field in run))  # (n_worlds, n_periods, 6, ...)
    driving = actuator_torques(model, segments, command[:, :, None])
    braking = -model.dof_damping * segments.qvel - model.dof_frictionloss * np.sign(segments.qvel)

    def integral(power: np.ndarray) -> np.ndarray:
        return np.sum(power, axis=-1) @ (CONTROL_PERIOD_S * NEWTON_COTES)

    change = np.diff(rig.energy(run)[:, ::STEPS], axis=1)
    residual = np.cumsum(change - integral((driving + braking) * segments.qvel), axis=1)
    turnover = np.sum(integral((np.abs(driving) + np.abs(braking)) * np.abs(segments.qvel)), axis=1)
    loss = np.sum(integral(driving * segments.qvel) - change, axis=1)
    limited = model.actuator_forcelimited.astype(bool)
    torque_share = np.abs(driving)[..., model.actuator_trnid[limited, 0]] / model.actuator_forcerange[limited, 1]
    return Balance(
        float((np.abs(residual).max(axis=1) / turnover).max()),
        float(loss.min()),
        float(torque_share.max()),
        float(np.abs(driving[..., 0] * segments.qvel[..., 0]).max()),
    )


VISCOUS = {"tilt_damping_n_m_s": 0.05, "gimbal_damping_n_m_s": 0.02}
DRY = {"tilt_friction_n_m": 0.05, "gimbal_friction_n_m": 0.05}


@pytest.mark.parametrize("duration_s", [2.5, slow(5.0)])
@pytest.mark.parametrize(("friction", "most"), [(VISCOUS, 1e-6), (DRY, 1e-4)])
def test_energy_changes_by_the_work_of_motors_and_friction(
    friction: dict[str, float], most: float, duration_s: float
) -> None:
    """MuJoCo's dry friction is a soft constraint: it creeps where Coulomb's sticks, and jumps at reversals.

    The balance is therefore only as good as the model of friction: its error is stated, not made small.
    """
    balance = work_balance(PAIR, duration_s, 1.5, **friction)
    assert balance.torque_used < 1.0 or friction is DRY  # no kinks from saturation, and a quadrature of full order
    assert balance.lost_j > 0.1 * duration_s
    assert balance.residual < most


@pytest.mark.parametrize("duration_s", [1.0, slow(2.0)])
def test_energy_of_two_axes_changes_by_the_work_of_servos_and_motors(duration_s: float) -> None:
    """Gimbals, flywheels and yaw are driven, the tilts have friction."""
    balance = work_balance(TWO_AXES, duration_s, 1.0, tilt_damping_n_m_s=0.05)
    assert balance.torque_used < 1.0
    assert balance.residual < 1e-6
    assert balance.yaw_w > 1.0

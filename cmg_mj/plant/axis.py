"""A compiled rig with its names resolved: of each axis its line, modules and sensors, and its reduced model."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import itemgetter
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.loop import Joints
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.tilt import PairTilt
from cmg_mj.core.types import IdealReading
from cmg_mj.plant.elements import ACCELEROMETERS, EQUILIBRIUM_KEY, TILT_ELEMENT, Module, element_id
from cmg_mj.plant.inertia import inertia_about
from cmg_mj.plant.mjcf import data_at_keyframe
from cmg_mj.plant.tilt_line import UP, Line, line_named

_new = tuple.__new__  # a named tuple's own takes twice as long

QUARTER_TURN = math.pi / 2.0
MIN_ARM_M = 1e-4
"""A pivot that moves by less for a tilt of 1 rad is at rest [m]."""
MOUNTED_DEG = 5.0
"""A sensor or axis farther off is mounted otherwise, not inaccurately: no observer stands so much [deg]."""
TURNS_ALIKE = 1e-6
"""A frame whose rate differs from the hinge's by less turns with the hinge."""


@dataclass(frozen=True, eq=False)
class Axis:
    """One axis of a plant, with its names resolved.

    Attributes:
        name: The prefix of its elements' names, without the slash; empty for a plant's only axis.
        line: The line that it tilts about.
        frame: The body that carries its sensors.
        point: A point of the line, in the frame's axes [m].
        direction: Unit vector along the line, in the frame's axes, (3,).
        up: Unit vector upward at the keyframe, the same way.
        modules: Addresses of its modules.
        reduced: The reduced model.
        pair_tilt: The tilt estimate for its accelerometers.
        forces: Addresses in sensordata of inner x, inner z, outer x, outer z.
        encoders: Addresses in sensordata of the gimbals' encoders.
        gyro: Address in sensordata of the gyro along the line.
        motion: Addresses in sensordata of velocity, x and z axis of both accelerometers, if the model shows them.
        gravity: [m/s^2].
        bias: Equilibrium bias e [rad].
        initial_tilt: Tilt from the equilibrium at the start [rad].
        misplaced: Whether an accelerometer sits elsewhere than the tilt estimate knows.
    """

    name: str
    line: Line
    frame: int
    point: np.ndarray
    direction: np.ndarray
    up: np.ndarray
    modules: tuple[Module, ...]
    reduced: ReducedModel
    pair_tilt: PairTilt
    forces: list[int]
    encoders: list[int]
    gyro: int
    motion: tuple[int, ...] = ()
    gravity: float = 0.0
    bias: float = 0.0
    initial_tilt: float = 0.0
    misplaced: bool = False

    @property
    def prefix(self) -> str:
        """Prefix of its elements' names."""
        return f"{self.name}/" if self.name else ""

    @cached_property
    def servos(self) -> list[int]:
        """The gimbal servos' controls."""
        return [module.servo for module in self.modules]

    @cached_property
    def directions(self) -> list[float]:
        """Sign of u for each gimbal."""
        return [module.direction for module in self.modules]

    @cached_property
    def _forces_of(self) -> Callable[[Joints], Sequence[float]]:
        return itemgetter(*self.forces)

    @cached_property
    def _encoders_of(self) -> Callable[[Joints], Sequence[float]]:
        (only, *others) = self.encoders
        return itemgetter(*self.encoders) if others else itemgetter(slice(only, only + 1))

    @cached_property
    def _spins(self) -> list[int]:
        return [module.flywheel_dof for module in self.modules]

    @cached_property
    def _gimbals(self) -> list[tuple[int, float, float]]:
        """Address, share of x3 and zero of each gimbal."""
        n = len(self.modules)
        return [(module.gimbal, module.direction / n, module.gimbal_zero) for module in self.modules]

    def ideal(self, sensordata: Joints, qvel: Joints) -> IdealReading:
        """Return the readings of perfect sensors.

        Args:
            sensordata: MuJoCo's sensor readings after a forward pass, indexed by address: floats, or an array
                (n_numbers, n_worlds).
            qvel: Joint rates, the same way [rad/s].

        Returns:
            The ideal readings, of the elements' own type (float, or array (n_worlds,)).
        """
        if isinstance(sensordata, np.ndarray):
            forces, encoders = sensordata[self.forces], sensordata[self.encoders]
        else:  # of one world, at every tick
            forces, encoders = self._forces_of(sensordata), self._encoders_of(sensordata)
        wheels = [qvel[dof] for dof in self._spins]
        motion = [*(sensordata[address] for address in self.motion), self.gravity] if self.motion else ()
        return _new(IdealReading, (forces, encoders, sensordata[self.gyro], self.line.rate(qvel), wheels, motion))

    def gimbal_angle(self, qpos: Joints) -> Scalar:
        """True x3: the gimbals' mean angle from upright, each in its own direction [rad]."""
        angle = 0.0
        for gimbal, share, zero in self._gimbals:
            angle = angle + share * (qpos[gimbal] - zero)
        return angle


class ResolvedModel(NamedTuple):
    """A compiled rig as its file has it, with its names resolved.

    Attributes:
        path: The file.
        model: The compiled model, without what is only seen.
        key: The keyframe at which it stands upright.
        modules: The names of its axes, the locked ones too, each with those of its modules.
        axes: The axes that are not locked.
        held: The modules of axes that are locked.
        hints: Clauses on what is right and yet not what the reduced model takes it for.
    """

    path: Path
    model: mujoco.MjModel
    key: int
    modules: Mapping[str, Sequence[str]]
    axes: tuple[Axis, ...]
    held: tuple[Module, ...]
    hints: tuple[str, ...] = ()


def resolve(
    path: Path, model: mujoco.MjModel, modules: Mapping[str, Sequence[str]], locked: Sequence[str] = ()
) -> ResolvedModel:
    """Resolve the names of a compiled rig.

    Args:
        path: The model's file.
        model: The compiled model, which has all elements of a rig.
        modules: The names of its axes, each with those of its modules.
        locked: Axes whose hinges have been taken out.
    """
    key = element_id(model, "key", EQUILIBRIUM_KEY)
    axes = tuple(find_axis(model, key, name, modules[name]) for name in modules if name not in locked)
    held = tuple(_find_module(model, key, None, module) for name in locked for module in modules[name])
    return ResolvedModel(path, model, key, modules, axes, held)


def find_axis(model: mujoco.MjModel, key: int, name: str, modules: Sequence[str]) -> Axis:
    """Resolve the names of an axis, all of whose elements are there: see `parts.missing_elements`.

    Args:
        model: The compiled model, as its file has it.
        key: The keyframe at which the plant stands upright.
        name: The axis' name.
        modules: The names of its modules.

    Returns:
        The axis, without bias.

    Raises:
        InputError: It tilts about no hinge and no free body.
    """
    prefix = f"{name}/" if name else ""
    data = data_at_keyframe(model, key)
    line = line_named(model, data, prefix + TILT_ELEMENT, key)
    site = element_id(model, "site", prefix + TILT_ELEMENT)
    if element_id(model, "joint", prefix + TILT_ELEMENT) >= 0:
        joint = line.joint
        frame, point, direction = int(model.jnt_bodyid[joint]), model.jnt_pos[joint], model.jnt_axis[joint]
    else:
        frame, point = int(model.site_bodyid[site]), model.site_pos[site]
        direction = data.xmat[frame].reshape(3, 3).T @ data.site_xmat[site].reshape(3, 3)[:, 1]
    addresses = [int(model.sensor_adr[element_id(model, "sensor", prefix + name)]) for name in ACCELEROMETERS]
    up = data.xmat[frame].reshape(3, 3).T @ UP
    axis = Axis(
        name,
        line,
        frame,
        point.copy(),
        direction.copy(),
        up,
        tuple(_find_module(model, key, line, module) for module in modules),
        ReducedModel(1.0, 0.0, 1.0, 1.0, 1.0),
        _pair(model, prefix, point, direction, up),
        [address + along for address in addresses for along in (0, 2)],
        [int(model.sensor_adr[element_id(model, "sensor", f"{module}/gimbal_encoder")]) for module in modules],
        int(model.sensor_adr[element_id(model, "sensor", f"{prefix}fog")]) + 1,  # its y axis
    )
    shown = [f"{prefix}{name}_{what}" for name in ACCELEROMETERS for what in ("velocity", "x", "z")]
    numbers = [element_id(model, "sensor", name) for name in shown]
    motion = [int(model.sensor_adr[i]) + j for i in numbers for j in range(3)] if min(numbers) >= 0 else []
    gravity = float(np.linalg.norm(model.opt.gravity))
    return replace(axis, reduced=read_reduced(model, key, axis), motion=tuple(motion), gravity=gravity)


def _find_module(model: mujoco.MjModel, key: int, line: Line | None, name: str) -> Module:
    gimbal, flywheel = (element_id(model, "joint", f"{name}/{joint}") for joint in ("gimbal", "flywheel"))
    servo, motor = (element_id(model, "actuator", f"{name}/{drive}") for drive in ("gimbal_servo", "flywheel_motor"))
    angle, spin = int(model.jnt_qposadr[gimbal]), int(model.jnt_dofadr[flywheel])
    zero = float(model.key_qpos[key, angle])
    speed = float(model.key_ctrl[key, motor])
    # A quarter turn back, the flywheel's momentum lies along the tilt axis; u > 0 turns it away from there.
    direction = 0.0
    if line is not None:
        inertia = inertia_about(model, key, line, {angle: zero - QUARTER_TURN})
        direction = math.copysign(1.0, inertia.coupling_row[spin] * speed)
    addresses = angle, int(model.jnt_dofadr[gimbal]), int(model.jnt_qposadr[flywheel]), spin
    return Module(name, *addresses, servo, motor, direction, zero, speed)


def read_reduced(model: mujoco.MjModel, key: int, axis: Axis) -> ReducedModel:
    """Read J1, J2, J_d, omega_d and m g l/sqrt(2) off the model's inertia and gravity, a share per module.

    Args:
        model: The compiled model, as its file has it but for the flywheels' speed.
        key: The keyframe at which the rig stands upright.
        axis: The axis.

    Returns:
        The reduced model.
    """
    n = len(axis.modules)
    line = axis.line
    upright = inertia_about(model, key, line, {})
    turned = inertia_about(
        model, key, line, {c.gimbal: c.gimbal_zero - c.direction * QUARTER_TURN for c in axis.modules}
    )
    J1 = upright.tilt_inertia / n
    J2 = turned.tilt_inertia / n - J1
    J_d = sum(abs(turned.coupling_row[c.flywheel_dof]) for c in axis.modules) / n
    momentum = sum(turned.coupling_row[c.flywheel_dof] * c.speed for c in axis.modules)
    data = data_at_keyframe(model, key)
    data.qvel[:] = 0.0
    line.tilt(data, QUARTER_TURN)
    mujoco.mj_forward(model, data)
    gravity_torque = -(line.motion(model, data) @ data.qfrc_bias) / n
    across, about = pivot_rows(model, key, axis)
    arm = -float(across @ upright.rates)  # how far the pivot slides back for a tilt of 1 rad
    if not (arm > MIN_ARM_M and abs(about @ upright.rates - 1.0) <= TURNS_ALIKE):
        arm = 0.0  # it is at rest, or the body that carries the hinge turns with the tilt
    return ReducedModel(float(J1), float(J2), float(J_d), float(momentum / (n * J_d)), float(gravity_torque), n, arm)


def _pair(model: mujoco.MjModel, prefix: str, point: np.ndarray, direction: np.ndarray, up: np.ndarray) -> PairTilt:
    """Find where the accelerometers sit; what is off by less than `MOUNTED_DEG` is an inaccuracy, which none knows."""
    radii, beside, angles = [], [], []
    across = np.cross(direction, up)
    for name in ACCELEROMETERS:
        site = model.sensor_objid[element_id(model, "sensor", prefix + name)]
        arm = model.site_pos[site] - point
        r, c = float(arm @ up), float(arm @ across)
        z = np.empty(3)
        mujoco.mju_rotVecQuat(z, np.array((0.0, 0.0, 1.0)), model.site_quat[site])
        angle = math.atan2(-z @ across, z @ up)
        radial = abs(math.atan2(c, r)) <= math.radians(MOUNTED_DEG)
        radii.append(math.hypot(*(arm - (arm @ direction) * direction)) if radial else r)
        beside.append(0.0 if radial else c)
        angles.append(0.0 if radial and abs(angle) <= math.radians(MOUNTED_DEG) else angle)
    return PairTilt(*radii, across=tuple(beside), angles=tuple(angles))


def pivot_rows(model: mujoco.MjModel, key: int, axis: Axis) -> tuple[np.ndarray, np.ndarray]:
    """Find how the pivot and what it belongs to move with the joints' rates, at a keyframe.

    Args:
        model: The compiled model.
        key: The keyframe.
        axis: The axis.

    Returns:
        The pivot's velocity across the axis, to the side a positive tilt leans to, (nv,); the frame's rate about the
        axis, (nv,).
    """
    data = data_at_keyframe(model, key)
    turn = data.xmat[axis.frame].reshape(3, 3)
    slides, turns = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, slides, turns, data.xpos[axis.frame] + turn @ axis.point, axis.frame)
    line = turn @ axis.direction
    return np.cross(line, UP) @ slides, line @ turns

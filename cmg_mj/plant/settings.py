"""Differences of a rig from its model file: integrator and step, friction, servos, wheels, the equilibrium bias."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.core.tilt import PairTilt
from cmg_mj.plant.axis import Axis, ResolvedModel, read_reduced
from cmg_mj.plant.elements import ACCELEROMETERS, BEND_JOINT, EQUILIBRIUM_KEY, Module, element_id
from cmg_mj.plant.mjcf import data_at_keyframe
from cmg_mj.plant.step_limit import largest_step
from cmg_mj.plant.tilt_line import HingeLine
from cmg_mj.scenario.plant_settings import PlantSettings

YAW_SERVO = "yaw_servo"
FLAGS_OFF = sum(int(getattr(mujoco.mjtEnableBit, f"mjENBL_{flag}")) for flag in ("SLEEP", "IPC", "INVDISCRETE"))
"""Flags that worlds which are stepped together cannot have, and one that RK4 cannot."""


def apply(
    rig: ResolvedModel,
    settings: PlantSettings,
    axis_settings: Mapping[str, PlantSettings],
    sections: Mapping[str, Any],
) -> tuple[mujoco.MjModel, tuple[Axis, ...], float]:
    """Change a copy of a compiled model as settings say.

    Args:
        rig: The model as its file has it.
        settings: The properties to change; a property without a value stays.
        axis_settings: The settings of axes that have their own.
        sections: Settings of the features that edit the model.

    Returns:
        The changed model, whose physics step is still that of its file, or the longest that a feature allows; its axes;
        the largest physics step that is accurate enough [s].

    Raises:
        InputError: The body that tilts has no mass of its own to move or no joint for friction; a servo lacks a
            property to change; or a feature does not go together with the rest.
    """
    path, key, held, axes, speed = rig.path, rig.key, rig.held, [], settings.flywheel_speed_rad_s
    known = _with_pendulum(rig, settings)  # what the controller knows but for the flywheels' speed
    model = copy.copy(known)
    if settings.flywheel_momentum_n_m_s is not None:
        if speed is not None:
            raise InputError("plant.flywheel_momentum_n_m_s: sets the flywheels' speed; leave flywheel_speed_rad_s out")
        speed = settings.flywheel_momentum_n_m_s / (rig.axes[0].reduced.J_d * rig.axes[0].reduced.gimbals)
    for axis in rig.axes:
        own = axis_settings.get(axis.name, settings)
        changed = replace(
            axis,
            bias=math.radians(own.equilibrium_bias_deg),
            initial_tilt=math.radians(own.initial_tilt_deg),
            pair_tilt=place_accelerometers(model, own, axis, path),
            misplaced=bool(own.accelerometer_inner_misplaced_mm or own.accelerometer_outer_misplaced_mm),
        )
        if speed is not None:
            changed = replace(changed, modules=_set_flywheel_speed(model, key, axis.modules, speed, path))
        if speed is not None or known is not rig.model:
            changed = replace(changed, reduced=read_reduced(known, key, changed))
        axes.append(changed)
    if speed is not None:
        held = _set_flywheel_speed(model, key, held, speed, path)
    if settings.turn_rate_rad_s:
        _set_turn_rate(model, key, settings.turn_rate_rad_s, path)
    modules = [*(module for axis in axes for module in axis.modules), *held]
    _vary_masses_and_friction(model, settings, path, axes, modules)
    for section in sections.values():
        longest = model.opt.timestep
        model.opt.timestep = section.limit_step(settings.timestep_s, settings.integrator, longest, path)
    mujoco.mj_setConst(model, mujoco.MjData(model))  # makes what follows from the centres of mass
    speeds = [abs(module.speed) for axis in axes for module in axis.modules]
    shake_rate = max(speeds) if settings.flywheel_imbalance_kg_m else 0.0
    return model, tuple(axes), largest_step(model, key, model.opt.timestep, shake_rate)


def _with_pendulum(rig: ResolvedModel, settings: PlantSettings) -> mujoco.MjModel:
    """Return the model with the inertia about the tilt axis and the torque of gravity that settings ask for."""
    if settings.tilt_inertia_kg_m2 is None and settings.tilt_gravity_n_m is None:
        return rig.model
    if rig.axes[1:]:
        raise InputError(f"plant.tilt_inertia_kg_m2, plant.tilt_gravity_n_m: of one axis, and {rig.path} has several")
    if element_id(rig.model, "joint", BEND_JOINT) >= 0:
        raise InputError(
            "plant.tilt_inertia_kg_m2, plant.tilt_gravity_n_m: of a frame that does not bend; leave [bend] out"
        )
    axis, model = rig.axes[0], copy.copy(rig.model)
    mass, moments = model.body_mass[axis.frame], model.body_inertia[axis.frame]
    own, own_torque = (axis.reduced.gimbals * share for share in (axis.reduced.J1, axis.reduced.gravity_torque))
    inertia, torque = settings.tilt_inertia_kg_m2 or own, settings.tilt_gravity_n_m or own_torque
    height = float((model.body_ipos[axis.frame] - axis.point) @ axis.up)
    shift = (torque - own_torque) / (mass * float(np.linalg.norm(model.opt.gravity)))
    has = own + mass * ((height + shift) ** 2 - height**2)
    least = has + 2.0 * moments.max() - moments.sum()  # where two principal moments make the third
    if inertia < least:
        raise InputError(
            f"plant.tilt_inertia_kg_m2 = {inertia:g}: must be at least {least:.4g}, which the masses of {rig.path} "
            "have where they are"
        )
    model.body_ipos[axis.frame] += shift * axis.up
    model.body_inertia[axis.frame] += inertia - has
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def _vary_masses_and_friction(
    model: mujoco.MjModel, settings: PlantSettings, path: Path, axes: Sequence[Axis], modules: Sequence[Module]
) -> None:
    """Set integrator, friction, servos, equilibrium bias and imbalance."""
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{settings.integrator.upper()}")
    # A plant that diverges must say so, not start again from its reference pose.
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    model.opt.enableflags &= ~FLAGS_OFF
    gimbals, hinges = [module.gimbal_dof for module in modules], [axis.line.dof for axis in axes]
    for field, dofs, value in (
        (model.dof_armature, gimbals, settings.gimbal_armature_kg_m2),
        (model.dof_frictionloss, gimbals, settings.gimbal_friction_n_m),
        (model.dof_damping, gimbals, settings.gimbal_damping_n_m_s),
        (model.dof_frictionloss, hinges, settings.tilt_friction_n_m),
        (model.dof_damping, hinges, settings.tilt_damping_n_m_s),
    ):
        if value is not None:
            if dofs is hinges and not all(isinstance(axis.line, HingeLine) for axis in axes):
                raise InputError(f"plant.tilt_friction_n_m, plant.tilt_damping_n_m_s: {path} tilts about no hinge")
            field[dofs] = value
    _vary_servos(model, settings, path, modules)
    biased = [axis for axis in axes if axis.bias]
    shifts = [bias_shift(model, axis, path) for axis in biased]
    for axis, shift in zip(biased, shifts, strict=True):
        model.body_ipos[frame_bodies(model, axis)] += shift
    if settings.flywheel_imbalance_kg_m:
        for module in modules:
            body = model.dof_bodyid[module.flywheel_dof]
            model.body_ipos[body, 0] += settings.flywheel_imbalance_kg_m / model.body_mass[body]


def _set_flywheel_speed(
    model: mujoco.MjModel, key: int, modules: Sequence[Module], speed: float, path: Path
) -> tuple[Module, ...]:
    """Let the flywheels turn at another speed [rad/s] from the start, each in its own direction; return the modules."""
    result = []
    for module in modules:
        signed = math.copysign(speed, module.speed)
        _check_range(model, module.motor, signed, f"plant.flywheel_speed_rad_s = {speed:g}: {path}")
        model.key_qvel[key, module.flywheel_dof] = model.key_ctrl[key, module.motor] = signed
        result.append(replace(module, speed=signed))
    return tuple(result)


def _set_turn_rate(model: mujoco.MjModel, key: int, rate: float, path: Path) -> None:
    """Let the rig turn about the vertical from the start, held by its drive [rad/s]."""
    prefix = f"plant.turn_rate_rad_s = {rate:g}: {path}"
    joint, servo = element_id(model, "joint", "yaw"), element_id(model, "actuator", YAW_SERVO)
    if joint < 0 or servo < 0 or model.actuator_trnid[servo, 0] != joint:
        raise InputError(f"{prefix} has no actuator {YAW_SERVO!r} that drives a joint 'yaw', which alone holds a rate")
    _check_range(model, servo, rate, prefix)
    model.key_qvel[key, model.jnt_dofadr[joint]] = model.key_ctrl[key, servo] = rate


def _check_range(model: mujoco.MjModel, actuator: int, rate: float, prefix: str) -> None:
    """Refuse a rate [rad/s] that an actuator does not take."""
    low, high = model.actuator_ctrlrange[actuator]
    if model.actuator_ctrllimited[actuator] and not low <= rate <= high:
        name = model.actuator(actuator).name
        raise InputError(f"{prefix}: actuator {name!r} takes only {low:g} to {high:g} rad/s (ctrlrange)")


def place_accelerometers(model: mujoco.MjModel, settings: PlantSettings, axis: Axis, path: Path) -> PairTilt:
    """Move the accelerometers of an axis in its tilting plane.

    Args:
        model: The model, as its file has it.
        settings: Their places and angles, which stay without a value, and their offsets from these.
        axis: The axis, as its file has it.
        path: The model's file, for messages.

    Returns:
        The tilt estimate for their new places, as far as it knows them.

    Raises:
        InputError: They are at one place, or on the radial line in the wrong order.
    """
    height = axis.reduced.pivot_arm if settings.pivot_slides else 0.0  # of the point that is taken to be at rest
    if settings.pivot_slides and not height:
        about = f" of axis {axis.name!r}" if axis.name else ""
        raise InputError(f"plant.pivot_slides = true: {path}: the pivot{about} does not slide freely; leave it out")
    filed, known, true = axis.pair_tilt, [], []
    for name, place, angle in zip(ACCELEROMETERS, filed.places, filed.angles, strict=True):
        r, c = (getattr(settings, f"{name}{field}") for field in ("_m", "_across_m"))
        turn_deg = getattr(settings, f"{name}_angle_deg")
        r, c = place[0] if r is None else r, place[1] if c is None else c
        known.append((r, c, angle if turn_deg is None else math.radians(turn_deg)))
        true.append(r + 1e-3 * getattr(settings, f"{name}_misplaced_mm"))
        _move_site(model, axis, axis.prefix + name, (*place, angle), (true[-1], *known[-1][1:]))
    radii, beside, angles = zip(*known, strict=True)
    tilt = PairTilt(*radii, across=beside, angles=angles)
    if not (tilt.is_apart and replace(tilt, r_inner=true[0], r_outer=true[1]).is_apart):
        changes = {name: value for name, value in settings.changes().items() if name.startswith("accelerometer")}
        raise InputError(
            f"{', '.join(f'plant.{name} = {value:g}' for name, value in changes.items())}: the inner accelerometer "
            f"must lie nearer to the tilt axis than the outer one, or beside it, and they are {true[0]:g} and "
            f"{true[1]:g} m away ({path})"
        )
    return tilt.about(height)


def _move_site(
    model: mujoco.MjModel, axis: Axis, sensor: str, was: tuple[float, float, float], to: tuple[float, float, float]
) -> None:
    """Move the site of a sensor to another place along the radial line and across [m], and angle [rad]."""
    if to == was:
        return
    site = model.sensor_objid[element_id(model, "sensor", sensor)]
    (r, c, angle), (new_r, new_c, new_angle) = was, to
    if c == new_c == 0.0 and r:
        arm = model.site_pos[site] - axis.point
        model.site_pos[site] += (arm - (arm @ axis.direction) * axis.direction) * (new_r / r - 1.0)
    else:
        model.site_pos[site] += (new_r - r) * axis.up + (new_c - c) * np.cross(axis.direction, axis.up)
    if new_angle != angle:
        mujoco.mju_axisAngle2Quat(turn := np.empty(4), axis.direction, angle - new_angle)
        mujoco.mju_mulQuat(model.site_quat[site], turn, model.site_quat[site].copy())
        mujoco.mju_normalize4(model.site_quat[site])
    model.site_sameframe[site] = 0  # should it have stood as the body's frame does


def _vary_servos(model: mujoco.MjModel, settings: PlantSettings, path: Path, modules: Sequence[Module]) -> None:
    """Give the gimbals' servos another stiffness and damping: torque = kp (setpoint - angle) - kv rate."""
    stiffness, damping = settings.servo_stiffness_n_m_rad, settings.servo_damping_n_m_s_rad
    if stiffness is None and damping is None:
        return
    field = "servo_damping_n_m_s_rad" if stiffness is None else "servo_stiffness_n_m_rad"
    for module in modules:
        servo = module.servo
        gain, bias = model.actuator_gainprm[servo], model.actuator_biasprm[servo]
        # A position loop whose setpoint is the integral of its command: what <intvelocity> makes.
        if not (
            model.actuator_dyntype[servo] == mujoco.mjtDyn.mjDYN_INTEGRATOR
            and model.actuator_gaintype[servo] == mujoco.mjtGain.mjGAIN_FIXED
            and model.actuator_biastype[servo] == mujoco.mjtBias.mjBIAS_AFFINE
            and gain[0] == -bias[1]
        ):
            raise InputError(
                f"plant.{field}: {path}: actuator '{module.name}/gimbal_servo' is no position loop whose setpoint "
                "is the integral of its command (<intvelocity>), which alone has this stiffness and damping"
            )
        per_gear = 1.0 / model.actuator_gear[servo, 0] ** 2  # they are those at the joint
        if stiffness is not None:
            gain[0], bias[1] = stiffness * per_gear, -stiffness * per_gear
        if damping is not None:
            bias[2] = -damping * per_gear


def bias_shift(model: mujoco.MjModel, axis: Axis, path: Path) -> np.ndarray:
    """Compute the shift of the frame's centre of mass that turns the whole plant's about the line by e.

    The first moment of all that tilts is turned, not lengthened: gravity's torque keeps its amplitude.

    Args:
        model: The model, as its file has it.
        axis: The axis, on whose frame all of the shift is.
        path: The model's file, for messages.

    Returns:
        The shift in the frame's axes, (3,) [m].

    Raises:
        InputError: The frame has no mass of its own.
    """
    frame, all_that_tilts = axis.frame, model.jnt_bodyid[axis.line.joint]
    if model.body_mass[frame] <= 0.0:
        raise InputError(
            f"plant.equilibrium_bias_deg: {path}: the body {model.body(frame).name!r}, which tilts, needs a mass of "
            "its own to move (give the model's compiler fusestatic=\"true\", so that the modules' halves become part "
            "of it)"
        )
    data = data_at_keyframe(model, element_id(model, "key", EQUILIBRIUM_KEY))
    to_frame = data.xmat[frame].reshape(3, 3).T
    centre = to_frame @ (data.subtree_com[all_that_tilts] - data.xpos[frame]) - axis.point
    radial = centre - (centre @ axis.direction) * axis.direction
    turned = math.cos(axis.bias) * radial + math.sin(axis.bias) * np.cross(axis.direction, radial)
    own = sum(model.body_mass[frame_bodies(model, axis)])
    return model.body_subtreemass[all_that_tilts] / own * (turned - radial)


def frame_bodies(model: mujoco.MjModel, axis: Axis) -> list[int]:
    """Return the frame, and the part of it beyond a bend if there is one."""
    part = element_id(model, "body", BEND_JOINT)
    return [axis.frame, *([part] if part >= 0 else [])]

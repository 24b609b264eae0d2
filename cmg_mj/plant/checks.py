"""Finds all settings of a compiled model that are wrong for a rig, not only the first."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import mujoco
import numpy as np

from cmg_mj.core.errors import shown
from cmg_mj.inputs.messages import LARGEST
from cmg_mj.plant.axis import MOUNTED_DEG, Axis, ResolvedModel
from cmg_mj.plant.elements import ACCELEROMETERS, EQUILIBRIUM_KEY, SENSORS, TILT_ELEMENT, Module, element_id
from cmg_mj.plant.inertia import wheel_momentum
from cmg_mj.plant.mjcf import data_at_keyframe
from cmg_mj.plant.tilt_line import UP, HingeLine

TRUE_DEG = 0.05
"""A keyframe that is off by more is no equilibrium: a tenth of the bias that observers are tried with [deg]."""
STEPS_S = 1e-6, 0.1
"""Physics steps that a model may ask for [s]."""


def invalid_numbers(model: mujoco.MjModel) -> list[str]:
    """Numbers of a compiled model that are NaN, infinite or beyond all size, by their element.

    Args:
        model: The model, as its file has it.

    Returns:
        Clauses for an error message.
    """
    wrong = []
    step = model.opt.timestep
    if not STEPS_S[0] <= step <= STEPS_S[1]:
        wrong.append(f"<option timestep={shown(f'{step:g}')}>: must be from {STEPS_S[0]:g} to {STEPS_S[1]:g} s")
    x, y, z = model.opt.gravity
    if not (x == y == 0.0 and -LARGEST < z < 0.0):
        wrong.append(f"<option gravity={shown(f'{x:g} {y:g} {z:g}')}>: must point straight down, such as '0 0 -9.81'")
    named = {"body": model.body, "jnt": model.joint, "dof": model.joint, "geom": model.geom, "site": model.site}
    named |= {"actuator": model.actuator, "sensor": model.sensor, "key": model.key}
    for name in dir(model):
        values = getattr(model, name) if "_" in name and not name.startswith("_") else None
        if not (isinstance(values, np.ndarray) and values.dtype.kind == "f") or np.all(np.abs(values) < LARGEST):
            continue
        row = np.argwhere(~(np.abs(values) < LARGEST))[0][0]
        prefix, _, quantity = name.partition("_")
        element = named[prefix](row).name if prefix in named else str(row)
        wrong.append(f"{quantity} of {prefix} {element!r} is no number of any size")
    return wrong


class RigChecker:
    """A compiled model at its keyframe: what stands where it must not.

    Args:
        rig: The model, as its file has it, all its numbers finite.

    Attributes:
        wrong: Clauses for an error message.
        hints: What is right and yet not what the reduced model takes it for, in clauses.
    """

    def __init__(self, rig: ResolvedModel) -> None:
        self.model, self.data = rig.model, data_at_keyframe(rig.model, rig.key)
        self.hints: list[str] = []
        self.wrong = [*(clause for axis in rig.axes for clause in self._axis(axis)), *self._rest()]
        if element_id(rig.model, "joint", "yaw") >= 0:
            self._momentum([module for axis in rig.axes for module in axis.modules])

    def _axis(self, axis: Axis) -> Iterator[str]:
        """Check that the mass of all that tilts is above the tilt axis, which is horizontal; then the axis' parts."""
        data, what = self.data, axis.prefix + TILT_ELEMENT
        turn = data.xmat[axis.frame].reshape(3, 3)
        along, pivot, radial = turn @ axis.direction, data.xpos[axis.frame] + turn @ axis.point, UP
        if not _is_square(along, UP):
            yield f"{what!r} must lie along a horizontal axis"
        else:
            centre = data.subtree_com[self.model.jnt_bodyid[axis.line.joint]] - pivot
            radial = centre - (centre @ along) * along
            lean = math.atan2(centre @ np.cross(along, UP), centre[2])
            if abs(math.degrees(lean)) > TRUE_DEG or not centre[2] > 0.0:
                cure = ""
                if isinstance(axis.line, HingeLine):
                    angle = math.remainder(axis.line.zero - axis.line.sign * lean, 2.0 * math.pi)
                    cure = f" ({self.model.joint(axis.line.joint).name!r} = {angle:.6g} would be upright)"
                yield (
                    f"at the keyframe {EQUILIBRIUM_KEY!r} the rig must stand upright, its mass above the tilt axis; it "
                    f"leans by {math.degrees(lean):.3g} deg{cure}"
                )
        for module in axis.modules:
            yield from self._module(module, along)
        yield from self._sensors(axis, along, pivot, radial)

    def _module(self, module: Module, along: np.ndarray) -> Iterator[str]:
        """Check a module: its axes are at right angles, its flywheel turns, its servo holds where it stands."""
        model, data, name = self.model, self.data, module.name
        turns, spins = (data.xaxis[model.dof_jntid[dof]] for dof in (module.gimbal_dof, module.flywheel_dof))
        angle, speed, start = module.gimbal_zero, module.speed, data.qvel[module.flywheel_dof]
        if not (_is_square(turns, along) and _is_square(spins, turns)):
            yield (
                f"the axes of '{name}/gimbal' and the tilt, and of '{name}/flywheel' and its gimbal, must be at right "
                "angles"
            )
        else:
            # Both lie in the plane that the gimbal turns in: by how much it must turn to part them by a quarter turn.
            apart = math.atan2(np.cross(spins, along) @ turns, spins @ along)
            off = apart - math.copysign(math.pi / 2.0, apart)
            if abs(math.degrees(off)) > TRUE_DEG:
                yield (
                    f"at the keyframe {EQUILIBRIUM_KEY!r} the axis of '{name}/flywheel' must be at right angles to the "
                    f"tilt's; it is {abs(math.degrees(off)):.3g} deg off ('{name}/gimbal' = {angle + off:.6g} would be "
                    "right)"
                )
        if speed == 0.0:
            yield f"keyframe {EQUILIBRIUM_KEY!r} must give '{name}/flywheel_motor' a speed (in ctrl)"
        elif abs(start - speed) > 0.01 * abs(speed):
            yield (
                f"keyframe {EQUILIBRIUM_KEY!r} must start '{name}/flywheel' at its motor's speed: qvel says "
                f"{start:g}, ctrl {speed:g}"
            )
        if model.actuator_dyntype[module.servo] == mujoco.mjtDyn.mjDYN_INTEGRATOR:
            setpoint = data.act[model.actuator_actadr[module.servo]]
            if abs(math.degrees(setpoint - angle)) > TRUE_DEG:
                yield (
                    f"keyframe {EQUILIBRIUM_KEY!r} must have the setpoint (act) of '{name}/gimbal_servo' where its "
                    f"gimbal stands: {angle:.6g}, not {setpoint:.6g}"
                )

    def _rest(self) -> Iterator[str]:
        """Nothing but the flywheels moves."""
        joints = {
            self.model.joint(joint).name: rate for joint, rate in zip(self.model.dof_jntid, self.data.qvel, strict=True)
        }
        moving = [
            f"{name!r} ({rate:g} rad/s)" for name, rate in joints.items() if rate and not name.endswith("/flywheel")
        ]
        if moving:
            yield f"at the keyframe {EQUILIBRIUM_KEY!r} only flywheels may turn, not {', '.join(moving)}"

    def _sensors(self, axis: Axis, along: np.ndarray, pivot: np.ndarray, line: np.ndarray) -> Iterator[str]:
        """Check that they sit on the frame, with their y axes along the tilt's, the accelerometers apart."""
        model, data = self.model, self.data
        for sensor, kind in SENSORS.items():
            name, beside = axis.prefix + sensor, 0.0
            site = model.sensor_objid[element_id(model, "sensor", name)]
            if model.site_bodyid[site] != axis.frame:
                yield f"sensor {name!r} must be at a site of the body with {axis.prefix + TILT_ELEMENT!r}"
                continue
            axes = data.site_xmat[site].reshape(3, 3)
            off = _degrees_between(axes[:, 1], along)
            if kind == "accelerometer":  # one that is mounted otherwise, the tilt estimate knows
                arm = data.site_xpos[site] - pivot
                aslant = _degrees_between(axes[:, 2], arm - (arm @ along) * along)
                lies = _degrees_between(arm, line)
                beside = max((a for a in (aslant, lies) if a <= MOUNTED_DEG >= lies), default=0.0)
            if off > MOUNTED_DEG:
                yield f"the site of sensor {name!r} must have its y axis along the tilt axis; it is {off:.3g} deg off"
            elif max(off, beside) > TRUE_DEG:
                self.hints.append(
                    f"the site of sensor {name!r} is {max(off, beside):.2g} deg off its place, which counts as an "
                    "inaccuracy of the rig"
                )
        if not axis.pair_tilt.is_apart:
            inner, outer = (axis.prefix + sensor for sensor in ACCELEROMETERS)
            yield f"{outer} must lie farther from the tilt axis than {inner}, or beside it"

    def _momentum(self, modules: Sequence[Module]) -> None:
        """Check that the flywheels' momenta cancel on a free thrust bearing; else the rig turns with every tilt."""
        model, data = self.model, self.data
        momenta = [
            wheel_momentum(model, data, module.flywheel_dof, data.qvel[module.flywheel_dof]) for module in modules
        ]
        left = np.linalg.norm(np.sum(momenta, axis=0))
        if left > 0.01 * sum(np.linalg.norm(momentum) for momentum in momenta):
            self.hints.append(
                "the flywheels' momenta do not cancel while the thrust bearing is free, which the reduced model does "
                "not know: see plant.lock_thrust_bearing"
            )


def _degrees_between(a: np.ndarray, b: np.ndarray) -> float:
    return math.degrees(math.atan2(np.linalg.norm(np.cross(a, b)), a @ b))


def _is_square(a: np.ndarray, b: np.ndarray) -> bool:
    return abs(_degrees_between(a, b) - 90.0) < MOUNTED_DEG

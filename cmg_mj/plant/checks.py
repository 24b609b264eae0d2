"""Finds all settings of a compiled model that are wrong for a rig, not only the first."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import mujoco
import numpy as np

from cmg_mj.core.errors import shown
from cmg_mj.inputs.messages import LARGEST
from cmg_mj.plant.elements import EQUILIBRIUM_KEY, SENSORS, TILT_ELEMENT, element_id
from cmg_mj.plant.inertia import wheel_momentum
from cmg_mj.plant.mjcf import data_at_keyframe
from cmg_mj.plant.tilt_line import HingeLine, Line, line_at_site, line_of_joint

TRUE_DEG = 0.05
"""A keyframe that is off by more is no equilibrium: a tenth of the bias that observers are tried with [deg]."""
MOUNTED_DEG = 5.0
"""A sensor or axis farther off is mounted otherwise, not inaccurately: no observer stands so much [deg]."""
FIRST_S = 0.02
"""Simulated time of the trial of the physics, in 4 to 100 steps [s]."""
HUGE = 1e10  # MuJoCo's mjMAXVAL
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
    step = float(model.opt.timestep)
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
        row = int(np.argwhere(~(np.abs(values) < LARGEST))[0][0])
        prefix, _, quantity = name.partition("_")
        element = named[prefix](row).name if prefix in named else str(row)
        wrong.append(f"{quantity} of {prefix} {element!r} is no number of any size")
    return wrong


class RigChecker:
    """A compiled model at its keyframe: what stands where it must not. What is missing is not looked at.

    Args:
        model: The model, as its file has it, all its numbers finite.
        axes: The names of its axes, each with those of its modules.

    Attributes:
        wrong: Clauses for an error message.
        hints: What is right and yet not what the reduced model takes it for, in clauses.
    """

    def __init__(self, model: mujoco.MjModel, axes: Mapping[str, Sequence[str]]) -> None:
        self.hints: list[str] = []
        self.wrong: list[str] = []
        self.key = element_id(model, "key", EQUILIBRIUM_KEY)
        if self.key < 0:
            return
        self.model, self.data = model, data_at_keyframe(model, self.key)
        complete = {
            name: [module for module in modules if min(self._addresses(module)) >= 0] for name, modules in axes.items()
        }
        for name, modules in complete.items():
            self.wrong += self._axis(name, modules)
        self.wrong += self._rest()
        if element_id(model, "joint", "yaw") >= 0:
            self._momentum([module for modules in complete.values() for module in modules])

    def _axis(self, name: str, modules: Sequence[str]) -> Iterator[str]:
        """Check all of one axis."""
        model, data = self.model, self.data
        self.prefix = f"{name}/" if name else ""
        self.what = what = self.prefix + TILT_ELEMENT
        joint, site = element_id(model, "joint", what), element_id(model, "site", what)
        if max(joint, site) < 0:
            return
        if joint >= 0:
            if int(model.jnt_type[joint]) != int(mujoco.mjtJoint.mjJNT_HINGE):
                return
            self.frame, self.axis, self.pivot = int(model.jnt_bodyid[joint]), data.xaxis[joint], data.xanchor[joint]
            self.tilt: Line | None = line_of_joint(model, joint, self.key)
        else:
            self.frame, self.pivot = int(model.site_bodyid[site]), data.site_xpos[site]
            self.axis = data.site_xmat[site].reshape(3, 3)[:, 1]
            self.tilt = line_at_site(model, data, site, self.key)
        if self.tilt is None:
            yield (
                f"site {what!r} lies on no hinge that its body hangs on, along its y axis, and that body is not free: "
                "about what it tilts cannot be told"
            )
            return
        self.line = np.array([0.0, 0.0, 1.0])
        yield from self._upright()
        for module in modules:
            yield from self._module(module)
        yield from self._sensors()

    def _addresses(self, module: str) -> tuple[int, int, int, int]:
        """Return the addresses of gimbal, flywheel, servo and motor; negative for one that is missing."""
        gimbal, flywheel = (element_id(self.model, "joint", f"{module}/{name}") for name in ("gimbal", "flywheel"))
        servo, motor = (
            element_id(self.model, "actuator", f"{module}/{name}") for name in ("gimbal_servo", "flywheel_motor")
        )
        return gimbal, flywheel, servo, motor

    def _upright(self) -> Iterator[str]:
        """Check that the centre of mass of all that tilts lies above the tilt axis, which is horizontal."""
        assert self.tilt is not None
        if abs(_degrees_between(self.axis, np.array([0.0, 0.0, 1.0])) - 90.0) > MOUNTED_DEG:
            yield f"{self.what!r} must lie along a horizontal axis"
            return
        centre = self.data.subtree_com[self.model.jnt_bodyid[self.tilt.joint]] - self.pivot
        self.line = centre - (centre @ self.axis) * self.axis
        side = np.cross(self.axis, (0.0, 0.0, 1.0))
        lean = math.atan2(float(centre @ side), float(centre[2]))
        if abs(math.degrees(lean)) > TRUE_DEG or not centre[2] > 0.0:
            cure = ""
            if isinstance(self.tilt, HingeLine):
                angle = math.remainder(self.tilt.zero - self.tilt.sign * lean, 2.0 * math.pi)
                cure = f" ({self.model.joint(self.tilt.joint).name!r} = {angle:.6g} would be upright)"
            yield (
                f"at the keyframe {EQUILIBRIUM_KEY!r} the rig must stand upright, its mass above the tilt axis; it "
                f"leans by {math.degrees(lean):.3g} deg{cure}"
            )

    def _module(self, module: str) -> Iterator[str]:
        """Check a module: its axes are at right angles, its flywheel turns, its servo holds where it stands."""
        model, data = self.model, self.data
        gimbal, flywheel, servo, motor = self._addresses(module)
        turns, spins = data.xaxis[gimbal], data.xaxis[flywheel]
        angle = float(data.qpos[model.jnt_qposadr[gimbal]])
        place = f"at the keyframe {EQUILIBRIUM_KEY!r}"
        if not (_is_square(turns, self.axis) and _is_square(spins, turns)):
            yield (
                f"the axes of '{module}/gimbal' and the tilt, and of '{module}/flywheel' and its gimbal, must be at "
                "right angles"
            )
        else:
            # Both lie in the plane that the gimbal turns in: by how much it must turn to part them by a quarter turn.
            apart = math.atan2(float(np.cross(spins, self.axis) @ turns), float(spins @ self.axis))
            off = apart - math.copysign(math.pi / 2.0, apart)
            if abs(math.degrees(off)) > TRUE_DEG:
                yield (
                    f"{place} the axis of '{module}/flywheel' must be at right angles to the tilt's; it is "
                    f"{abs(math.degrees(off)):.3g} deg off ('{module}/gimbal' = {angle + off:.6g} would be "
                    "right)"
                )
        speed, start = float(data.ctrl[motor]), float(data.qvel[model.jnt_dofadr[flywheel]])
        if speed == 0.0:
            yield f"keyframe {EQUILIBRIUM_KEY!r} must give '{module}/flywheel_motor' a speed (in ctrl)"
        elif abs(start - speed) > 0.01 * abs(speed):
            yield (
                f"keyframe {EQUILIBRIUM_KEY!r} must start '{module}/flywheel' at its motor's speed: qvel says "
                f"{start:g}, ctrl {speed:g}"
            )
        if model.actuator_dyntype[servo] == mujoco.mjtDyn.mjDYN_INTEGRATOR:
            setpoint = float(data.act[model.actuator_actadr[servo]])
            if abs(math.degrees(setpoint - angle)) > TRUE_DEG:
                yield (
                    f"keyframe {EQUILIBRIUM_KEY!r} must have the setpoint (act) of '{module}/gimbal_servo' where its "
                    f"gimbal stands: {angle:.6g}, not {setpoint:.6g}"
                )

    def _rest(self) -> Iterator[str]:
        """Nothing but the flywheels moves."""
        model = self.model
        joints = {model.joint(int(model.dof_jntid[dof])).name: float(self.data.qvel[dof]) for dof in range(model.nv)}
        moving = [
            f"{name!r} ({rate:g} rad/s)" for name, rate in joints.items() if rate and not name.endswith("/flywheel")
        ]
        if moving:
            yield f"at the keyframe {EQUILIBRIUM_KEY!r} only flywheels may turn, not {', '.join(moving)}"

    def _sensors(self) -> Iterator[str]:
        """They sit on the frame, the accelerometers on the radial line, upright."""
        model, data = self.model, self.data
        radii = {}
        for name, kind in SENSORS.items():
            name = self.prefix + name
            sensor = element_id(model, "sensor", name)
            if sensor < 0 or model.sensor_objtype[sensor] != mujoco.mjtObj.mjOBJ_SITE:
                continue
            site = int(model.sensor_objid[sensor])
            if model.site_bodyid[site] != self.frame:
                yield f"sensor {name!r} must be at a site of the body with {self.what!r}"
                continue
            axes = data.site_xmat[site].reshape(3, 3)
            off = _degrees_between(axes[:, 1], self.axis)
            arm = data.site_xpos[site] - self.pivot
            if kind == "accelerometer":
                radial = arm - (arm @ self.axis) * self.axis
                radii[name] = float(np.linalg.norm(radial))
                off = max(off, _degrees_between(axes[:, 2], radial) if radii[name] else 180.0)
            if off > MOUNTED_DEG:
                away = " and its z axis pointing away from it" if kind == "accelerometer" else ""
                yield (
                    f"the site of sensor {name!r} must have its y axis along the tilt axis{away}; it is {off:.3g} deg "
                    "off"
                )
            beside = _degrees_between(arm, self.line) if kind == "accelerometer" and radii[name] else 0.0
            if beside > MOUNTED_DEG:
                yield (
                    f"the site of sensor {name!r} must lie on the radial line, from the tilt axis through the centre "
                    f"of mass; it lies {beside:.3g} deg beside it"
                )
            elif TRUE_DEG < max(off, beside) <= MOUNTED_DEG:
                self.hints.append(
                    f"the site of sensor {name!r} is {max(off, beside):.2g} deg off its place, which counts as an "
                    "inaccuracy of the rig"
                )
        inner, outer = (radii.get(self.prefix + name) for name in list(SENSORS)[:2])
        if inner is not None and outer is not None and not 0.0 < inner < outer:
            names = [self.prefix + name for name in SENSORS]
            yield f"{names[1]} must lie farther from the tilt axis than {names[0]}"

    def _momentum(self, modules: list[str]) -> None:
        """Check that the flywheels' momenta cancel on a free thrust bearing; else the rig turns with every tilt."""
        model, data = self.model, self.data
        momenta = []
        for module in modules:
            _, flywheel, _, _ = self._addresses(module)
            momenta.append(wheel_momentum(model, data, flywheel, data.qvel[model.jnt_dofadr[flywheel]]))
        left = float(np.linalg.norm(np.sum(momenta, axis=0)))
        if left > 0.01 * sum(float(np.linalg.norm(momentum)) for momentum in momenta):
            self.hints.append(
                "the flywheels' momenta do not cancel while the thrust bearing is free, which the reduced model does "
                "not know: see plant.lock_thrust_bearing"
            )


def survives_first_steps(model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    """Check that the physics gets through its first steps.

    Args:
        model: The rig as it is run.
        data: Its initial state, which is changed.

    Returns:
        Whether all joints still have angles and rates that MuJoCo takes for sane.
    """
    mujoco.mj_step(model, data, int(np.clip(FIRST_S / model.opt.timestep, 4, 100)))
    return bool(np.all(np.abs(data.qpos) < HUGE) and np.all(np.abs(data.qvel) < HUGE))


def _degrees_between(a: np.ndarray, b: np.ndarray) -> float:
    return math.degrees(math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b)))


def _is_square(a: np.ndarray, b: np.ndarray) -> bool:
    return abs(_degrees_between(a, b) - 90.0) < MOUNTED_DEG

"""The rig: a compiled model with its names resolved once, and the reduced model's parameters read off it."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from pydantic import ValidationError

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.axis import KnownPlant
from cmg_mj.core.errors import InputError, TomlValue, nearest
from cmg_mj.core.loop import Joints
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.tilt import GimbalAngle, PairTilt
from cmg_mj.core.types import MultiAxisReading
from cmg_mj.inputs.features import entries
from cmg_mj.inputs.files import find, folder
from cmg_mj.inputs.messages import complaints
from cmg_mj.plant.axis import Axis, ResolvedModel, resolve
from cmg_mj.plant.build import build, edit
from cmg_mj.plant.elements import BEND_JOINT, element_id
from cmg_mj.plant.locking import lock_thrust_bearing
from cmg_mj.plant.mjcf import compile_model, parse, quiet, set_control_callback
from cmg_mj.plant.settings import apply, place_accelerometers
from cmg_mj.plant.step_limit import fit_step
from cmg_mj.plant.tilt_line import HingeLine
from cmg_mj.scenario.design import PlantNumbers
from cmg_mj.scenario.plant_settings import MIN_STEP_S, PlantSettings
from cmg_mj.scenario.schema import ControllerSettings, Scenario
from cmg_mj.scenario.time_grid import TimeGrid
from cmg_mj.sensors.accelerometer import Accelerometer
from cmg_mj.stages.backlash import ARCMIN_A_DEGREE

if TYPE_CHECKING:
    from cmg_mj.stages.turning import YawCoupling

FIRST_S = 0.02
"""Simulated time of the trial of the physics, in 4 to 100 steps [s]."""
HUGE = 1e10  # MuJoCo's mjMAXVAL


class Plant:
    """A compiled rig with its names resolved, and a scenario's settings in it.

    Args:
        filed: The rig as its file has it.
        settings: Its settings.
        sections: Settings of the features that edit the model, by name.
        axis_settings: The settings of axes that have their own.
        grid: The times that whole physics steps must fill; by default the step is the largest that is accurate enough.

    Attributes:
        model: The compiled model, without what is only seen. Do not change it: the plant may be shared.
        axes: What it tilts about, each with its modules, sensors and reduced model. That is read off the file as it is
            but for the flywheels' speed, which the controller knows: without bias or friction, which it does not.
        hints: What on the model is not what the reduced model takes it for, in clauses.
        yaw: Address of q_a, or None if the thrust bearing is locked.
        largest_step: The largest physics step that is accurate enough [s].
        backlash: Between the servos' motors and the gimbals [rad].

    Raises:
        InputError: The settings do not fit the rig, or its physics fails.
    """

    def __init__(
        self,
        filed: ResolvedModel,
        settings: PlantSettings,
        sections: Mapping[str, Any] = MappingProxyType({}),
        axis_settings: Mapping[str, PlantSettings] = MappingProxyType({}),
        grid: TimeGrid | None = None,
    ) -> None:
        self.filed, self.settings, self.sections, self.axis_settings = filed, settings, sections, axis_settings
        self.path, self.key, self.hints = filed.path, filed.key, filed.hints
        self.model, self.axes, self.largest_step = apply(filed, settings, axis_settings, sections)
        self.yaw = int(self.model.joint("yaw").qposadr[0]) if "yaw" in self.joint_names else None
        self.backlash = math.radians(settings.gimbal_backlash_arcmin / ARCMIN_A_DEGREE)
        if settings.timestep_s is None and self.largest_step < MIN_STEP_S:
            raise InputError(
                f"{self._error_source}: so stiff a rig needs physics steps of {self.largest_step:.2g} s, below "
                f"{MIN_STEP_S:g} s; soften it, or set plant.timestep_s"
            )
        grid = grid or TimeGrid(0.0, settings.timestep_s, 1.0 / ControllerSettings().rate_hz)
        self.model.opt.timestep = fit_step(grid, self.largest_step)
        data = self.new_data()
        mujoco.mj_step(self.model, data, int(np.clip(FIRST_S / self.timestep, 4, 100)))
        if not np.all(np.abs([*data.qpos, *data.qvel]) < HUGE):
            raise InputError(
                f"{self._error_source}: the physics fails in its first steps of {self.timestep:g} s; masses, friction, "
                "damping and servos must be of sizes that go together"
            )

    @property
    def _error_source(self) -> str:
        """Culprit if the physics fails: the settings that change it, or without such settings the file."""
        changes = self.settings.changes_of_physics()
        return ", ".join(f"plant.{name} = {value:g}" for name, value in changes.items()) or str(self.path)

    @cached_property
    def drawn_model(self) -> mujoco.MjModel:
        """The model with all that is only seen: the same bodies and joints, and geoms that physics does without."""
        with set_control_callback(None), quiet():  # compiling a model runs it
            model = compile_model(self.drawn_spec(), self.path)
        for axis in self.filed.axes:
            place_accelerometers(model, self.axis_settings.get(axis.name, self.settings), axis, self.path)
        return model

    def drawn_spec(self) -> mujoco.MjSpec:
        """Parse the model's file, with all that is only seen, edited as the settings say.

        Raises:
            InputError: MuJoCo's compiler refuses it, because of a mesh that cannot be read.
        """
        path, settings, spec = self.path, self.settings, parse(self.path)
        if settings.lock_thrust_bearing:
            lock_thrust_bearing(spec, path)
        if settings.locked_axes or any(section.unmodelled for section in self.sections.values()):
            edit(spec, resolve(path, compile_model(spec, path), self.filed.modules), settings, self.sections)
        return spec

    def with_own_model(self) -> Plant:
        """Copy the plant onto a model of its own, whose gravity may be shifted while it runs."""
        other = copy.copy(self)
        other.model = copy.copy(self.model)
        return other

    @property
    def bends(self) -> bool:
        """True if the frame bends."""
        return element_id(self.model, "joint", BEND_JOINT) >= 0

    def single_axis(self, axis: str) -> Plant:
        """Return the rig as one of its axes sees it: with that axis alone.

        Args:
            axis: Its name.

        Returns:
            The rig, whose `axis`, `reduced`, `ideal_readings`, `controller`, ... are that axis'.

        Raises:
            InputError: There is no such axis.
        """
        other = copy.copy(self)
        other.axes = tuple(candidate for candidate in self.axes if candidate.name == axis)
        if not other.axes:
            raise InputError(f"{self.path}: no axis {axis!r}; {nearest(axis, self.axis_names)}")
        return other

    @property
    def axis_names(self) -> list[str]:
        """Names of the axes; of a rig's only one it may be empty."""
        return [axis.name for axis in self.axes]

    @cached_property
    def turning(self) -> YawCoupling:
        """Coupling of the axes in a turn about the vertical."""
        from cmg_mj.plant.turning import turning  # most rigs have one axis

        return turning(self.filed.model, self.key, self.axes)

    @property
    def largest_tilt(self) -> Callable[[Joints], Scalar]:
        """Function of qpos: the tilt from the keyframe of the axis that is farthest from it [rad]."""
        return self.axis.line.lean if len(self.axes) == 1 else self._farthest_lean

    def _farthest_lean(self, qpos: Joints) -> Scalar:
        leans = np.array([axis.line.lean(qpos) for axis in self.axes])
        farthest = np.argmax(np.where(np.isnan(leans), np.inf, np.abs(leans)), axis=0)
        lean = np.take_along_axis(leans, farthest[None], axis=0)[0]
        return lean if lean.ndim else float(lean)

    @property
    def axis(self) -> Axis:
        """The rig's axis, or the first of several."""
        return self.axes[0]

    @property
    def reduced(self) -> ReducedModel:
        """The reduced model of the axis."""
        return self.axis.reduced

    @property
    def pair_tilt(self) -> PairTilt:
        """The tilt estimate for the accelerometers of the axis."""
        return self.axis.pair_tilt

    @property
    def bias(self) -> float:
        """Bias e of the axis [rad]."""
        return self.axis.bias

    @property
    def tilt(self) -> int:
        """Address of q_b in qpos, and of its rate in qvel: of a rig that consists of hinges, the papers' among them."""
        return self._hinge.angle

    @property
    def tilt_zero(self) -> float:
        """q_b at which the radial line is upright [rad]."""
        return self._hinge.zero

    @property
    def _hinge(self) -> HingeLine:
        line = self.axis.line
        if not isinstance(line, HingeLine) or line.angle != line.dof:
            raise InputError(f"{self.path}: tilts about no hinge of its own at one address; use plant.axis.line")
        return line

    @property
    def ideal_readings(self) -> Callable[[Joints, Joints], Any]:
        """Function of sensordata and qvel: readings of perfect sensors (see `Axis.ideal`), or `MultiAxisReading`."""
        return self.axis.ideal if len(self.axes) == 1 else self._readings_of_axes

    def _readings_of_axes(self, sensordata: Joints, qvel: Joints) -> MultiAxisReading:
        upward, touch = sensordata[self.axis.gyro + 1], [sensordata[address] for address in self._touch]
        return MultiAxisReading([axis.ideal(sensordata, qvel) for axis in self.axes], upward, touch)

    @cached_property
    def _touch(self) -> list[int]:
        """Addresses in sensordata of the touch sensors."""
        return self.model.sensor_adr[self.model.sensor_type == mujoco.mjtSensor.mjSENS_TOUCH].tolist()

    def apparent_bias(self, accelerometer: Accelerometer) -> float:
        """Return the bias an observer should find: e less the tilt made by the accelerometers' constant errors.

        Since y1 = x1 - e + offset, no observer can separate the two.

        Args:
            accelerometer: The sensors of the tilt.

        Returns:
            The bias at the equilibrium [rad].
        """
        return self.bias - self.pair_tilt.offset(-self.bias, accelerometer.constant_errors(), self.gravity)

    @property
    def interface(self) -> KnownPlant:
        """The plant as a controller of the axis knows it."""
        zeros = tuple(module.gimbal_zero for module in self.axis.modules)
        gimbal_angle = GimbalAngle(tuple(self.axis.directions), zeros)
        return KnownPlant(self.pair_tilt, gimbal_angle, self.model.opt.timestep, self.backlash)

    @property
    def timestep(self) -> float:
        """The physics step [s]."""
        return float(self.model.opt.timestep)

    @property
    def gravity(self) -> float:
        """[m/s^2]."""
        return float(np.linalg.norm(self.model.opt.gravity))

    @property
    def parameters(self) -> PlantNumbers:
        """Parameters from which a scenario's controller and observers are made."""
        names = tuple(module.name for module in self.axis.modules)
        numbers = self.reduced, self.pair_tilt, self.gravity, self.timestep, self.largest_step
        return PlantNumbers(self.path, names, *numbers, self.hints)

    def initialise(self, data: mujoco.MjData) -> None:
        """Put data at the scenario's initial state: flywheels at speed, tilted by initial_tilt_deg."""
        mujoco.mj_resetDataKeyframe(self.model, data, self.key)
        for axis in self.axes:
            axis.line.tilt(data, -axis.bias + axis.initial_tilt)
        with set_control_callback(None):  # the first control tick is the first step's
            mujoco.mj_forward(self.model, data)

    def new_data(self) -> mujoco.MjData:
        """Fresh simulation data at the scenario's initial state."""
        data = mujoco.MjData(self.model)
        self.initialise(data)
        return data

    @cached_property
    def joint_names(self) -> list[str]:
        """Names of the joints in the order of qpos."""
        return [self.model.joint(i).name for i in range(self.model.njnt)]

    @cached_property
    def joint_kinds(self) -> tuple[str, ...]:
        """Kind of each joint: `hinge`, `slide`, `ball` or `free`; empty if all are hinges."""
        kinds = tuple(mujoco.mjtJoint(kind).name.removeprefix("mjJNT_").lower() for kind in self.model.jnt_type)
        return () if set(kinds) == {"hinge"} else kinds


@quiet()
def load_plant(
    settings: PlantSettings | None = None,
    beside: Path | None = None,
    grid: TimeGrid | None = None,
    axis_settings: Mapping[str, PlantSettings] = MappingProxyType({}),
    sections: Mapping[str, Any] = MappingProxyType({}),
    **fields: TomlValue,
) -> Plant:
    """Load a rig.

    Args:
        settings: Its settings; or give them as keyword arguments.
        beside: A folder that a relative model path may start from.
        grid: The times that whole physics steps must fill; by default a control period of 5 ms.
        axis_settings: The settings of axes that have their own: equilibrium bias, initial tilt, places of the
            accelerometers.
        sections: Settings of the features that edit the model, such as {"bend": Bend(frequency_hz=20.0)}.
        **fields: Fields of `PlantSettings`. A robot that is not bundled begins upright, without an equilibrium bias.

    Returns:
        The compiled plant.

    Raises:
        InputError: A field is unknown or not allowed; the file does not exist, does not compile, or lacks a joint,
            actuator, sensor or keyframe.
    """
    if settings is None:
        try:
            settings = PlantSettings(**fields)  # type: ignore[arg-type]
        except ValidationError as error:
            wrong = complaints(PlantSettings, error.errors(), fields)
            raise InputError("; ".join(f"plant.{clause}" for clause in wrong)) from error
    for name, section in sections.items():
        if name not in entries("edit"):
            raise InputError(f"sections: {name!r}: no such section; {nearest(name, entries('edit'))}")
        if not isinstance(section, entries("section")[name]):
            raise InputError(f"sections: {name}: must be a {entries('section')[name].__name__}")
    path = find("models", settings.model, ".xml", "plant.model =", beside)
    if "model" in fields and not path.parent.samefile(folder("models")):
        settings = replace(settings, **{"equilibrium_bias_deg": 0.0, "initial_tilt_deg": 0.0} | fields)
    with set_control_callback(None):  # compiling a model runs it
        return Plant(build(path, settings, sections), settings, sections, axis_settings, grid)


@quiet()
def load_scenario_plant(scenario: Scenario, grid: TimeGrid, like: Plant | None = None) -> Plant:
    """Load a scenario's plant, with the axes that the scenario names.

    Args:
        scenario: The scenario.
        grid: The grid of its times.
        like: A plant that may have the same compiled file, locks and edits, which then is not compiled again.

    Raises:
        InputError: No physics step fits the grid, or `load_plant` refuses the plant.
    """
    settings, axes = scenario.plant, scenario.axis_scenarios
    sections = {name: scenario.section(name) for name in entries("edit")}
    same = like is not None and like.sections == sections and like.settings.compiled_alike(settings)
    with set_control_callback(None):  # compiling a model runs it
        if like is not None and same:  # whose file may be gone
            filed = like.filed
        else:
            path = find("models", settings.model, ".xml", "plant.model =")
            filed = build(path, settings, sections)
        plant = Plant(filed, settings, sections, {name: axis.plant for name, axis in axes.items()}, grid)
    if not same and not plant.path.parent.samefile(folder("models")):
        _ = plant.drawn_model  # a mesh that cannot be read is found before a run and not after it
    return plant


def check_axes(scenario: Scenario, plant: Plant) -> None:
    """Refuse the name of an axis that the plant does not have, and on a plant of several axes a torque without one.

    Raises:
        InputError: There is such a name, or such a torque.
    """
    for name in scenario.axes:
        check_axis("axes", name, plant)
    for section in ("push", "swing"):
        for i, torque in enumerate(scenario.section(section)):
            check_axis(f"{section}.{i}.axis", torque.axis, plant)


def check_axis(field: str, axis: str | None, plant: Plant) -> None:
    """Refuse the name of an axis that the plant does not have, and on a plant of several axes None.

    Raises:
        InputError: There is no such axis; the field is named.
    """
    known = [*plant.axis_names, *plant.settings.locked_axes]
    if axis is None and len(known) > 1:
        raise InputError(f"{field}: the rig has several axes: which of {', '.join(known)}?")
    if axis is not None and known == [""]:
        raise InputError(f"{field} = {axis!r}: the rig has one axis, without a name; leave it out")
    if axis is not None and axis not in known:
        raise InputError(f"{field} = {axis!r}: the rig has no such axis; {nearest(axis, known)}")

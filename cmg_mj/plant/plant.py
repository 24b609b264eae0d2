"""The rig: a compiled model with its names resolved once, and the reduced model's parameters read off it."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, Unpack

import mujoco
import numpy as np
from pydantic import ValidationError

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.axes import MultiAxisController
from cmg_mj.core.controller import Controller, PlantInterface
from cmg_mj.core.errors import InputError, TomlValue, nearest
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.tilt import GimbalAngle, RadialTilt
from cmg_mj.core.types import MultiAxisReading
from cmg_mj.inputs.files import find
from cmg_mj.inputs.messages import complaints
from cmg_mj.laws import Law, StateFeedback
from cmg_mj.observers import Observer
from cmg_mj.plant.axis import Axis, find_axis, find_locked_modules, read_reduced
from cmg_mj.plant.checks import survives_first_steps
from cmg_mj.plant.elements import EQUILIBRIUM_KEY, JOINT_KINDS, element_id
from cmg_mj.plant.mjcf import compile_model, load_rig, parse_drawn
from cmg_mj.plant.mujoco_state import quiet, set_control_callback
from cmg_mj.plant.step_limit import largest_step
from cmg_mj.plant.tilt_line import Addressed, HingeLine
from cmg_mj.plant.turning import turning
from cmg_mj.plant.variations import place_accelerometers, set_turn_rate, vary, with_flywheel_speed
from cmg_mj.scenario.make_controller import StageOptions, make_controller
from cmg_mj.scenario.plant_parameters import PlantParameters
from cmg_mj.scenario.plant_settings import COMPILED_FIELDS, FINEST_STEP_S, PlantSettings
from cmg_mj.scenario.schema import ObserverSettings
from cmg_mj.scenario.time_grid import TimeGrid
from cmg_mj.sensors.accelerometer import Accelerometer
from cmg_mj.sensors.sampled import Sensors
from cmg_mj.stages.backlash import ARCMIN_A_DEGREE, backlash
from cmg_mj.stages.turning import YawCoupling, compensation


class Plant:
    """A compiled rig with its names resolved.

    Attributes:
        settings: What it was made from.
        model: The compiled model, without what is only seen. Do not change it: the plant may be shared.
        axes: What it tilts about, each with its modules, sensors and reduced model. That is read off the file as it is
            but for the flywheels' speed, which the controller knows: without bias or friction, which it does not.
        hints: What on the model is not what the reduced model takes it for, in clauses.
        yaw: Address of q_a, or None if the thrust bearing is locked.
        largest_step: The largest physics step that is accurate enough [s].
        backlash: Between the servos' motors and the gimbals [rad].
        above_centre_m: So much above the common mass centre lies the point that the tilt estimate of a pivot that
            slides takes to be at rest: an error of the estimate, which settings made from this plant keep [m].
    """

    above_centre_m = 0.0

    def __init__(
        self,
        settings: PlantSettings,
        path: Path,
        grid: TimeGrid | None = None,
        of_axes: Mapping[str, PlantSettings] = MappingProxyType({}),
    ) -> None:
        self.path = path
        locked, lock = settings.locked_axes, settings.lock_thrust_bearing
        self.model, modules, self.hints = load_rig(path, lock=lock, locked_axes=locked, bend=settings)
        self._as_filed = self.model
        self.key = element_id(self.model, "key", EQUILIBRIUM_KEY)
        self.yaw = int(self.model.joint("yaw").qposadr[0]) if "yaw" in self.joint_names else None
        self._module_names = modules
        self._axes_as_filed = tuple(
            find_axis(self.model, self.key, name, modules[name]) for name in modules if name not in locked
        )
        self._held = tuple(
            module for name in locked for module in find_locked_modules(self.model, self.key, modules[name])
        )
        self._apply_settings(settings, grid, of_axes)

    def changed(
        self,
        settings: PlantSettings,
        grid: TimeGrid | None = None,
        of_axes: Mapping[str, PlantSettings] = MappingProxyType({}),
    ) -> Plant:
        """Return the rig with other settings, without compiling its file again.

        Args:
            settings: Settings with the same model file, the same locks and the same bend.
            grid: The times that whole physics steps must fill.
            of_axes: The settings of axes that have their own.

        Returns:
            Another plant.

        Raises:
            InputError: With these settings the physics fails.
        """
        other = copy.copy(self)
        for cached in ("drawn_model", "turning"):
            other.__dict__.pop(cached, None)
        other._apply_settings(settings, grid, of_axes)
        return other

    def is_of_same_file(self, settings: PlantSettings) -> bool:
        """Return whether `changed` can take these settings: the same model file, locks and bend."""
        return all(getattr(self.settings, name) == getattr(settings, name) for name in COMPILED_FIELDS)

    def _apply_settings(
        self, settings: PlantSettings, grid: TimeGrid | None, of_axes: Mapping[str, PlantSettings]
    ) -> None:
        """Change the model as the settings say, and fit the physics step to the grid."""
        self.settings, self._of_axes = settings, of_axes
        self.backlash = math.radians(settings.gimbal_backlash_arcmin / ARCMIN_A_DEGREE)
        self.model = copy.copy(self._as_filed)
        axes, speed = [], settings.flywheel_speed_rad_s
        for axis in self._axes_as_filed:
            axis_settings = of_axes.get(axis.name, settings)
            changed = replace(
                axis,
                bias=math.radians(axis_settings.equilibrium_bias_deg),
                initial_tilt=math.radians(axis_settings.initial_tilt_deg),
                radial_tilt=place_accelerometers(self.model, axis_settings, axis, self.path, self.above_centre_m),
                misplaced=axis_settings.has_misplaced,
            )
            if speed is not None:
                modules = with_flywheel_speed(self.model, self.key, axis.modules, speed, self.path)
                changed = replace(changed, modules=modules)
                changed = replace(changed, reduced=read_reduced(self._as_filed, self.key, changed))
            axes.append(changed)
        self.axes = tuple(axes)
        held = self._held if speed is None else with_flywheel_speed(self.model, self.key, self._held, speed, self.path)
        if settings.turn_rate_rad_s:
            set_turn_rate(self.model, self.key, settings.turn_rate_rad_s, self.path)
        vary(self.model, settings, self.path, self.axes, held)
        speeds = [abs(module.speed) for axis in self.axes for module in axis.modules]
        shake_rate = max(speeds) if settings.flywheel_imbalance_kg_m else 0.0
        self.largest_step = largest_step(self.model, self.key, float(self.model.opt.timestep), shake_rate)
        if settings.timestep_s is None and self.largest_step < FINEST_STEP_S:
            raise InputError(
                f"{self._error_source}: so stiff a rig needs physics steps of {self.largest_step:.2g} s, below "
                f"{FINEST_STEP_S:g} s; soften it, or set plant.timestep_s"
            )
        step = grid.physics_step(self.largest_step) if grid else settings.timestep_s
        self.model.opt.timestep = step or self.largest_step
        if not survives_first_steps(self.model, self.new_data()):
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
        for axis in self._axes_as_filed:
            place_accelerometers(model, self._of_axes.get(axis.name, self.settings), axis, self.path)
        return model

    def drawn_spec(self) -> mujoco.MjSpec:
        """Parse the model's file, with all that is only seen, and lock what the settings lock."""
        return parse_drawn(self.path, self.settings, self._module_names)

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
        return turning(self._as_filed, self.key, self.axes)

    def largest_tilt(self, qpos: Addressed) -> Scalar:
        """Return the tilt from the keyframe of the axis that is farthest from it [rad]."""
        if len(self.axes) == 1:
            return self.axis.line.lean(qpos)
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
    def radial_tilt(self) -> RadialTilt:
        """The tilt estimate for the accelerometers of the axis."""
        return self.axis.radial_tilt

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

    def ideal_readings(self, sensordata: list[float] | np.ndarray, qvel: Addressed) -> Any:
        """Return the readings of perfect sensors: of the axis (see `Axis.ideal`), or `MultiAxisReading` of several."""
        if len(self.axes) == 1:
            return self.axis.ideal(sensordata, qvel)
        upward = sensordata[self.axis.gyro + 1]
        return MultiAxisReading([axis.ideal(sensordata, qvel) for axis in self.axes], upward)

    def apparent_bias(self, accelerometer: Accelerometer) -> float:
        """Return the bias that an observer should find: see `Axis.apparent_bias`."""
        return self.axis.apparent_bias(accelerometer, self.gravity)

    @property
    def interface(self) -> PlantInterface:
        """The plant as a controller of the axis knows it."""
        zeros = tuple(module.gimbal_zero for module in self.axis.modules)
        gimbal_angle = GimbalAngle(tuple(self.axis.directions), zeros)
        return PlantInterface(self.radial_tilt, gimbal_angle, self.model.opt.timestep, backlash(self.backlash))

    def controller(
        self,
        observer: Observer | str | Mapping[str, Any] = "homogeneous",
        *,
        law: Law | None = None,
        sensors: Sensors | None = None,
        **options: Unpack[StageOptions],
    ) -> Controller:
        """Make a fresh controller for a plant of one axis, without a scenario.

        Args:
            observer: An observer, its name (or package.module:Class), or a section [observer] with its `kind` and
                parameters, such as {"kind": "homogeneous", "k1": 20.0}.
            law: The law, an object; by default Table 2's gains at 200 Hz. `Experiment.law` is a scenario's.
            sensors: The sensors; by default those of the datasheets.
            **options: Options of `Controller`, such as seed and feedback.

        Returns:
            The controller.

        Raises:
            InputError: The plant has several axes, the observer does not exist or refuses a parameter, the law is a
                name, or a rate does not fit the physics step.
        """
        if len(self.axes) > 1:
            raise InputError(f"{self.path}: tilts about several axes; use multi_axis_controller")
        if isinstance(law, (str, Mapping)):
            raise InputError(
                f"law = {law!r}: must be a law, not its name. Give StateFeedback(dt=0.005, gains=...), or "
                "prepare(scenario).law of a scenario with this [controller]"
            )
        law, sensors = law or StateFeedback(dt=0.005), sensors or Sensors()
        if isinstance(observer, (str, Mapping)):
            settings = ObserverSettings(**({"kind": observer} if isinstance(observer, str) else observer))
            observer = settings.make(law.dt, self.reduced, self.parameters.noise(sensors))
        return make_controller(observer, law, sensors, self.interface, **options)

    def multi_axis_controller(
        self,
        observer: Observer | str | Mapping[str, Any] = "homogeneous",
        *,
        law: Law | None = None,
        sensors: Sensors | None = None,
        **options: Unpack[StageOptions],
    ) -> MultiAxisController:
        """Make a fresh controller for a plant of several axes: one an axis, all made alike, as `controller` makes it.

        Their gimbals also compensate what a turn about the vertical couples.
        """
        plants = [self.single_axis(name) for name in self.axis_names]
        parts = [
            plant.controller(observer, law=law, sensors=sensors, **{**options, "axis": i})
            for i, plant in enumerate(plants)
        ]
        return MultiAxisController(parts, compensation(self.turning, parts[0].sensors.mems_gyro))

    @property
    def timestep(self) -> float:
        """The physics step [s]."""
        return float(self.model.opt.timestep)

    @property
    def gravity(self) -> float:
        """[m/s^2]."""
        return float(np.linalg.norm(self.model.opt.gravity))

    @property
    def parameters(self) -> PlantParameters:
        """Parameters from which a scenario's controller and observers are made."""
        names = tuple(module.name for module in self.axis.modules)
        numbers = self.reduced, self.radial_tilt, self.gravity, self.timestep, self.largest_step
        return PlantParameters(self.path, names, *numbers, self.hints)

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
        kinds = tuple(JOINT_KINDS[int(kind)] for kind in self.model.jnt_type)
        return () if set(kinds) == {"hinge"} else kinds


@quiet()
def load_plant(
    settings: PlantSettings | None = None,
    beside: Path | None = None,
    grid: TimeGrid | None = None,
    of_axes: Mapping[str, PlantSettings] = MappingProxyType({}),
    **fields: TomlValue,
) -> Plant:
    """Load a rig.

    Args:
        settings: Its settings; or give them as keyword arguments.
        beside: A folder that a relative model path may start from.
        grid: The times that whole physics steps must fill; by default the step is the largest that is accurate enough.
        of_axes: The settings of axes that have their own: equilibrium bias, initial tilt, places of the accelerometers.
        **fields: Fields of `PlantSettings`.

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
    with set_control_callback(None):  # compiling a model runs it
        return Plant(settings, find("models", settings.model, ".xml", "plant.model =", beside), grid, of_axes)

"""The law and the observers of a scenario, made for one reduced model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, TypedDict, Unpack

from cmg_mj.core.axis import AngleSource, AxisControl, Feedback, KnownPlant
from cmg_mj.core.controller import Controller
from cmg_mj.core.errors import InputError, nearest
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.sensor import whole_steps
from cmg_mj.core.tilt import MeasurementNoise, PairTilt
from cmg_mj.core.types import LAW_NEEDS, extra_signals, law_needs, reads_gyro
from cmg_mj.laws import LAW_CLASSES, LAWS, Law
from cmg_mj.observers import OBSERVER_CLASSES, Observer, make_observer
from cmg_mj.scenario.schema import ControllerSettings, Scenario
from cmg_mj.sensors import Sensors
from cmg_mj.stages.backlash import backlash
from cmg_mj.stages.notch import notches
from cmg_mj.stages.trim import trims


@dataclass(frozen=True)
class Design:
    """The law of a scenario, and its observers.

    A user's own law or observer is made anew for every run: it may remember more than its state holds.

    Attributes:
        scenario: The scenario.
        rig: The parameters of the plant.
        law: The control law, to be looked at: a run has its `fresh_law`.
    """

    scenario: Scenario
    rig: PlantNumbers
    law: Law

    @property
    def constructor_arguments(self) -> tuple[float, ReducedModel, MeasurementNoise]:
        """Arguments of every observer: control period [s], reduced model, noise by the datasheet."""
        sensors, dt = self.scenario.sensors, self.law.dt
        repeats = max(dt, 1.0 / sensors.accelerometer.rate_hz) / dt
        return dt, self.rig.reduced, replace(self.rig.noise(sensors), repeats=repeats)

    def fresh_law(self) -> Law:
        """Make the law of a run."""
        controller = self.scenario.controller
        return self.law if controller.kind in LAWS else controller.law(*self.constructor_arguments[1:])

    def observer(self) -> Observer:
        """Make the observer in the loop."""
        return self.scenario.observer.make(*self.constructor_arguments)

    def open_loop_observers(self) -> dict[str, Observer]:
        """Make the open-loop observers, by name."""
        return {name: make_observer(name, *self.constructor_arguments) for name in self.scenario.open_loop_names()}

    def axis_control(
        self,
        plant: KnownPlant,
        *,
        axis: int = 0,
        observer: Observer | None = None,
        open_loop_observers: Sequence[Observer] | None = None,
        law: Law | None = None,
        sensors: Sensors | None = None,
    ) -> AxisControl:
        """Make the control of an axis.

        Args:
            plant: The controller's knowledge of the plant.
            axis: The number of the plant's axis.
            observer: Instead of the scenario's, as are the next three.
            open_loop_observers: The open-loop observers.
            law: The control law.
            sensors: The sensors.

        Returns:
            The control.

        Raises:
            InputError: A rate does not fit the physics step.
        """
        settings = self.scenario.controller
        if open_loop_observers is None:
            open_loop_observers = list(self.open_loop_observers().values())
        return make_axis(
            observer or self.observer(),
            law or self.fresh_law(),
            sensors or self.scenario.sensors,
            plant,
            feedback=settings.feedback,
            angle_source=settings.angle_source,
            bias_trim_s=settings.bias_trim_s,
            notch_hz=settings.notch_hz,
            open_loop_observers=open_loop_observers,
            axis=axis,
        )

    def controller(self, plant: KnownPlant, world_ids: int | Sequence[int] = 0, **options: Any) -> Controller:
        """Make a fresh controller of this axis alone: the number of one world, or the numbers of many.

        Options are those of `axis_control`.
        """
        return Controller([self.axis_control(plant, **options)], seed=self.scenario.seed, world_ids=world_ids)


def design(scenario: Scenario, rig: PlantNumbers) -> Design:
    """Check what pydantic could not, and construct the law and the observers.

    Args:
        scenario: The scenario of one axis.
        rig: The parameters of the plant along that axis.

    Returns:
        The design.

    Raises:
        InputError: Something in the scenario does not fit.
    """
    _check(scenario)
    controller = scenario.controller
    result = Design(scenario, rig, controller.law(rig.reduced, rig.noise(scenario.sensors)))
    result.open_loop_observers()
    notches(controller.notch_hz, result.law)
    trims(controller.bias_trim_s, result.law, extra_signals(result.observer()), rig.timestep)
    return result


def _check(scenario: Scenario) -> None:
    """Refuse observers and a law that do not exist, parameters that they do not take, and fields without a use."""
    names = [("open_loop_observers", name) for name in scenario.open_loop_names()]
    names += [("compare.observers", name) for name in (scenario.compare.names() if scenario.compare else ())]
    for field, name in names:
        try:
            OBSERVER_CLASSES.find(name)
        except InputError as error:
            raise InputError(str(error).replace("observer.kind = ", f"{field}: ", 1)) from error
    OBSERVER_CLASSES.check_types(scenario.observer.kind, scenario.observer.parameters)
    controller = scenario.controller
    kind, parameters = controller.kind, controller.parameters
    law = LAW_CLASSES.find(kind)
    LAW_CLASSES.check_types(kind, parameters)
    for name in ("gains", "lqr"):
        if getattr(controller, name) is not None and not LAW_CLASSES.may_take(kind, "gains"):
            raise InputError(f"controller.{name}: {kind} takes no gains; leave it out")
    for name in ("feedback", "angle_source"):
        value, usual = getattr(controller, name), ControllerSettings.model_fields[name].default
        if value != usual and law_needs(law) != LAW_NEEDS:
            raise InputError(
                f"controller.{name} = {value!r}: {kind} takes nothing of the observer and has no use "
                f"for this; leave it out, or set controller.{name}={usual}"
            )


class PlantNumbers(NamedTuple):
    """The parameters that a scenario's controller and observers are made from.

    Attributes:
        path: The model's file.
        modules: Names of the plant's modules.
        reduced: The reduced model.
        tilt: The tilt estimate for the plant's accelerometers.
        gravity: Gravitational acceleration [m/s^2].
        timestep: The physics step [s].
        largest_step: The largest physics step that is accurate enough [s].
        hints: Clauses on what the reduced model does not know of the plant.
    """

    path: Path
    modules: tuple[str, ...]
    reduced: ReducedModel
    tilt: PairTilt
    gravity: float
    timestep: float
    largest_step: float
    hints: tuple[str, ...]

    def noise(self, sensors: Sensors) -> MeasurementNoise:
        """Return the noise of tilt, angular acceleration, y2 and the cheap gyro.

        The gimbals of an axis mirror each other about upright, so their encoders round alike and y2 has the noise of
        one. Only while the plant turns about the vertical do the gimbals differ, and their mean has less.
        """
        noise = self.tilt.noise(sensors.accelerometer.sample_sigma, self.gravity)
        gyro = sensors.mems_gyro
        return replace(
            noise,
            gimbal=sensors.encoder.sample_sigma,
            gyro=math.radians(gyro.noise_density_deg_s_rthz),
            gyro_walk=gyro.flicker_floor,
        )


class AxisOptions(TypedDict, total=False):
    """Keyword arguments of `make_axis`: a user's choice, and settings of the stages."""

    feedback: Feedback
    angle_source: AngleSource
    open_loop_observers: Sequence[Observer]
    """Observers that run open loop."""
    axis: int
    """The number of the rig's axis, on which the noise depends."""
    bias_trim_s: float
    """For so long from the start, the integrator is held where the observer's bias estimate asks for it [s]."""
    notch_hz: float
    """The middle of a notch on the law's command; 0: none [Hz]."""


def make_axis(
    observer: Observer, law: Law, sensors: Sensors, plant: KnownPlant, **options: Unpack[AxisOptions]
) -> AxisControl:
    """Make the control of one axis.

    Args:
        observer: The observer in the loop.
        law: The control law; its `dt` is the control period.
        sensors: The sensors between the ideal readings and the controller.
        plant: The controller's knowledge of the plant.
        **options: See `AxisOptions`.

    Returns:
        The control.

    Raises:
        InputError: A rate does not fit the physics step, or an option does not fit the observer or the law.
    """
    for name in options:
        if name not in AxisOptions.__annotations__:
            raise InputError(f"{name}: no such option; {nearest(name, AxisOptions.__annotations__)}")
    observers = observer, *options.get("open_loop_observers", ())
    number = options.get("axis", 0)
    gyro_period_s = law.dt if reads_gyro(*observers) else None
    return AxisControl(
        observers,
        law,
        sensors,
        plant,
        at_work=sensors.at_work(plant.timestep, number, gyro_period_s),
        period=whole_steps(law.dt, plant.timestep, "controller.rate_hz", f"{1.0 / law.dt:g} Hz"),
        commands=tuple(notches(options.get("notch_hz", 0.0), law)),
        servos=backlash(plant.backlash, law.dt),
        memories=tuple(trims(options.get("bias_trim_s", 0.0), law, extra_signals(observer), plant.timestep)),
        feedback=options.get("feedback", "observer"),
        angle_source=options.get("angle_source", "measured"),
        number=number,
    )

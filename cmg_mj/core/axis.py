"""The controller of one axis as a value: sensors -> tilt -> observer -> law -> gimbal rate.

Its functions are pure and elementwise over worlds. All memory is in their arguments.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple, Protocol

from cmg_mj.core.arrays import Scalar, clip, where
from cmg_mj.core.errors import InputError, RunStopped
from cmg_mj.core.failures import check_estimate, check_shape, is_trusted, stop, stop_not_finite
from cmg_mj.core.sensor import Memory, Sensor, SensorState
from cmg_mj.core.straight_line import Tables
from cmg_mj.core.tilt import GimbalAngle, PairTilt
from cmg_mj.core.types import (
    STATE_NAMES,
    FeedbackState,
    Forces,
    IdealReading,
    Law,
    Measurement,
    Observer,
    State,
    as_estimate,
    extra_signals,
    feedback_state,
    reads_gyro,
)

Feedback = Literal["observer", "fog", "truth"]
AngleSource = Literal["measured", "estimated"]

_new = tuple.__new__  # a named tuple's own takes twice as long


class Tick(NamedTuple):
    """All that one control period measured and decided (floats, or arrays (n_worlds,))."""

    y1: Scalar
    y2: Scalar
    acceleration: Scalar
    fog: Scalar
    u: Scalar
    x_e: Scalar
    estimates: Sequence[Sequence[Scalar]]
    """The observer's estimate (x1, x2, x3, its extra signals), then those of the open-loop observers."""
    gyro: Scalar = math.nan
    """Reading of the cheap gyro, if an observer needs it [rad/s]."""


class CommandStage(Protocol):
    """An effect on the gimbal rate [rad/s]: on the law's command, which observers are told, or behind it in the servo.

    The law's limit lies before it: a stage on the command keeps to that limit itself.
    """

    def init(self, u: Scalar) -> Memory:
        """Return the memory before the first command, given a command of zero."""
        ...

    def step(self, memory: Memory, u: Scalar) -> tuple[Memory, Scalar]:
        """Advance by a control tick: return the next memory, and the rate with the effect."""
        ...


class MemoryStage(Protocol):
    """An effect on the law's memory before its step; it has no memory of its own."""

    @property
    def until(self) -> int:
        """The physics step from which on it does nothing."""
        ...

    def __call__(self, step: int, estimate: Sequence[Scalar], memory: State) -> State:
        """Return the law's memory: physics step, the estimate in the loop, memory."""
        ...


class KnownPlant(NamedTuple):
    """The plant's properties that its controller knows."""

    tilt: PairTilt
    """The tilt from its accelerometers."""
    gimbal_angle: GimbalAngle
    """y2 from its encoders: directions and zeros of the gimbals."""
    timestep: float
    """Physics step [s]."""
    backlash: Scalar = 0.0
    """Gap between the servos' motors and the gimbals, a float or an array (n_worlds,) [rad]."""


class Known(NamedTuple):
    """Knowledge of an axis' next measurement, from a stage between the axes."""

    tilt: Scalar = 0.0
    """Tilt by which the accelerometers err in a planned motion [rad]."""
    acceleration: Scalar = 0.0
    """Part of the measured angular acceleration that is none of the tilt's: Coriolis' [rad/s^2]."""
    bias: Scalar = 0.0
    """Equilibrium bias, added to the tilt that is fed back [rad]."""
    contact: Scalar | None = None
    """Angular acceleration by contacts, held until the next tick [rad/s^2]."""


class Delivered(NamedTuple):
    """The samples that have been delivered by a control tick."""

    forces: Forces
    """Specific force: inner x, inner z, outer x, outer z [m/s^2]."""
    encoders: Sequence[Scalar]
    """Gimbal angles, one a gimbal [rad]."""
    fog: Scalar
    """The fibre-optic gyro's rate [rad/s]."""
    gyro: Scalar = math.nan
    """The cheap gyro's rate, where an observer needs it [rad/s]."""


class Deciding(NamedTuple):
    """The memory of an axis' decisions."""

    observers: tuple[State, ...]
    law: State
    held: Scalar
    """Command since the last tick, as observers are told [rad/s]."""
    commands: tuple[Memory, ...]
    servos: tuple[Memory, ...]
    known: Known | None = None


Sampled = tuple[SensorState, ...]
"""The memory of an axis' sensors."""


@dataclass(frozen=True)
class AxisControl:
    """The controller of one axis. It does not know MuJoCo.

    Attributes:
        observers: The observer whose estimate the law uses, then those that run open loop.
        law: The control law; its `dt` is the control period, and what it decides is limited to its `rate_limit`.
        sensors: Settings of the sensors between the ideal readings and the controller.
        plant: The controller's knowledge of the plant.
        at_work: The sensors: accelerometers, encoders, fibre-optic gyro, and a cheap gyro if an observer needs it.
        period: Physics steps between two control ticks.
        commands: The stages on the law's command.
        servos: The stages between the command and the gimbals' rate.
        memories: The stages on the law's memory.
        feedback: Which rate the law uses: the observer's, the gyro's or the true one.
        angle_source: Whether the law uses y1, y2 as (8) says or the estimates, as the text after (10) says.
        number: The number of the rig's axis, on which the noise depends.
    """

    observers: tuple[Observer, ...]
    law: Law
    sensors: Any
    plant: KnownPlant
    at_work: tuple[Sensor, ...]
    period: int
    commands: tuple[CommandStage, ...] = ()
    servos: tuple[CommandStage, ...] = ()
    memories: tuple[MemoryStage, ...] = ()
    feedback: Feedback = "observer"
    angle_source: AngleSource = "measured"
    number: int = 0

    @property
    def observer(self) -> Observer:
        """The observer in the loop."""
        return self.observers[0]

    @property
    def timestep(self) -> float:
        """Physics step [s]."""
        return self.plant.timestep

    @cached_property
    def reads_gyro(self) -> bool:
        """True if an observer needs the cheap gyro."""
        return reads_gyro(*(getattr(observer, "stands_for", observer) for observer in self.observers))

    @cached_property
    def extra_signals(self) -> list[tuple[str, ...]]:
        """Names of what each observer estimates beyond x."""
        return [extra_signals(getattr(observer, "stands_for", observer)) for observer in self.observers]

    @cached_property
    def is_trusted(self) -> bool:
        """True if observers and law are the package's own, whose numbers have the same shapes at every tick."""
        return all(map(is_trusted, (*self.observers, self.law)))

    @property
    def settled(self) -> int:
        """The physics step from which on no stage hangs on the step's number."""
        return max((stage.until for stage in self.memories), default=0)

    def init(self, ideal: IdealReading, tables: Tables) -> Sampled:
        """Start the sensors at a reading of perfect ones; before, the rig stood still."""
        return tuple(sensor.init(ideal, tables) for sensor in self.at_work)

    def sample(self, sampled: Sampled, step: int, ideal: IdealReading, tables: Tables) -> Sampled:
        """Take the samples that are due at a physics step."""
        pairs = zip(self.at_work, sampled, strict=True)
        return tuple([sensor.sample(state, step, ideal, tables) for sensor, state in pairs])

    def delivered(self, sampled: Sampled, step: int) -> Delivered:
        """Return the samples that have been delivered by a physics step."""
        pairs = zip(self.at_work, sampled, strict=True)
        forces, encoders, (fog,), *gyro = [sensor.read(state, step) for sensor, state in pairs]
        return _new(Delivered, (forces, encoders, fog, gyro[0][0] if gyro else math.nan))

    def measure(self, delivered: Delivered, known: Known | None = None) -> Measurement:
        """Compute what the observers are given from what the sensors show."""
        forces = delivered.forces
        y1, y2 = self.plant.tilt(*forces), self.plant.gimbal_angle(delivered.encoders)
        acceleration = self.plant.tilt.acceleration(*forces)
        if known is not None:
            y1 = y1 - known.tilt
            acceleration = acceleration - known.acceleration
        y = _new(Measurement, (y1, y2))
        y.acceleration = acceleration
        if self.reads_gyro:
            y.gyro = delivered.gyro
        if known is not None and known.contact is not None:
            y.contact = known.contact
        return y

    def decide(self, deciding: Deciding | None, step: int, delivered: Delivered, rate: Scalar) -> tuple[Deciding, Tick]:
        """Take the decision of a control tick.

        Args:
            deciding: The memory; None at the first tick.
            step: Number of the physics step.
            delivered: The samples.
            rate: The true tilt rate, where that is fed back [rad/s].

        Returns:
            The next memory, and the tick.

        Raises:
            RunStopped: The observer or the law failed, or returned a number that is not finite (one world).
        """
        known = None if deciding is None else deciding.known
        return self.decide_on(deciding, step, self.measure(delivered, known), delivered.fog, rate)

    def decide_on(
        self, deciding: Deciding | None, step: int, y: Measurement, fog: Scalar, rate: Scalar
    ) -> tuple[Deciding, Tick]:
        """Take the decision of a control tick on a measurement: see `decide`."""
        if deciding is None:
            deciding = self._begun(y, step)
            zero = 0.0 * y[0]
            observers = deciding.observers
            estimates = [as_estimate((y[0], zero, y[1], *[zero] * len(names))) for names in self.extra_signals]
        else:
            observers, estimates = self._observed(deciding, y, step)
        memory = deciding.law
        for remember in self.memories:
            memory = remember(step, estimates[0], memory)
        x = self._fed_back(y, estimates[0], fog, rate, deciding.known)
        x_e = getattr(memory, "x_e", None)
        law, u = self._decided(memory, y, x, deciding.held, step)
        commands, u = passed(self.commands, deciding.commands, u)
        x_e = math.nan * y[0] if x_e is None else x_e
        tick = _new(Tick, (y[0], y[1], y.acceleration, fog, u, x_e, estimates, y.gyro))
        return _new(Deciding, (observers, law, u, commands, deciding.servos, deciding.known)), tick

    def _begun(self, y: Measurement, step: int) -> Deciding:
        """Return the memory before the first decision."""
        zero = 0.0 * y[0]
        observers = []
        for observer in self.observers:
            try:
                observers.append(observer.init(y))
            except Exception as error:
                stop(observer, "observer", step * self.timestep, error)
        try:
            law = self.law.init(y)
        except Exception as error:
            stop(self.law, "law", step * self.timestep, error)
        commands, servos = (tuple(stage.init(zero) for stage in stages) for stages in (self.commands, self.servos))
        return Deciding(tuple(observers), law, zero, commands, servos)

    def _observed(
        self, deciding: Deciding, y: Measurement, step: int
    ) -> tuple[tuple[State, ...], list[Sequence[Scalar]]]:
        """Advance the observers by a sample."""
        after, estimates = [], []
        observer = None
        held = deciding.held
        try:
            for observer, state in zip(self.observers, deciding.observers, strict=True):
                state, estimate = observer.step(state, y, held)
                after.append(state)
                estimates.append(estimate)
                if not self.is_trusted:
                    check_estimate(estimate, self._names(len(after) - 1), y)
        except Exception as error:
            stop(observer, "observer", step * self.timestep, error)
        # Many worlds are judged one by one, elsewhere. Neither NaN nor a masked number is below infinity.
        if type(y[0]) is float and not abs(sum(estimates[0])) < math.inf:
            stop_not_finite(self.observers[0], estimates[0], self._names(0), step * self.timestep)
        return tuple(after), estimates

    def _names(self, observer: int) -> tuple[str, ...]:
        return *STATE_NAMES, *self.extra_signals[observer]

    def _fed_back(
        self, y: Measurement, estimate: Sequence[Scalar], fog: Scalar, rate: Scalar, known: Known | None
    ) -> FeedbackState:
        x1, x2, x3 = estimate[:3]
        if self.angle_source == "measured":
            x1, x3 = y
        if known is not None:
            x1 = x1 + known.bias
        if self.feedback != "observer":
            x2 = fog if self.feedback == "fog" else rate
        return feedback_state(x1, x2, x3, estimate[3:])

    def _decided(
        self, memory: State, y: Measurement, x: FeedbackState, held: Scalar, step: int
    ) -> tuple[State, Scalar]:
        """Return the law's next memory and its command, within the limit."""
        try:
            after, command = self.law.step(memory, y, x, held)
            if not self.is_trusted:
                check_shape("u", command, y)
                check_shape("x_e", getattr(memory, "x_e", y[0]), y)
        except Exception as error:
            stop(self.law, "law", step * self.timestep, error)
        limit = self.law.rate_limit
        if type(y[0]) is float:
            if not math.isfinite(command):
                name = type(self.law).__name__
                raise RunStopped(f"law {name} returned {command} for u at t = {step * self.timestep:g} s")
            return after, clip(float(command), -limit, limit)
        return after, where(abs(command) < math.inf, clip(command, -limit, limit), command)  # judged elsewhere

    def drive(self, deciding: Deciding, u: Scalar) -> tuple[Deciding, Scalar]:
        """Turn the gimbals at a rate from now on: return the next memory, and the rate behind the servo's stages."""
        if not self.servos:
            return deciding, u
        servos, rate = passed(self.servos, deciding.servos, u)
        return deciding._replace(servos=servos), rate


def passed(stages: Sequence[CommandStage], memories: Sequence[Memory], u: Scalar) -> tuple[tuple[Memory, ...], Scalar]:
    """Pass a command through its stages."""
    if not stages:
        return (), u
    after = []
    for stage, memory in zip(stages, memories, strict=True):
        memory, u = stage.step(memory, u)
        after.append(memory)
    return tuple(after), u


def require_one_period(axes: Sequence[AxisControl]) -> None:
    """Refuse axes whose control periods differ.

    Raises:
        InputError: They do.
    """
    if any(axis.period != axes[0].period for axis in axes):
        raise InputError("controller.rate_hz: must be the same on all axes")

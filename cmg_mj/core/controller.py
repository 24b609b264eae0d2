"""The controller: sensors -> tilt -> observer -> law -> gimbal rate."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, NamedTuple

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.runners import LawRunner, ObserverRunner
from cmg_mj.core.sensor import whole_steps
from cmg_mj.core.tilt import GimbalAngle, PairTilt
from cmg_mj.core.types import (
    Forces,
    IdealReading,
    Law,
    Measurement,
    Observer,
    Setpoints,
    State,
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


CommandStage = Callable[[Scalar], Scalar]
"""An effect on the gimbal rate [rad/s]: on the law's command, which observers are told, or behind it in the servo.

It is called once a control tick. The law's limit lies before it: a stage on the command keeps to that limit itself.
"""

MemoryStage = Callable[[int, Sequence[Scalar], State], State]
"""An effect on the law's memory before its step: (physics step, the estimate in the loop, memory) -> memory.

It outlives a reset, and so has no memory of its own.
"""


class KnownPlant(NamedTuple):
    """The plant's properties that its controller knows."""

    tilt: PairTilt
    """The tilt from its accelerometers."""
    gimbal_angle: GimbalAngle
    """y2 from its encoders: directions and zeros of the gimbals."""
    timestep: float
    """Physics step [s]."""
    servos: Sequence[Callable[[float], CommandStage]] = ()
    """Make the stages between the commanded rate and the gimbals' own, from the control period [s]."""


class Controller:
    """Runs the sensors, the observer and the law, tick after tick.

    It does not know MuJoCo. `sample` takes the number of the physics step and the ideal readings there. `control`
    decides at a tick. `update` does both.

    Args:
        observer: The observer whose estimate the law uses.
        law: The control law; its `dt` is the control period, and what it decides is limited to its `rate_limit`.
        sensors: The sensors between the ideal readings and the controller, such as `Sensors`.
        plant: The controller's knowledge of the plant.
        seed: Seed of the sensors' noise.
        world_ids: The number of one world, on floats, or the numbers of many, on arrays.
        feedback: Which rate the law uses: the observer's, the gyro's or the true one.
        angle_source: Whether the law uses y1, y2 as (8) says or the estimates, as the text after (10) says.
        open_loop_observers: Observers that run open loop, by name.
        axis: The number of the rig's axis, on which the noise depends.
        commands: Make the stages on the law's command.
        memories: The stages on the law's memory.

    Attributes:
        extra_signals: Names of what the observer, then each open-loop observer, estimates beyond x.
        command_stages: The stages on the law's command.
        servo_stages: The stages behind the command.

    Raises:
        InputError: A rate does not fit the physics step.
    """

    def __init__(
        self,
        observer: Observer,
        law: Law,
        sensors: Any,
        plant: KnownPlant,
        *,
        seed: int = 0,
        world_ids: int | Sequence[int] = 0,
        feedback: Feedback = "observer",
        angle_source: AngleSource = "measured",
        open_loop_observers: Mapping[str, Observer] | None = None,
        axis: int = 0,
        commands: Sequence[Callable[[], CommandStage]] = (),
        memories: Sequence[MemoryStage] = (),
    ) -> None:
        self.observer = observer
        self.law = law
        self.sensors = sensors
        self.plant = plant
        self.tilt, self.gimbal_angle, self.timestep, self.servos = plant
        self.commands, self.memories = commands, memories
        self.seed = seed
        self.world_ids = world_ids
        self.axis = axis
        self.turns_gimbals = True
        """True if `update` turns the gimbals; with several axes a stage on all of them may come between."""
        self.feedback: Feedback = feedback
        self.angle_source: AngleSource = angle_source
        self.open_loop_observers = dict(open_loop_observers or {})
        self._single = isinstance(world_ids, int)
        self.period = whole_steps(law.dt, self.timestep, "controller.rate_hz", f"{1.0 / law.dt:g} Hz")
        observers = [observer, *self.open_loop_observers.values()]
        self.reads_gyro = reads_gyro(*observers)
        """True if an observer needs the cheap gyro."""
        self._observers = ObserverRunner(observers, self._single)
        self.extra_signals = self._observers.extra_signals
        self._law = LawRunner(law, self._single)
        self.reset()

    setpoints: Setpoints | None = None
    """Of several axes, what a stage between them moves beside the gimbals."""

    @property
    def axes(self) -> Sequence[Controller]:
        """Controllers of the axes; for one axis, the controller itself."""
        return (self,)

    def reset(self) -> None:
        """Forget everything: the next update is the first tick of a run with the same seed."""
        gyro = {"gyro_period_s": self.law.dt} if self.reads_gyro else {}
        self._sampled = self.sensors.at_work(self.timestep, self.seed, self.world_ids, self.axis, **gyro)
        self.tick: Tick | None = None
        self.gimbal_rate: Scalar = None
        """The rate at which the gimbals are turned since the last tick: its u, behind the servo's stages [rad/s]."""
        self.command_stages = [make() for make in self.commands]
        self.servo_stages = [make(self.law.dt) for make in self.servos]
        self._true_rate: Scalar = math.nan
        self.body_rate: Scalar = math.nan
        """Rate of the frame along the tilt axis at the last update, as a perfect gyro on it shows [rad/s]."""
        self.coriolis: Scalar | None = None
        """Coriolis part of the measured angular acceleration, which the stage between axes sets [rad/s^2]."""
        self.known_tilt: Scalar | None = None
        """Tilt by which accelerometers err in a planned motion, which a stage between axes sets [rad]."""
        self.bias: Scalar | None = None
        """Equilibrium bias, added to the tilt that is fed back, which a stage between axes sets [rad]."""
        self.contact: Scalar | None = None
        """Angular acceleration by contacts, held until the next tick, which a stage between axes sets [rad/s^2]."""
        self.step: int | None = None
        """The physics step of the last update."""
        self.steps_per_sample = math.gcd(self.period, *(sensor.steps_per_sample for sensor in self._sampled))
        """Physics steps between the instants at which anything may be due."""

    def update(self, step: int, ideal: IdealReading) -> bool:
        """Take the samples and the control decision that are due at a physics step.

        Args:
            step: Number of the physics step, a multiple of `steps_per_sample`.
            ideal: The ideal readings at that step.

        Returns:
            Whether a control tick was due; `tick` then is its record.

        Raises:
            RunStopped: An observer returned a number that is not finite.
        """
        self.sample(step, ideal)
        if step % self.period:
            return False
        self.control(step)
        return True

    def sample(self, step: int, ideal: IdealReading) -> None:
        """Take the samples that are due at a physics step: see `update`."""
        self.step, self._true_rate, self.body_rate = step, ideal.rate, ideal.gyro
        for sensor in self._sampled:
            sensor.sample(step, ideal)

    def readings(self, step: int) -> tuple[Forces, Sequence[Scalar], Scalar]:
        """Return the samples that have been delivered by a physics step, as `decide` takes them."""
        accelerometers, encoders, fog = self._sampled[:3]
        return accelerometers.read(step), encoders.read(step), fog.read(step)

    def read_gyro(self, step: int) -> Scalar:
        """Return the cheap gyro's reading at a physics step [rad/s]; NaN if no observer needs it."""
        return self._sampled[3].read(step) if self.reads_gyro else math.nan

    def control(self, step: int) -> None:
        """Take the control decision of a tick, a multiple of `period`: see `update`."""
        u = self.decide(step, *self.readings(step), self._true_rate, self.read_gyro(step)).u
        if self.turns_gimbals:
            self.command_rate(u)

    def command_rate(self, u: Scalar) -> None:
        """Turn the gimbals at a rate from now on [rad/s]."""
        for stage in self.servo_stages:
            u = stage(u)
        self.gimbal_rate = u

    def decide(
        self,
        step: int,
        forces: Forces,
        encoders: Sequence[Scalar],
        fog: Scalar,
        rate: Scalar,
        gyro: Scalar = math.nan,
    ) -> Tick:
        """Take the control decision of a tick from the samples that have been delivered.

        Args:
            step: Number of the physics step.
            forces: Specific force: inner x, inner z, outer x, outer z [m/s^2].
            encoders: Gimbal angles, one a gimbal [rad].
            fog: The gyro's rate [rad/s].
            rate: The true one, where that is fed back [rad/s].
            gyro: Reading of the cheap gyro, where an observer needs it [rad/s].

        Returns:
            The tick, which counts as the last one from now on.

        Raises:
            RunStopped: The observer or the law failed, or returned a number that is not finite.
        """
        y1, y2 = self.tilt(*forces), self.gimbal_angle(encoders)
        acceleration = self.tilt.acceleration(*forces)
        if self.known_tilt is not None:
            y1 = y1 - self.known_tilt
        if self.coriolis is not None:
            acceleration = acceleration - self.coriolis
        y = _new(Measurement, (y1, y2))
        y.acceleration = acceleration
        if self.reads_gyro:
            y.gyro = gyro
        if self.contact is not None:
            y.contact = self.contact
        time = step * self.timestep
        if self.tick is None:
            estimates, held = self._observers.start(y, time), 0.0 * y1
            self._law.start(y, time)
        else:
            held = self.tick.u
            estimates = self._observers.advance(y, held, time)
        estimate = estimates[0]
        for remember in self.memories:
            self._law.state = remember(step, estimate, self._law.state)
        x1, x2, x3 = (y1, estimate[1], y2) if self.angle_source == "measured" else estimate[:3]
        if self.bias is not None:
            x1 = x1 + self.bias
        if self.feedback != "observer":
            x2 = fog if self.feedback == "fog" else rate
        u, x_e = self._law.decide(y, feedback_state(x1, x2, x3, estimate[3:]), held, time)
        for stage in self.command_stages:
            u = stage(u)
        self.tick = _new(Tick, (y1, y2, acceleration, fog, u, x_e, estimates, gyro))
        return self.tick

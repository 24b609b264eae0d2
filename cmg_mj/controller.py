"""The controller: sensors -> tilt -> observer -> law -> gimbal rate."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple, NoReturn, Protocol

import numpy as np

from cmg_mj.elementwise import Scalar, dot
from cmg_mj.errors import InputError, RunStopped, raised
from cmg_mj.ideal import Ideal
from cmg_mj.law import Law
from cmg_mj.observers.protocol import BIAS, Estimate, Measurement, Observer, extra_signals
from cmg_mj.sensors import Sensors, at_work
from cmg_mj.tilt import RadialTilt
from cmg_mj.timing import steps_until, whole_steps

Feedback = Literal["observer", "fog", "truth"]
Angles = Literal["measured", "estimated"]


CONTROLLER_OPTIONS = frozenset({"seed", "worlds", "feedback", "angles", "companions", "trim_s", "processor"})
"""Keyword arguments of `Controller` that are a user's choice; the rest is the rig's."""


def trim_of(trim_s: float, law: Law, extra_signals: Sequence[str]) -> tuple[int, float]:
    """How the integrator is trimmed by the observer's estimate of the bias.

    Args:
        trim_s: For how long [s]; 0 for not at all.
        law: The law, whose integrator settles at k_e1/k_e4 e.
        extra_signals: What the observer estimates beyond x.

    Returns:
        Which part of the estimate is the bias, and the gain on it.

    Raises:
        InputError: It cannot be trimmed.
    """
    if not (isinstance(trim_s, (int, float)) and trim_s >= 0.0):
        raise InputError(f"controller.trim_s = {trim_s!r}: must be a number greater than or equal to 0")
    if not trim_s:
        return 0, 0.0
    k1, _, _, k4 = law.gains
    if BIAS not in extra_signals:
        raise InputError(
            f"controller.trim_s = {trim_s:g}: needs an observer in the loop that estimates the bias, "
            "such as adaptive; or set controller.trim_s=0"
        )
    if k4 == 0.0:
        raise InputError(f"controller.trim_s = {trim_s:g}: the gain on the integrator is zero")
    return 3 + list(extra_signals).index(BIAS), k1 / k4


class Tick(NamedTuple):
    """All that one control period measured and decided (floats, or arrays (n_worlds,))."""

    y1: Scalar
    y2: Scalar
    acceleration: Scalar
    fog: Scalar
    u: Scalar
    x_e: Scalar
    estimates: Sequence[Sequence[Scalar]]
    """The observer's estimate (x1, x2, x3, its extra signals), then those of the companions."""


class Decision(NamedTuple):
    """What a processor has decided."""

    u: float
    """Gimbal rate [rad/s]."""
    x_e: float
    """The integrator before it [rad s], which went into it unless it is being trimmed."""
    estimate: Sequence[float]
    """The observer's: x1, x2, x3, its extra signals."""


class Processor(Protocol):
    """What takes the control decision in the controller's place, such as a board that runs all of it in C."""

    def start(self) -> None:
        """The next update is the first."""

    def update(self, accelerations: Sequence[float], encoders: Sequence[float]) -> Decision:
        """One control period, from what the sensors show.

        Args:
            accelerations: Inner x, z, outer x, z [m/s^2].
            encoders: The gimbals' angles [rad].

        Returns:
            The decision.

        Raises:
            RunStopped: There is none.
        """
        ...


def read_only(*arrays: np.ndarray) -> None:
    """What is handed to several observers must not be changed by one of them: `d = y.y1; d -= 0.02` raises."""
    for array in arrays:
        array.flags.writeable = False


def _estimate(parts: Sequence[Scalar]) -> Sequence[Scalar]:
    """An estimate of x alone has its parts' names."""
    return Estimate(*parts) if len(parts) == 3 else tuple(parts)


def _extra_signals(observer: Observer) -> tuple[str, ...]:
    """What an observer estimates beyond x; what is wrong with its names is the user's affair."""
    try:
        return extra_signals(observer)
    except ValueError as error:
        raise InputError(f"observer {type(observer).__name__}: {error}") from error


@dataclass(frozen=True)
class GimbalAngle:
    """y2 from the encoders: of a scissored pair half their difference.

    Attributes:
        directions: For each gimbal +1 or -1: the sign of u that it is given.
        zeros: For each gimbal the angle at which y2 = 0 [rad].
    """

    directions: tuple[float, ...]
    zeros: tuple[float, ...]

    @cached_property
    def _shares(self) -> list[float]:
        return [direction / len(self.directions) for direction in self.directions]

    @cached_property
    def _at_zero(self) -> float:
        return dot(self._shares, self.zeros)

    def __call__(self, encoders: Sequence[Scalar]) -> Scalar:
        """y2 [rad] from the gimbals' angles, one a gimbal [rad]."""
        y2 = -self._at_zero
        for share, angle in zip(self._shares, encoders, strict=True):
            y2 = y2 + share * angle
        return y2


class _Lost:
    """A companion that raised: nothing is known any more."""

    def __init__(self, width: int) -> None:
        self.width = width

    def init(self, y: Measurement) -> None:
        return None

    def step(self, state: None, y: Measurement, u: Scalar) -> tuple[None, Any]:
        return None, _estimate((math.nan + 0.0 * y[0],) * self.width)


class _Elsewhere:
    """The observer that a processor runs: what it estimates has just been decided."""

    def __init__(self) -> None:
        self.estimate: Sequence[float] = ()

    def init(self, y: Measurement) -> None:
        return None

    def step(self, state: None, y: Measurement, u: Scalar) -> tuple[None, Any]:
        return None, _estimate(self.estimate)


class Controller:
    """Runs the sensors, the observer and the law, tick after tick.

    It does not know MuJoCo: `update` takes the number of the physics step and the ideal readings at that step.

    Args:
        observer: The observer whose estimate the law uses.
        law: The control law; its `dt` is the control period.
        tilt: The tilt estimate.
        sensors: What stands between the ideal readings and the controller.
        directions: For each gimbal +1 or -1: the sign of u that it is given.
        gimbal_zero: For each gimbal the angle at which y2 = 0 [rad].
        timestep: Physics step [s].
        seed: Seed of the sensors' noise.
        worlds: The number of one world, on floats, or the numbers of many, on arrays.
        feedback: Which rate the law uses: the observer's, the gyro's or the true one.
        angles: Whether the law uses y1, y2 as (8) says or the estimates, as the text after (10) says.
        companions: Observers that ride along open loop, by name.
        trim_s: For so long from the start, the integrator is held at the value that the observer's bias estimate asks
            for, k_e1/k_e4 e, instead of finding it by integration [s].
        processor: What runs observer and law in their place, if anything does (one world only). It gets what the
            sensors show; `observer` and `law` say here what it runs.

    Attributes:
        extra_signals: Names of what the observer, then each companion, estimates beyond x.
        trimmed_until: The physics step from which on the integrator goes free.
        trim_part: Which part of the estimate is the bias that it is trimmed with.
        trim_gain: The gain on it [s].

    Raises:
        InputError: A rate does not fit the physics step, or there is no bias estimate to trim with.
    """

    def __init__(
        self,
        observer: Observer,
        law: Law,
        tilt: RadialTilt,
        sensors: Sensors,
        *,
        directions: Sequence[float],
        gimbal_zero: Sequence[float],
        timestep: float,
        seed: int = 0,
        worlds: int | Sequence[int] = 0,
        feedback: Feedback = "observer",
        angles: Angles = "measured",
        companions: Mapping[str, Observer] | None = None,
        trim_s: float = 0.0,
        processor: Processor | None = None,
    ) -> None:
        self.observer = observer
        self.law = law
        self.tilt = tilt
        self.sensors = sensors
        self.directions = tuple(directions)
        self.gimbal_zero = tuple(gimbal_zero)
        self.timestep = timestep
        self.seed = seed
        self.worlds = worlds
        self.feedback: Feedback = feedback
        self.angles: Angles = angles
        self.companions = dict(companions or {})
        self.processor = processor
        self._single = isinstance(worlds, int)
        if processor is not None and not (self._single and feedback == "observer"):
            raise InputError("a processor runs one world, on the observer's rate: no batch, and feedback = 'observer'")
        self.period = whole_steps(law.dt, timestep, "controller.rate_hz", f"{1.0 / law.dt:g} Hz")
        self._observers: list[Observer] = []
        self.extra_signals = [_extra_signals(o) for o in (observer, *self.companions.values())]
        self._widths = [3 + len(names) for names in self.extra_signals]
        self.trim_s = trim_s
        self.trim_part, self.trim_gain = trim_of(trim_s, law, self.extra_signals[0])
        self.trimmed_until = steps_until(trim_s, timestep)
        self.gimbal_angle = GimbalAngle(self.directions, self.gimbal_zero)
        self.reset()

    def reset(self) -> None:
        """Forget everything: the next update is the first tick of a run with the same seed."""
        self._observers = [self.observer, *self.companions.values()]
        if self.processor is not None:
            self._elsewhere = _Elsewhere()
            self._observers[0] = self._elsewhere
            self.processor.start()
        self._sampled = at_work(self.sensors, self.timestep, self.seed, self.worlds)
        self._states: list[Any] | None = None
        self._x_e: Scalar = 0.0
        self.tick: Tick | None = None
        self.step: int | None = None
        """The physics step of the last update."""
        self.beat = math.gcd(self.period, *(sensor.beat for sensor in self._sampled))
        """Physics steps between the moments at which anything may be due."""

    def update(self, step: int, ideal: Ideal) -> bool:
        """Take the samples and the control decision that are due at a physics step.

        Args:
            step: Number of the physics step, a multiple of `beat`.
            ideal: The ideal readings at that step.

        Returns:
            Whether a control tick was due; `tick` then is its record.

        Raises:
            RunStopped: An observer returned a number that is not finite.
        """
        first, self.step = self.step is None, step
        for sensor in self._sampled:
            if sensor.due(step) or first:  # a start between two samples still has something to show
                sensor.sample(step, ideal)
        if step % self.period:
            return False
        accelerometers, encoders, fog = self._sampled
        self.decide(step, accelerometers.read(step), encoders.read(step), fog.read(step), ideal.rate)
        return True

    def decide(
        self, step: int, forces: Sequence[Scalar], encoders: Sequence[Scalar], fog: Scalar, rate: Scalar
    ) -> Tick:
        """What a control tick makes of the samples that have been delivered.

        Args:
            step: Number of the physics step.
            forces: Specific force: inner x, inner z, outer x, outer z [m/s^2].
            encoders: Gimbal angles, one a gimbal [rad].
            fog: The gyro's rate [rad/s].
            rate: The true one, where that is fed back [rad/s].

        Returns:
            The tick, which counts as the last one from now on.

        Raises:
            RunStopped: An observer returned a number that is not finite.
        """
        y1, y2 = self.tilt(*forces), self.gimbal_angle(encoders)
        acceleration = self.tilt.acceleration(forces[0], forces[2])
        y = Measurement(y1, y2, acceleration)
        if not self._single:
            read_only(*y, y.acceleration)  # observers share them
        decision = self._decided_elsewhere(forces, encoders, step)
        if self._states is None:
            self._states = [self._start(observer, y, step) for observer in self._observers]
            zero = 0.0 * y1
            estimates = [_estimate((y1, zero, y2, *[zero] * (width - 3))) for width in self._widths]
            self._x_e = 0.0 * y1
            if decision:
                estimates[0] = _estimate(decision.estimate)
        else:
            assert self.tick is not None
            estimates = self._observe(y, self.tick.u, step)
        x1, x2, x3 = estimates[0][:3]
        if self.angles == "measured":
            x1, x3 = y1, y2
        if self.feedback != "observer":
            x2 = fog if self.feedback == "fog" else rate
        x_e = decision.x_e if decision else self._x_e
        if step < self.trimmed_until:
            x_e = self.trim_gain * estimates[0][self.trim_part]
        u: Scalar
        if decision:
            u = decision.u
        else:
            u, self._x_e = self.law(x1, x2, x3, x_e)
        if not self._single:
            read_only(u)  # observers get it at the next tick, the trajectory later
        self.tick = Tick(y1, y2, acceleration, fog, u, x_e, estimates)
        return self.tick

    def _decided_elsewhere(self, forces: Sequence[float], encoders: Sequence[float], step: int) -> Decision | None:
        """What the processor makes of what the sensors show; nothing if there is none."""
        if self.processor is None:
            return None
        try:
            decision = self.processor.update(forces, encoders)
        except RunStopped as error:
            raise RunStopped(f"{error}, at t = {step * self.timestep:g} s") from error
        self._elsewhere.estimate = decision.estimate
        return decision

    def _start(self, observer: Observer, y: Measurement, step: int) -> Any:
        """An observer's first state."""
        try:
            return observer.init(y)
        except (Exception, SystemExit) as error:  # a user's observer may fail in any way
            self._blame(observer, f"raised {raised(error)}", step, error)

    def _fits(self, estimate: Sequence[Scalar], width: int, y: Measurement) -> bool:
        """Whether an estimate has all its parts, floats (one world) or arrays (n_worlds,)."""
        if self._single:
            return list(map(type, estimate)) == [float] * width
        shape = y[0].shape
        return len(estimate) == width and all(
            getattr(part, "shape", None) == shape and part.dtype == float for part in estimate
        )

    def _fitted(self, estimate: Sequence[Scalar], width: int, y: Measurement) -> Sequence[Scalar]:
        """Make a user's estimate, which may be NumPy's numbers or the same for all worlds, consist of these."""
        if len(estimate) < width:
            raise ValueError(f"the estimate has {len(estimate)} parts, not {width}: x1, x2, x3 and the extra signals")
        parts = [np.asarray(part) for part in estimate[:width]]
        for part in parts:
            if part.dtype.kind not in "fiub":
                raise TypeError(f"the estimate has a part of type {part.dtype}, not real numbers")
        if self._single:
            return _estimate([float(part) for part in parts])
        return _estimate([np.broadcast_to(part.astype(float), y[0].shape) for part in parts])

    def _observe(self, y: Measurement, u: Scalar, step: int) -> list[Sequence[Scalar]]:
        """Advance every observer by one sample."""
        states = self._states
        estimates: list[Sequence[Scalar]] = []
        assert states is not None
        for i, observer in enumerate(self._observers):
            try:
                states[i], estimate = observer.step(states[i], y, u)
                if not self._fits(estimate, self._widths[i], y):
                    estimate = self._fitted(estimate, self._widths[i], y)
                elif not self._single:  # the record keeps a copy: an observer may go on changing its arrays in place
                    estimate = _estimate([part.copy() for part in estimate])
            except (Exception, SystemExit) as error:  # a user's observer may fail in any way
                if i == 0:
                    self._blame(observer, f"raised {raised(error)}", step, error)
                # One that only rides along must not end the run: it is NaN from here on.
                self._observers[i] = _Lost(self._widths[i])
                states[i], estimate = self._observers[i].step(None, y, u)
            estimates.append(estimate)
        # Many worlds are judged one by one, elsewhere. NaN and infinity alike are not zero times themselves.
        if self._single and 0.0 * sum(estimates[0]) != 0.0:
            named = zip(("x1", "x2", "x3", *self.extra_signals[0]), estimates[0], strict=True)
            name, value = next((n, v) for n, v in named if not math.isfinite(v))
            self._blame(self.observer, f"returned {value} for {name}", step)
        return estimates

    def _blame(self, observer: Observer, what: str, step: int, cause: BaseException | None = None) -> NoReturn:
        raise RunStopped(f"observer {type(observer).__name__} {what} at t = {step * self.timestep:g} s") from cause

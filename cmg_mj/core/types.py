"""Perfect readings, measurements, estimates; the protocols of an observer and a law: frozen values, elementwise."""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple, Protocol

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.errors import InputError, nearest


class _Angles(NamedTuple):
    y1: Scalar
    """Tilt q_b + pi/4 from the accelerometers [rad]."""
    y2: Scalar
    """Gimbal angle q_c - pi/2, half the difference of the two encoders [rad]."""


_new = tuple.__new__


class Measurement(_Angles):
    """y of aranovskiy2020 (5), two angles: floats for one world, arrays (n_worlds,) for many.

    Beside them, `acceleration` is what the same two accelerometers say of the tilt's angular acceleration [rad/s^2],
    and `gyro` the reading of a cheap gyro [rad/s]. Both are no part of the papers' y, so that `y1, y2 = y` takes the
    angles alone. NaN where they are not measured.
    """

    acceleration: Scalar = math.nan
    gyro: Scalar = math.nan
    contact: Scalar | None = None
    """Angular acceleration that contacts add to f2 of the reduced model, held since the sample before [rad/s^2]."""

    def __new__(
        cls, y1: Scalar, y2: Scalar, acceleration: Scalar = math.nan, gyro: Scalar | None = None
    ) -> Measurement:
        """Make a measurement of the angles [rad]; angular acceleration [rad/s^2] and rate [rad/s] if measured."""
        y = _new(cls, (y1, y2))
        y.acceleration = acceleration
        if gyro is not None:
            y.gyro = gyro
        return y


STATE_NAMES = ("x1", "x2", "x3")


class Estimate(NamedTuple):
    """An observer's estimate of x at the sample it was given."""

    x1: Scalar
    """Tilt as y1 measures it, less its noise: from y1 = 0, not from the true equilibrium [rad]."""
    x2: Scalar
    """Tilt rate [rad/s]."""
    x3: Scalar
    """Gimbal angle [rad]."""


State = Any
"""An observer's or a law's memory between two samples: whatever its author has chosen."""


class Observer(Protocol):
    """A velocity observer in discrete time.

    The estimate at sample k uses y_k (a filter, not a one-step predictor) and the input u held since sample
    k-1. All memory is in the state, so that one observer value serves any number of runs and worlds.

    An observer that estimates more than x names it in an attribute `extra_signals`, a tuple of names that end in
    their unit, such as ("bias_rad",), and appends the values to its estimate in that order. `BIAS` among them is what
    the summary judges and the controller can trim its integrator with.

    Its constructor is given `dt`, `model` and `noise` (`MeasurementNoise`, of the sensors' datasheet), those of them
    that it takes. An attribute `needs` says what it cannot do without (`NEEDS`).
    """

    def init(self, y: Measurement) -> State:
        """Return the state at the first sample. The estimate of that sample is (y1, 0, y2), extra signals are 0."""
        ...

    def step(self, state: State, y: Measurement, u: Scalar) -> tuple[State, Estimate]:
        """Advance by one sample period.

        Args:
            state: The state at sample k-1.
            y: The measurement at sample k.
            u: The gimbal rate commanded at sample k-1 and held since [rad/s].

        Returns:
            The state and the estimate at sample k: (x1, x2, x3), and the extra signals if there are any.
        """
        ...


NEEDS = ("model", "gimbals", "acceleration", "gyro")
"""Inputs that an observer may need beside y1: the reduced model, y2 and u, the angular acceleration, a cheap gyro."""

BIAS = "bias_rad"
"""The extra signal of an observer that estimates e, the equilibrium bias [rad]."""
TORQUE = "torque_n_m"
"""The extra signal of an observer that estimates a tilting torque on the whole rig [N m]."""


def as_estimate(parts: Sequence[Scalar]) -> Sequence[Scalar]:
    """Give an estimate of x alone its parts' names; a longer one is a plain tuple."""
    return Estimate(*parts) if len(parts) == len(STATE_NAMES) else tuple(parts)


@cache
def estimate_class(extra: tuple[str, ...]) -> Any:
    """Make the named tuple of x1, x2, x3 and extra signals."""
    made: Any = namedtuple("Estimate", (*STATE_NAMES, *extra))
    made.__reduce__ = lambda self: (_estimate, (extra, *self))  # pickle finds no class that is made while it runs
    return made


def _estimate(extra: tuple[str, ...], *parts: Scalar) -> Any:
    return estimate_class(extra)(*parts)


STATE_SIGNALS = ("x1_rad", "x2_rad_s", "x3_rad")
"""The state's signals, which every observer estimates; those that it estimates beyond x come after them."""


def needs(observer: Observer | type) -> tuple[str, ...]:
    """Return the `NEEDS` of an observer, or of its class: its required inputs beside y1.

    One that does not say counts as needing the model and the gimbals, as the papers' observers do.

    Raises:
        InputError: A name is none of `NEEDS`.
    """
    named = tuple(getattr(observer, "needs", ("model", "gimbals")))
    for name in named:
        if name not in NEEDS:
            raise InputError(f"an observer's needs = {named}: {name!r}: {nearest(name, NEEDS)}")
    return named


def reads_gyro(*observers: Observer | type) -> bool:
    """Return whether one of these observers needs the cheap gyro."""
    return any("gyro" in needs(observer) for observer in observers)


def extra_signals(observer: Observer) -> tuple[str, ...]:
    """Return the names of what an observer estimates beyond x, none if it has no `extra_signals`.

    Raises:
        InputError: A name is there twice.
    """
    names = tuple(getattr(observer, "extra_signals", ()))
    if len({*STATE_SIGNALS, *names}) < len(STATE_SIGNALS) + len(names):
        raise InputError(f"observer {type(observer).__name__}: extra_signals = {names}: each name once, none of x's")
    return names


class FeedbackState(Estimate):
    """Feedback of a law: x1 [rad], x2 [rad/s], x3 [rad], floats for one world, arrays (n_worlds,) for many.

    x1 and x3 are measured or estimated (`controller.angle_source`), x2 is the observer's, the gyro's or the true one
    (`controller.feedback`). `extra` has what the observer in the loop estimates beyond x, in the order of its
    `extra_signals`.
    """

    extra: Sequence[Scalar] = ()


def feedback_state(x1: Scalar, x2: Scalar, x3: Scalar, extra: Sequence[Scalar] = ()) -> FeedbackState:
    """Put together what is fed back to a law."""
    x = _new(FeedbackState, (x1, x2, x3))
    if len(extra):
        x.extra = extra
    return x


class Law(Protocol):
    """A control law in discrete time: from what is measured and estimated to the gimbal rate u.

    All memory is in the state, so that one value serves any number of runs and worlds. Its constructor is given `dt`
    and `rate_limit`, which it keeps under these names, and `model` and `noise` (`MeasurementNoise`, of the sensors'
    datasheet) if it takes them. The controller limits u to `rate_limit` whatever the law says; a law that has memory
    should know the limit, and not wind up.

    Where a law has more to say:

    - A part `x_e` of its state is its integrator, which the trajectory shows; of a law without one it shows NaN.
    - `trim_gain` [s]: its integrator settles at that times the equilibrium bias. Such a law can be trimmed
      (`controller.bias_trim_s`); its state is a NamedTuple with `x_e`.
    - `needs`, out of `LAW_NEEDS`: () for a law that takes y and nothing of the observer.
    - `arrays`: names of its fields that may be arrays (n_worlds,), so that worlds of one batch may differ in them.

    Attributes:
        dt: Control period [s].
        rate_limit: Largest gimbal rate [rad/s].
    """

    @property
    def dt(self) -> float: ...  # noqa: D102

    @property
    def rate_limit(self) -> Scalar: ...  # noqa: D102

    def init(self, y: Measurement) -> State:
        """Return the state before the first sample is fed back."""
        ...

    def step(self, state: State, y: Measurement, x: FeedbackState, u: Scalar) -> tuple[State, Scalar]:
        """Decide on one sample.

        Args:
            state: The state before it.
            y: What is measured at it.
            x: What is fed back at it.
            u: The gimbal rate commanded at the sample before and held since [rad/s]; 0 at the first.

        Returns:
            The next state, and the gimbal rate to hold until the next sample [rad/s].
        """
        ...


LAW_NEEDS = ("estimate",)
"""Inputs that a law may need beside y: the estimate, which the observer or in its place the gyro gives."""


def law_needs(law: Law | type[Law]) -> tuple[str, ...]:
    """Return the `LAW_NEEDS` of a law, or of its class; a law that does not say takes all."""
    return getattr(law, "needs", LAW_NEEDS)


STANDARD_GRAVITY = 9.80665  # m/s^2, the g of a datasheet's mg

Forces = Sequence[Scalar] | np.ndarray
"""Specific force: inner x, inner z, outer x, outer z [m/s^2]; floats, or one array (4, n_worlds)."""


Setpoints = tuple[Sequence[int], Any]
"""Numbers of actuators that are no gimbal's and no flywheel's, and their controls, (n,) or (n, n_worlds)."""


class IdealReading(NamedTuple):
    """Readings of perfect sensors at one instant: floats, or arrays (n_worlds,)."""

    accelerations: Forces
    gimbals: Sequence[Scalar]
    """Gimbal angles, one a gimbal [rad]."""
    gyro: Scalar
    """Rate of the frame along the tilt axis, as a gyro on it measures [rad/s]."""
    rate: Scalar
    """The true tilt rate, q_b' [rad/s]: no sensor's, but what `feedback = "truth"` uses."""
    wheels: Sequence[Scalar] = ()
    """Rates of the flywheels, one a module [rad/s]: no sensor's, but what makes accelerometers vibrate."""
    motion: Any = ()
    """Of both accelerometers velocity, x and z axis in the world, 18 numbers, then g; if the model shows them."""


class MultiAxisReading(NamedTuple):
    """The readings of a rig of several axes."""

    axes: Sequence[IdealReading]
    """Readings of each axis."""
    turn_rate: Scalar
    """Upward rate of the frame, as a gyro on it measures [rad/s]."""
    touch: Sequence[Scalar] = ()
    """Forces on the touch sensors, in the order of the model [N]."""

"""Runs observers step by step and checks what user-written ones return."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from cmg_mj.core.types import Estimate, FeedbackState, Law, Measurement, Observer, State, extra_signals
from cmg_mj.elementwise import Scalar, clip
from cmg_mj.errors import InputError, RunStopped
from cmg_mj.observers.user_code import UserCode, real_array


def read_only(*arrays: np.ndarray) -> None:
    """Protect arrays that several observers get: `d = y.y1; d -= 0.02` raises."""
    for array in arrays:
        array.flags.writeable = False


class ObserverRunner:
    """Steps observers that see the same samples.

    Args:
        observers: The one in the loop, whose failure stops a run, then the open-loop ones.
        single: Whether on floats (one world) or on arrays (n_worlds,).
        timestep: Physics step [s].

    Attributes:
        extra_signals: Names of what each of them estimates beyond x.

    Raises:
        InputError: An observer's extra signals are not distinct lower-case names.
    """

    def __init__(self, observers: Sequence[Observer], single: bool, timestep: float) -> None:
        self.extra_signals = [_extra_signals(observer) for observer in observers]
        self._widths = [3 + len(names) for names in self.extra_signals]
        self._fresh = list(observers)
        self._single = single
        names = (type(getattr(observer, "stands_for", observer)).__name__ for observer in observers)
        self._user_codes = [UserCode("observer", name, timestep) for name in names]
        self._running: list[Observer] = []
        self._states: list[State] = []

    @property
    def started(self) -> bool:
        """Return whether the observers have seen a sample."""
        return bool(self._running)

    def start(self, y: Measurement, step: int) -> list[Sequence[Scalar]]:
        """Take the first sample.

        Args:
            y: The measurement.
            step: Number of the physics step.

        Returns:
            An estimate an observer: x1, x2, x3, its extra signals.

        Raises:
            RunStopped: An observer failed.
        """
        self._running = list(self._fresh)
        self._states = [self._first_state(i, y, step) for i in range(len(self._running))]
        zero = 0.0 * y.y1
        return [as_estimate((y.y1, zero, y.y2, *[zero] * (width - 3))) for width in self._widths]

    def advance(self, y: Measurement, u: Scalar, step: int) -> list[Sequence[Scalar]]:
        """Take the next sample.

        Args:
            y: The measurement.
            u: The gimbal rate held since the last one [rad/s].
            step: Number of the physics step.

        Returns:
            An estimate an observer: x1, x2, x3, its extra signals.

        Raises:
            RunStopped: The observer in the loop failed, or in one world returned a number that is not finite.
        """
        states, single = self._states, self._single
        estimates: list[Sequence[Scalar]] = []
        total = 0.0
        for i, observer in enumerate(self._running):
            try:
                states[i], estimate = observer.step(states[i], y, u)
                if single:
                    # The sum of floats is a float, of anything else (but for a few integers among them) is not.
                    if len(estimate) != self._widths[i] or type(total := sum(estimate)) is not float:
                        estimate = self._coerced(estimate, self._widths[i], y)
                        total = sum(estimate)
                elif self._has_right_shape(estimate, self._widths[i], y):
                    # The record keeps a copy: an observer may go on changing its arrays in place.
                    estimate = as_estimate([part.copy() for part in estimate])
                else:
                    estimate = self._coerced(estimate, self._widths[i], y)
            except KeyboardInterrupt:
                raise
            except BaseException as error:  # whatever a user's code raises
                if i == 0:
                    self._user_codes[0].fail_from(error, step)
                # An open-loop observer must not end the run: it is NaN from here on.
                self._running[i] = failed = _FailedObserver(self._widths[i])
                states[i], estimate = failed.step(None, y, u)
            # Many worlds are judged one by one, elsewhere. NaN and infinity alike are not zero times themselves.
            if i == 0 and 0.0 * total != 0.0:
                self._fail_if_not_finite(estimate, step)
            estimates.append(estimate)
        return estimates

    def _first_state(self, i: int, y: Measurement, step: int) -> State:
        try:
            return self._running[i].init(y)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # whatever a user's code raises
            self._user_codes[i].fail_from(error, step)

    def _has_right_shape(self, estimate: Sequence[Scalar], width: int, y: Measurement) -> bool:
        """Return whether an estimate has all its parts, arrays (n_worlds,)."""
        shape = y.y1.shape
        return len(estimate) == width and all(
            getattr(part, "shape", None) == shape and part.dtype == float for part in estimate
        )

    def _coerced(self, estimate: Sequence[Scalar], width: int, y: Measurement) -> Sequence[Scalar]:
        """Convert a user's estimate, which may be NumPy's numbers or the same for all worlds."""
        if len(estimate) < width:
            raise ValueError(f"the estimate has {len(estimate)} parts, not {width}: x1, x2, x3 and the extra signals")
        parts = [real_array(part, "the estimate has a part of type") for part in estimate[:width]]
        if self._single:
            return as_estimate([float(part) for part in parts])
        return as_estimate([np.broadcast_to(part.astype(float), y.y1.shape) for part in parts])

    def _fail_if_not_finite(self, estimate: Sequence[float], step: int) -> None:
        """Stop for a number that is not finite, if there is one: a sum may overflow."""
        for name, value in zip(("x1", "x2", "x3", *self.extra_signals[0]), estimate, strict=True):
            if not math.isfinite(value):
                self._user_codes[0].fail(f"returned {value} for {name}", step)


class ObserverTakeover:
    """Observers that start in the middle of a run, and take over once they have had time to converge.

    They take the rate at their first sample for zero. Until they take over, or their predecessor fails, the estimate of
    x in the loop is the predecessor's.

    Args:
        predecessor: The observers that they take over from.
        ticks: How many samples they run open loop.
        successor: The new observers.
    """

    def __init__(self, predecessor: Observers, ticks: int, successor: ObserverRunner) -> None:
        self._predecessor: Observers | None = predecessor
        self._ticks = ticks
        self._successor = successor
        self.extra_signals = successor.extra_signals

    def start(self, y: Measurement, step: int) -> list[Sequence[Scalar]]:
        """Take the first sample of a run: nothing is left of the predecessor. See `ObserverRunner.start`."""
        self._predecessor = None
        return self._successor.start(y, step)

    def advance(self, y: Measurement, u: Scalar, step: int) -> list[Sequence[Scalar]]:
        """Take the next sample: see `ObserverRunner.advance`."""
        successor = self._successor
        estimates = successor.advance(y, u, step) if successor.started else successor.start(y, step)
        if self._predecessor is not None:
            self._ticks -= 1
            try:
                x = self._predecessor.advance(y, u, step)[0][:3]
                estimates[0] = as_estimate([*x, *estimates[0][3:]])  # a law finds the new observer's extra signals
            except RunStopped:
                self._ticks = 0
            if self._ticks <= 0:
                self._predecessor = None
        return estimates


Observers = ObserverRunner | ObserverTakeover


class _FailedObserver:
    """An open-loop observer that raised: it estimates NaN from then on."""

    def __init__(self, width: int) -> None:
        self.width = width

    def init(self, y: Measurement) -> None:
        return None

    def step(self, state: None, y: Measurement, u: Scalar) -> tuple[None, Any]:
        return None, as_estimate((math.nan + 0.0 * y[0],) * self.width)


def as_estimate(parts: Sequence[Scalar]) -> Sequence[Scalar]:
    """Give an estimate of x alone its parts' names; a longer one is a plain tuple."""
    return Estimate(*parts) if len(parts) == 3 else tuple(parts)


def _extra_signals(observer: Observer) -> tuple[str, ...]:
    """Read what an observer estimates beyond x.

    Raises:
        InputError: Its names are wrong.
    """
    try:
        return extra_signals(observer)
    except ValueError as error:
        raise InputError(f"observer {type(observer).__name__}: {error}") from error


class LawRunner:
    """Asks a law for its command at each tick.

    Args:
        law: The law.
        single: Whether on floats (one world) or on arrays (n_worlds,).
        timestep: Physics step [s].
    """

    def __init__(self, law: Law, single: bool, timestep: float) -> None:
        self.law = law
        self._step = law.step
        self._least, self._most = -law.rate_limit, law.rate_limit
        self._single = single
        self._user_code = UserCode("law", type(law).__name__, timestep)
        self._state: State = None

    def start(self, y: Measurement, step: int) -> None:
        """Forget everything: the next decision is the first.

        Args:
            y: The first measurement.
            step: Number of the physics step.

        Raises:
            RunStopped: The law failed.
        """
        try:
            self._state = self.law.init(y)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # whatever a user's code raises
            self._user_code.fail_from(error, step)

    def trim(self, x_e: Scalar) -> None:
        """Hold the integrator at a value [rad s]."""
        self._state = self._state._replace(x_e=x_e)

    @property
    def integrator(self) -> Scalar | None:
        """x_e [rad s]; None for a law without one."""
        return getattr(self._state, "x_e", None)

    def take_integrator(self, predecessor: LawRunner) -> None:
        """Go on with another law's integrator, if both have one."""
        x_e = predecessor.integrator
        if x_e is not None and self.integrator is not None and hasattr(self._state, "_replace"):
            self.trim(x_e)

    def decide(self, y: Measurement, x: FeedbackState, u: Scalar, step: int) -> tuple[Scalar, Scalar]:
        """Return the command of a tick.

        Args:
            y: What is measured.
            x: What is fed back.
            u: The gimbal rate held since the last tick [rad/s].
            step: Number of the physics step.

        Returns:
            The gimbal rate [rad/s], within the limit, and the integrator that went into it; NaN if the law has none.

        Raises:
            RunStopped: The law failed, or in one world returned a number that is not finite.
        """
        before = self._state
        try:
            self._state, command = self._step(before, y, x, u)
            x_e = getattr(before, "x_e", math.nan)
            # A float within the limit is what the bench's laws give: all else is looked at more closely.
            if self._single and type(command) is float and type(x_e) is float and self._least <= command <= self._most:
                return command, x_e
            command, x_e = self._coerced(command, x_e, y)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # whatever a user's code raises
            self._user_code.fail_from(error, step)
        if self._single and not math.isfinite(command):  # many worlds are judged one by one, elsewhere
            self._user_code.fail(f"returned {command} for u", step)
        return command, x_e

    def _coerced(self, command: Scalar, x_e: Scalar, y: Measurement) -> tuple[Scalar, Scalar]:
        """Limit a law's command; copy it and its integrator, as floats or arrays: a law may change its own in place."""
        if self._single:
            u, x_e = _number(command), _number(x_e)
            return clip(u, self._least, self._most) if math.isfinite(u) else u, x_e
        u = _of_worlds(command, y)
        return np.where(np.isfinite(u), clip(u, self._least, self._most), u), _of_worlds(x_e, y)


class LawTakeover:
    """A law that takes over in the middle of a run, from its first sample on, with its predecessor's integrator.

    Args:
        predecessor: The law that it takes over from.
        successor: The new law.
    """

    def __init__(self, predecessor: Laws, successor: LawRunner) -> None:
        self._predecessor = predecessor.in_charge if isinstance(predecessor, LawTakeover) else predecessor
        self._successor = successor
        self._begun = False

    def start(self, y: Measurement, step: int) -> None:
        """Forget everything, the predecessor too: see `LawRunner.start`."""
        self._begun = True
        self._successor.start(y, step)

    def trim(self, x_e: Scalar) -> None:
        """Hold the integrator at a value [rad s]."""
        self._successor.trim(x_e)

    @property
    def in_charge(self) -> LawRunner:
        """The law that took the last decision."""
        return self._successor if self._begun else self._predecessor

    def decide(self, y: Measurement, x: FeedbackState, u: Scalar, step: int) -> tuple[Scalar, Scalar]:
        """Return the command of a tick: see `LawRunner.decide`."""
        if not self._begun:
            self._successor.start(y, step)
            self._successor.take_integrator(self._predecessor)
            self._begun = True
        return self._successor.decide(y, x, u, step)


Laws = LawRunner | LawTakeover


def _of_worlds(value: Scalar, y: Measurement) -> np.ndarray:
    """Return a user's numbers, which may be one for all worlds, as an array (n_worlds,) of its own."""
    numbers = real_array(value, "the law returned")
    return numbers.astype(float) if numbers.shape == y.y1.shape else np.full(y.y1.shape, numbers, dtype=float)


def _number(value: Scalar) -> float:
    """Return a user's number, which may be NumPy's, as Python's own."""
    number = np.asarray(value)
    if number.dtype.kind not in "fiub" or number.shape:
        raise TypeError(f"the law returned {number.dtype} of shape {number.shape}, not a real number")
    return float(number)

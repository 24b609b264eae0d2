"""Runs observers and a law tick by tick: one check of shape, the limit on the command, errors that name who failed."""

from __future__ import annotations

import math
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

import numpy as np

from cmg_mj.core.arrays import Scalar, clip
from cmg_mj.core.errors import RunStopped
from cmg_mj.core.one_by_one import for_worlds
from cmg_mj.core.types import Estimate, FeedbackState, Law, Measurement, Observer, State, extra_signals

_PACKAGE = str(Path(__file__).parents[1])


class ObserverRunner:
    """Steps observers that see the same samples.

    Args:
        observers: The observer in the loop, then the open-loop observers.
        single: Whether on floats (one world) or on arrays (n_worlds,).

    Attributes:
        extra_signals: Names of what each observer estimates beyond x.
    """

    def __init__(self, observers: Sequence[Observer], single: bool) -> None:
        self.observers = list(observers) if single else [for_worlds(observer) for observer in observers]
        self._single = single
        self.extra_signals = [extra_signals(observer) for observer in observers]
        self._states: list[State] = []
        self._checked = False
        self._trusted = all(map(_is_trusted, observers))

    def start(self, y: Measurement, time: float) -> list[Sequence[Scalar]]:
        """Take the first sample, at a time [s].

        Returns:
            An estimate an observer: x1, x2, x3, its extra signals.

        Raises:
            RunStopped: An observer failed.
        """
        self._states = []
        self._checked = False
        for observer in self.observers:
            with _named(observer, "observer", time):
                self._states.append(observer.init(y))
        zero = 0.0 * y.y1
        return [as_estimate((y.y1, zero, y.y2, *[zero] * len(names))) for names in self.extra_signals]

    def advance(self, y: Measurement, u: Scalar, time: float) -> list[Sequence[Scalar]]:
        """Take the next sample.

        Args:
            y: The measurement.
            u: The gimbal rate held since the last one [rad/s].
            time: Its time [s].

        Returns:
            An estimate an observer: x1, x2, x3, its extra signals.

        Raises:
            RunStopped: An observer failed, or the observer in the loop returned a number that is not finite (one
                world).
        """
        states = self._states
        estimates: list[Sequence[Scalar]] = []
        i = 0
        try:
            for i, observer in enumerate(self.observers):
                states[i], estimate = observer.step(states[i], y, u)
                estimates.append(estimate)
        except Exception as error:
            _stop(self.observers[i], "observer", time, error)
        if not self._checked:
            self._check_shapes(estimates, y, time)
        # Many worlds are judged one by one, elsewhere. Neither NaN nor a masked number is below infinity.
        if self._single and not abs(sum(estimates[0])) < math.inf:
            for name, value in zip(self._names(0), estimates[0], strict=True):
                if not math.isfinite(value):
                    name = f"{type(self.observers[0]).__name__} returned {value} for {name}"
                    raise RunStopped(f"observer {name} at t = {time:g} s")
        return estimates

    def _check_shapes(self, estimates: Sequence[Sequence[Scalar]], y: Measurement, time: float) -> None:
        """Check estimates, of the package's own observers the first alone: each part is a number of every world."""
        self._checked = self._trusted
        for i, (observer, estimate) in enumerate(zip(self.observers, estimates, strict=True)):
            names = self._names(i)
            with _named(observer, "observer", time):
                if len(estimate) != len(names):
                    raise TypeError(f"step(state, y, u) returned {len(estimate)} numbers, not {', '.join(names)}")
                for name, value in zip(names, estimate, strict=True):
                    check_shape(name, value, y)

    def _names(self, i: int) -> tuple[str, ...]:
        return "x1", "x2", "x3", *self.extra_signals[i]


class LawRunner:
    """Asks a law for its command at each tick, and limits it.

    Args:
        law: The law.
        single: Whether on floats (one world) or on arrays (n_worlds,).

    Attributes:
        state: The law's memory; stages on the memory may replace it.
    """

    def __init__(self, law: Law, single: bool) -> None:
        self.law = law if single else for_worlds(law)
        self.state: State = None
        self._step = self.law.step
        self._least, self._most = -law.rate_limit, law.rate_limit
        self._single = single
        self._checked = False
        self._no_integrator: Scalar = math.nan

    def start(self, y: Measurement, time: float) -> None:
        """Forget everything: the next decision is the first.

        Args:
            y: The first measurement.
            time: Its time [s].

        Raises:
            RunStopped: The law failed.
        """
        self._checked = False
        self._no_integrator = math.nan * y.y1
        with _named(self.law, "law", time):
            self.state = self.law.init(y)

    def decide(self, y: Measurement, x: FeedbackState, u: Scalar, time: float) -> tuple[Scalar, Scalar]:
        """Return the command of a tick.

        Args:
            y: What is measured.
            x: What is fed back.
            u: The gimbal rate held since the last tick [rad/s].
            time: Of the tick [s].

        Returns:
            The gimbal rate [rad/s], within the limit, and the integrator that went into it; NaN if the law has none.

        Raises:
            RunStopped: The law failed, or returned a number that is not finite (one world).
        """
        before = self.state
        try:
            self.state, command = self._step(before, y, x, u)
        except Exception as error:
            _stop(self.law, "law", time, error)
        x_e = getattr(before, "x_e", self._no_integrator)
        if not self._checked:
            self._checked = _is_trusted(self.law)
            with _named(self.law, "law", time):
                check_shape("u", command, y)
                check_shape("x_e", x_e, y)
        if not self._single:  # many worlds are judged one by one, elsewhere
            return np.where(np.isfinite(command), clip(command, self._least, self._most), command), x_e
        if self._least <= command <= self._most:
            return command, x_e
        if not math.isfinite(command):
            name = type(self.law).__name__
            raise RunStopped(f"law {name} returned {command} for u at t = {time:g} s")
        return clip(float(command), self._least, self._most), x_e


def _is_trusted(part: Observer | Law) -> bool:
    """Return whether a part is the package's own, whose numbers have the same shapes at every tick."""
    return type(getattr(part, "stands_for", part)).__module__.startswith("cmg_mj.")


def as_estimate(parts: Sequence[Scalar]) -> Sequence[Scalar]:
    """Give an estimate of x alone its parts' names; a longer one is a plain tuple."""
    return Estimate(*parts) if len(parts) == 3 else tuple(parts)


def check_shape(name: str, value: Scalar, y: Measurement) -> None:
    """Refuse what is not a real number of each world.

    Raises:
        TypeError: It has another shape than the measurement.
    """
    number = np.asarray(value)
    if np.ma.is_masked(value):
        raise TypeError(f"{name} is masked")
    if number.shape != np.shape(y.y1) or number.dtype.kind not in "fiu":
        raise TypeError(f"{name} has shape {number.shape} of {number.dtype}, not {np.shape(y.y1)} of float64")


@contextmanager
def _named(part: Observer | Law, kind: str, time: float) -> Iterator[None]:
    """Stop a run in which an observer or a law fails."""
    try:
        yield
    except Exception as error:
        _stop(part, kind, time, error)


def _stop(part: Observer | Law, kind: str, time: float, error: Exception) -> NoReturn:
    """Stop the run at a time [s]; show the error with the user's own frames.

    Raises:
        RunStopped: Always.
    """
    frames = error.__traceback__
    while frames is not None and frames.tb_frame.f_code.co_filename.startswith(_PACKAGE):
        frames = frames.tb_next
    part = getattr(part, "stands_for", part)
    shown = "".join(traceback.format_exception(type(error), error, frames, chain=False)).rstrip()
    raise RunStopped(f"{kind} {type(part).__name__} failed at t = {time:g} s\n{shown}") from error

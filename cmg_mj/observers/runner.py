"""Observers at work: started, advanced sample by sample, and a user's one held to its word."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NoReturn

import numpy as np

from cmg_mj.elementwise import Scalar
from cmg_mj.errors import InputError, RunStopped, raised
from cmg_mj.observers.protocol import Estimate, Measurement, Observer, extra_signals


def read_only(*arrays: np.ndarray) -> None:
    """What is handed to several observers must not be changed by one of them: `d = y.y1; d -= 0.02` raises."""
    for array in arrays:
        array.flags.writeable = False


class ObserverRunner:
    """Observers that see the same samples.

    Args:
        observers: The one in the loop, whose failure stops a run, then those that only ride along.
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
        self._given = list(observers)
        self._single = single
        self._timestep = timestep
        self._at_work: list[Observer] = []
        self._states: list[Any] = []

    def start(self, y: Measurement, step: int) -> list[Sequence[Scalar]]:
        """The estimates at the first sample.

        Args:
            y: The measurement.
            step: Number of the physics step.

        Returns:
            An estimate an observer: x1, x2, x3, its extra signals.

        Raises:
            RunStopped: An observer failed.
        """
        self._at_work = list(self._given)
        self._states = [self._first_state(observer, y, step) for observer in self._at_work]
        zero = 0.0 * y.y1
        return [as_estimate((y.y1, zero, y.y2, *[zero] * (width - 3))) for width in self._widths]

    def advance(self, y: Measurement, u: Scalar, step: int) -> list[Sequence[Scalar]]:
        """The estimates at the next sample.

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
        for i, observer in enumerate(self._at_work):
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
            except (Exception, SystemExit) as error:  # a user's observer may fail in any way
                if i == 0:
                    self._fail(observer, f"raised {raised(error)}", step, error)
                # One that only rides along must not end the run: it is NaN from here on.
                self._at_work[i] = lost = _FailedObserver(self._widths[i])
                states[i], estimate = lost.step(None, y, u)
            # Many worlds are judged one by one, elsewhere. NaN and infinity alike are not zero times themselves.
            if i == 0 and 0.0 * total != 0.0:
                self._fail_not_finite(observer, estimate, step)
            estimates.append(estimate)
        return estimates

    def _first_state(self, observer: Observer, y: Measurement, step: int) -> Any:
        try:
            return observer.init(y)
        except (Exception, SystemExit) as error:  # a user's observer may fail in any way
            self._fail(observer, f"raised {raised(error)}", step, error)

    def _has_right_shape(self, estimate: Sequence[Scalar], width: int, y: Measurement) -> bool:
        """Whether an estimate has all its parts, arrays (n_worlds,)."""
        shape = y.y1.shape
        return len(estimate) == width and all(
            getattr(part, "shape", None) == shape and part.dtype == float for part in estimate
        )

    def _coerced(self, estimate: Sequence[Scalar], width: int, y: Measurement) -> Sequence[Scalar]:
        """Make a user's estimate, which may be NumPy's numbers or the same for all worlds, consist of these."""
        if len(estimate) < width:
            raise ValueError(f"the estimate has {len(estimate)} parts, not {width}: x1, x2, x3 and the extra signals")
        parts = [np.asarray(part) for part in estimate[:width]]
        for part in parts:
            if part.dtype.kind not in "fiub":
                raise TypeError(f"the estimate has a part of type {part.dtype}, not real numbers")
        if self._single:
            return as_estimate([float(part) for part in parts])
        return as_estimate([np.broadcast_to(part.astype(float), y.y1.shape) for part in parts])

    def _fail_not_finite(self, observer: Observer, estimate: Sequence[float], step: int) -> None:
        """Stop for a number that is not finite, if there is one: a sum may overflow."""
        for name, value in zip(("x1", "x2", "x3", *self.extra_signals[0]), estimate, strict=True):
            if not math.isfinite(value):
                self._fail(observer, f"returned {value} for {name}", step)

    def _fail(self, observer: Observer, what: str, step: int, cause: BaseException | None = None) -> NoReturn:
        name = type(getattr(observer, "stands_for", observer)).__name__
        raise RunStopped(f"observer {name} {what} at t = {step * self._timestep:g} s") from cause


class ObserverTakeover(ObserverRunner):
    """Observers that join a run which others have begun, and take over once they have had time to converge.

    They start from the first sample that they see, whose rate they take for zero. Until they take over, or the one
    before fails, the estimate of x in the loop is its.

    Args:
        before: Those that they take over from.
        ticks: How many samples they ride along.
        observers: The one that will be in the loop, then those that only ride along.
        single: Whether on floats (one world) or on arrays (n_worlds,).
        timestep: Physics step [s].
    """

    def __init__(
        self, before: ObserverRunner, ticks: int, observers: Sequence[Observer], single: bool, timestep: float
    ) -> None:
        super().__init__(observers, single, timestep)
        self._before: ObserverRunner | None = before
        self._ticks = ticks

    def advance(self, y: Measurement, u: Scalar, step: int) -> list[Sequence[Scalar]]:
        """The estimates at the next sample: see `ObserverRunner`."""
        estimates = super().advance(y, u, step) if self._at_work else self.start(y, step)
        if self._before is not None:
            self._ticks -= 1
            try:
                of_before = self._before.advance(y, u, step)[0]
                estimates[0] = as_estimate([*of_before[:3], *estimates[0][3:]])  # beyond x a law finds what it was told
            except RunStopped:
                self._ticks = 0
            if self._ticks <= 0:
                self._before = None
        return estimates


class _FailedObserver:
    """An open-loop observer that raised: nothing is known any more."""

    def __init__(self, width: int) -> None:
        self.width = width

    def init(self, y: Measurement) -> None:
        return None

    def step(self, state: None, y: Measurement, u: Scalar) -> tuple[None, Any]:
        return None, as_estimate((math.nan + 0.0 * y[0],) * self.width)


def as_estimate(parts: Sequence[Scalar]) -> Sequence[Scalar]:
    """An estimate of x alone has its parts' names."""
    return Estimate(*parts) if len(parts) == 3 else tuple(parts)


def _extra_signals(observer: Observer) -> tuple[str, ...]:
    """What an observer estimates beyond x; what is wrong with its names is the user's affair."""
    try:
        return extra_signals(observer)
    except ValueError as error:
        raise InputError(f"observer {type(observer).__name__}: {error}") from error

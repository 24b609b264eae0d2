"""A control law at work: started, asked tick by tick, limited, and a user's one held to its word."""

from __future__ import annotations

import math
from typing import Any, NoReturn

import numpy as np

from cmg_mj.controllers.laws.protocol import FeedbackState, Law
from cmg_mj.elementwise import Scalar, clip
from cmg_mj.errors import RunStopped, raised
from cmg_mj.observers.protocol import Measurement


class LawRunner:
    """A law that decides.

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
        self._timestep = timestep
        self._state: Any = None

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
        except (Exception, SystemExit) as error:  # a user's law may fail in any way
            self._fail(f"raised {raised(error)}", step, error)

    def trim(self, x_e: Scalar) -> None:
        """Hold the integrator at a value [rad s]."""
        self._state = self._state._replace(x_e=x_e)

    def decide(self, y: Measurement, x: FeedbackState, u: Scalar, step: int) -> tuple[Scalar, Scalar]:
        """The command of a tick.

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
        except (Exception, SystemExit) as error:  # a user's law may fail in any way
            self._fail(f"raised {raised(error)}", step, error)
        if self._single and not math.isfinite(command):  # many worlds are judged one by one, elsewhere
            self._fail(f"returned {command} for u", step)
        return command, x_e

    def _coerced(self, command: Any, x_e: Any, y: Measurement) -> tuple[Scalar, Scalar]:
        """What a law has said, within the limit, as floats or as arrays of their own: it may go on changing its own."""
        if self._single:
            u, x_e = _number(command), _number(x_e)
            return clip(u, self._least, self._most) if math.isfinite(u) else u, x_e
        u = _of_worlds(command, y)
        return np.where(np.isfinite(u), clip(u, self._least, self._most), u), _of_worlds(x_e, y)

    def _fail(self, what: str, step: int, cause: BaseException | None = None) -> NoReturn:
        raise RunStopped(f"law {type(self.law).__name__} {what} at t = {step * self._timestep:g} s") from cause


class LawTakeover(LawRunner):
    """A law that takes over from another: it starts from the first sample that it sees, with the other's integrator.

    Args:
        before: The other one, at work.
        law: The law.
        single: Whether on floats (one world) or on arrays (n_worlds,).
        timestep: Physics step [s].
    """

    def __init__(self, before: LawRunner, law: Law, single: bool, timestep: float) -> None:
        super().__init__(law, single, timestep)
        waiting = before._before if isinstance(before, LawTakeover) else None
        self._before: LawRunner | None = waiting or before

    def decide(self, y: Measurement, x: FeedbackState, u: Scalar, step: int) -> tuple[Scalar, Scalar]:
        """The command of a tick: see `LawRunner`."""
        if self._before is not None:
            self.start(y, step)
            x_e = getattr(self._before._state, "x_e", None)
            if x_e is not None and hasattr(self._state, "x_e") and hasattr(self._state, "_replace"):
                self.trim(x_e)
            self._before = None
        return super().decide(y, x, u, step)


def _of_worlds(value: Any, y: Measurement) -> np.ndarray:
    """A user's numbers, which may be one for all worlds, as an array (n_worlds,) of its own."""
    given = np.asarray(value)
    if given.dtype.kind not in "fiub":
        raise TypeError(f"the law returned {given.dtype}, not real numbers")
    return given.astype(float) if given.shape == y.y1.shape else np.full(y.y1.shape, given, dtype=float)


def _number(value: Any) -> float:
    """A user's number, which may be NumPy's, as Python's own."""
    given = np.asarray(value)
    if given.dtype.kind not in "fiub" or given.shape:
        raise TypeError(f"the law returned {given.dtype} of shape {given.shape}, not a real number")
    return float(given)

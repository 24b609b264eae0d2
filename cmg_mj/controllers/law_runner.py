"""Runs a control law tick by tick, limits its command, and checks what a user-written one returns."""

from __future__ import annotations

import math

import numpy as np

from cmg_mj.controllers.laws.protocol import FeedbackState, Law
from cmg_mj.elementwise import Scalar, clip
from cmg_mj.observers.protocol import Measurement, State
from cmg_mj.observers.user_code import UserCode, real_array


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

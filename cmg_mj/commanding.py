"""A control law at work: started, asked tick by tick, limited, and a user's one held to its word."""

from __future__ import annotations

import math
from typing import Any, NoReturn

import numpy as np

from cmg_mj.elementwise import Scalar
from cmg_mj.errors import RunStopped, raised
from cmg_mj.laws.protocol import Fed, Law, integrator
from cmg_mj.observers.protocol import Measurement


class Commanding:
    """A law that decides.

    Args:
        law: The law.
        single: Whether on floats (one world) or on arrays (n_worlds,).
        timestep: Physics step [s].
    """

    def __init__(self, law: Law, single: bool, timestep: float) -> None:
        self.law = law
        self._step = law.step
        self._limit = law.rate_limit
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
            self._blame(f"raised {raised(error)}", step, error)

    def trim(self, x_e: Scalar) -> None:
        """Hold the integrator at a value [rad s]."""
        self._state = self._state._replace(x_e=x_e)

    def decide(self, y: Measurement, x: Fed, u: Scalar, step: int) -> tuple[Scalar, Scalar]:
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
            if not self._single:
                return self._limited(command, y), self._of_worlds(integrator(before), y)
            x_e = integrator(before)
            limit = self._limit
            if type(command) is not float or type(x_e) is not float or not -limit <= command <= limit:
                command, x_e = _number(command), _number(x_e)
                command = min(max(command, -limit), limit) if math.isfinite(command) else command
        except (Exception, SystemExit) as error:  # a user's law may fail in any way
            self._blame(f"raised {raised(error)}", step, error)
        if not math.isfinite(command):  # many worlds are judged one by one, elsewhere
            self._blame(f"returned {command} for u", step)
        return command, x_e

    def _limited(self, command: Any, y: Measurement) -> np.ndarray:
        """A command of many worlds within the limit, in an array of its own: a law may go on changing its arrays."""
        return np.minimum(np.maximum(self._of_worlds(command, y), -self._limit), self._limit)

    def _of_worlds(self, value: Any, y: Measurement) -> np.ndarray:
        """What a law has said, which may be the same for all worlds, as an array (n_worlds,)."""
        given = np.asarray(value)
        if given.dtype.kind not in "fiub":
            raise TypeError(f"the law returned {given.dtype}, not real numbers")
        return given.astype(float) if given.shape == y.y1.shape else np.full(y.y1.shape, given, dtype=float)

    def _blame(self, what: str, step: int, cause: BaseException | None = None) -> NoReturn:
        raise RunStopped(f"law {type(self.law).__name__} {what} at t = {step * self._timestep:g} s") from cause


def _number(value: Any) -> float:
    """A user's number, which may be NumPy's, as Python's own."""
    given = np.asarray(value)
    if given.dtype.kind not in "fiub" or given.shape:
        raise TypeError(f"the law returned {given.dtype} of shape {given.shape}, not a real number")
    return float(given)

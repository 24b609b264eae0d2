"""Checks what user-written observers and laws return, and names the one that fails."""

from __future__ import annotations

from typing import NamedTuple, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from cmg_mj.errors import RunStopped, raised
from cmg_mj.inputs.users_line import in_users_line


class UserCode(NamedTuple):
    """An observer or a law in a run, as an error names it."""

    kind: str
    """`observer` or `law`."""
    name: str
    """The name of its class."""
    timestep: float
    """Physics step [s]."""

    def fail(self, failure: str, step: int, cause: BaseException | None = None) -> NoReturn:
        """Stop the run at a physics step.

        Raises:
            RunStopped: Always.
        """
        line = "" if cause is None else in_users_line(cause)
        raise RunStopped(f"{self.kind} {self.name} {failure} at t = {step * self.timestep:g} s{line}") from cause

    def fail_from(self, error: BaseException, step: int) -> NoReturn:
        """Stop the run at a physics step because the user's code raised.

        Raises:
            RunStopped: Always.
        """
        self.fail(f"raised {raised(error)}", step, error)


def real_array(value: ArrayLike, name: str) -> np.ndarray:
    """Return a user's number or numbers as NumPy's.

    Raises:
        TypeError: They are no real numbers.
    """
    numbers = np.asarray(value)
    if numbers.dtype.kind not in "fiub":
        raise TypeError(f"{name} {numbers.dtype}, not real numbers")
    return numbers

"""The integrator held, for the first seconds, where an observer's estimate of the bias asks for it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.axis import AxisControl
from cmg_mj.core.errors import InputError
from cmg_mj.core.sensor import steps_until
from cmg_mj.core.types import BIAS, Law, State


class Trim(NamedTuple):
    """Holds the integrator at k_e1/k_e4 e, instead of letting the law find that value by integration."""

    until: int = 0
    """The physics step from which on the integrator goes free."""
    part: int = 0
    """The part of the estimate that is the bias."""
    gain: Scalar = 0.0
    """The gain on it [s]."""

    def __call__(self, step: int, estimate: Sequence[Scalar], memory: State) -> State:
        """Return the law's memory, trimmed."""
        return memory._replace(x_e=self.gain * estimate[self.part]) if int(step) < self.until else memory


def trims(seconds: float, law: Law, extra_signals: Sequence[str], timestep: float) -> list[Trim]:
    """Make the stage of a controller that is trimmed.

    Args:
        seconds: For how long [s]; 0 for not at all.
        law: The law, whose integrator settles at its `trim_gain` times the bias.
        extra_signals: Names of what the observer estimates beyond x.
        timestep: Physics step [s].

    Returns:
        The stage; none for 0 s.

    Raises:
        InputError: It cannot be trimmed.
    """
    if not seconds:
        return []
    setting, cure = f"controller.bias_trim_s = {seconds:g}", "set controller.bias_trim_s=0"
    gain = getattr(law, "trim_gain", None)
    if gain is None:
        raise InputError(f"{setting}: {type(law).__name__} has no integrator to be trimmed; leave it out, or {cure}")
    if BIAS not in extra_signals:
        raise InputError(
            f"{setting}: needs an observer in the loop that estimates the bias, such as adaptive; or {cure}"
        )
    if not np.all(np.isfinite(gain)):
        raise InputError(f"{setting}: the gain on the integrator is zero")
    return [Trim(steps_until(seconds, timestep), 3 + list(extra_signals).index(BIAS), gain)]


def trim_of(axis: AxisControl) -> Trim:
    """Return the trim of an axis; one that never holds for an axis without it."""
    return next((stage for stage in axis.memories if isinstance(stage, Trim)), Trim())

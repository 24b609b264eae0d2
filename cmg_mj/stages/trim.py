"""The integrator held, for the first seconds, where an observer's estimate of the bias asks for it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.controller import Controller, ControllerSite
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
        return memory._replace(x_e=self.gain * estimate[self.part]) if step < self.until else memory


def trim(site: ControllerSite) -> Trim | None:
    """Make the stage of a controller that is trimmed: see `integrator_trim`."""
    seconds = site.settings.get("bias_trim_s", 0.0)
    part, gain = integrator_trim(seconds, site.law, site.extra_signals)
    return Trim(steps_until(seconds, site.timestep), part, gain) if seconds else None


def trim_of(controller: Controller) -> Trim:
    """Return the trim of a controller; one that never holds for a controller without it."""
    return next((stage for stage in controller.memories if isinstance(stage, Trim)), Trim())


def integrator_trim(bias_trim_s: float, law: Law, extra_signals: Sequence[str]) -> tuple[int, float]:
    """Find the part of the estimate that trims the integrator, and the gain on it.

    Args:
        bias_trim_s: For how long [s]; 0 for not at all.
        law: The law, whose integrator settles at its `trim_gain` times the bias.
        extra_signals: Names of what the observer estimates beyond x.

    Returns:
        Which part of the estimate is the bias, and the gain on it.

    Raises:
        InputError: It cannot be trimmed.
    """
    setting = f"controller.bias_trim_s = {bias_trim_s!r}"
    if not (isinstance(bias_trim_s, (int, float)) and bias_trim_s >= 0.0):
        raise InputError(f"{setting}: must be a number greater than or equal to 0")
    if not bias_trim_s:
        return 0, 0.0
    setting = f"controller.bias_trim_s = {bias_trim_s:g}"
    cure = "set controller.bias_trim_s=0"
    gain = getattr(law, "trim_gain", None)
    if gain is None:
        raise InputError(f"{setting}: {type(law).__name__} has no integrator to be trimmed; leave it out, or {cure}")
    if BIAS not in extra_signals:
        raise InputError(
            f"{setting}: needs an observer in the loop that estimates the bias, such as adaptive; or {cure}"
        )
    if not np.all(np.isfinite(gain)):
        raise InputError(f"{setting}: the gain on the integrator is zero")
    return 3 + list(extra_signals).index(BIAS), gain

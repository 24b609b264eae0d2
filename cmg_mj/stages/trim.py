"""The integrator trimmed by an observer's estimate of the bias."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmg_mj.core.types import BIAS, Law
from cmg_mj.errors import InputError


def integrator_trim(bias_trim_s: float, law: Law, extra_signals: Sequence[str]) -> tuple[int, float]:
    """Find the part of the estimate that trims the integrator, and the gain on it.

    Args:
        bias_trim_s: For how long [s]; 0 for not at all.
        law: The law, whose integrator settles at its `trim_gain` times the bias.
        extra_signals: What the observer estimates beyond x.

    Returns:
        Which part of the estimate is the bias, and the gain on it.

    Raises:
        InputError: It cannot be trimmed.
    """
    if not (isinstance(bias_trim_s, (int, float)) and bias_trim_s >= 0.0):
        raise InputError(f"controller.bias_trim_s = {bias_trim_s!r}: must be a number greater than or equal to 0")
    if not bias_trim_s:
        return 0, 0.0
    gain = getattr(law, "trim_gain", None)
    if gain is None:
        raise InputError(
            f"controller.bias_trim_s = {bias_trim_s:g}: {type(law).__name__} has no integrator to be trimmed; leave "
            "it out, or set controller.bias_trim_s=0"
        )
    if BIAS not in extra_signals:
        raise InputError(
            f"controller.bias_trim_s = {bias_trim_s:g}: needs an observer in the loop that estimates the bias, "
            "such as adaptive; or set controller.bias_trim_s=0"
        )
    if not np.all(np.isfinite(gain)):
        raise InputError(f"controller.bias_trim_s = {bias_trim_s:g}: the gain on the integrator is zero")
    return 3 + list(extra_signals).index(BIAS), gain

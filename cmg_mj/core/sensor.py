"""Times on the physics grid."""

from __future__ import annotations

import math

from cmg_mj.errors import InputError


def whole_steps(duration: float, timestep: float, field: str, text: str) -> int:
    """Count the physics steps of a duration.

    Args:
        duration: Duration [s].
        timestep: Physics step [s].
        field: The scenario field to name in the error.
        text: Its value as the user wrote it.

    Returns:
        The whole number of steps.

    Raises:
        InputError: The duration is no whole number of physics steps.
    """
    ratio = duration / timestep
    steps = round(ratio) if math.isfinite(ratio) else 0
    if abs(steps * timestep - duration) > 1e-9 * max(duration, timestep) + 1e-12 or (duration > 0 and steps == 0):
        raise InputError(
            f"{field} = {text}: not a whole number of physics steps of {timestep:g} s; "
            f"rates must divide {1.0 / timestep:g} Hz and times be multiples of {timestep:g} s"
        )
    return steps


def steps_until(delay: float, timestep: float) -> int:
    """Return the first physics step that is no earlier than a delay after step 0.

    Args:
        delay: The delay [s], any number.
        timestep: Physics step [s].

    Returns:
        The number of steps.
    """
    return math.ceil(delay / timestep - 1e-6)

"""Times on the physics grid."""

from __future__ import annotations

from cmg_mj.errors import InputError


def whole_steps(duration: float, timestep: float, field: str, shown: str) -> int:
    """How many physics steps a duration has.

    Args:
        duration: Duration [s].
        timestep: Physics step [s].
        field: The scenario field to name in the error.
        shown: Its value as the user wrote it.

    Returns:
        The whole number of steps.

    Raises:
        InputError: The duration is no whole number of physics steps.
    """
    steps = round(duration / timestep)
    if abs(steps * timestep - duration) > 1e-9 * max(duration, timestep) + 1e-12 or (duration > 0 and steps == 0):
        raise InputError(
            f"{field} = {shown}: not a whole number of physics steps of {timestep:g} s; "
            f"rates must divide {1.0 / timestep:g} Hz and times be multiples of {timestep:g} s"
        )
    return steps

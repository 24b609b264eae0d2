"""The columns of a log, `tilt=pitch_deg,rate=gyro_dps`, with their roles and units."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from cmg_mj.errors import InputError, nearest
from cmg_mj.replay.logs.units import UNITS, Quantity, in_si, unit, unit_of_name

ROLES: dict[str, Quantity] = {
    "time": "time",
    "tilt": "angle",
    "inner_x": "acceleration",
    "inner_z": "acceleration",
    "outer_x": "acceleration",
    "outer_z": "acceleration",
    "acceleration": "angular acceleration",
    "gimbal": "angle",
    "gimbal1": "angle",
    "gimbal2": "angle",
    "command": "rate",
    "rate": "rate",
}
"""Role -> quantity of its column.

`tilt` is the angle from the vertical, `inner_x` to `outer_z` two accelerometers as `RadialTilt` takes them,
`acceleration` the angular acceleration of the tilt, `gimbal` the gimbals' common angle from the spin axis' upright
place (or `gimbal1` and `gimbal2`, whose half difference it is), `command` their rate, `rate` the reference.
"""

ACCELEROMETERS = ("inner_x", "inner_z", "outer_x", "outer_z")


@dataclass(frozen=True)
class Column:
    """One column of a log.

    Attributes:
        role: One of `ROLES`.
        name: Heading in the file.
        unit: Unit of its numbers.
        factor: Factor to SI and radians, the user's scale included.
        offset: Addend after the factor, in SI and radians.
        unit_known: Whether the unit was given or is in the heading; else it is assumed.
    """

    role: str
    name: str
    unit: str
    factor: float
    offset: float = 0.0
    unit_known: bool = True


def assignments(texts: str | Iterable[str], option: str) -> dict[str, str]:
    """Parse `tilt=pitch_deg,rate=gyro dps` into role -> heading; a heading may contain commas.

    Args:
        texts: One text or several.
        option: The option's name, for messages.

    Returns:
        Role -> value, in their order.

    Raises:
        InputError: A text has another form, or a role is unknown or given twice.
    """
    values: dict[str, str] = {}
    for text in [texts] if isinstance(texts, str) else texts:
        parts = [part for part in re.split(r"(?:^|,)\s*(?=\w+\s*=)", text.strip()) if part]
        for part in parts or [text]:
            role, equals, value = part.partition("=")
            role, value = role.strip(), value.strip()
            if not equals or not value or not re.fullmatch(r"\w+", role):
                raise InputError(f"{option} {text!r}: write ROLE=VALUE with commas between, such as tilt=pitch_deg")
            check_role(role, option)
            if role in values:
                raise InputError(f"{option}: {role} is given twice")
            values[role] = value
    return values


def check_role(role: str, option: str) -> None:
    """Refuse an unknown role."""
    if role not in ROLES:
        raise InputError(f"{option} {role}: no such role; {nearest(role, ROLES)}")


def columns_of(
    names: Mapping[str, str],
    units: Mapping[str, str] | None = None,
    scales: Mapping[str, float] | None = None,
    offsets: Mapping[str, float] | None = None,
) -> dict[str, Column]:
    """Find the columns' units, factors and offsets.

    Args:
        names: Role -> heading.
        units: Role -> unit, where the heading does not end in it.
        scales: Role -> factor, such as -1 for a sensor mounted the other way round.
        offsets: Role -> addend after the scale, in the column's unit.

    Returns:
        Role -> column.

    Raises:
        InputError: A role is unknown, roles do not go together, or a column has no known unit.
    """
    units, scales, offsets = dict(units or {}), dict(scales or {}), dict(offsets or {})
    for option, roles in (("--columns", names), ("--units", units), ("--scale", scales), ("--offset", offsets)):
        for role in roles:
            check_role(role, option)
            if role not in names:
                raise InputError(f"{option} {role}: there is no such column; --columns names {', '.join(names)}")
    _check_together(names)
    columns = {}
    for role, name in names.items():
        quantity, unit_known = ROLES[role], True
        if role in units:
            in_unit = unit(quantity, units[role], f"--units {role}")
        else:
            ends_in = unit_of_name(quantity, name)
            if ends_in is None and role != "time":
                allowed = ", ".join(UNITS[quantity])
                no_unit = f"--columns {role}={name}: the name does not end in a unit"
                raise InputError(f"{no_unit}; say --units {role}=UNIT, one of {allowed}")
            in_unit, unit_known = ends_in or "s", ends_in is not None
        scale, offset = scales.get(role, 1.0), offsets.get(role, 0.0)
        if not math.isfinite(scale) or scale == 0.0:
            raise InputError(f"--scale {role}={scale:g}: must be a finite number other than 0")
        if not math.isfinite(offset):
            raise InputError(f"--offset {role}={offset:g}: must be a finite number")
        size = in_si(quantity, in_unit)
        columns[role] = Column(role, name, in_unit, size * scale, size * offset, unit_known)
    return columns


def _check_together(names: Mapping[str, str]) -> None:
    """Refuse roles that leave the tilt unknown, or determine it twice."""
    accelerometers = [role for role in ACCELEROMETERS if role in names]
    missing = [role for role in ACCELEROMETERS if role not in names]
    if "tilt" in names and accelerometers:
        raise InputError("--columns: the tilt either as tilt or from inner_x, inner_z, outer_x, outer_z, not both")
    if accelerometers and missing:
        raise InputError(f"--columns: of two accelerometers {', '.join(missing)} is missing")
    if "tilt" not in names and not accelerometers:
        raise InputError("--columns: there is no tilt; name one, or inner_x, inner_z, outer_x and outer_z")
    if "acceleration" in names and accelerometers:
        raise InputError("--columns: two accelerometers show the angular acceleration; acceleration is one too many")
    if ("gimbal1" in names) != ("gimbal2" in names):
        raise InputError("--columns: gimbal1 and gimbal2 go together; one gimbal is gimbal")
    if "gimbal" in names and "gimbal1" in names:
        raise InputError("--columns: either gimbal or gimbal1 and gimbal2, not both")

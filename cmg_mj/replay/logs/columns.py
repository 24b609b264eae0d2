"""The columns of a log, `tilt=pitch_deg,rate=gyro_dps`, with their roles and units."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from cmg_mj.errors import InputError, nearest, shortened
from cmg_mj.replay.logs.units import UNITS, Quantity, in_si, unit, unit_of_name

ROLES: dict[str, Quantity] = {
    "time": "time",
    "tilt": "angle",
    "inner_x": "acceleration",
    "inner_z": "acceleration",
    "outer_x": "acceleration",
    "outer_z": "acceleration",
    "ax": "acceleration",
    "az": "acceleration",
    "acceleration": "angular acceleration",
    "gimbal": "angle",
    "gimbal1": "angle",
    "gimbal2": "angle",
    "command": "rate",
    "rate": "rate",
}
"""Role -> quantity of its column.

`tilt` is the angle from the vertical, `inner_x` to `outer_z` two accelerometers as `RadialTilt` takes them, `ax` and
`az` one accelerometer: along the motion of a growing tilt, and outward (upward while upright), `acceleration` the
angular acceleration of the tilt, `gimbal` the gimbals' common angle from the spin axis' upright place (or `gimbal1` and
`gimbal2`, whose half difference it is), `command` their rate, `rate` the reference.
"""

HOW_TO_QUOTE = """; a heading with commas in it goes into quotes: --columns 'tilt="roll,x (deg)",rate=gyro'"""
_ASSIGNMENT = re.compile(
    r"""\s*(?P<role>\w+)\s*=\s*(?:"(?P<quoted>(?:[^"]|"")*)"\s*|(?P<plain>.*?))(?:,(?=\s*\w+\s*=)|$)""", re.DOTALL
)
"""ROLE=HEADING or ROLE="HEADING"; the heading ends at a comma before another ROLE=, a quoted one at its quote."""

ACCELEROMETERS = ("inner_x", "inner_z", "outer_x", "outer_z")
ONE_ACCELEROMETER = ("ax", "az")


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

    A heading with a comma before something like `x=` goes into quotes as in a CSV: `tilt="roll,x=1 (deg)"`, where a
    quote is written twice.

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
        rest, where = text.strip().lstrip(","), f"{option} {shortened(text)!r}"
        while True:
            part = _ASSIGNMENT.match(rest)
            quoted = None if part is None else part["quoted"]
            value = "" if part is None else (part["plain"] if quoted is None else quoted.replace('""', '"')).strip()
            if part is None or not value:
                raise InputError(
                    f"{option} {shortened(text)!r}: write ROLE=VALUE with commas between, such as tilt=pitch_deg"
                )
            if quoted is None and value.startswith('"'):
                raise InputError(
                    f"{where}: what begins with a quote ends with one, before a comma or at the end; a quote inside is "
                    "written twice"
                )
            role = part["role"]
            _check_part(role, option, later=len(rest) < len(text.strip()))
            if role in values:
                raise InputError(f"{option}: {role} is given twice")
            values[role] = value
            rest = rest[part.end() :]
            if not rest:
                break
    return values


def _check_part(role: str, option: str, *, later: bool) -> None:
    """Refuse an unknown role; behind a comma, one that is like no role may be part of a heading."""
    allowed = nearest(role, ROLES)
    if role not in ROLES and later and not allowed.startswith("did you mean"):
        raise InputError(f"{option} {role}: no such role; {allowed}{HOW_TO_QUOTE}")
    check_role(role, option)


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
    one = [role for role in ONE_ACCELEROMETER if role in names]
    sources = [
        text
        for text, known in (
            ("tilt", "tilt" in names),
            ("inner_x, inner_z, outer_x, outer_z", accelerometers),
            ("ax, az", one),
        )
        if known
    ]
    if len(sources) > 1:
        raise InputError(f"--columns: the tilt either as {' or from '.join(sources)}, not both")
    if accelerometers and len(accelerometers) < len(ACCELEROMETERS):
        missing = [role for role in ACCELEROMETERS if role not in names]
        raise InputError(f"--columns: of two accelerometers {', '.join(missing)} is missing")
    if len(one) == 1:
        (missing,) = set(ONE_ACCELEROMETER) - set(one)
        raise InputError(f"--columns: of one accelerometer {missing} is missing: the tilt is atan2(-ax, az)")
    if not sources:
        raise InputError(
            "--columns: there is no tilt; name one, or ax and az, or inner_x, inner_z, outer_x and outer_z"
        )
    if "acceleration" in names and accelerometers:
        raise InputError("--columns: two accelerometers show the angular acceleration; leave acceleration out")
    if ("gimbal1" in names) != ("gimbal2" in names):
        raise InputError("--columns: gimbal1 and gimbal2 go together; one gimbal is gimbal")
    if "gimbal" in names and "gimbal1" in names:
        raise InputError("--columns: either gimbal or gimbal1 and gimbal2, not both")

"""`--set section.field=value`: a setting that replaces one of the scenario file."""

from __future__ import annotations

import tomllib
from typing import Any

from cmg_mj.core.errors import InputError, TomlValue


def override(fields: dict[str, TomlValue], setting: str) -> None:
    """Replace a field of a scenario, or add it.

    Args:
        fields: The TOML file's content, which is changed.
        setting: `section.field=value`; an element of a list by its number, `push.0.torque_n_m=2.0`.

    Raises:
        InputError: It is not written so, or there is no such place.
    """
    name, equals, text = setting.partition("=")
    parts = name.strip().split(".")
    if not equals or not all(parts):
        raise InputError(f"--set {setting!r}: write section.field=value, for example plant.equilibrium_bias_deg=1.0")
    assign(fields, name.strip(), value_of(text), f"--set {setting!r}")


def value_of(text: str) -> Any:
    """Read a value as TOML has it; a bare word is a string."""
    try:
        (value,) = tomllib.loads(f"value = {text}").values()
    except (ValueError, RecursionError):  # TOMLDecodeError is a ValueError
        return text.strip()
    return value


def assign(fields: dict[str, TomlValue], name: str, value: TomlValue, setting: str) -> None:
    """Give a field of a scenario a value.

    Args:
        fields: The TOML file's content, which is changed.
        name: `section.field`; an element of a list by its number.
        value: Its value.
        setting: The setting as the user wrote it, for messages.

    Raises:
        InputError: There is no such place.
    """
    *sections, field = name.split(".")
    place: Any = fields
    for i, section in enumerate(sections):
        if isinstance(place, list) and section.isdecimal() and int(section) < len(place):
            place = place[int(section)]
        elif isinstance(place, dict) and not section.isdecimal():
            following = sections[i + 1 : i + 2]
            place = place.setdefault(section, [] if following and following[0].isdecimal() else {})
        else:
            there = f"; it has {len(place)} of them, counted from 0" if isinstance(place, list) else ""
            raise InputError(f"{setting}: there is no {'.'.join(sections[: i + 1])}{there}")
    if not isinstance(place, dict):
        example = f"{'.'.join(sections)}.0.torque_n_m=2.0" if isinstance(place, list) else "plant.timestep_s=0.0005"
        raise InputError(f"{setting}: {'.'.join(sections)} is not a section; write for example {example}")
    place[field] = value

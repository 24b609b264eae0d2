"""Parsing of a replay's options: numbers by name, and observers' parameters."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Collection, Mapping, Sequence
from typing import TypeAlias

from cmg_mj.core.errors import InputError, nearest
from cmg_mj.observers import OBSERVER_CLASSES

ParameterValue: TypeAlias = "bool | int | float | str | Sequence[ParameterValue] | None"
"""Value of an observer's parameter."""
Parameters = Mapping[str, Mapping[str, ParameterValue]]
"""Observer -> parameter -> value."""


def numbers(text: str, option: str, names: Collection[str]) -> dict[str, float]:
    """Parse `inertia=0.06,gravity_torque=3.4`.

    Args:
        text: NAME=VALUE with commas between.
        option: The option's name, for messages.
        names: The known names.

    Returns:
        Name -> finite number.

    Raises:
        InputError: The text has another form, or a name is unknown or given twice.
    """
    values: dict[str, float] = {}
    for part in text.split(","):
        name, _, value = (piece.strip() for piece in part.partition("="))
        if name not in names:
            raise InputError(f"{option} {name}: no such number; {nearest(name, names)}")
        if name in values:
            raise InputError(f"{option} {name}: given twice")
        values[name] = finite(value, f"{option} {name}")
    return values


def parameters_of(settings: Sequence[str]) -> dict[str, dict[str, ParameterValue]]:
    """Parse `--set homogeneous.k1=20`.

    Args:
        settings: Each OBSERVER.PARAMETER=VALUE.

    Returns:
        Observer -> parameter -> value, as TOML reads it.

    Raises:
        InputError: A setting has another form, or there is no such observer.
    """
    parameters: dict[str, dict[str, ParameterValue]] = {}
    for setting in settings:
        place, equals, text = setting.partition("=")
        kind, dot, name = place.strip().rpartition(".")
        if not (equals and dot and kind and name):
            raise InputError(f"--set {setting!r}: write OBSERVER.PARAMETER=VALUE, for example homogeneous.k1=20")
        OBSERVER_CLASSES.find(kind)
        try:
            (value,) = tomllib.loads(f"value = {text}").values()
        except (ValueError, RecursionError):
            raise InputError(f"--set {setting!r}: {text!r} is no number, list or text in quotes") from None
        parameters.setdefault(kind, {})[name] = value
    return parameters


def finite(text: str, where: str) -> float:
    """Read a finite number.

    Raises:
        InputError: It is none.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or abs(value) > 1e30:
        raise InputError(f"{where}={text}: must be a finite number")
    return value

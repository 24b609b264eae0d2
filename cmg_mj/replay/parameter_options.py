"""Options of a replay as texts: numbers by name, and observers' parameters."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Collection, Sequence
from typing import Any

from cmg_mj.errors import InputError, nearest
from cmg_mj.observers import OBSERVERS, observer_class


def numbers(text: str, option: str, names: Collection[str]) -> dict[str, float]:
    """`inertia=0.06,gravity_torque=3.4` -> by name.

    Args:
        text: NAME=VALUE with commas between.
        option: The option's name, for messages.
        names: Those that there are.

    Returns:
        Finite numbers.

    Raises:
        InputError: Not of this form, an unknown name, or one twice.
    """
    found: dict[str, float] = {}
    for part in text.split(","):
        name, _, value = (piece.strip() for piece in part.partition("="))
        if name not in names:
            raise InputError(f"{option} {name}: no such number; {nearest(name, names)}")
        if name in found:
            raise InputError(f"{option} {name}: given twice")
        found[name] = _finite(value, f"{option} {name}")
    return found


def parameters_of(settings: Sequence[str]) -> dict[str, dict[str, Any]]:
    """`--set homogeneous.k1=20` -> observer -> parameter -> value.

    Args:
        settings: Each OBSERVER.PARAMETER=VALUE.

    Returns:
        Values as TOML reads them.

    Raises:
        InputError: Not of this form, or no such observer.
    """
    found: dict[str, dict[str, Any]] = {}
    for setting in settings:
        place, equals, text = setting.partition("=")
        kind, dot, name = place.strip().rpartition(".")
        if not (equals and dot and kind and name):
            raise InputError(f"--set {setting!r}: write OBSERVER.PARAMETER=VALUE, for example homogeneous.k1=20")
        if ":" not in kind and kind not in OBSERVERS:
            raise InputError(f"--set {setting!r}: no such observer; {nearest(kind, OBSERVERS)}")
        observer_class(kind)
        try:
            (value,) = tomllib.loads(f"value = {text}").values()
        except (ValueError, RecursionError):
            raise InputError(f"--set {setting!r}: {text!r} is no number, list or text in quotes") from None
        found.setdefault(kind, {})[name] = value
    return found


def _finite(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or abs(value) > 1e30:
        raise InputError(f"{where}={text}: must be a finite number")
    return value

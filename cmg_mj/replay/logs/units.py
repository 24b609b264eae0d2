"""Units of columns, given or at the end of a heading (`pitch_deg`, `Gyro [deg/s]`), and their SI sizes."""

from __future__ import annotations

import math
import re
from typing import Literal

from cmg_mj.core.types import STANDARD_GRAVITY
from cmg_mj.errors import InputError, nearest

Quantity = Literal["angle", "rate", "angular acceleration", "acceleration", "time"]

_DEG, _TURN = math.pi / 180.0, 2.0 * math.pi

UNITS: dict[Quantity, dict[str, float]] = {
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": _DEG, "mdeg": 1e-3 * _DEG, "rev": _TURN},
    "rate": {
        "rad_s": 1.0,
        "mrad_s": 1e-3,
        "deg_s": _DEG,
        "dps": _DEG,
        "mdps": 1e-3 * _DEG,
        "rpm": _TURN / 60.0,
        "rev_s": _TURN,
    },
    "angular acceleration": {"rad_s2": 1.0, "deg_s2": _DEG},
    "acceleration": {
        "m_s2": 1.0,
        "mm_s2": 1e-3,
        "g": STANDARD_GRAVITY,
        "mg": 1e-3 * STANDARD_GRAVITY,
        "ug": 1e-6 * STANDARD_GRAVITY,
    },
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
}
"""Quantity -> unit -> its size in rad, rad/s, rad/s^2, m/s^2 or s. The first of each is that."""

_SPELLINGS = {
    "rad": "radian radians",
    "deg": "° degree degrees",
    "rad_s": "rads rps radps rad_sec",
    "deg_s": "degs degps deg_sec °_s",
    "rad_s2": "rad_ss",
    "deg_s2": "°_s2",
    "m_s": "mps",
    "m_s2": "ms2 mps2 m_ss",
    "s": "sec secs second seconds",
    "ms": "msec millis",
    "us": "usec µs μs micros",
    "ns": "nsec nanos",
}
"""Unit -> its other spellings."""
_UNIT_OF_SPELLING = {spelling: unit for unit, others in _SPELLINGS.items() for spelling in others.split()}


def _plain(text: str) -> str:
    """Spell `Deg/s^2`, `deg.s-2` and `deg_s2` alike."""
    text = text.strip().lower().replace("²", "2").replace("^", "").replace("**", "")
    text = re.sub(r"[\s./*·]+", "_", text).replace("_s-1", "_s").replace("_s-2", "_s2").strip("_")
    return _UNIT_OF_SPELLING.get(text, text)


def unit(quantity: Quantity, text: str, where: str) -> str:
    """Return the name in `UNITS` of a unit as a user writes it.

    Args:
        quantity: The measured quantity.
        text: `deg`, `deg/s`, `rad_s`.
        where: The option, for the message.

    Returns:
        The name.

    Raises:
        InputError: It is no unit of this quantity.
    """
    name = _plain(text)
    if name not in UNITS[quantity]:
        raise InputError(f"{where}: {text!r} is no unit of {_an(quantity)}; {nearest(name, UNITS[quantity])}")
    return name


def unit_of_name(quantity: Quantity, name: str) -> str | None:
    """Return the unit that a column's name ends in, after `_`, a space, or in brackets; None if it ends in none.

    A name that is a unit and nothing else, such as `ms`, is one too.
    """
    bracketed = re.search(r"[\[({]([^\[\](){}]+)[\])}]\s*$", name)
    if bracketed:
        unit = _plain(bracketed[1])
        return unit if unit in UNITS[quantity] else None
    whole = _plain(re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name))
    parts = whole.split("_")
    for start in range(len(parts)):  # the longest first: deg_s before s
        unit = _plain("_".join(parts[start:]))
        if unit in UNITS[quantity]:
            return unit
    return None


def in_si(quantity: Quantity, unit: str) -> float:
    """Return the size of a unit in rad, rad/s, rad/s^2, m/s^2 or s."""
    return UNITS[quantity][unit]


def unit_of_factor(quantity: Quantity, unit: str, factor: float, near: tuple[float, float]) -> str | None:
    """Return the unit that makes numbers, given in another unit, larger by a factor.

    Args:
        quantity: The measured quantity.
        unit: The given unit.
        factor: The factor.
        near: Tolerance of the factor, as two factors.

    Returns:
        The nearest unit; None if there is none but the given one.
    """
    size = in_si(quantity, unit)
    misses = {name: factor * size / other for name, other in UNITS[quantity].items() if other != size}
    fits = {name: abs(math.log(miss)) for name, miss in misses.items() if near[0] <= miss <= near[1]}
    return min(fits, key=fits.__getitem__) if fits else None


def _an(quantity: str) -> str:
    return f"an {quantity}" if quantity[0] in "aeiou" else f"a {quantity}"

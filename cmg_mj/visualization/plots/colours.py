"""Colours of observers and baselines: the same in recordings, in plots of a run and in plots of a comparison.

`colour("ltv")` is (69, 148, 253); matplotlib takes `hexadecimal(colour("ltv"))`. The names are those of observers, of
the signals `true` and `gyro`, and of the baselines of tables (`cmg_mj/results/baselines.py`). Every colour stands out
on the viewer's dark ground and on white paper. A test measures how well each kind of colour blindness separates them.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable

Colour = tuple[int, int, int]

COLOURS: dict[str, Colour] = {
    "linear": (70, 178, 124),
    "ltv": (69, 144, 254),
    "homogeneous": (252, 95, 0),
    "luenberger": (255, 138, 186),
    "kalman": (129, 68, 110),
    "gyro_free": (69, 131, 155),
    "free_pivot": (172, 99, 90),
    "finite_difference": (176, 25, 9),
    "super_twisting": (43, 60, 254),
    "linear_high_gain": (177, 178, 253),
    "high_gain": (148, 41, 182),
    "adaptive": (243, 50, 197),
    "homogeneous_adaptive": (230, 178, 32),
}
"""The bundled observers. Observers that are often among the best are no shades of one colour."""

BASELINE_COLOURS: dict[str, Colour] = {
    "true": (165, 165, 165),
    "gyro": (95, 130, 190),
    "zero": (120, 120, 120),
    "mems_as_bought": (156, 154, 46),
    "mems_gyro": (6, 109, 61),
    "mems_fused": (12, 191, 110),
    "floor_y1": (133, 179, 209),
    "floor_accel": (143, 83, 167),
}
"""The signals that observers are compared with."""

BOUND_COLOURS: dict[str, Colour] = {
    "settle band": (0, 140, 100),
    "rate limit": (205, 90, 100),
}
"""Bounds that signals are held against: green like the phase `settled`, red like the one of a run that is lost."""

USER_COLOURS: tuple[Colour, ...] = ((91, 85, 128), (47, 157, 113), (236, 15, 72), (212, 88, 142))
"""Observers of users: the name decides which."""


def colour(name: str) -> Colour:
    """Return the colour of one observer.

    Args:
        name: A bundled observer, a user's observer by its dotted path, or one of `BASELINE_COLOURS`.

    Returns:
        Red, green, blue, 0 to 255; for the same name always the same.
    """
    return colours([name])[name]


def colours(names: Iterable[str]) -> dict[str, Colour]:
    """Choose the colours of observers that one figure shows.

    Args:
        names: The observers.

    Returns:
        Name -> colour, in the order of `names`: `colour(name)`, unless an earlier user's observer has that colour.
    """
    known = COLOURS | BASELINE_COLOURS
    palette: dict[str, Colour] = {}
    for name in names:
        first = zlib.crc32(name.encode()) % len(USER_COLOURS)
        choices = [*USER_COLOURS[first:], *USER_COLOURS[:first]]
        palette.setdefault(name, known.get(name) or next((c for c in choices if c not in palette.values()), choices[0]))
    return palette


def hexadecimal(rgb: Colour) -> str:
    """Write a colour as `#rrggbb`."""
    return "#{:02x}{:02x}{:02x}".format(*rgb)

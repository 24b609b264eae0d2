"""Which colour an observer has: the same in recordings, in plots of a run and in plots of a comparison.

`colour("ltv")` is (69, 148, 253), and `hexadecimal(colour("ltv"))` is what matplotlib takes. Names are those of the
observers; `true`, `gyro` and the baselines of tables (`cmg_mj/results/baselines.py`) are what they are compared
with. All can be seen on the viewer's dark ground and on white paper, and told apart with each kind of colour blindness:
a test says how well.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable

Colour = tuple[int, int, int]

COLOURS: dict[str, Colour] = {
    "linear": (49, 171, 105),
    "ltv": (69, 148, 253),
    "homogeneous": (251, 96, 0),
    "luenberger": (255, 134, 181),
    "kalman": (110, 83, 99),
    "gyro_free": (66, 132, 146),
    "finite_difference": (179, 45, 0),
    "super_twisting": (44, 61, 254),
    "linear_high_gain": (177, 179, 252),
    "high_gain": (148, 42, 178),
    "adaptive": (243, 54, 196),
    "homogeneous_adaptive": (231, 180, 33),
}
"""The bundled observers. Those that are often among the best are no shades of one colour."""

BASELINE_COLOURS: dict[str, Colour] = {
    "true": (165, 165, 165),
    "gyro": (95, 130, 190),
    "zero": (120, 120, 120),
    "mems_gyro": (6, 109, 61),
    "floor_y1": (133, 179, 209),
    "floor_accel": (143, 83, 167),
}
"""What observers are compared with."""

USER_COLOURS: tuple[Colour, ...] = ((96, 84, 120), (51, 213, 119), (219, 6, 76), (216, 77, 151))
"""Observers that are not bundled: the name decides which."""


def colour(name: str) -> Colour:
    """The colour of one observer.

    Args:
        name: A bundled observer, a user's own by its dotted path, or one of `BASELINE_COLOURS`.

    Returns:
        Red, green, blue, 0 to 255; for the same name always the same.
    """
    return colours([name])[name]


def colours(names: Iterable[str]) -> dict[str, Colour]:
    """The colours of observers that are shown together.

    Args:
        names: The observers.

    Returns:
        Name -> colour, in the order given: `colour(name)`, unless a user's own that comes before has that one.
    """
    known = COLOURS | BASELINE_COLOURS
    found: dict[str, Colour] = {}
    for name in names:
        first = zlib.crc32(name.encode()) % len(USER_COLOURS)
        own = [*USER_COLOURS[first:], *USER_COLOURS[:first]]
        found.setdefault(name, known.get(name) or next((c for c in own if c not in found.values()), own[0]))
    return found


def hexadecimal(rgb: Colour) -> str:
    """A colour as `#rrggbb`."""
    return "#{:02x}{:02x}{:02x}".format(*rgb)

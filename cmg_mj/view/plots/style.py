"""The common ground of all figures: colours, short names, the observers to draw, thinned signals.

`colour("ltv")` is (69, 144, 254); matplotlib takes `hexadecimal(colour("ltv"))`. The names are those of observers, of
the signals `true` and `gyro`, and of the baselines of tables (`cmg_mj/results/baselines.py`). Every colour stands out
on the viewer's dark ground and on white paper. A test measures how well each kind of colour blindness separates them.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from cmg_mj.results.summary_keys import SummaryValue

Colour = tuple[int, int, int]

COLOURS: dict[str, Colour] = {
    "linear": (70, 178, 124),
    "ltv": (69, 144, 254),
    "homogeneous": (252, 95, 0),
    "luenberger": (255, 138, 186),
    "kalman": (129, 68, 110),
    "gyro_free": (69, 131, 155),
    "free_pivot": (172, 99, 90),
    "mems_fused": (72, 42, 132),
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

Summary = Mapping[str, SummaryValue]
"""The numbers of a run by the names that `--json` prints."""

FEW = 3
"""Number of observers that a reader can follow over each other."""

RANKING_KEYS = ("velocity_rms_error_push_rad_s", "velocity_rms_error_rad_s")
"""Keys that rank observers: the first one that a summary has. Most of a whole run is stillness."""

LONG, DRAWN = 32768, 8000
"""Number of samples of a signal that is thinned, and how many are left: several for each pixel across a plot."""


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


def short_names(names: Sequence[str]) -> dict[str, str]:
    """Shorten the names of observers for legends and tables.

    Args:
        names: The observers that one figure or table shows.

    Returns:
        Name -> the class of a dotted path, unless two classes have one name; otherwise the name itself.
    """
    short = [name.rpartition(":")[2] or name for name in names]
    return {name: part if short.count(part) == 1 else name for name, part in zip(names, short, strict=True)}


def observers_to_draw(summaries: Mapping[str, Summary], always: Iterable[str] = ()) -> list[str]:
    """Choose the observers to draw when there are too many.

    Args:
        summaries: Observer -> its summary. An observer whose summary has `fell` ranks last.
        always: Observers to draw in any case.

    Returns:
        At most `FEW` names (more only if `always` has more), in the order of `summaries`: those with the smallest
        errors. Baselines are among them only if there are too few observers.
    """
    always = list(always)
    rest = sorted((name for name in summaries if name not in always), key=lambda name: _rank(name, summaries[name]))
    chosen = {*always, *rest[: max(0, FEW - len(always))]}
    return [name for name in summaries if name in chosen]


def _rank(name: str, summary: Summary) -> tuple[bool, bool, float]:
    error = next((value for key in RANKING_KEYS if isinstance(value := summary.get(key), (int, float))), math.inf)
    return name in BASELINE_COLOURS, bool(summary.get("fell")), error if math.isfinite(error) else math.inf


def thinned(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Select the samples that make the outline of a signal: the lowest and the highest of each short span of time.

    Args:
        time: Times, (n,) [s].
        values: Values, (n,).

    Returns:
        Times and values.
    """
    if len(time) <= LONG:
        return time, values
    width = -(-2 * len(time) // DRAWN)
    n_spans = len(time) // width
    spans = values[: n_spans * width].reshape(n_spans, width)
    lowest = np.argmin(np.where(np.isnan(spans), np.inf, spans), axis=1)
    highest = np.argmax(np.where(np.isnan(spans), -np.inf, spans), axis=1)
    pairs = np.sort([lowest, highest], axis=0) + width * np.arange(n_spans)
    rest = np.arange(n_spans * width, len(time))
    rows = np.unique(np.concatenate([[0], pairs.T.ravel(), rest, [len(time) - 1]]))
    return time[rows], values[rows]

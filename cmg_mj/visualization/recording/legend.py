"""The names, colours and ranks of the runs of a recording, and of the observers of a run."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import rerun as rr

from cmg_mj.visualization.plots.colours import Colour, colours
from cmg_mj.visualization.plots.readability import Summary, observers_to_draw, short_names


@dataclass(frozen=True)
class LegendEntry:
    """A run or an observer as a recording names it.

    Attributes:
        name: The name.
        part: Its part of an entity path.
        label: The shortened name.
        color: Its colour.
        is_best: Whether it is switched on at first.
    """

    name: str
    part: str
    label: str
    color: Colour
    is_best: bool


def legend(figures: Mapping[str, Summary], always: Collection[str] = ()) -> list[LegendEntry]:
    """Make the legend of runs or observers.

    Args:
        figures: Name -> its numbers, which rank it.
        always: Names that are switched on in any case.

    Returns:
        An entry for each, in the order of `figures`.
    """
    names = list(figures)
    best, labels = observers_to_draw(figures, always), short_names(names)
    places = zip(numbered_parts(names), colours(names).items(), strict=True)
    return [LegendEntry(name, part, labels[name], color, name in best) for part, (name, color) in places]


def numbered_parts(names: Sequence[str]) -> list[str]:
    """Make parts of entity paths; each of several gets a number before its name, because the viewer sorts by path."""
    digits = len(str(len(names)))
    return [
        rr.escape_entity_path_part(f"{i:0{digits}}_{name}" if len(names) > 1 else name)
        for i, name in enumerate(names, 1)
    ]

"""The instants of a run at which something is due, and what acts on the plant from outside between them."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import NamedTuple, Protocol

from cmg_mj.core.arrays import Scalar


class Outside(NamedTuple):
    """What acts on the plant until the next instant."""

    torques: Sequence[Scalar]
    """About each axis, one for all worlds or (n_worlds,) [N m]."""
    acceleration: Sequence[Scalar] | None = None
    """The pivot's: x, y, z, likewise; None: it stays what it was, at first zero [m/s^2]."""


class Disturbance(Protocol):
    """Something that acts from outside."""

    @property
    def edges(self) -> Collection[int]:
        """Physics steps that become instants."""
        ...

    @property
    def accelerates(self) -> bool:
        """Whether it accelerates the pivot: gravity of the plant's model then changes."""
        ...

    def __call__(self, step: int, steps: int, outside: Outside) -> Outside:
        """Add what acts from a physics step on, held or averaged for so many steps, until the next instant.

        Torques that stay are the same sequence.
        """
        ...


def instants(end: int, grid: int, edges: Iterable[int] = ()) -> Iterator[tuple[int, int]]:
    """Find the physics steps at which a sensor or the controller is due, or a disturbance has an edge.

    Args:
        end: Number of the last step's end.
        grid: Physics steps between the instants at which a sensor or the controller may be due.
        edges: Steps that are instants beside.

    Yields:
        The step, and the steps until the next instant.
    """
    ends = sorted({0, end, *(step for step in edges if step <= end)})
    for start, stop in itertools.pairwise(ends):
        first = min(-(-start // grid) * grid, stop)  # the first of the grid not before the edge
        if first > start:
            yield start, first - start
        last = max(stop // grid * grid, first)
        for step in range(first, last, grid):
            yield step, grid
        if last < stop:
            yield last, stop - last

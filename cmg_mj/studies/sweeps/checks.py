"""Checks of a study's numbers, names and fields, from the command line, a study file or Python."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TypeGuard

import numpy as np

from cmg_mj.errors import InputError, nearest, shown
from cmg_mj.observers import OBSERVERS
from cmg_mj.results.baselines import RATES
from cmg_mj.simulation.batch import UNUSED
from cmg_mj.studies.sweeps.axes import VariedField

NOT_VARIED = {
    "seed": "worlds differ in it already: --worlds says how many, --seed which",
    "observer": "--observers names them",
    "observer.kind": "--observers names them",
    "open_loop_observers": "a sweep runs without them; --observers puts each in the loop",
    **dict.fromkeys(sorted(UNUSED), "no trial depends on it"),
}
"""Fields that a sweep does not vary, and why. Fields below them are not varied either, but for an observer's own."""


def listed_names(names: Iterable[str], argument: str) -> tuple[str, ...]:
    """Make a list of names that Python gave into a tuple.

    Raises:
        InputError: It is no list.
    """
    if isinstance(names, str) or not isinstance(names, Iterable):
        raise InputError(f"{argument} = {shown(names)}: must be a list of observers' names, such as ['linear', 'ltv']")
    return tuple(names)


def check_axes(axes: Sequence[VariedField], design: str) -> None:
    """Check that something is varied, each field once, so that it makes a difference, and that a range is sampled."""
    if not axes:
        raise InputError("--vary: nothing is varied; give a field, such as --vary plant.equilibrium_bias_deg=0,0.5")
    fields = [field for axis in axes for field in axis.fields]
    twice = next((field for i, field in enumerate(fields) if field in fields[:i]), None)
    if twice is not None:
        raise InputError(f"--vary {twice}: given twice")
    for field in fields:
        section = field.partition(".")[0]
        why = NOT_VARIED.get(field) or (None if section == "observer" else NOT_VARIED.get(section))
        if why is not None:
            raise InputError(f"--vary {field}: is not varied: {why}")
    for axis in axes:
        if axis.is_range and design == "grid":
            raise InputError(
                f"--vary {axis.field}: a range without a count is for --sample and --sobol; write first:last:count"
            )


def check_worlds(worlds: int) -> None:
    """Check that there is one at least."""
    if not _counts(worlds):
        raise InputError(f"worlds = {shown(worlds)}: must be a whole number, 1 or more")


def check_points(design: str, n: int, axes: int) -> None:
    """Check a design's number of points: for indices as many as Saltelli's scheme wants, none for a grid."""
    if design == "grid":
        if n != 0:
            raise InputError(f"n = {shown(n)}: is for the designs sample and sobol; a grid is every combination")
        return
    if design == "sample" and not _counts(n):
        raise InputError(f"--sample, n = {shown(n)}: must be a whole number of points, 1 or more")
    if design == "sobol":
        if not _counts(n) or n < 2 or n & (n - 1):
            near = 2 ** max(1, round(math.log2(max(n, 2)))) if _is_whole(n) else 256
            raise InputError(f"--sobol {shown(n)}: must be a power of two, such as {near}")
        if axes < 2:
            raise InputError(
                "--sobol: indices compare several fields; vary two or more (fields with + between count as one)"
            )


def check_observers(observers: Sequence[str]) -> None:
    """Check that observers exist, as far as is known without importing them, and are there once."""
    if not observers:
        raise InputError("observers: there must be one at least")
    for i, name in enumerate(observers):
        if not isinstance(name, str):
            raise InputError(f"observers: {shown(name)}: must be an observer's name")
        if ":" not in name and name not in (*OBSERVERS, *RATES):
            known = nearest(name, [*OBSERVERS, *RATES])
            raise InputError(f"observers: {name!r}: no such observer; {known}, or your own as package.module:Class")
        if name in observers[:i]:
            raise InputError(f"observers: {name!r} is there twice")


def check_order(order: Sequence[str], observers: Sequence[str]) -> None:
    """Check that an order is one of observers that run here."""
    option = f"--order {','.join(map(str, order))}"
    if any(not isinstance(name, str) for name in order):
        raise InputError(f"{option}: must be observers' names, the best first")
    if len(order) < 2 or len(set(order)) < len(order):
        raise InputError(f"{option}: write two observers or more, each once, the best first")
    for name in order:
        if name not in observers:
            raise InputError(f"{option}: {name} does not run here; --observers are {', '.join(observers)}")


def _counts(number: float | str | None) -> bool:
    return _is_whole(number) and number >= 1


def _is_whole(number: float | str | None) -> TypeGuard[int]:
    return isinstance(number, (int, np.integer)) and not isinstance(number, bool)

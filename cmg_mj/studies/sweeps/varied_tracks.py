"""Tracks of the pivot that a study varies: where they lie, and which files they are."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from cmg_mj.scenario.loading import find_track
from cmg_mj.studies.sweeps.axes import FieldValue, VariedField

FILE = re.compile(r"pivot\.\d+\.file")
PIVOT = re.compile(r"pivot(\.\d+)?")


def locate_tracks(axis: VariedField, beside: Path) -> VariedField:
    """Give the tracks that an axis varies whole paths.

    Args:
        axis: The axis; of other fields it stays.
        beside: The folder of the study file or of the scenario, from which a path may start.
    """
    for field in axis.fields:
        change = partial(_replace_tracks, field, change=lambda file: find_track(file, beside))
        axis = replace(axis, values=tuple(change(value) for value in axis.values))
    return axis


def varied_tracks(axis: VariedField) -> Iterator[tuple[str, str]]:
    """List the tracks that an axis varies, each with its field."""
    for field in axis.fields:
        for value in axis.values:
            files: list[str] = []
            _replace_tracks(field, value, change=lambda file, files=files: files.append(file) or file)
            yield from ((field, file) for file in files)


def _replace_tracks(field: str, value: FieldValue, change: Callable[[str], str]) -> FieldValue:
    """Change the paths of tracks in a value: of a file, of a motion, or of all motions."""
    if FILE.fullmatch(field):
        return change(str(value))
    if not PIVOT.fullmatch(field) or isinstance(value, str):
        return value
    if isinstance(value, Mapping):
        file = value.get("file")
        return {**value, "file": change(file)} if isinstance(file, str) else value
    if isinstance(value, Sequence):
        return [_replace_tracks(field, motion, change) for motion in value]
    return value

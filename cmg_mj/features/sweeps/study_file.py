"""A study file: a scenario, a [vary] table, and the observers."""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypedDict, get_args

from cmg_mj.core.errors import InputError, TomlValue, nearest
from cmg_mj.features.sweeps.study import FieldValue, SamplingDesign, VariedField, parse_axis
from cmg_mj.inputs.files import bundled, find, whole_path
from cmg_mj.inputs.overrides import override
from cmg_mj.scenario.loading import find_files, find_model, load_scenario, parse_scenario
from cmg_mj.scenario.schema import Scenario

SECTIONS = ("sweep", "vary", "scenario")
SWEEP_TYPES = {"observers": list, "worlds": int, "design": str, "n": int}
"""Types of the fields of [sweep]."""


class SweepFields(TypedDict, total=False):
    """The fields of [sweep]."""

    observers: list[str]
    worlds: int
    design: str
    n: int


class StudyFile(TypedDict, total=False):
    """The sections of a study file."""

    sweep: SweepFields
    vary: dict[str, FieldValue]
    scenario: str | dict[str, TomlValue]


def study_file(name: str) -> StudyFile | None:
    """Read a study file; None of a scenario.

    Raises:
        InputError: The file is neither.
    """
    path = find("scenarios", name, ".toml", "scenario")
    if path.stem in bundled("scenarios"):
        return None
    try:
        fields = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError):
        return None  # as a scenario it is refused with what is wrong
    if "vary" not in fields and "sweep" not in fields:
        return None
    for section in fields:
        if section not in SECTIONS:
            raise InputError(f"{name}: {section}: no section of a study file; {nearest(section, SECTIONS)}")
    for section in ("vary", "sweep"):
        if not isinstance(fields.get(section, {}), dict):
            raise InputError(f"{name}: {section}: must be a table")
    for key, value in fields.get("sweep", {}).items():
        if key not in SWEEP_TYPES:
            raise InputError(f"{name}: sweep.{key}: no such field; {nearest(key, SWEEP_TYPES)}")
        if type(value) is not SWEEP_TYPES[key]:
            raise InputError(f"{name}: sweep.{key} = {value!r}: must be of type {SWEEP_TYPES[key].__name__}")
    return StudyFile(**fields)


def scenario_of(name: str, fields: StudyFile, settings: Sequence[str] = ()) -> Scenario:
    """Load a study file's scenario, a table or a name, with settings `section.field=value` that replace its own."""
    scenario_fields = fields.get("scenario")
    if isinstance(scenario_fields, str):
        return load_scenario(scenario_fields, settings)
    if not isinstance(scenario_fields, dict):
        raise InputError(f"{name}: scenario: must be there, as a table or as a scenario's name")
    changed = copy.deepcopy({key: value for key, value in scenario_fields.items() if key != "versions"})
    for setting in settings:
        override(changed, setting)
    where = " ".join([name, *(["with"] if settings else []), *(f"--set {setting}" for setting in settings)])
    scenario = parse_scenario(changed, where)
    beside = find("scenarios", name, ".toml", "scenario").parent
    if not any(setting.partition("=")[0].strip() == "plant.model" for setting in settings):
        scenario = find_model(scenario, beside)
    return find_files(scenario, beside)


def axes_of(name: str, fields: StudyFile) -> list[VariedField]:
    """Read a study file's [vary]."""
    return [parse_axis(field, value, f"{name}: vary.{field}") for field, value in fields.get("vary", {}).items()]


def design_of(name: str, fields: SweepFields) -> tuple[SamplingDesign, int]:
    """Read a study file's design, and how many points it has."""
    text = fields.get("design", "grid")
    designs: tuple[SamplingDesign, ...] = get_args(SamplingDesign)
    for design in designs:
        if text == design:
            return design, fields.get("n", 0)
    raise InputError(f"{name}: sweep.design = {text!r}: must be one of {', '.join(designs)}")


FILE = re.compile(r"pivot\.\d+\.file")
PIVOT = re.compile(r"pivot(\.\d+)?")


def locate_tracks(axis: VariedField, beside: Path) -> VariedField:
    """Give the tracks that an axis varies whole paths.

    Args:
        axis: The axis; of other fields it stays.
        beside: The folder of the study file or of the scenario, from which a path may start.
    """
    for field in axis.fields:
        change = partial(_replace_tracks, field, change=lambda file: whole_path(file, beside))
        axis = replace(axis, values=tuple(change(value) for value in axis.values))
    return axis


def varied_tracks(axis: VariedField) -> list[str]:
    """List the tracks that an axis varies."""
    files: list[str] = []
    for field in axis.fields:
        for value in axis.values:
            _replace_tracks(field, value, change=lambda file: files.append(file) or file)
    return files


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

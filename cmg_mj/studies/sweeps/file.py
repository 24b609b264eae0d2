"""A study file: a scenario, a [vary] table, and who is to run."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

from cmg_mj.errors import InputError, nearest
from cmg_mj.inputs.bundled import bundled, find
from cmg_mj.inputs.overrides import override
from cmg_mj.scenario.loading import find_model, load_scenario, parse_scenario
from cmg_mj.scenario.schema import Scenario
from cmg_mj.studies.sweeps.axes import VariedField, parse_axis
from cmg_mj.studies.sweeps.study import SamplingDesign

SECTIONS = ("sweep", "vary", "scenario")
ASKED = {"observers": list, "worlds": int, "design": str, "n": int, "order": list}


def study_file(name: str) -> dict[str, Any] | None:
    """The content of a study file; None of what is a scenario.

    Raises:
        InputError: It is neither.
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
        if key not in ASKED:
            raise InputError(f"{name}: sweep.{key}: no such field; {nearest(key, ASKED)}")
        if type(value) is not ASKED[key]:
            raise InputError(f"{name}: sweep.{key} = {value!r}: must be of type {ASKED[key].__name__}")
    return fields


def scenario_of(name: str, fields: Mapping[str, Any], settings: Sequence[str] = ()) -> Scenario:
    """A study file's scenario, a table or a name, with settings `section.field=value` that replace its own."""
    given = fields.get("scenario")
    if isinstance(given, str):
        return load_scenario(given, settings)
    if not isinstance(given, dict):
        raise InputError(f"{name}: scenario: must be there, as a table or as a scenario's name")
    changed = copy.deepcopy({key: value for key, value in given.items() if key != "versions"})
    for setting in settings:
        override(changed, setting)
    where = " ".join([name, *(["with"] if settings else []), *(f"--set {setting}" for setting in settings)])
    scenario = parse_scenario(changed, where)
    if any(setting.partition("=")[0].strip() == "plant.model" for setting in settings):
        return scenario
    return find_model(scenario, find("scenarios", name, ".toml", "scenario").parent)


def axes_of(name: str, fields: Mapping[str, Any]) -> list[VariedField]:
    """A study file's [vary]."""
    return [parse_axis(field, said, f"{name}: vary.{field}") for field, said in fields.get("vary", {}).items()]


def design_of(name: str, asked: Mapping[str, Any]) -> tuple[SamplingDesign, int]:
    """A study file's design, and how many points it has."""
    design: Any = asked.get("design", "grid")
    known: Sequence[str] = ("grid", "sample", "sobol")
    if design not in known:
        raise InputError(f"{name}: sweep.design = {design!r}: must be one of {', '.join(known)}")
    return design, asked.get("n", 0)

"""TOML -> a scenario, every field checked."""

from __future__ import annotations

import dataclasses
import json
import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from cmg_mj.controllers.laws.registry import LAWS, OF_LAWS
from cmg_mj.errors import InputError, nearest
from cmg_mj.inputs.bundled import bundled, find, folder
from cmg_mj.inputs.messages import complaint
from cmg_mj.inputs.overrides import override
from cmg_mj.inputs.sanity import out_of_size, unreadable
from cmg_mj.inputs.user_classes import as_json
from cmg_mj.scenario.schema import COMMON_LAW_FIELDS, AxisSettings, ControllerSettings, ObserverSettings, Scenario

LARGEST_FILE = 1_000_000
"""Bytes of a scenario file; the longest that a run writes has three thousand."""
MOST_PARTS = 100
_PART = r"""(?:"[^"\n]*+"|'[^'\n]*+'|[\w-]++)[ \t]*+\.[ \t]*+"""
_ENDLESS_KEY = re.compile(rf"(?<![\w-])(?:{_PART}){{{MOST_PARTS}}}")  # tomllib takes a minute over 50,000 parts
MOST_CLAUSES = 20
"""So many wrong fields are named in one line."""


def load_scenario(name: str, overrides: Iterable[str] = (), observer: str | None = None) -> Scenario:
    """Read a scenario.

    Args:
        name: A bundled scenario's name, or the path of a TOML file.
        overrides: Settings `section.field=value` that replace those of the file.
        observer: An observer instead of the file's, whose parameters then do not count; `overrides` come after it.

    Returns:
        The scenario, its fields checked.

    Raises:
        InputError: The file does not exist, is no TOML, or has a field that is unknown or not allowed.
    """
    path = find("scenarios", name, ".toml", "scenario")
    fields = _read(path, name)
    if path.stem in bundled("scenarios"):
        fields.setdefault("based_on", path.stem)
    changes = []
    if observer is not None:
        changes.append(f"--observer {observer}")
        _take_observer(fields, observer)
    law, overrides = _kind_of(fields, "controller"), list(overrides)  # they are gone through twice
    for setting in overrides:
        changes.append(f"--set {setting}")
        override(fields, setting)
    if _kind_of(fields, "controller") != law:
        _drop_gains(fields, overrides)
    where = " ".join([name, *(["with"] if changes else []), *changes])
    scenario = parse_scenario(fields, where)
    if not any(setting.partition("=")[0].strip() == "plant.model" for setting in overrides):
        scenario = find_model(scenario, path.parent)
    return scenario


def _take_observer(fields: dict[str, Any], observer: str) -> None:
    """Another observer instead of the file's, on all axes; parameters that are another's go."""
    common = _kind_of(fields, "observer")
    axes = fields.get("axes")
    for own in axes.values() if isinstance(axes, dict) else ():
        section = own.get("observer") if isinstance(own, dict) else None
        if isinstance(section, dict) and section.get("kind", common) != observer:
            own.pop("observer")
    if common != observer or not isinstance(fields.get("observer", {}), dict):
        fields["observer"] = {"kind": observer}


def _drop_gains(fields: dict[str, Any], overrides: Iterable[str]) -> None:
    """The file's gains are its law's: another law, which --set names, does without unless --set gives it some."""
    given = [setting.partition("=")[0].strip() for setting in overrides]
    for name in ("gains", "lqr"):
        if not any(f"{field}.".startswith(f"controller.{name}.") for field in given):
            fields["controller"].pop(name, None)


def _kind_of(fields: Mapping[str, Any], section: str) -> Any:
    """The kind of observer or law that a file names, or the default."""
    usual = {"observer": ObserverSettings().kind, "controller": ControllerSettings().kind}[section]
    given = fields.get(section)
    return given.get("kind", usual) if isinstance(given, Mapping) else usual


def _read(path: Path, name: str) -> dict[str, Any]:
    """The content of a TOML file."""
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise InputError(f"{name}: larger than {LARGEST_FILE // 1000} kB, which no scenario is")
        text = path.read_text(encoding="utf-8-sig")
        if text.lstrip().startswith("<"):
            raise InputError(f"{name}: is XML, not a scenario; a scenario names its model with plant.model")
        if _ENDLESS_KEY.search(text):
            raise InputError(f"{name}: not valid TOML: a key of more than {MOST_PARTS} parts")
        return tomllib.loads(text)
    except UnicodeDecodeError as error:
        raise InputError(f"{name}: not valid TOML: not UTF-8 text (at byte {error.start})") from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{name}: not valid TOML: {error}") from error
    except RecursionError as error:
        raise InputError(f"{name}: not valid TOML: brackets in one another without end") from error
    except OSError as error:
        raise InputError(f"{name}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{name}: not valid TOML: a number of too many digits, or no date") from error


def base_of(scenario: Scenario) -> Scenario | None:
    """The bundled scenario that one is told apart from, if there is one."""
    if scenario.based_on not in bundled("scenarios"):
        return None
    return load_scenario(str(folder("scenarios") / f"{scenario.based_on}.toml"))


def find_model(scenario: Scenario, beside: Path) -> Scenario:
    """The same with the path of its model, which a scenario file names relative to itself."""
    try:
        model = find("models", scenario.plant.model, ".xml", "plant.model =", beside)
    except InputError as error:
        raise InputError(f"{scenario._source}: {error}") from error
    return scenario.model_copy(update={"plant": dataclasses.replace(scenario.plant, model=str(model))})


def parse_scenario(fields: Mapping[str, Any], where: str = "") -> Scenario:
    """Check a scenario given as a mapping.

    Args:
        fields: The TOML file's content.
        where: What to call it in an error.

    Returns:
        The scenario.

    Raises:
        InputError: A field is unknown or not allowed. All wrong fields are named, on one line.
    """
    wrong = list(unreadable(fields))
    if wrong:
        raise InputError(with_source(where, _clauses(wrong)))
    try:
        # By way of JSON, pydantic takes a list for a tuple and still no text or true for a number.
        scenario = Scenario.model_validate_json(json.dumps(fields, default=as_json), strict=True)
    except ValidationError as error:
        complaints = [complaint(Scenario, detail, fields) for detail in error.errors()]
        raise InputError(with_source(where, _clauses([*complaints, *_unknown_to_law(fields)]))) from error
    wrong = [*_unknown_to_law(fields), *out_of_size(fields)]
    if wrong:
        raise InputError(with_source(where, _clauses(wrong)))
    scenario._source = where
    for axis in scenario.axes:
        scenario_of_axis(scenario, axis)
    return scenario


def scenario_of_axis(scenario: Scenario, axis: str) -> Scenario:
    """A scenario as one axis of several has it.

    Args:
        scenario: Of the whole rig.
        axis: The axis' name.

    Returns:
        The scenario with what [axes.NAME] gives it in the place of what holds for all. Where that names another
        observer or law, no parameter of the common one is left.

    Raises:
        InputError: A field is unknown or not allowed.
    """
    own = scenario.axes.get(axis)
    if own is None:
        return scenario.model_copy(update={"axes": {}})
    fields = as_fields(scenario.model_copy(update={"axes": {}}))
    where = f"{scenario._source}, [axes.{axis}]".removeprefix(", ")
    for whole in ("rate_hz", "compensate_turning"):
        if whole in own.controller:
            raise InputError(with_source(where, f"controller.{whole}: is the same on all axes; set it in [controller]"))
    for name, section in axis_fields(own).items():
        common = fields.setdefault(name, {})
        if section.get("kind", common.get("kind")) != common.get("kind"):
            kept = COMMON_LAW_FIELDS if name == "controller" else ()
            common = {field: common[field] for field in kept if field in common}
        if name == "controller" and {"gains", "lqr"} & section.keys():
            common = {field: value for field, value in common.items() if field not in ("gains", "lqr")}
        fields[name] = _merged(common, section)
    return parse_scenario(fields, where)


def axis_fields(own: AxisSettings) -> dict[str, Any]:
    """What an axis has of its own as the content of its section, empty sections left out."""
    return {name: section for name, section in own.model_dump(mode="json", exclude_none=True).items() if section}


def _merged(common: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """A section with another's fields in the place of its own, down to the last."""
    both = {
        name: _merged(common[name], own[name])
        for name in common.keys() & own.keys()
        if _are_sections(common[name], own[name])
    }
    return {**common, **own, **both}


def _are_sections(*values: Any) -> bool:
    return all(isinstance(value, Mapping) for value in values)


def unknown_to_law(kind: str, given: Iterable[str]) -> list[str]:
    """Fields of [controller] that are neither every law's nor this one's own.

    Args:
        kind: Of the law.
        given: The fields.

    Returns:
        A clause for each.
    """
    known = {*ControllerSettings.model_fields, *OF_LAWS.own(kind)}
    unknown = [name for name in given if name not in known and not OF_LAWS.may_take(kind, name)]
    return [f"controller.{name}: no such field; {nearest(name, known)}" for name in unknown]


def _unknown_to_law(fields: Mapping[str, Any]) -> list[str]:
    """The same of a scenario with one of the bench's laws; no code of a user's is run to read a file."""
    section = fields.get("controller")
    if not isinstance(section, Mapping):
        return []
    kind = section.get("kind", ControllerSettings().kind)
    return unknown_to_law(kind, section) if isinstance(kind, str) and kind in LAWS else []


def as_fields(scenario: Scenario) -> dict[str, Any]:
    """A scenario as the content of a TOML file: what `parse_scenario` takes."""
    return TypeAdapter(Scenario).dump_python(scenario, mode="json", exclude_none=True)


def _clauses(wrong: Iterable[str]) -> str:
    """All that is wrong, or the first of very much."""
    each = list(dict.fromkeys(wrong))
    more = [f"and {len(each) - MOST_CLAUSES} more"] if len(each) > MOST_CLAUSES else []
    return "; ".join(each[:MOST_CLAUSES] + more)


def with_source(where: str, wrong: str) -> str:
    """What is wrong, with where it is before it."""
    return f"{where}: {wrong}" if where else wrong

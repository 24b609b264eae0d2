"""A scenario's file and what a command line changes in it -> a scenario, every field checked."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from cmg_mj.core.errors import InputError
from cmg_mj.inputs.files import bundled, find, folder, read_text
from cmg_mj.inputs.overrides import override
from cmg_mj.scenario.schema import ControllerSettings, ObserverSettings, Scenario, parse_scenario

MAX_BYTES = 1_000_000
"""A scenario file is smaller; the longest that a run writes has three thousand bytes."""


def load_scenario(
    name: str, overrides: Iterable[str] = (), observer: str | None = None, fields: dict[str, Any] | None = None
) -> Scenario:
    """Read a scenario.

    Args:
        name: A bundled scenario's name, or the path of a TOML file.
        overrides: Settings `section.field=value` that replace those of the file.
        observer: An observer instead of the file's, whose parameters then do not count; `overrides` come after it.
        fields: The scenario instead of the whole file, as in a study's; the overrides change it.

    Returns:
        The scenario, its fields checked.

    Raises:
        InputError: The file does not exist, is no TOML, or has a field that is unknown or not allowed.
    """
    path = find("scenarios", name, ".toml", "scenario")
    fields = fields or _read(path, name)
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
    _drop_gains(fields, overrides, _kind_of(fields, "controller") != law)
    scenario = parse_scenario(fields, " ".join([name, *(["with"] if changes else []), *changes]))
    if not any(setting.partition("=")[0].strip() == "plant.model" for setting in overrides):
        scenario = find_model(scenario, path.parent)
    return find_files(scenario, path.parent)


def _take_observer(fields: dict[str, Any], observer: str) -> None:
    """Another observer instead of the file's, on all axes; parameters that are another's go."""
    common = _kind_of(fields, "observer")
    axes = fields.get("axes")
    for axis in axes.values() if isinstance(axes, dict) else ():
        section = axis.get("observer") if isinstance(axis, dict) else None
        if isinstance(section, dict) and section.get("kind", common) != observer:
            axis.pop("observer")
    if common != observer or not isinstance(fields.get("observer", {}), dict):
        fields["observer"] = {"kind": observer}


def _drop_gains(fields: dict[str, Any], overrides: Iterable[str], has_law_changed: bool) -> None:
    """Take the file's gains out where --set names another law; of gains and lqr, the one that --set does not give."""
    set_fields = [setting.partition("=")[0].strip() for setting in overrides]
    unset = [
        name
        for name in ("gains", "lqr")
        if not any(f"{field}.".startswith(f"controller.{name}.") for field in set_fields)
    ]
    if has_law_changed or len(unset) == 1:
        for name in unset:
            fields["controller"].pop(name, None)


def _kind_of(fields: Mapping[str, Any], section: str) -> Any:
    """Return the kind of observer or law that a file names, or the default."""
    usual = {"observer": ObserverSettings().kind, "controller": ControllerSettings().kind}[section]
    section_fields = fields.get(section)
    return section_fields.get("kind", usual) if isinstance(section_fields, Mapping) else usual


def _read(path: Path, name: str) -> dict[str, Any]:
    """Read the content of a TOML file."""
    text = read_text(path, name, MAX_BYTES)
    if text.lstrip().startswith("<"):
        raise InputError(f"{name}: is XML, not a scenario; a scenario names its model with plant.model")
    try:
        return tomllib.loads(text)
    except ValueError as error:  # a TOMLDecodeError, or a number of too many digits
        raise InputError(f"{name}: not valid TOML: {error}") from error


def base_of(scenario: Scenario) -> Scenario | None:
    """Return the bundled scenario that a scenario changes, if there is one."""
    if scenario.based_on not in bundled("scenarios"):
        return None
    return load_scenario(str(folder("scenarios") / f"{scenario.based_on}.toml"))


def find_model(scenario: Scenario, beside: Path) -> Scenario:
    """Return a scenario with the path of its model, which a scenario file names relative to itself."""
    with scenario.named_in_errors():
        model = find("models", scenario.plant.model, ".xml", "plant.model =", beside)
    return scenario.model_copy(update={"plant": dataclasses.replace(scenario.plant, model=str(model))})


def find_files(scenario: Scenario, beside: Path) -> Scenario:
    """Return the scenario with the whole paths of its features' files, which it names relative to itself."""
    found = {}
    for name in scenario.feature_sections:
        section = scenario.section(name)
        found[name] = (
            [part.located(beside) for part in section] if isinstance(section, list) else section.located(beside)
        )
    return scenario.model_copy(update=found)

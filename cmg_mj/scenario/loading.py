"""A scenario's file and what a command line changes in it -> a scenario, every field checked."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from cmg_mj.inputs.features import FEATURES
from cmg_mj.inputs.files import bundled, find, folder, read_toml
from cmg_mj.inputs.overrides import override
from cmg_mj.scenario.schema import Scenario, parse_scenario


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
    fields = read_toml(path, name) if fields is None else fields
    if path.stem in bundled("scenarios"):
        fields.setdefault("based_on", path.stem)
    changes, names = [], []
    if observer is not None:
        changes.append(f"--observer {observer}")
        _take_observer(fields, observer)
    law = _kind_of(fields, "controller")
    for setting in overrides:
        changes.append(f"--set {setting}")
        names.append(setting.partition("=")[0].strip())
        override(fields, setting)
    # Of gains and lqr, the one that --set does not give goes; with another law both.
    given = [f"{field}." for field in names]
    unset = [name for name in ("gains", "lqr") if not any(f.startswith(f"controller.{name}.") for f in given)]
    settings = fields.get("controller")
    if isinstance(settings, dict) and (len(unset) == 1 or _kind_of(fields, "controller") != law):
        for field in unset:
            settings.pop(field, None)
    scenario = parse_scenario(fields, " ".join([name, *(["with"] if changes else []), *changes]))
    if "plant.model" not in names:
        scenario = find_model(scenario, path.parent)
    return find_files(scenario, path.parent)


def _take_observer(fields: dict[str, Any], observer: str) -> None:
    """Take another observer than the file's, on all axes; parameters that are another's go."""
    common = _kind_of(fields, "observer")
    axes = fields.get("axes")
    for axis in axes.values() if isinstance(axes, dict) else ():
        if isinstance(axis, dict) and _kind_of(axis, "observer", common) != observer:
            axis.pop("observer", None)
    if common != observer:
        fields["observer"] = {"kind": observer}


def _kind_of(fields: Mapping[str, Any], section: str, usual: Any = None) -> Any:
    """Return the kind of observer or law that a file names, or the default."""
    usual = usual or getattr(Scenario(), section).kind
    parts = fields.get(section, {})
    return parts.get("kind", usual) if isinstance(parts, Mapping) else None


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
    for name, parts in scenario.feature_sections.items():
        located = [part.located(beside) for part in parts]
        found[name] = located if FEATURES[name].is_list else located[0]
    return scenario.model_copy(update=found)

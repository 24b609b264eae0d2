"""A scenario with every default written out, which runs again to the same numbers; and how two of them differ."""

from __future__ import annotations

import dataclasses
import functools
import json
import platform
import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from importlib.metadata import version
from pathlib import PurePath
from typing import Any

import tomli_w

from cmg_mj.core.errors import TomlValue
from cmg_mj.inputs.files import folder
from cmg_mj.inputs.types import NoEffect, marked_fields
from cmg_mj.laws import LAW_CLASSES
from cmg_mj.observers import OBSERVER_CLASSES
from cmg_mj.scenario.design import Design
from cmg_mj.scenario.plant_settings import PlantSettings
from cmg_mj.scenario.schema import ALL_AXES_LAW_FIELDS, AxisPlant, AxisSettings, ControllerSettings, Scenario

NOT_DIFFERENCES = {"seed", "observer.kind", *marked_fields(Scenario, NoEffect)}
"""Fields that differ without being called a difference: they have a place of their own wherever a run is named."""


def resolved(scenario: Scenario, designs: Mapping[str, Design]) -> dict[str, Any]:
    """Write out every default of a scenario, and the versions it ran with, as TOML can hold them.

    Args:
        scenario: The scenario.
        designs: The law and the observers of each axis, by its name.

    Returns:
        Sections and fields; of several axes, and where an axis has fields of its own, all that it may have in [axes].
    """
    first, *_ = designs.values()
    fields = _resolved(scenario, first)
    if len(designs) == 1 and not scenario.axes:
        return fields
    axes = {}
    for name, design in designs.items():
        axis_fields = _resolved(design.scenario, design)
        axes[name] = {section: axis_fields[section] for section in AxisSettings.model_fields}
        axes[name]["plant"] = {
            field: axis_fields["plant"][field] for field in axis_fields["plant"] if field in AxisPlant.model_fields
        }
        for field in ALL_AXES_LAW_FIELDS:
            axes[name]["controller"].pop(field)
    scenario_fields = scenario.as_fields()
    return {
        **fields,
        **{name: scenario_fields[name] for name in ("controller", "observer", "open_loop_observers")},
        "axes": axes,
    }


def _resolved(scenario: Scenario, design: Design) -> dict[str, Any]:
    """Return the scenario with the defaults of one axis' law and observer."""
    fields = scenario.as_fields()
    path = design.rig.path.resolve()
    fields["plant"]["model"] = path.name if path.parent == folder("models").resolve() else str(path)
    plant = fields["plant"] | {"timestep_s": design.rig.timestep}
    fields["plant"] = {
        field.name: plant[field.name] for field in dataclasses.fields(PlantSettings) if field.name in plant
    }
    law = _parameters(scenario.controller.parameters, design.law, LAW_CLASSES.bench_parameters)
    controller = fields["controller"] | law
    if "gains" in law:
        controller.pop("lqr", None)  # they have been solved for
    known = [*ControllerSettings.model_fields, *law]
    fields["controller"] = {name: controller[name] for name in dict.fromkeys(known) if name in controller}
    fields["open_loop_observers"] = scenario.open_loop_names()
    fields["observer"] = {
        "kind": scenario.observer.kind,
        **_parameters(scenario.observer.parameters, design.observer(), OBSERVER_CLASSES.bench_parameters),
    }
    for rare in ("axes", "swing", *scenario.feature_sections):
        if not fields[rare]:
            fields.pop(rare)
    fields["versions"] = versions()
    return _plain(fields)


def _parameters(parameters: dict[str, Any], part: Any, by_bench: Collection[str]) -> dict[str, Any]:
    """Return the given parameters, and the defaults of the rest as far as they are known and TOML can hold them."""
    defaults = {}
    for field in dataclasses.fields(part) if dataclasses.is_dataclass(part) else ():
        if field.init and field.name not in {*by_bench, *parameters}:
            with suppress(AttributeError, TypeError, ValueError):
                value = _plain(getattr(part, field.name))
                tomli_w.dumps({"value": value})
                defaults[field.name] = value
    return defaults | parameters


@functools.cache
def versions() -> dict[str, str]:
    """Return the versions that a run depends on. They are read once: that takes longer than to simulate a second."""
    names = ("cmg_mj", "mujoco", "numpy", "scipy")
    return {name: version(name) for name in names} | {"python": platform.python_version()}


def _plain(value: Any) -> Any:
    """Tuples and arrays to lists, as TOML wants them."""
    return json.loads(json.dumps(value, default=lambda array: array.tolist()))


def differences(base: Mapping[str, Any], scenario: Mapping[str, Any]) -> dict[str, Any]:
    """Compare two resolved scenarios.

    Args:
        base: The scenario that `scenario` is compared with.
        scenario: A scenario.

    Returns:
        Field, `section.field` -> its value in the other; None where it has no such field. The parameters of different
        observers are not compared.
    """
    ignored = NOT_DIFFERENCES | ({"observer"} if base["observer"]["kind"] != scenario["observer"]["kind"] else set())
    return {
        name: value
        for name, value in _differing(base, scenario)
        if name not in ignored and name.partition(".")[0] not in ignored
    }


def _differing(
    base: TomlValue | None, other: TomlValue | None, name: str = ""
) -> Iterator[tuple[str, TomlValue | None]]:
    below = f"{name}." if name else ""
    if isinstance(base, Mapping) and isinstance(other, Mapping):
        for key in dict.fromkeys([*other, *base]):
            yield from _differing(base.get(key), other.get(key), f"{below}{key}")
    elif (
        isinstance(base, list)
        and isinstance(other, list)
        and len(base) == len(other)
        and all(isinstance(item, Mapping) for item in [*base, *other])
    ):
        for i, one in enumerate(base):
            yield from _differing(one, other[i], f"{below}{i}")
    elif base != other:
        yield name, other


MAX_NAME = 60
"""Longest text of the differences in a folder's name [characters]."""
SHOWN = 3
"""Most differences in one line."""


def describe_differences(differing: Mapping[str, TomlValue | None]) -> str:
    """Write the first few after a comma, as `--set` takes them; nothing if nothing differs."""
    return "".join(f", {text}" for text in _first(_assignments(differing), SHOWN, "and {} more"))


def folder_suffix(differing: Mapping[str, TomlValue | None]) -> str:
    """Make the end of a folder's name: letters that every system takes, and not too many."""
    assignments = [re.sub(r"[^\w.=+-]+", "_", text, flags=re.ASCII).strip("_") for text in _assignments(differing)]
    count = len(assignments)
    while count and sum(len(text) + 1 for text in assignments[:count]) > MAX_NAME:
        count -= 1
    return "".join(f"-{text}" for text in _first(assignments, count, "and-{}-more"))


def safe_name(text: str) -> str:
    """Make a user's name a part of a folder's: without letters that some system refuses, and not too long."""
    return re.sub(r'[\x00-\x1f\x7f/\\:*?"<>|\ud800-\udfff]', "_", text)[:MAX_NAME]


def _first(texts: list[str], count: int, rest: str) -> list[str]:
    """Return the first ones, and how many more there are."""
    more = len(texts) - count
    return texts if more <= 0 else [*texts[:count], rest.format(more)]


def _assignments(differing: Mapping[str, TomlValue | None]) -> list[str]:
    """`field=value`, the field by its last name, or by as many as tell it apart from the other differences."""
    full = [name.split(".") for name in differing]

    def short(parts: list[str]) -> str:
        for start in range(len(parts) - 1, 0, -1):
            end = parts[start:]
            if not end[0].isdecimal() and sum(other[-len(end) :] == end for other in full) == 1:
                return ".".join(end)
        return ".".join(parts)

    return [f"{short(parts)}={_value(value)}" for parts, value in zip(full, differing.values(), strict=True)]


def _value(value: TomlValue | None) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if value is None or value == []:
        return "none"
    if isinstance(value, list):
        return ",".join(_value(item) for item in value)
    if isinstance(value, Mapping):
        return ",".join(f"{name}={_value(item)}" for name, item in value.items())
    if isinstance(value, float):
        return f"{value:.6g}"
    return PurePath(str(value)).stem if str(value).endswith(".xml") else str(value)

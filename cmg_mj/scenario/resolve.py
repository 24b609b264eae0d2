"""A scenario with every default written out: running that file again gives the same run."""

from __future__ import annotations

import dataclasses
import functools
import platform
from collections.abc import Collection, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import TypeAdapter

from cmg_mj.controllers.laws.registry import BENCH_PARAMETERS as GIVEN_TO_LAWS
from cmg_mj.inputs.bundled import folder
from cmg_mj.observers import BENCH_PARAMETERS
from cmg_mj.scenario.design import Design
from cmg_mj.scenario.plant_settings import PlantSettings
from cmg_mj.scenario.schema import AxisPlant, ControllerSettings, Scenario


def resolved(scenario: Scenario, design: Design, model: Path, timestep_s: float) -> dict[str, Any]:
    """The scenario with every default written out, and the versions it ran with, as TOML can hold it.

    Args:
        scenario: The scenario.
        design: What was made of it.
        model: The model's file.
        timestep_s: The physics step [s].

    Returns:
        Sections and fields.
    """
    fields = TypeAdapter(Scenario).dump_python(scenario, mode="json", exclude_none=True)
    path = model.resolve()
    fields["plant"]["model"] = path.name if path.parent == folder("models").resolve() else str(path)
    plant = fields["plant"] | {"timestep_s": timestep_s}
    fields["plant"] = {
        field.name: plant[field.name] for field in dataclasses.fields(PlantSettings) if field.name in plant
    }
    law = _parameters(scenario.controller.parameters, design.law, GIVEN_TO_LAWS)
    controller = fields["controller"] | law
    if "gains" in law:
        controller.pop("lqr", None)  # they have been solved for
    known = [*ControllerSettings.model_fields, *law]
    fields["controller"] = {name: controller[name] for name in dict.fromkeys(known) if name in controller}
    fields["open_loop_observers"] = scenario.open_loop_names()
    fields["observer"] = {
        "kind": scenario.observer.kind,
        **_parameters(scenario.observer.parameters, design.observer(), BENCH_PARAMETERS),
    }
    for rare in ("axes", "swing"):
        if not fields[rare]:
            fields.pop(rare)
    fields["versions"] = versions()
    return _plain(fields)


OF_AN_AXIS = ("plant", "controller", "observer", "sensors")
"""Sections of which an axis may have something of its own."""


def with_axes(fields: dict[str, Any], scenario: Scenario, axes: Mapping[str, dict[str, Any]]) -> dict[str, Any]:
    """The resolved scenario of a rig with what each axis has, written out.

    Args:
        fields: Of the rig.
        scenario: The same as it was given.
        axes: The resolved scenario of each axis, by its name.

    Returns:
        The rig's, with [axes] in it: all that an axis may have of its own.
    """
    if not axes:
        return fields
    found = {name: {section: own[section] for section in OF_AN_AXIS} for name, own in axes.items()}
    for own in found.values():
        own["plant"] = {name: value for name, value in own["plant"].items() if name in AxisPlant.model_fields}
        whole = ("rate_hz", "compensate_turning")
        own["controller"] = {name: value for name, value in own["controller"].items() if name not in whole}
    given = TypeAdapter(Scenario).dump_python(scenario, mode="json", exclude_none=True)
    as_given = {name: given[name] for name in ("controller", "observer", "open_loop_observers")}
    return {**fields, **as_given, "axes": found}


def _parameters(given: dict[str, Any], made: Any, by_bench: Collection[str]) -> dict[str, Any]:
    """What was given, and the defaults of the rest as far as they can be known and TOML can hold them."""
    if not dataclasses.is_dataclass(made):
        return given
    names = [f.name for f in dataclasses.fields(made) if f.init and f.name not in by_bench]
    kept = {name: _plain(getattr(made, name, None)) for name in names if name not in given}
    return {name: value for name, value in kept.items() if _is_toml(value)} | given


@functools.cache
def versions() -> dict[str, str]:
    """What a run depends on (read once: that takes longer than to simulate a second)."""
    names = ("cmg_mj", "mujoco", "numpy", "scipy")
    return {name: version(name) for name in names} | {"python": platform.python_version()}


def _plain(value: Any) -> Any:
    """Tuples and arrays to lists, as TOML wants them."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value


def _is_toml(value: Any) -> bool:
    try:
        tomli_w.dumps({"value": value})
    except TypeError:
        return False
    return True

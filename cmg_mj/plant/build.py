"""A rig's model file -> a compiled model, all of whose names are resolved: text, one MjSpec, checks, edits."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import mujoco

from cmg_mj.core.errors import InputError
from cmg_mj.inputs.features import entries
from cmg_mj.plant.axis import ResolvedModel, find_axis, resolve
from cmg_mj.plant.checks import RigChecker, invalid_numbers
from cmg_mj.plant.elements import EQUILIBRIUM_KEY, REQUIRED_ELEMENTS, axis_modules, element_id, missing_elements
from cmg_mj.plant.locking import lock_axes, lock_thrust_bearing
from cmg_mj.plant.mjcf import compile_model, parse_without_plugins
from cmg_mj.scenario.plant_settings import PlantSettings

_HAS_PLUGIN = "the model has the plugin {}, which is left out here: the scenario's own controller takes its place"


def build(path: Path, settings: PlantSettings, sections: Mapping[str, Any]) -> ResolvedModel:
    """Read and compile a rig, without what is only seen.

    Args:
        path: The model's file.
        settings: What to lock.
        sections: Settings of the features that edit the model.

    Returns:
        The rig.

    Raises:
        InputError: The file holds no rig. All that is missing is named, or else all that is wrong.
    """
    spec, plugins = parse_without_plugins(path)
    if missing := missing_elements(spec):
        raise InputError(f"{path}: {'; '.join([*missing, REQUIRED_ELEMENTS])}")
    if settings.lock_thrust_bearing:
        lock_thrust_bearing(spec, path)
    spec.compiler.discardvisual = True
    model = compile_model(spec, path)
    if wrong := invalid_numbers(model):
        raise InputError(f"{path}: {'; '.join(wrong)}")
    lost, modules, key = {}, axis_modules(model), element_id(model, "key", EQUILIBRIUM_KEY)
    for name in modules:
        try:
            find_axis(model, key, name, modules[name])
        except InputError as error:
            lost[name] = str(error)
    rig = resolve(path, model, modules, list(lost))
    checker = RigChecker(rig)
    if wrong := [*lost.values(), *checker.wrong]:
        raise InputError(f"{path}: {'; '.join(wrong)}")
    rig = edit(spec, rig, settings, sections)
    return rig._replace(hints=(*checker.hints, *(_HAS_PLUGIN.format(name) for name in plugins)))


def edit(
    spec: mujoco.MjSpec, rig: ResolvedModel, settings: PlantSettings, sections: Mapping[str, Any]
) -> ResolvedModel:
    """Edit a parsed rig: lock axes, then what features do. Each edit sees the model before it compiled.

    Args:
        spec: The parsed rig, which is changed.
        rig: The same, compiled.
        settings: What to lock.
        sections: Settings of the features that edit the model.

    Returns:
        The rig, edited.
    """
    edits: list[Callable[..., Any]] = [partial(lock_axes, settings=settings)] if settings.locked_axes else []
    edits += [partial(entries("edit")[name], settings=settings, section=section) for name, section in sections.items()]
    for change in edits:
        finish = change(spec, rig)
        if finish is not None:  # sets numbers that depend on the compiled model
            rig = resolve(rig.path, compile_model(spec, rig.path), rig.modules, settings.locked_axes)
            finish(rig.model)
    return rig

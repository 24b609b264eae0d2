"""An MJCF file -> a compiled model that has all that a rig needs, or a line that says what it lacks."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import mujoco

from cmg_mj.core.errors import InputError
from cmg_mj.features.bend.edit import bend_frame
from cmg_mj.inputs.files import model_files
from cmg_mj.plant.checks import RigChecker, invalid_numbers
from cmg_mj.plant.elements import REQUIRED_PARTS, axes_of, missing_parts
from cmg_mj.plant.locking import lock_axes, lock_thrust_bearing
from cmg_mj.plant.without_plugins import OWN, parse_without_plugins
from cmg_mj.scenario.plant_settings import PlantSettings


def _one_line(error: Exception) -> str:
    """MuJoCo's message without what tells a user nothing."""
    text = " ".join(str(error).split()).removeprefix("Error: ")
    syntax = re.match(r"XML parse error .*Line number=(\d+)", text)
    return (
        f"XML syntax error at line {syntax[1]}" if syntax else re.sub(r" The (static|visual) .* remain so\.", "", text)
    )


def parse(path: Path) -> mujoco.MjSpec:
    """Read a model file, without this package's plugins.

    Raises:
        InputError: It is no MJCF.
    """
    return _parse(path)[0]


def _parse(path: Path) -> tuple[mujoco.MjSpec, list[str]]:
    """Read a model file; the names are those of the plugins that are left out."""
    model_files(path)
    try:
        return parse_without_plugins(path)
    except (ValueError, RuntimeError, MemoryError, mujoco.FatalError) as error:
        raise InputError(f"{path}: not a model MuJoCo can read: {_one_line(error)}") from error


def compile_model(spec: mujoco.MjSpec, path: Path) -> mujoco.MjModel:
    """Compile a parsed model.

    Raises:
        InputError: MuJoCo's compiler refuses it, or it has a plugin of this package's.
    """
    if any(plugin.plugin_name.startswith(OWN) for plugin in spec.plugins):
        raise InputError(f"{path}: a file that it includes has a plugin of cmg_mj's; take the plugin out of that file")
    try:
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            model = spec.compile()
    except (ValueError, RuntimeError, MemoryError, mujoco.FatalError) as error:
        raise InputError(f"{path}: does not compile: {_one_line(error)}") from error
    for warning in warned:
        if "singular" in str(warning.message):
            raise InputError(f"{path}: does not compile: its masses and inertias are of too different sizes")
    return model


def as_mjcf(spec: mujoco.MjSpec, path: Path) -> str:
    """Write a model as MJCF.

    Raises:
        InputError: MuJoCo cannot write it, or does not find its meshes and textures.
    """
    try:
        return spec.to_xml()
    except (ValueError, RuntimeError, MemoryError, mujoco.FatalError) as error:
        raise InputError(f"{path}: MuJoCo cannot write it: {_one_line(error)}") from error


_HAS_PLUGIN = "the model has the plugin {}, which is left out here: the scenario's own controller takes its place"


class Rig(NamedTuple):
    """A compiled model that has all parts of a plant.

    Attributes:
        model: The model.
        axes: The names of its axes, the locked ones too, each with those of its modules.
        hints: Clauses on what is right and yet not what the reduced model takes it for.
    """

    model: mujoco.MjModel
    axes: dict[str, list[str]]
    hints: tuple[str, ...]


def load_rig(path: Path, *, lock: bool, locked_axes: Sequence[str] = (), bend: PlantSettings | None = None) -> Rig:
    """Read and compile a model, without what is only seen, and see that it is a rig.

    Args:
        path: The model's file.
        lock: Whether to take the yaw joint out.
        locked_axes: Axes whose hinges to take out.
        bend: How the frame bends, if it does.

    Returns:
        The compiled model with its axes.

    Raises:
        InputError: The file holds no rig. All that is missing or wrong is named.
    """
    spec, plugins = _parse(path)
    missing = missing_parts(spec)
    if lock and not missing:
        lock_thrust_bearing(spec, path)
    spec.compiler.discardvisual = True
    rig = None
    wrong = list(missing)
    try:
        model = compile_model(spec, path)
    except InputError as error:
        if not missing:
            raise
        if "keyframe" not in str(error):  # whose sizes are wrong because something is missing
            wrong.append(str(error).removeprefix(f"{path}: "))
    else:
        axes = axes_of(model)
        numbers = invalid_numbers(model)
        placement = None if numbers else RigChecker(model, axes)
        wrong += numbers if placement is None else placement.wrong
        hints = () if placement is None else tuple(placement.hints)
        rig = Rig(model, axes, (*hints, *(_HAS_PLUGIN.format(name) for name in plugins)))
    if wrong or rig is None:
        raise InputError("; ".join([f"{path}: {wrong[0]}", *wrong[1:], *([REQUIRED_PARTS] if missing else [])]))
    if locked_axes:
        lock_axes(spec, rig.model, locked_axes, rig.axes, path)
        rig = rig._replace(model=compile_model(spec, path))
    if bend is not None and bend.bends:
        bend_frame(spec, rig.model, bend, {name: rig.axes[name] for name in rig.axes if name not in locked_axes}, path)
        rig = rig._replace(model=compile_model(spec, path))
    return rig


def parse_drawn(path: Path, settings: PlantSettings, axes: Mapping[str, Sequence[str]]) -> mujoco.MjSpec:
    """Read a rig that `load_rig` has read with all that is only seen.

    Args:
        path: The model's file.
        settings: Which hinges to take out, and how the frame bends.
        axes: All axes of the rig.

    Returns:
        The parsed model.

    Raises:
        InputError: MuJoCo's compiler refuses it, because of a mesh that cannot be read.
    """
    spec = parse(path)
    if settings.lock_thrust_bearing:
        lock_thrust_bearing(spec, path)
    if settings.locked_axes:
        lock_axes(spec, compile_model(spec, path), settings.locked_axes, axes, path)
    if settings.bends:
        unlocked = {name: axes[name] for name in axes if name not in settings.locked_axes}
        bend_frame(spec, compile_model(spec, path), settings, unlocked, path)
    return spec


def check_rig(path: Path, name: Path) -> None:
    """See that a file is a rig.

    Args:
        path: The file.
        name: Name of the file in messages.

    Raises:
        InputError: The file is not a rig.
    """
    try:
        load_rig(path, lock=False)
    except InputError as error:
        raise InputError(str(error).replace(str(path), str(name))) from error

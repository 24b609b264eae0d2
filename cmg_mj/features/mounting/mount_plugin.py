"""The plugin that a mount writes: a folder beside the model, with a library and a model that names it."""

from __future__ import annotations

import os
import re
from pathlib import Path

from cmg_mj.core.errors import InputError
from cmg_mj.features.export.names import LONGEST, RESERVED
from cmg_mj.features.plugin.make import Plugin, make_plugin, write_plugin
from cmg_mj.features.plugin.tables import NAMES_IN_USE
from cmg_mj.inputs.files import model_files
from cmg_mj.results.folder import RunFolder, is_own
from cmg_mj.runs.experiment import Experiment


def plugin_folder(target: Path) -> Path:
    """Return the folder of the plugin that belongs to a mounted model."""
    return target.with_name(f"{target.stem}_plugin")


def plugin_name(target: Path) -> str:
    """Name a plugin after a model's file, in letters, digits and _: `my robot.xml` has my_robot."""
    words = re.sub(r"[^A-Za-z0-9]+", "_", target.stem, flags=re.ASCII).strip("_")
    name = words if words[:1].isalpha() else f"robot_{words}".rstrip("_")
    taken = {name, name.lower()} & (RESERVED | NAMES_IN_USE)
    return f"{name}_robot" if taken else name[:LONGEST]


def check_plugin_folder(target: Path, robot: Path, *, overwrite: bool) -> None:
    """Check that the folder of a plugin may be written, by the rules that hold for the mounted model.

    Args:
        target: The model's file.
        robot: The robot's own file.
        overwrite: Whether the plugin of an earlier mount is replaced.

    Raises:
        InputError: The folder holds a file of the robot's, or anything that may not be replaced.
    """
    folder = plugin_folder(target)
    originals = model_files(robot) if robot.is_file() else []
    if any(folder.resolve() in file.resolve().parents for file in originals):
        raise InputError(f"-o {target}: {folder} holds the robot's own file, or one that it names; give another name")
    if os.path.lexists(folder) and not is_own(folder):
        raise InputError(f"-o {target}: {folder} holds files that cmg-mj did not write; give another name")
    if folder.exists() and not overwrite:
        raise InputError(f"-o {target}: {folder} exists; give another name, or --overwrite")


def check_plugin(experiment: Experiment, target: Path) -> None:
    """Generate a plugin as `write_mounted_plugin` does, before what takes a minute.

    Raises:
        InputError: Something in use cannot be exported.
    """
    make_plugin(experiment, plugin_name(target), start="spinning")


def write_mounted_plugin(experiment: Experiment, target: Path) -> Plugin:
    """Write the plugin of a mounted robot, whole or not at all.

    Args:
        experiment: The robot's scenario, prepared.
        target: The mounted model's file, after which the plugin is named.

    Returns:
        The plugin. It sets the flywheels going itself, since a robot's own programs do not.

    Raises:
        InputError: Something in use cannot be exported, or the folder cannot be written.
    """
    made = make_plugin(experiment, plugin_name(target), start="spinning")
    with RunFolder(plugin_folder(target), overwrite=True) as folder:
        return write_plugin(made, folder)

"""The plugin that a mount writes: a folder beside the model, with a library and a model that names it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cmg_mj.codegen.engine_plugin.build import COMMON_HEADERS, COMMON_SOURCES
from cmg_mj.codegen.engine_plugin.generate import NAMES_IN_USE
from cmg_mj.codegen.export.names import LONGEST, RESERVED
from cmg_mj.errors import InputError, listed
from cmg_mj.inputs.includes import check_files
from cmg_mj.results.run_folder import RunFolder
from cmg_mj.results.run_folder.manifest import HIDDEN, Manifest, users_files
from cmg_mj.simulation.experiment import Experiment
from cmg_mj.simulation.plugin_files import Plugin, make_plugin, plugin_files, write_plugin

LIBRARY = re.compile(r"libcmg_mj_\w+\.so", re.ASCII)


def plugin_folder(target: Path) -> Path:
    """Return the folder of the plugin that belongs to a mounted model."""
    return target.with_name(f"{target.stem}_plugin")


def plugin_name(target: Path) -> str:
    """Name a plugin after a model's file, in letters, digits and _: `my robot.xml` has my_robot."""
    words = re.sub(r"[^A-Za-z0-9]+", "_", target.stem, flags=re.ASCII).strip("_")
    name = words if words[:1].isalpha() else f"robot_{words}".rstrip("_")
    taken = {name, name.lower()} & (RESERVED | NAMES_IN_USE)
    return f"{name}_robot" if taken else name[:LONGEST]


@contextmanager
def claimed_plugin(target: Path, robot: Path, *, overwrite: bool) -> Iterator[RunFolder]:
    """Claim the folder of a plugin, by the rules that hold for the mounted model.

    Args:
        target: The model's file.
        robot: The robot's own file.
        overwrite: Whether the plugin of an earlier mount is replaced, if nobody has changed it since.

    Yields:
        The folder, to be written to once.

    Raises:
        InputError: Another command writes there, or what is there may not be replaced.
    """
    folder, name = plugin_folder(target), plugin_name(target)
    originals = check_files(robot) if robot.is_file() else []
    if any(folder.resolve() in file.resolve().parents for file in originals):
        raise InputError(f"-o {target}: {folder} holds the robot's own file, or one that it names; give another name")
    try:
        _check_replaceable(target, overwrite=overwrite)
        own = [f"libcmg_mj_{name}.so", f"{name}.xml", f"{name}_example.py", f"{name}_example.c", "Makefile", "rig.c"]
        claim = RunFolder(folder, (*own, *COMMON_HEADERS, *COMMON_SOURCES))
    except OSError as error:
        raise InputError(f"-o {target}: {folder} cannot be written: {error.strerror}") from error
    except InputError as error:
        message = str(error).replace(f"--out {folder}: ", f"-o {target}: {folder}: ", 1)
        raise InputError(message.replace("name another folder", "give another name")) from error
    with claim:
        yield claim


def check_plugin(experiment: Experiment, target: Path) -> None:
    """Generate a plugin as `write_mounted_plugin` does, before what takes a minute.

    Raises:
        InputError: Something in use cannot be exported.
    """
    make_plugin(experiment, plugin_name(target), start="spinning")


def write_mounted_plugin(experiment: Experiment, target: Path, folder: RunFolder) -> Plugin:
    """Write the plugin of a mounted robot, whole or not at all.

    Args:
        experiment: The robot's scenario, prepared.
        target: The mounted model's file, after which the plugin is named.
        folder: The plugin's folder, claimed.

    Returns:
        The plugin. It sets the flywheels going itself, since a robot's own programs do not.

    Raises:
        InputError: Something in use cannot be exported, or a file of the user's would be lost.
    """
    made = make_plugin(experiment, plugin_name(target), start="spinning")
    _refuse_loss(target, folder.path, set(users_files(folder.path)) & set(plugin_files(made)))
    return write_plugin(made, folder)


def _check_replaceable(target: Path, *, overwrite: bool) -> None:
    """Refuse to replace what no mount has written, what has changed since, or anything unless that is asked for."""
    folder = plugin_folder(target)
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        _refuse_loss(target, folder.parent, {folder.name})
    if not folder.is_dir():
        return
    written = Manifest.read(folder).files
    names = {path.name for path in folder.iterdir()} - {HIDDEN}
    _refuse_loss(target, folder, set(users_files(folder)) & set(written))
    if written and not any(LIBRARY.fullmatch(name) for name in written):
        _refuse_loss(target, folder, names & set(written))
    if names and not overwrite:
        raise InputError(f"-o {target}: {folder} exists; give another name, or --overwrite")


def _refuse_loss(target: Path, folder: Path, names: set[str]) -> None:
    if names:
        files = listed([str(folder / name) for name in sorted(names)])
        are = "is" if len(names) == 1 else "are"
        raise InputError(
            f"-o {target}: {files} {are} there, not as cmg-mj mount wrote it, and would be lost: move it, or give "
            "another name"
        )

"""Generates all C of a plugin: the exported controllers, the rig's numbers, and what all plugins have in common."""

from __future__ import annotations

import copy
import hashlib
from typing import NamedTuple

from cmg_mj.codegen.engine_plugin.build import COMMON_SOURCES, common_files
from cmg_mj.codegen.engine_plugin.rig import PluginRig
from cmg_mj.codegen.engine_plugin.tables import format_controller, format_rig
from cmg_mj.codegen.export import generate_code
from cmg_mj.core.controller import Controller
from cmg_mj.errors import InputError

NAMES_IN_USE = frozenset(
    [
        "axis",
        "controller",
        "decision",
        "delivery",
        "encoder",
        "fog",
        "gyros",
        "law",
        "measure",
        "module",
        "noise",
        "observer",
        "pair",
        "plugin",
        "rig",
        "sensor",
        "sensors",
        "setup",
        "show",
        "spin",
        "state",
        "turn_gyro",
        "turning",
        "ziggurat",
    ]
)
"""Names that would clash with the C that all plugins have in common."""


class PluginCode(NamedTuple):
    """The C of a plugin.

    Attributes:
        files: Name -> text.
        sources: The files that are compiled.
        build: Fingerprint of the code, by which a model knows its library.
    """

    files: dict[str, str]
    sources: tuple[str, ...]
    build: str


def generate_plugin(rig: PluginRig, name: str) -> PluginCode:
    """Generate a plugin's C.

    Args:
        rig: The rig with its controllers.
        name: Prefix of the exported controllers in C; of several axes the axis' number follows.

    Returns:
        The code.

    Raises:
        InputError: Something in use cannot be exported, or the name is none for a plugin.
    """
    rig.refuse_unsupported()
    if name in NAMES_IN_USE:
        raise InputError(f"--name {name}: is a name in every plugin's C; take another, such as {name}_of_mine")
    files, names = common_files(), []
    sources: list[str] = [*COMMON_SOURCES]
    for number, axis in enumerate(rig.axes):
        suffix = f"_{number}" if len(rig.axes) > 1 else ""
        own, controller = name + suffix, axis.controller
        code = generate_code(_exportable(controller), "double", name, suffix)
        files |= {file: text for file, text in code.files.items() if file in (f"{own}.h", f"{own}.c")}
        files[f"{own}_controller.c"] = format_controller(own, axis, code.figures["numbers_in_state"], code.law)
        sources.append(f"{own}_controller.c")
        names.append(own)
    files["rig.c"] = format_rig(rig, names, "")
    build = hashlib.sha256("".join(files.values()).encode()).hexdigest()[:16]
    files["rig.c"] = format_rig(rig, names, build)
    return PluginCode(files, (*sources, "rig.c"), build)


def _exportable(controller: Controller) -> Controller:
    """Copy a controller as one that the export takes: on its observer's rate. The plugin's own C chooses the rate."""
    result = copy.copy(controller)
    result.feedback = "observer"
    return result

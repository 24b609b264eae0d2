"""Reads an MJCF without this package's plugins: its own runs and analyses bring the controller themselves."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import mujoco

OWN = "cmg_mj."
"""Prefix of the names of this package's plugins."""


def parse_without_plugins(path: Path) -> tuple[mujoco.MjSpec, list[str]]:
    """Parse a model without this package's plugins, their instances and their sensors.

    MuJoCo reads no file with a plugin whose library is not loaded. What the file includes is read as it is.

    Args:
        path: The model's file.

    Returns:
        The parsed model, and the names of the plugins that were in it.
    """
    root = _elements(path)
    own = [plugin for plugin in root.findall("extension/plugin") if plugin.get("plugin", "").startswith(OWN)]
    if not own:
        return mujoco.MjSpec.from_file(str(path)), []
    instances = {instance.get("name") for plugin in own for instance in plugin.findall("instance")}
    for parent in list(root.iter()):
        for plugin in parent.findall("plugin"):
            if plugin in own or plugin.get("instance") in instances:
                parent.remove(plugin)
    with mujoco.MjVfs() as files:
        files[str(path)] = ElementTree.tostring(
            root, "unicode"
        ).encode()  # which MuJoCo takes before the file of that name
        return mujoco.MjSpec.from_file(str(path), vfs=files), [plugin.get("plugin", "") for plugin in own]


def _elements(path: Path) -> ElementTree.Element:
    try:
        return ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError):  # MuJoCo, which reads more than this parser, says what is wrong
        return ElementTree.Element("mujoco")

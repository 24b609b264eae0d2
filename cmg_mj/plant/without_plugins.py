"""Takes this package's plugins out of an MJCF: its own runs and analyses bring the controller themselves."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from cmg_mj.inputs.includes import MODEL_FILE
from cmg_mj.inputs.text_files import read_text

OWN = "cmg_mj."
"""How the names of this package's plugins begin."""


class Stripped(NamedTuple):
    """An MJCF without this package's plugins.

    Attributes:
        text: The MJCF.
        plugins: The names of the plugins that were in it.
    """

    text: str
    plugins: tuple[str, ...]


def strip_plugins(path: Path) -> Stripped | None:
    """Take this package's plugins out of a model file, with their instances and sensors.

    Args:
        path: The file; files that it includes are not looked into.

    Returns:
        The model without them; None if it has none.
    """
    text = read_text(path, str(path), MODEL_FILE)
    if OWN not in text:
        return None
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError:  # MuJoCo says what is wrong
        return None
    plugins: dict[str, None] = {}
    instances: set[str] = set()
    for extension in root.findall("extension"):
        for plugin in extension.findall("plugin"):
            if plugin.get("plugin", "").startswith(OWN):
                plugins[plugin.get("plugin", "")] = None
                instances |= {instance.get("name", "") for instance in plugin.findall("instance")}
                extension.remove(plugin)
    for sensors in root.findall("sensor"):
        for sensor in sensors.findall("plugin"):
            if sensor.get("plugin", "").startswith(OWN) or sensor.get("instance") in instances:
                sensors.remove(sensor)
    return Stripped(ElementTree.tostring(root, encoding="unicode"), tuple(plugins)) if plugins else None


def plugins_in(path: Path) -> tuple[str, ...]:
    """Name this package's plugins in a model file."""
    stripped = strip_plugins(path)
    return () if stripped is None else stripped.plugins

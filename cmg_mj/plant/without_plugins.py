"""Takes this package's plugins out of an MJCF: its own runs and analyses bring the controller themselves.

What is taken out is text, before MuJoCo reads it: MuJoCo reads no file with a plugin whose library is not loaded, and
a parsed model keeps the plugin's name in its <extension>. The text may be anything that MuJoCo takes, which is more
than Python's XML parser does.
"""

from __future__ import annotations

import html
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import mujoco

from cmg_mj.inputs.files import MAX_MODEL_BYTES, model_files, read_text

OWN = "cmg_mj."
"""Prefix of the names of this package's plugins."""
_TOKEN = re.compile(
    r"<!--.*?-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>"
    r"|<(?P<end>/?)(?P<tag>[\w:.-]+)(?P<attributes>(?:[^<>\"']|\"[^\"]*\"|'[^']*')*)>",
    re.DOTALL,
)
_ATTRIBUTE = re.compile(r"""([\w:.-]+)\s*=\s*(?:"([^"]*)"|'([^']*)')""")
_COPY = "#{} without plugins of "
"""Prefix of the name of a file's copy: MuJoCo takes files of the same name for each other."""
NAMES_OF_COPIES = re.compile(_COPY.format(r"\d+"))


class Stripped(NamedTuple):
    """An MJCF without this package's plugins.

    Attributes:
        main: Name of the model's copy, in the folder of the model.
        copies: The files that are changed: name of the copy -> text.
        plugins: The names of the plugins that were in it.
    """

    main: str
    copies: dict[str, str]
    plugins: tuple[str, ...]

    def parse(self) -> mujoco.MjSpec:
        """Read the model as if its files were without the plugins, where they are."""
        with mujoco.MjVfs() as copies:
            for name, text in self.copies.items():
                copies[name] = text.encode()
            return mujoco.MjSpec.from_file(self.main, vfs=copies)


class _Value(NamedTuple):
    """An attribute's value, and where it is in the text."""

    text: str
    start: int
    end: int


class _Element(NamedTuple):
    """An element, from the beginning of its first tag to the end of its last."""

    tag: str
    attributes: dict[str, _Value]
    start: int
    end: int

    def get(self, name: str) -> str:
        return self.attributes[name].text if name in self.attributes else ""


def strip_plugins(path: Path) -> Stripped | None:
    """Take this package's plugins out of a model, with their instances and sensors.

    Args:
        path: The model's file; what it includes or attaches is looked into.

    Returns:
        The model without them; None if it has none.
    """
    if not any(OWN in _unescaped(read_text(file, str(file), MAX_MODEL_BYTES)) for file in model_files(path)):
        return None
    stripper = _Stripper()
    main = Path(os.path.abspath(path))
    stripper.read(main, main.parent)
    name = stripper.copy(main, main.parent)
    return Stripped(name, stripper.copies, tuple(stripper.plugins)) if name else None


class _Stripper:
    """The files of a model, each read once for every model that it is a part of."""

    def __init__(self) -> None:
        self.plugins: dict[str, None] = {}
        self.copies: dict[str, str] = {}
        self._instances: set[str] = set()
        self._files: dict[tuple[Path, Path], tuple[str, list[_Element]]] = {}
        self._names: dict[tuple[Path, Path], str] = {}

    def read(self, file: Path, model: Path) -> None:
        """Read a file and those it names.

        Args:
            file: The file.
            model: Folder of the model that it is a part of.
        """
        if (file, model) in self._files or not file.is_file():
            return
        text = read_text(file, str(file), MAX_MODEL_BYTES)
        elements = list(_elements(text))
        self._files[file, model] = text, elements
        for element in elements:
            if _is_own(element):
                self.plugins[element.get("plugin")] = None
                inner = (other for other in elements if element.start < other.start and other.end < element.end)
                self._instances |= {other.get("name") for other in inner if other.tag == "instance"}
            for _, named in _named_files(element, file, model):
                self.read(*named)

    def copy(self, file: Path, model: Path) -> str:
        """Make copies of a file and of those it names, if they have plugins.

        Args:
            file: The file, which has been read.
            model: Folder of the model that it is a part of.

        Returns:
            Name of the copy; empty if there is nothing to change.
        """
        key = file, model
        if key not in self._files or key in self._names:
            return self._names.get(key, "")
        self._names[key] = ""
        text, elements = self._files[key]
        changes = {}
        for element in elements:
            if _is_own(element) or self._belongs_to_own(element):
                lines = text.count("\n", element.start, element.end)  # MuJoCo's messages count them
                changes[element.start] = element.end, "\n" * lines
            for value, named in _named_files(element, file, model):
                if name := self.copy(*named):
                    changes[value.start] = value.end, html.escape(name)
        if changes:
            self._names[key] = str(file.with_name(_COPY.format(len(self._names)) + file.name))
            self.copies[self._names[key]] = _changed(text, changes)
        return self._names[key]

    def _belongs_to_own(self, element: _Element) -> bool:
        return element.tag == "plugin" and not element.get("plugin") and element.get("instance") in self._instances


def _is_own(element: _Element) -> bool:
    return element.tag == "plugin" and element.get("plugin").startswith(OWN)


def _named_files(element: _Element, file: Path, model: Path) -> Iterator[tuple[_Value, tuple[Path, Path]]]:
    """Find the file that an element names where MuJoCo finds it, with the folder of the model it is a part of."""
    if element.tag not in ("include", "model") or "file" not in element.attributes:
        return
    value = element.attributes["file"]
    folders = (model, file.parent) if element.tag == "include" else (file.parent,)
    for folder in folders:
        named = Path(os.path.abspath(folder / value.text))
        if named.is_file():
            yield value, (named, model if element.tag == "include" else named.parent)
            return


def _elements(text: str) -> Iterator[_Element]:
    """List the closed <plugin>, <instance>, <include> and <model> elements of an MJCF."""
    opened: list[_Element] = []
    for token in _TOKEN.finditer(text):
        tag, attributes = token["tag"], token["attributes"]
        if tag is None:
            continue
        if token["end"]:
            if opened and opened[-1].tag == tag:
                yield opened.pop()._replace(end=token.end())
            continue
        found = {
            match[1]: _Value(_unescaped(match[match.lastindex or 0]), *_span(match, token.start("attributes")))
            for match in _ATTRIBUTE.finditer(attributes)
        }
        element = _Element(tag, found, token.start(), token.end())
        if attributes.endswith("/"):
            yield element
        else:
            opened.append(element)


def _span(match: re.Match[str], start: int) -> tuple[int, int]:
    first, last = match.span(match.lastindex or 0)
    return start + first, start + last


def _changed(text: str, changes: dict[int, tuple[int, str]]) -> str:
    """Put other text in places, which may lie within each other: then the outer one counts."""
    parts, at = [], 0
    for start in sorted(changes):
        if start >= at:
            end, instead = changes[start]
            parts += [text[at:start], instead]
            at = end
    return "".join([*parts, text[at:]])


def _unescaped(text: str) -> str:
    return html.unescape(text) if "&" in text else text

"""Checks the files of a model before MuJoCo opens them: a pipe never ends, a circle of files crashes MuJoCo."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Iterator
from pathlib import Path

from cmg_mj.errors import InputError
from cmg_mj.inputs.text_files import TextFormat, read_text

MODEL_FILE = TextFormat("model", 50_000_000, "utf-8", "not UTF-8 text")
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_ELEMENT = re.compile(r"<(\w+)\b([^<>]*)>")
_REFERENCE = re.compile(r"""\b(file\w*|meshdir|texturedir|assetdir)\s*=\s*(?:"([^"]*)"|'([^']*)')""")
_XML = ("include", "model")
_COUNT = re.compile(
    r"""<(replicate|composite|flexcomp|texture)\b[^<>]*?\b(count|width|height)\s*=\s*["']([^"']*)["']"""
)
LARGEST_COUNT = 10_000
"""Copies of an element, or pixels in a row of a picture: MuJoCo makes all of them before it checks them."""


def check_files(path: Path) -> list[Path]:
    """Refuse a model that names what is no ordinary file, or that contains itself.

    Args:
        path: The model's file.

    Returns:
        The file and those it names, as far as they are there.

    Raises:
        InputError: The model names a pipe or device, contains itself, or asks for too many copies.
    """
    return list(dict.fromkeys(file for file, _ in _checked(path, path, ())))


def model_files(path: Path) -> list[Path]:
    """List a model's file and those that it includes or attaches, as far as they are there.

    Raises:
        InputError: See `check_files`.
    """
    return list(dict.fromkeys(file for file, is_model in _checked(path, path, ()) if is_model))


def _checked(path: Path, root: Path, within: tuple[Path, ...]) -> Iterator[tuple[Path, bool]]:
    """Check a file and those that it names; yield each, and whether it is a model or a part of one."""
    here = path.resolve()
    if here in within:
        raise InputError(
            f"{root}: contains itself: {' in '.join(p.name for p in (*within[within.index(here) :], here))}"
        )
    if path.suffix.lower() == ".mjb":
        raise InputError(
            f"{root}: is a model that MuJoCo has compiled, whose parts cannot be read any more; give the MJCF "
            "that it was made from (.xml)"
        )
    name = str(root) if path == root else f"{root}: {path.name}"
    text = _COMMENT.sub("", read_text(path, name, MODEL_FILE))
    yield path, True
    for element, name, count in _COUNT.findall(text):
        if math.prod(int(number) for number in re.findall(r"\d{1,20}", count)) > LARGEST_COUNT:
            raise InputError(f"{root}: <{element} {name}={count!r}>: at most {LARGEST_COUNT} are allowed")
    references = [
        (element, *pair) for element, attributes in _ELEMENT.findall(text) for pair in _attributes(attributes)
    ]
    folders = [value for _, name, value in references if name.endswith("dir")]
    for element, name, value in references:
        if name.endswith("dir"):
            continue
        for file in _places(value, path, root, folders):
            if file.is_dir():
                continue  # MuJoCo says so
            if file.exists() and not file.is_file():
                raise InputError(f"{root}: <{element} {name}={value!r}>: is no ordinary file")
            if element in _XML and file.is_file():
                yield from _checked(file, root, (*within, here))
                break
            if file.is_file():
                yield file, False


def _places(value: str, path: Path, root: Path, folders: list[str]) -> Iterator[Path]:
    """List the paths at which MuJoCo may look for a file."""
    for base in dict.fromkeys((path.parent, root.parent)):
        yield base / value
        for folder in folders:
            yield base / folder / value


def _attributes(text: str) -> Iterator[tuple[str, str]]:
    for name, double, single in _REFERENCE.findall(text):
        yield name, html.unescape(double or single)

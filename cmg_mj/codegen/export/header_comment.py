"""The comment at the top of an export: what it is, and what it was made with."""

from __future__ import annotations

import dataclasses
import inspect
import re
import textwrap
from importlib.metadata import version
from typing import Any

from cmg_mj.codegen.export.c_code import Precision
from cmg_mj.controllers.controller import Controller
from cmg_mj.observers.registry import BENCH_PARAMETERS

WIDTH = 110
"""Of its lines."""


def about(name: str, controller: Controller, precision: Precision) -> str:
    """The comment.

    Args:
        name: Of the export.
        controller: What is exported.
        precision: Of its numbers.

    Returns:
        A comment in C, whatever stands in a user's docstring.
    """
    observer = controller.observer
    cls = type(observer)
    first = (inspect.getdoc(cls) or "").split("\n\n")[0]
    own = [parameter for parameter in inspect.signature(cls).parameters if parameter not in BENCH_PARAMETERS]
    lines = [
        f"{name}: observer and control law, {precision} precision; by cmg_mj {version('cmg_mj')}.",
        "",
        f"{cls.__module__}:{cls.__qualname__}",
        *textwrap.wrap(first, WIDTH),
        "",
        f"Made for a period of {controller.law.dt:g} s with these parameters of the observer:",
        *(f"    {line}" for line in settings_of(observer, own) or ["none"]),
    ]
    for given, words in (("model", "this reduced model of the rig"), ("noise", "this noise of the measurement")):
        value = getattr(observer, given, None)
        if dataclasses.is_dataclass(value):
            named = [field.name for field in dataclasses.fields(value)]
            lines += [f"and {words}:", *(f"    {line}" for line in settings_of(value, named))]
    lines += ["What belongs to the law and the sensors stands at the top of the .c file."]
    return "/* " + "\n".join(f" * {_harmless(line)}".rstrip() for line in lines)[3:] + "\n */"


def _harmless(line: str) -> str:
    """Without what would end a comment, begin another, or join lines."""
    return line.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?").rstrip("\\")


def settings_of(thing: Any, names: list[str]) -> list[str]:
    """What a value was made with, as in `tau = 0.02  Time constant [s]`, an entry each.

    Args:
        thing: A value whose docstring has a part "Attributes:".
        names: Of its constructor's parameters.

    Returns:
        Lines.
    """
    values = {name: getattr(thing, name) for name in names if hasattr(thing, name)}
    words = _attributes(type(thing).__doc__ or "")
    width = max((len(f"{name} = {value!r}") for name, value in values.items()), default=0)
    lines = []
    for name, value in values.items():
        text = f"{f'{name} = {value!r}':<{width}}  {words.get(name, '')}"
        lines += textwrap.wrap(text, WIDTH, subsequent_indent=" " * (width + 2)) if width < WIDTH // 2 else [text]
    return lines


def _attributes(docstring: str) -> dict[str, str]:
    """Name -> words, of the part "Attributes:" of a docstring."""
    _, _, part = inspect.cleandoc(docstring).partition("Attributes:\n")
    block = re.split(r"\n(?=\S)", part)[0]
    entries = re.findall(r"^    (\w+)[^:\n]*: (.*(?:\n        .*)*)", block, re.MULTILINE)
    return {name: " ".join(text.split()) for name, text in entries}

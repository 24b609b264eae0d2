"""Formats the comment at the top of an export: the controller and its parameters."""

from __future__ import annotations

import dataclasses
import inspect
import re
import textwrap
from importlib.metadata import version
from typing import TYPE_CHECKING

from cmg_mj.core.controller import Controller
from cmg_mj.core.types import Observer
from cmg_mj.features.export.c_code import Precision
from cmg_mj.inputs.user_classes import UserClassKind
from cmg_mj.laws import LAW_CLASSES, Law, StateFeedback
from cmg_mj.observers import OBSERVER_CLASSES

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

WIDTH = 110
"""Longest line of the comment [characters]."""


def format_header_comment(name: str, controller: Controller, precision: Precision) -> str:
    """Describe an export in a comment of its header.

    Args:
        name: Name of the export.
        controller: The exported controller.
        precision: Precision of its numbers.

    Returns:
        A valid comment in C, whatever a user's docstring contains.
    """
    observer, law = controller.observer, controller.law
    lines = [
        f"{name}: observer and control law, {precision} precision; by cmg_mj {version('cmg_mj')}.",
        "",
        *_first_words(observer),
        "",
        f"Made for a period of {law.dt:g} s with these parameters of the observer:",
        *_choices(observer, OBSERVER_CLASSES),
    ]
    for attribute, words in (("model", "this reduced model of the rig"), ("noise", "this noise of the measurement")):
        value = getattr(observer, attribute, None)
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            fields = [field.name for field in dataclasses.fields(value)]
            lines += [f"and {words}:", *(f"    {line}" for line in describe_parameters(value, fields))]
    if type(law) is StateFeedback:
        lines += ["What belongs to the law and the sensors stands at the top of the .c file."]
    else:
        lines += ["", *_first_words(law), "", "It is the law, with these parameters:", *_choices(law, LAW_CLASSES)]
        lines += ["Its limit and what belongs to the sensors stand at the top of the .c file."]
    return "/* " + "\n".join(f" * {_harmless(line)}".rstrip() for line in lines)[3:] + "\n */"


def class_path(instance: Observer | Law) -> str:
    """Name the class of an observer or a law, as `package.module:Class`."""
    return f"{type(instance).__module__}:{type(instance).__qualname__}"


def _first_words(instance: Observer | Law) -> list[str]:
    """Name an observer or a law, and quote the first words of its docstring."""
    first = (inspect.getdoc(type(instance)) or "").split("\n\n")[0]
    return [class_path(instance), *textwrap.wrap(first, WIDTH)]


def _choices(instance: Observer | Law, kind: UserClassKind) -> list[str]:
    """Describe the parameters of an observer or a law that are a user's choice."""
    names = [name for name in inspect.signature(type(instance)).parameters if name not in kind.bench_parameters]
    return [f"    {line}" for line in describe_parameters(instance, names) or ["none"]]


def _harmless(line: str) -> str:
    """Remove whatever would end a comment, begin another, or join lines."""
    return line.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?").rstrip("\\")


def describe_parameters(instance: Observer | Law | DataclassInstance, names: list[str]) -> list[str]:
    """Describe the parameters of an object, as in `tau = 0.02  Time constant [s]`.

    Args:
        instance: An object whose docstring has a section "Attributes:".
        names: Parameters of its constructor.

    Returns:
        Lines, one or more for each parameter.
    """
    values = {name: getattr(instance, name) for name in names if hasattr(instance, name)}
    words = attribute_descriptions(type(instance).__doc__ or "")
    width = max((len(f"{name} = {value!r}") for name, value in values.items()), default=0)
    lines = []
    for name, value in values.items():
        text = f"{f'{name} = {value!r}':<{width}}  {words.get(name, '')}"
        lines += textwrap.wrap(text, WIDTH, subsequent_indent=" " * (width + 2)) if width < WIDTH // 2 else [text]
    return lines


def attribute_descriptions(docstring: str) -> dict[str, str]:
    """Read the section "Attributes:" of a docstring: name -> description."""
    _, _, part = inspect.cleandoc(docstring).partition("Attributes:\n")
    block = re.split(r"\n(?=\S)", part)[0]
    entries = re.findall(r"^    (\w+)[^:\n]*: (.*(?:\n        .*)*)", block, re.MULTILINE)
    return {name: " ".join(text.split()) for name, text in entries}

"""The constants of a controller's C: names, values and units of what the measurement, the law and the trim take."""

from __future__ import annotations

import dataclasses
import inspect
import re
import textwrap
from importlib.metadata import version
from typing import TYPE_CHECKING, NamedTuple

from cmg_mj.core.controller import Controller
from cmg_mj.core.types import Observer
from cmg_mj.features.export.c_code import Precision
from cmg_mj.inputs.user_classes import UserClassKind
from cmg_mj.laws import LAW_CLASSES, Law, StateFeedback
from cmg_mj.observers import OBSERVER_CLASSES
from cmg_mj.stages.trim import trim_of

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


class Constant(NamedTuple):
    """A constant in the C."""

    name: str
    value: float
    meaning: str


class Constants(NamedTuple):
    """The constants that the measurement, the law and the trim take.

    Attributes:
        of_measure: Radii, then the gimbals' directions, then their zeros.
        of_law: The period, the gains, the limit; of a law that is not (8) the limit alone.
        trimmed: Number of updates during which the integrator is trimmed.
        trim_gain: Gain of the trim; see `integrator_trim`.
        trim_part: Index of the part of the estimate that trims the integrator.
        gimbals: Number of gimbals.
    """

    of_measure: list[Constant]
    of_law: list[Constant]
    trimmed: int
    trim_gain: Constant
    trim_part: int
    gimbals: int

    @property
    def all(self) -> list[Constant]:
        """The constants at the top of the C file."""
        return [*self.of_measure, *self.of_law, *([self.trim_gain] if self.trimmed else [])]


def constants_of(controller: Controller) -> Constants:
    """Collect the constants of a controller."""
    tilt, gimbals, trim = controller.tilt, controller.gimbal_angle, trim_of(controller)
    centre = "the common mass centre of rig and cart" if tilt.height else "the tilt axis"
    numbered = list(enumerate(zip(gimbals.directions, gimbals.zeros, strict=True), 1))
    return Constants(
        of_measure=[
            Constant("r_inner", tilt.r_inner, f"inner accelerometer from {centre} [m]"),
            Constant("r_outer", tilt.r_outer, f"outer accelerometer from {centre} [m]"),
            *(Constant(f"direction_{i}", sign, f"sign of u that gimbal {i} is given") for i, (sign, _) in numbered),
            *(Constant(f"zero_{i}", zero, f"encoder {i} at a gimbal angle of 0 [rad]") for i, (_, zero) in numbered),
        ],
        of_law=_of_law(controller.law),
        trimmed=-(-trim.until // controller.period),
        trim_gain=Constant("trim_gain", trim.gain, "from the bias to the integrator [s]"),
        trim_part=trim.part,
        gimbals=len(gimbals.directions),
    )


def _of_law(law: Law) -> list[Constant]:
    limit = Constant("rate_limit", float(law.rate_limit), "largest gimbal rate [rad/s]")
    if type(law) is not StateFeedback:  # its other numbers are in its formulas
        return [limit._replace(meaning=f"{limit.meaning}; the law's formulas have it too, if it knows it")]
    k1, k2, k3, k4 = law.gains
    return [
        Constant("period", law.dt, "from one update to the next [s]"),
        Constant("gain_x1", k1, "on the tilt [1/s]"),
        Constant("gain_x2", k2, "on the tilt rate"),
        Constant("gain_x3", k3, "on the gimbal angle [1/s]"),
        Constant("gain_x_e", k4, "on the integrator [1/s^2]"),
        limit,
    ]


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

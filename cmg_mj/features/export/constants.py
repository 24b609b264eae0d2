"""The constants of a controller's C: names, values and units of what the measurement, the law and the trim take."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Iterator
from importlib.metadata import version
from typing import Any, NamedTuple

from cmg_mj.core.axis import AxisControl
from cmg_mj.core.tilt import PairTilt
from cmg_mj.core.types import Observer
from cmg_mj.features.export.c_code import Precision
from cmg_mj.laws import Law, StateFeedback
from cmg_mj.stages.trim import trim_of


class Constant(NamedTuple):
    """A constant in the C."""

    name: str
    value: float
    meaning: str


class Constants(NamedTuple):
    """The constants that the measurement, the law and the trim take.

    Attributes:
        of_measure: Radii, then the gimbals' directions, then their zeros; of accelerometers beside the ray where.
        of_law: The period, the gains, the limit; of a law that is not (8) the limit alone.
        trimmed: Number of updates during which the integrator is trimmed.
        trim_gain: Gain of the trim; see `Trim`.
        trim_part: Index of the part of the estimate that trims the integrator.
        gimbals: Number of gimbals.
    """

    of_measure: list[Constant]
    of_law: list[Constant]
    trimmed: int
    trim_gain: Constant
    trim_part: int
    gimbals: int


def constants_of(controller: AxisControl) -> Constants:
    """Collect the constants of a controller."""
    tilt, gimbals, trim = controller.plant.tilt, controller.plant.gimbal_angle, trim_of(controller)
    centre = "the common mass centre of rig and cart" if tilt.height else "the tilt axis"
    numbered = list(enumerate(zip(gimbals.directions, gimbals.zeros, strict=True), 1))
    return Constants(
        of_measure=[
            Constant("r_inner", tilt.r_inner, f"inner accelerometer from {centre} [m]"),
            Constant("r_outer", tilt.r_outer, f"outer accelerometer from {centre} [m]"),
            *(Constant(f"direction_{i}", sign, f"sign of u that gimbal {i} is given") for i, (sign, _) in numbered),
            *(Constant(f"zero_{i}", zero, f"encoder {i} at a gimbal angle of 0 [rad]") for i, (_, zero) in numbered),
            *_beside(tilt),
        ],
        of_law=_of_law(controller.law),
        trimmed=-(-trim.until // controller.period),
        trim_gain=Constant("trim_gain", trim.gain, "from the bias to the integrator [s]"),
        trim_part=trim.part,
        gimbals=len(gimbals.directions),
    )


def _beside(tilt: PairTilt) -> Iterator[Constant]:
    """Yield where accelerometers that are not on the ray lie beside it, and by how much they are turned."""
    if not tilt.is_radial:
        for which, across in zip(("inner", "outer"), tilt.across, strict=True):
            yield Constant(f"across_{which}", across, f"{which} accelerometer beside the radial line [m]")
        for which, angle in zip(("inner", "outer"), tilt.angles, strict=True):
            yield Constant(f"angle_{which}", angle, f"{which} accelerometer's axes, turned from across to up [rad]")


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


def format_header_comment(name: str, controller: AxisControl, precision: Precision) -> str:
    """Describe an export in a comment of its header.

    Args:
        name: Name of the export.
        controller: The exported controller.
        precision: Precision of its numbers.

    Returns:
        A valid comment in C, whatever a user's docstring contains.
    """
    law = controller.law
    lines = [f"{name}: {precision} precision, a period of {law.dt:g} s; by cmg_mj {version('cmg_mj')}.", ""]
    lines += _described(controller.observer)
    if type(law) is not StateFeedback:  # whose numbers are in the .c file
        lines += _described(law)
    safe = (line.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?").rstrip("\\") for line in lines)
    return "/* " + "\n".join(f" * {line}".rstrip() for line in safe)[3:] + "\n */"


def class_path(part: Observer | Law) -> str:
    """Name the class of an observer or a law, as `package.module:Class`."""
    return f"{type(part).__module__}:{type(part).__qualname__}"


def _described(part: Any) -> list[str]:
    """Name a class, quote the first words of its docstring, and list its parameters; then those that are objects."""
    docstring = inspect.getdoc(type(part)) or ""
    words = attribute_descriptions(docstring)
    lines, objects = [class_path(part), *docstring.partition("\n\n")[0].splitlines()], []
    for name in inspect.signature(type(part)).parameters:
        value = getattr(part, name, None)
        if dataclasses.is_dataclass(value):
            objects += _described(value)
        elif value is not None:
            lines.append(f"    {name} = {value!r}  {words.get(name, '').partition('. ')[0]}")
    return lines + objects


def attribute_descriptions(docstring: str) -> dict[str, str]:
    """Read the section "Attributes:" of a docstring: name -> description."""
    _, _, part = inspect.cleandoc(docstring).partition("Attributes:\n")
    block = re.split(r"\n(?=\S)", part)[0]
    entries = re.findall(r"^    (\w+)[^:\n]*: (.*(?:\n        .*)*)", block, re.MULTILINE)
    return {name: " ".join(text.split()) for name, text in entries}

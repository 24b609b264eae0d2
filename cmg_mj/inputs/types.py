"""Types of the fields that users set, how strictly they are taken, and the marks on them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Field
from pydantic.fields import FieldInfo


@dataclass(frozen=True)
class OnGrid:
    """Marks a rate [Hz] or a time [s] that must fit the physics steps.

    Attributes:
        unit: `Hz` of a rate, `s` of a time.
    """

    unit: str


@dataclass(frozen=True)
class Batched:
    """Marks a number in which worlds of one batch may differ.

    Attributes:
        law_field: The field of the law that is then an array; the law names it in `arrays`.
    """

    law_field: str | None = None


@dataclass(frozen=True)
class Held:
    """Marks the frequency of something that is held from sample to sample [Hz].

    Attributes:
        what: What is held.
    """

    what: str


class Start:
    """Marks a time at which something begins, before the run ends [s]."""


class PerAxis:
    """Marks a field of which each axis of several may have its own value."""


class OnAllAxes:
    """Marks a field whose value is the same on all axes."""


class OfOneLaw:
    """Marks a field that another law does not take over."""


class NoEffect:
    """Marks a field on which no number of a run depends."""


Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]
NoiseSize = Annotated[float, Field(ge=0.0, le=1e6)]
"""No part is noisier than 1 g/rtHz [ug/rtHz], or shaken by more than 1000 g [mg]."""

MAX_TIME_S = 1e6
"""No time in a scenario is longer: eleven days [s]."""
Duration = Annotated[float, Field(gt=0.0, le=MAX_TIME_S)]
"""A time that passes [s]."""
Instant = Annotated[float, Field(ge=0.0, le=MAX_TIME_S)]
"""A time after the start, or a delay [s]."""
Latency = Annotated[float, Field(ge=0.0, le=1.0)]
"""A sensor's delay [s]: a rig has fallen before a longer one."""
GridDuration = Annotated[Duration, OnGrid("s")]
"""A time that passes in whole physics steps [s]."""
GridInstant = Annotated[Instant, OnGrid("s")]
"""A time after the start, or a delay, in whole physics steps [s]."""
Rate = Annotated[float, Field(ge=0.1, le=1e6), OnGrid("Hz")]
"""Ticks or samples a second [Hz]: no slower than a rig falls, no faster than the smallest physics step."""

Line = Annotated[str, Field(max_length=200, pattern=r"^[^\x00-\x1f\x7f-\x9f]*$")]
"""A line of text, which terminals, plots and recordings show."""

STRICT = ConfigDict(extra="forbid", arbitrary_types_allowed=True, allow_inf_nan=False)
"""Configuration of pydantic's dataclasses: an unknown field, infinity and NaN are refused."""

Mark = TypeVar("Mark")


class Section:
    """Settings of a feature or a disturbance in a scenario; by default without files and unmodelled effects."""

    @property
    def unmodelled(self) -> str:
        """Words for an effect that the reduced model lacks; empty if it lacks none."""
        return ""

    @property
    def files(self) -> tuple[str, ...]:
        """Files that the run depends on."""
        return ()

    def located(self, beside: Path) -> Self:
        """Return the settings with whole paths of files, which may start from a folder."""
        return self

    def limit_step(self, step_s: float | None, integrator: str, longest_s: float, path: Path) -> float:
        """Return the longest physics step that follows what is set here.

        Args:
            step_s: The step that the scenario sets, None for none [s].
            integrator: The integrator that it sets.
            longest_s: The longest step without these settings [s].
            path: The model's file, for messages.

        Returns:
            The step [s].

        Raises:
            InputError: The step or the integrator that is set does not follow it.
        """
        return longest_s


def marked_fields(section: type, mark: type[Mark]) -> dict[str, Mark]:
    """Find the fields that have a mark.

    Args:
        section: A class of pydantic's.
        mark: The mark's class.

    Returns:
        Field, `push.torque_n_m` -> its mark.
    """
    marks: dict[str, Mark] = {}
    for name, field in pydantic_fields(section).items():
        marks |= [(name, item) for item in field.metadata if isinstance(item, mark)]
        for part in parts_of(field.annotation):
            marks |= {f"{name}.{below}": item for below, item in marked_fields(part, mark).items()}
    return marks


def marked_values(section: BaseModel, mark: type | tuple[type, ...]) -> Iterator[tuple[str, float, Any]]:
    """Go through the numbers of a section that have a mark.

    Args:
        section: The section, such as a scenario.
        mark: The mark's class, or several.

    Yields:
        Field, `push.0.torque_n_m`, its value, its mark.
    """
    for name, field in pydantic_fields(type(section)).items():
        value = getattr(section, name)
        yield from ((name, value, item) for item in field.metadata if isinstance(item, mark))
        parts = {f"{name}.{i}": part for i, part in enumerate(value)} if isinstance(value, list) else {name: value}
        for at, part in parts.items():
            yield from ((f"{at}.{below}", number, item) for below, number, item in marked_values(part, mark))


def pydantic_fields(section: Any) -> Mapping[str, FieldInfo]:
    """Return the fields of a class of pydantic's; none of anything else."""
    return getattr(section, "__pydantic_fields__", {})


def parts_of(annotation: Any) -> list[Any]:
    """List what a type is put together from; one without parts alone."""
    arguments = get_args(annotation)
    return [part for argument in arguments for part in parts_of(argument)] if arguments else [annotation]

"""A claim of a paper beside what this software obtains, and the section of a paper it stands in."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from cmg_mj.visualization.plots.figure_spec import Picture

Verdict = Literal["reproduced", "reproduced within stated conditions", "not reproduced"]

OnShare = Callable[[float], None]
"""Called with the share of a section that is done."""


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One figure, table, remark, proof or statement. Its verdict follows from what was found.

    Attributes:
        place: Place in the paper: `Fig. 2`, `Remark 1`, `Section V`.
        statement: Statement of the paper there, in our words.
        result: Result obtained, with its figures, in words.
        table: More figures than a sentence bears, as a Markdown table below the words.
        holds: Whether what was obtained bears the paper out, computed from the figures.
        conditions: Under which conditions it holds, a whole sentence; empty if it holds outright.
        otherwise: Explanation where it does not hold, a whole sentence.
        figures: The numbers behind `result`, by names that end in their unit, as JSON can hold them.
        pictures: Plots.
        is_ours: Whether the claim is not the paper's but ours, such as its observer on the rig.
    """

    place: str
    statement: str
    result: str
    table: str = ""
    holds: bool
    conditions: str = ""
    otherwise: str = "The figures above do not bear it out."
    figures: Mapping[str, Any] = field(default_factory=dict)
    pictures: Sequence[Picture] = ()
    is_ours: bool = False

    def __post_init__(self) -> None:
        for name in ("conditions", "otherwise"):
            text = getattr(self, name)
            if text and not (" " in text and text.endswith(".")):
                raise ValueError(f"{self.place}: {name} = {text!r}: must be a whole sentence, which the report prints")
        if not self.otherwise:
            raise ValueError(f"{self.place}: otherwise: say what to make of it where it does not hold")
        object.__setattr__(self, "holds", bool(self.holds))  # numpy's truth is no JSON

    @property
    def verdict(self) -> Verdict:
        """The comparison of the paper with what was obtained."""
        if not self.holds:
            return "not reproduced"
        return "reproduced within stated conditions" if self.conditions else "reproduced"

    @property
    def reason(self) -> str:
        """The conditions under which it holds, or why it does not; empty if it holds outright."""
        return self.conditions if self.holds else self.otherwise


@dataclass(frozen=True)
class Section:
    """A part of a paper whose claims are obtained in one go.

    Attributes:
        title: Title that the progress bar shows.
        seconds: About how long it takes, for the progress bar.
        claims: Obtains them.
    """

    title: str
    seconds: float
    claims: Callable[[OnShare], list[Claim]]


def obtain(parts: Sequence[Callable[[], Claim]], on_share: OnShare) -> list[Claim]:
    """Obtain claims one by one, and report the share done before each."""
    claims = []
    for i, part in enumerate(parts):
        on_share(i / len(parts))
        claims.append(part())
    return claims

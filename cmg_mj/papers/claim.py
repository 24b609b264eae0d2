"""A claim of a paper beside what this software obtains, and the section of a paper it stands in."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cmg_mj.view.plots.figure import Picture

VERDICTS = {
    "reproduced": "the claim holds, and the paper prints all that the claim depends on",
    "reproduced within stated conditions": "the claim holds with an assumption of ours (a push, a bias e, noise, a "
    "drive), with a misprint mended, or in part, as its row says",
    "illustrated": "the claim is a general statement and holds for the systems on which it was tried. This is no proof",
    "cannot be tested": "the outcome depends on something that the paper does not give, such as a recording or a gain",
    "not reproduced": "the claim does not hold, for the reason in its row",
}
"""Verdict -> its meaning: the rule of `Claim.verdict` in words."""

Array = np.ndarray
"""An array of NumPy's."""

OnShare = Callable[[float], None]
"""Called with the share of a section that is done."""


def plain(value: Any) -> Any:
    """Make figures what JSON can hold: text for names, lists for arrays, None for what is not finite."""
    if isinstance(value, Mapping):
        return {str(name): plain(inner) for name, inner in value.items()}
    if type(value) in (list, tuple):  # an interval stays one
        return [plain(inner) for inner in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


@dataclass(frozen=True)
class Claim:
    """One figure, table, remark, proof or statement. Its verdict follows from what was found and what is declared.

    Attributes:
        place: Place in the paper: `Fig. 2`, `Remark 1`, `Section V`.
        statement: Statement of the paper there, in our words.
        holds: True if the figures confirm the claim, computed from them; or such a value for each of several
            measures, all of which must hold.
        one_suffices: Whether the measures are settings that the paper leaves open, of which one must hold.
        assumes: Assumptions of ours, which the paper does not print and the claim depends on, such as `push`, `noise`
            or `method`, each with its size in a few words.
        is_general: Whether the statement is a general one, which was tried on some systems and not proved.
        missing_data: Data that the paper does not give and that decide the outcome, a whole sentence; empty if none.
        conditions: The misprint that was mended, or for which part it holds, a whole sentence; empty if neither.
        otherwise: Explanation where it does not hold, a whole sentence.
        figures: The numbers found, by names that end in their unit; `plain` makes them what JSON can hold.
        picture: Plot.
        is_ours: Whether the claim is not the paper's but ours, such as its observer on the rig.
        measures: Measure -> true if the claim holds by it; empty if `holds` is one value.
    """

    place: str
    statement: str
    holds: bool | np.bool_ | Mapping[str, bool]
    one_suffices: bool = False
    assumes: Mapping[str, str] = field(default_factory=dict)
    is_general: bool = False
    missing_data: str = ""
    conditions: str = ""
    otherwise: str = "The figures contradict the claim."
    figures: Mapping[str, Any] = field(default_factory=dict)
    picture: Picture | None = None
    is_ours: bool = False
    measures: Mapping[str, bool] = field(init=False)

    def __post_init__(self) -> None:
        measures = self.holds if isinstance(self.holds, Mapping) else {}
        object.__setattr__(self, "measures", {name: bool(value) for name, value in measures.items()})
        judge = any if self.one_suffices else all
        object.__setattr__(self, "holds", judge(measures.values()) if measures else bool(self.holds))
        object.__setattr__(self, "figures", plain(self.figures))

    @property
    def verdict(self) -> str:
        """The comparison of the paper with what was obtained: the one rule, whose words are `VERDICTS`."""
        if self.missing_data:
            return "cannot be tested"
        if not self.holds:
            return "not reproduced"
        if self.is_general:
            return "illustrated"
        if self.assumes or self.conditions or self.one_suffices:
            return "reproduced within stated conditions"
        return "reproduced"

    @property
    def reason(self) -> str:
        """The conditions under which it holds, or why it does not; empty if it holds outright."""
        return " ".join(text for text in (self.missing_data, self.conditions if self.holds else self.otherwise) if text)


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


def section(title: str, seconds: float, *parts: Callable[[], Claim | list[Claim]]) -> Section:
    """Make a section of parts that are obtained one by one; the share done is reported before each."""

    def claims(on_share: OnShare) -> list[Claim]:
        found = []
        for i, part in enumerate(parts):
            on_share(i / len(parts))
            obtained = part()
            found += obtained if isinstance(obtained, list) else [obtained]
        return found

    return Section(title, seconds, claims)

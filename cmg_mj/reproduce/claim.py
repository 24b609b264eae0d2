"""A claim of a paper beside what this software obtains."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from cmg_mj.picture import Picture

Verdict = Literal["reproduced", "reproduced within stated conditions", "not reproduced"]

OnShare = Callable[[float], None]
"""Called with the share of a step that is done."""


@dataclass(frozen=True)
class Claim:
    """One figure, table, remark, proof or statement.

    Attributes:
        place: Where in the paper: `Fig. 2`, `Remark 1`, `Section V`.
        says: What the paper says there, in our words.
        found: What was obtained, with its figures, in words.
        verdict: How the two compare.
        why: The conditions, or why it was not reproduced; needed unless it was reproduced outright.
        figures: The numbers behind `found`, by names that end in their unit, as JSON can hold them.
        pictures: Plots.
        ours: Whether the claim is not the paper's but ours, such as its observer on the rig; `says` is what was asked.
    """

    place: str
    says: str
    found: str
    verdict: Verdict
    why: str = ""
    figures: Mapping[str, Any] = field(default_factory=dict)
    pictures: Sequence[Picture] = ()
    ours: bool = False

    def __post_init__(self) -> None:
        if self.verdict != "reproduced" and not self.why:
            raise ValueError(f"{self.place}: {self.verdict}: say under which conditions, or why not")


@dataclass(frozen=True)
class Step:
    """A part of a paper that is reproduced in one go.

    Attributes:
        title: What the progress bar shows.
        seconds: About how long it takes, for the progress bar.
        run: Obtains the claims.
    """

    title: str
    seconds: float
    run: Callable[[OnShare], list[Claim]]


def verdict(holds: bool, conditions: str = "") -> Verdict:
    """Reproduced, outright or under conditions, or not."""
    if not holds:
        return "not reproduced"
    return "reproduced within stated conditions" if conditions else "reproduced"

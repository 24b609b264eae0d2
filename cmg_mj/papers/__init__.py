"""Every figure, table, remark and proof of the four papers, beside what this software obtains.

A folder a paper: `paper.py` has the printed constants and equations, each other file a section's claims, and
`SECTIONS` lists them. `claim.py` is what a claim is, `report.py` writes them down. Nothing outside imports this floor
but the command.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from cmg_mj.papers.claim import Claim, Section

PAPERS = {
    "aranovskiy2020": "Experimental comparison of velocity observers: a scissored pair CMG case study",
    "sokolov2019": "Experimental comparison of velocity estimators for a control moment gyroscope inverted pendulum",
    "dao2023": "A design method of adaptive disturbance observer based on Friedland-Tacker equation",
    "andrieu2009": "High gain observers with updated gain and homogeneous correction terms",
}
"""Paper -> its title."""

BEYOND = {"beyond": "A step beyond the papers"}
"""What is reproduced only when asked for by name, because it takes long."""


@dataclass
class Reproduced:
    """What was obtained for one paper.

    Attributes:
        paper: Its short name.
        claims: One a figure, table, remark, proof or statement.
        complete: Whether all sections were done (not interrupted).
        seconds: How long it took [s].
    """

    paper: str
    claims: list[Claim] = field(default_factory=list)
    complete: bool = False
    seconds: float = 0.0


def sections_of(paper: str) -> list[Section]:
    """The sections in which a paper is reproduced."""
    return importlib.import_module(f"cmg_mj.papers.{paper}").SECTIONS


def reproduce(papers: Sequence[str], on_progress: Callable[[str, float], None]) -> list[Reproduced]:
    """Obtain every claim of the papers.

    Args:
        papers: Their short names, of `PAPERS`.
        on_progress: Called now and then with what is being done and the share done.

    Returns:
        One entry a paper. If the user interrupted, what was obtained until then.
    """
    work = [(paper, section) for paper in papers for section in sections_of(paper)]
    total = sum(section.seconds for _, section in work)
    entries = {paper: Reproduced(paper) for paper in papers}
    before = 0.0
    try:
        for paper, section in work:

            def on_share(share: float, before: float = before, section: Section = section, paper: str = paper) -> None:
                on_progress(f"{paper}: {section.title}", (before + share * section.seconds) / total)

            on_share(0.0)
            start = time.perf_counter()
            entries[paper].claims += section.claims(on_share)
            entries[paper].seconds += time.perf_counter() - start
            before += section.seconds
            entries[paper].complete = section is sections_of(paper)[-1]
    except KeyboardInterrupt:
        pass
    return list(entries.values())

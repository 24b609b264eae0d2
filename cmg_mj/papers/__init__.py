"""Every figure, table, remark and proof of the four papers, beside what this software obtains.

A folder a paper: `paper.py` has the printed constants and equations, each other file a section's claims, and
`SECTIONS` lists them. `claim.py` is what a claim is, `report.py` writes them down. Nothing outside imports this floor
but the command.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec

from cmg_mj.core.errors import InputError
from cmg_mj.papers.claim import Claim, Section

PAPERS = {
    "aranovskiy2020": "Experimental comparison of velocity observers: a scissored pair CMG case study",
    "sokolov2019": "Experimental comparison of velocity estimators for a control moment gyroscope inverted pendulum",
    "dao2023": "A design method of adaptive disturbance observer based on Friedland-Tacker equation",
    "andrieu2009": "High gain observers with updated gain and homogeneous correction terms",
}
"""Paper -> its title."""

SYMBOLIC = {"aranovskiy2020", "sokolov2019"}
"""The papers that need sympy, which the extra `[papers]` has."""


@dataclass
class Reproduction:
    """The claims obtained for one paper.

    Attributes:
        paper: Its short name.
        claims: One a figure, table, remark, proof or statement.
        complete: Whether all sections were done (not interrupted).
        seconds: Time that it took [s].
    """

    paper: str
    claims: list[Claim] = field(default_factory=list)
    complete: bool = False
    seconds: float = 0.0


def check_installed(papers: Iterable[str]) -> None:
    """Check that all packages that the papers need are there, before anything is computed.

    Args:
        papers: Their short names.

    Raises:
        InputError: A package is missing.
    """
    symbolic = " and ".join(sorted(SYMBOLIC.intersection(papers)))
    if symbolic and find_spec("sympy") is None:
        raise InputError(f'{symbolic}: sympy is not installed: python -m pip install "cmg_mj[papers]"')


def sections_of(paper: str) -> list[Section]:
    """Import the sections in which a paper is reproduced."""
    return importlib.import_module(f"cmg_mj.papers.{paper}").SECTIONS


def reproduce(papers: Sequence[str], on_progress: Callable[[str, float], None]) -> list[Reproduction]:
    """Obtain every claim of the papers.

    Args:
        papers: Their short names, of `PAPERS`.
        on_progress: Called now and then with what is being done and the share done.

    Returns:
        One entry a paper. If the user interrupted, what was obtained until then.

    Raises:
        InputError: A package that a paper needs is missing.
    """
    check_installed(papers)
    sections = {paper: sections_of(paper) for paper in papers}
    entries = [Reproduction(paper) for paper in papers]
    total = sum(section.seconds for of_paper in sections.values() for section in of_paper)
    label, done, span = "", 0.0, 0.0

    def on_share(share: float) -> None:
        on_progress(label, done + share * span)

    try:
        for entry in entries:
            for section in sections[entry.paper]:
                label, span = f"{entry.paper}: {section.title}", section.seconds / total
                on_share(0.0)
                start = time.perf_counter()
                entry.claims += section.claims(on_share)
                entry.seconds += time.perf_counter() - start
                done += span
            entry.complete = True
    except KeyboardInterrupt:
        pass
    return entries

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

NEEDS = {"aranovskiy2020": ("sympy",), "sokolov2019": ("sympy",)}
"""Paper -> the packages that it needs beyond the bench's; the extra `[papers]` has them all."""


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
    needed = {(paper, package) for paper in papers for package in NEEDS.get(paper, ())}
    missing = sorted((paper, package) for paper, package in needed if find_spec(package) is None)
    if missing:
        paper_names = " and ".join(dict.fromkeys(paper for paper, _ in missing))
        packages = " and ".join(dict.fromkeys(package for _, package in missing))
        raise InputError(f'{paper_names}: {packages} is not installed: python -m pip install "cmg_mj[papers]"')


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
    total = sum(section.seconds for paper_sections in sections.values() for section in paper_sections)
    begin = 0.0
    try:
        for entry in entries:
            for section in sections[entry.paper]:
                on_share = _on_share(on_progress, f"{entry.paper}: {section.title}", begin, section.seconds, total)
                on_share(0.0)
                start = time.perf_counter()
                entry.claims += section.claims(on_share)
                entry.seconds += time.perf_counter() - start
                begin += section.seconds
            entry.complete = True
    except KeyboardInterrupt:
        pass
    return entries


def _on_share(
    on_progress: Callable[[str, float], None], label: str, begin: float, seconds: float, total: float
) -> Callable[[float], None]:
    """Turn a section's share into that of the whole, of which so many seconds lie before the section."""
    return lambda share: on_progress(label, (begin + share * seconds) / total)

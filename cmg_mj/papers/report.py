"""The report: Markdown, plots, and the figures as JSON."""

from __future__ import annotations

import json
import platform
from collections import Counter
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from cmg_mj import markdown
from cmg_mj.papers import BEYOND, PAPERS, Reproduced
from cmg_mj.papers.claim import Claim
from cmg_mj.plots import draw
from cmg_mj.trajectory import whole_file


def figures_of(entries: Sequence[Reproduced]) -> dict[str, Any]:
    """Everything but the pictures, as `--json` prints it."""
    return {
        "versions": {name: version(name) for name in ("cmg_mj", "mujoco", "numpy", "scipy")}
        | {"python": platform.python_version()},
        "papers": {
            entry.paper: {
                "complete": entry.complete,
                "seconds": entry.seconds,
                "claims": [_figures_of_claim(claim) for claim in entry.claims],
            }
            for entry in entries
        },
    }


def _figures_of_claim(claim: Claim) -> dict[str, Any]:
    return {
        "place": claim.place,
        "says": claim.says,
        "found": claim.found,
        "table": claim.table,
        "verdict": claim.verdict,
        "why": claim.why,
        "ours": claim.ours,
        "figures": dict(claim.figures),
        "pictures": [f"{picture.name}.png" for picture in claim.pictures],
    }


def verdict_table(entries: Sequence[Reproduced]) -> str:
    """Every claim and its verdict, as a Markdown table."""
    whose = {False: "", True: " (not the paper's)"}
    rows = [
        (entry.paper, claim.place + whose[claim.ours], claim.says, verdict_words(claim))
        for entry in entries
        for claim in entry.claims
    ]
    return markdown.table(("paper", "place", "claim", "verdict"), rows, text_columns=4)


OURS = {
    "reproduced": "holds",
    "reproduced within stated conditions": "holds within stated conditions",
    "not reproduced": "does not hold",
}
"""The verdicts' words where there is no paper to reproduce."""


def verdict_words(claim: Claim) -> str:
    """A claim's verdict, in the words for those of a paper or for ours."""
    return OURS[claim.verdict] if claim.ours else claim.verdict


def report_text(entries: Sequence[Reproduced]) -> str:
    """The whole report in Markdown."""
    parts = [f"# {_title(entries)}", _count_of_verdicts(entries), verdict_table(entries)]
    for entry in entries:
        parts.append(f"## {entry.paper}: {(PAPERS | BEYOND)[entry.paper]}")
        if not entry.complete:
            parts.append("**Interrupted: not all of this paper's claims are here.**")
        parts += [part for claim in entry.claims for part in _parts_of_claim(claim)]
    return "\n\n".join(parts) + "\n"


def _title(entries: Sequence[Reproduced]) -> str:
    first = entries[0].paper
    title = BEYOND.get(first, f"{first}, reproduced") if len(entries) == 1 else "Four papers, reproduced"
    return title if all(entry.complete for entry in entries) else f"{title} (interrupted: not all of it)"


def _parts_of_claim(claim: Claim) -> list[str]:
    """A claim's paragraphs."""
    parts = [
        f"### {claim.place}: {verdict_words(claim)}",
        f"**{'Ours' if claim.ours else 'The paper'}:** {claim.says}",
        f"**Here:** {claim.found}",
    ]
    if claim.table:
        parts.append(claim.table)
    if claim.why:
        parts.append(f"**{'Conditions' if claim.holds else 'Why not'}:** {claim.why}")
    return parts + [f"![{picture.title}]({picture.name}.png)" for picture in claim.pictures]


def _count_of_verdicts(entries: Sequence[Reproduced]) -> str:
    """How many claims have which verdict, the papers' and ours apart, and how long it took."""
    claims = [claim for entry in entries for claim in entry.claims]
    sentences = []
    for ours, words in ((False, "claims of the papers"), (True, "beside them, not the papers'")):
        counts = Counter(verdict_words(claim) for claim in claims if claim.ours is ours)
        if counts:
            listed = ", ".join(f"{n} {v}" for v, n in counts.most_common())
            sentences.append(f"{sum(counts.values())} {words}: {listed}.")
    return " ".join([*sentences, f"Took {sum(entry.seconds for entry in entries):.0f} s."])


def save_report(folder: Path, entries: Sequence[Reproduced]) -> None:
    """Write report.md, figures.json and the plots, each whole or not at all.

    Args:
        folder: Where; it exists.
        entries: What was obtained.
    """
    for entry in entries:
        for claim in entry.claims:
            for picture in claim.pictures:
                draw(folder / f"{picture.name}.png", picture)
    texts = {"figures.json": json.dumps(figures_of(entries), indent=2), "report.md": report_text(entries)}
    for name, text in texts.items():
        with whole_file(folder / name) as temporary:
            temporary.write_text(text.rstrip("\n") + "\n", encoding="utf-8")

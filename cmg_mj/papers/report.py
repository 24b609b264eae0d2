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
                "claims": [_plain(claim) for claim in entry.claims],
            }
            for entry in entries
        },
    }


def _plain(claim: Claim) -> dict[str, Any]:
    return {
        "place": claim.place,
        "says": claim.says,
        "found": claim.found,
        "verdict": claim.verdict,
        "why": claim.why,
        "ours": claim.ours,
        "figures": dict(claim.figures),
        "pictures": [f"{picture.name}.png" for picture in claim.pictures],
    }


def verdict_table(entries: Sequence[Reproduced]) -> str:
    """Every claim and its verdict, as a Markdown table."""
    rows = [
        (entry.paper, f"{claim.place} (not the paper's)" if claim.ours else claim.place, claim.says, _verdict(claim))
        for entry in entries
        for claim in entry.claims
    ]
    return markdown.table(("paper", "place", "the paper says, or was asked", "verdict"), rows, text_columns=4)


OURS = {
    "reproduced": "holds",
    "reproduced within stated conditions": "holds within stated conditions",
    "not reproduced": "does not hold",
}
"""The verdicts' words where there is no paper to reproduce."""


def _verdict(claim: Claim) -> str:
    return OURS[claim.verdict] if claim.ours else claim.verdict


def report(entries: Sequence[Reproduced]) -> str:
    """The whole report in Markdown."""
    title = "Four papers, reproduced" if len(entries) > 1 else f"{entries[0].paper}, reproduced"
    if entries[0].paper in BEYOND:
        title = BEYOND[entries[0].paper]
    if not all(entry.complete for entry in entries):
        title += " (interrupted: not all of it)"
    parts = [f"# {title}", _count(entries), verdict_table(entries)]
    for entry in entries:
        parts.append(f"## {entry.paper}: {(PAPERS | BEYOND)[entry.paper]}")
        if not entry.complete:
            parts.append("**Interrupted: not all of this paper's claims are here.**")
        for claim in entry.claims:
            who = "Asked" if claim.ours else "The paper"
            parts += [f"### {claim.place}: {_verdict(claim)}", f"**{who}:** {claim.says}", f"**Here:** {claim.found}"]
            if claim.why:
                parts.append(f"**{'Why not' if claim.verdict == 'not reproduced' else 'Conditions'}:** {claim.why}")
            parts += [f"![{picture.title}]({picture.name}.png)" for picture in claim.pictures]
    return "\n\n".join(parts) + "\n"


def _count(entries: Sequence[Reproduced]) -> str:
    claims = [claim for entry in entries for claim in entry.claims]
    sentences = []
    for ours, words in ((False, "claims of the papers"), (True, "beside them, not the papers'")):
        counts = Counter(_verdict(claim) for claim in claims if claim.ours is ours)
        if counts:
            listed = ", ".join(f"{n} {v}" for v, n in counts.most_common())
            sentences.append(f"{sum(counts.values())} {words}: {listed}.")
    return " ".join([*sentences, f"Took {sum(entry.seconds for entry in entries):.0f} s."])


def save(folder: Path, entries: Sequence[Reproduced]) -> None:
    """Write report.md, figures.json and the plots, each whole or not at all.

    Args:
        folder: Where; it exists.
        entries: What was obtained.
    """
    for entry in entries:
        for claim in entry.claims:
            for picture in claim.pictures:
                draw(folder / f"{picture.name}.png", picture)
    for name, text in (("figures.json", json.dumps(figures_of(entries), indent=2)), ("report.md", report(entries))):
        with whole_file(folder / name) as temporary:
            temporary.write_text(text.rstrip("\n") + "\n", encoding="utf-8")

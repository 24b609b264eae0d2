"""The report: Markdown, plots, and the figures as JSON."""

from __future__ import annotations

import json
import platform
from collections import Counter
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from cmg_mj.papers import BEYOND, PAPERS, Reproduction
from cmg_mj.papers.claim import MEANINGS, Claim, Verdict
from cmg_mj.papers.sentences import SentenceLog
from cmg_mj.results import markdown
from cmg_mj.results.folder import RunFolder, Writers, claimed, write_text
from cmg_mj.visualization.plots.figure_spec import draw


def figures_of(entries: Sequence[Reproduction]) -> dict[str, Any]:
    """Collect everything but the pictures, as `--json` prints it."""
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
        "says": claim.statement,
        "found": claim.result,
        "table": claim.table,
        "verdict": claim.verdict,
        "measures": dict(claim.measures),
        "assumes": dict(claim.assumes),
        "general": claim.is_general,
        "missing": claim.missing_data,
        "why": claim.reason,
        "ours": claim.is_ours,
        "figures": dict(claim.figures),
        "pictures": [f"{picture.name}.png" for picture in claim.pictures],
    }


def verdict_table(entries: Sequence[Reproduction]) -> str:
    """Write every claim and its verdict as a Markdown table."""
    rows = [
        (entry.paper, claim.place + _owner_note(claim), claim.statement, verdict_words(claim))
        for entry in entries
        for claim in entry.claims
    ]
    return markdown.table(("paper", "place", "claim", "verdict"), rows, text_columns=4)


OURS: dict[Verdict, str] = {
    "reproduced": "holds",
    "reproduced within stated conditions": "holds within stated conditions",
    "illustrated": "illustrated",
    "cannot be tested": "cannot be tested",
    "not reproduced": "does not hold",
}
"""The verdicts' words where there is no paper to reproduce."""


def verdict_words(claim: Claim) -> str:
    """Say a claim's verdict in the words for those of a paper or for ours."""
    return OURS[claim.verdict] if claim.is_ours else claim.verdict


def report_text(entries: Sequence[Reproduction]) -> str:
    """Write the whole report in Markdown."""
    parts = [f"# {_title(entries)}", *_opening(entries), "## All claims", verdict_table(entries)]
    for entry in entries:
        parts.append(f"## {entry.paper}: {(PAPERS | BEYOND)[entry.paper]}")
        if not entry.complete:
            parts.append("**Interrupted: not all of this paper's claims are here.**")
        log = SentenceLog()
        parts += [part for claim in entry.claims for part in _parts_of_claim(claim, log)]
    return "\n\n".join(markdown.wrap(part) for part in parts) + "\n"


def _opening(entries: Sequence[Reproduction]) -> list[str]:
    """List the meanings of the verdicts, their counts, and the claims that do not hold or cannot be tested."""
    parts = [
        "Each claim stands beside the result of this software. One rule computes the verdict from the claim's figures "
        "and from the assumptions that the claim declares. No parameter was tuned to bring a verdict about.",
        "\n".join(f"- *{verdict}*: {meaning}." for verdict, meaning in MEANINGS.items()),
        "If a claim has several measures, all must hold. docs/assumptions.md lists the assumptions about the rig that "
        "every claim shares.",
        _count_of_verdicts(entries),
    ]
    for verdict in ("not reproduced", "cannot be tested"):
        places = [
            f"- {entry.paper}, {claim.place}{_owner_note(claim)}: {claim.statement}"
            for entry in entries
            for claim in entry.claims
            if claim.verdict == verdict
        ]
        parts += [f"{verdict.capitalize()}:", "\n".join(places)] if places else []
    return parts


def _owner_note(claim: Claim) -> str:
    return " (not the paper's)" if claim.is_ours else ""


def _title(entries: Sequence[Reproduction]) -> str:
    first = entries[0].paper
    title = BEYOND.get(first, f"{first}, reproduced") if len(entries) == 1 else "Four papers, reproduced"
    return title if all(entry.complete for entry in entries) else f"{title} (interrupted: not all of it)"


def _parts_of_claim(claim: Claim, log: SentenceLog) -> list[str]:
    """Write a claim's paragraphs, without the conditions that an earlier claim of the paper had."""
    parts = [
        f"### {claim.place}: {verdict_words(claim)}",
        f"**{'Ours' if claim.is_ours else 'The paper'}:** {claim.statement}",
        f"**Here:** {claim.result}",
    ]
    if claim.table:
        parts.append(claim.table)
    if claim.measures:
        words = "; ".join(f"{name}: {'holds' if holds else 'does not hold'}" for name, holds in claim.measures.items())
        parts.append(f"**By measure:** {words}.")
    if claim.assumes:
        parts.append(f"**Assumed by us:** {'; '.join(f'{name}: {size}' for name, size in claim.assumes.items())}.")
    if claim.reason:
        label = "Conditions" if claim.holds else "Why not"
        label = "Why" if claim.verdict == "cannot be tested" else label
        parts.append(f"**{label}:** {log.omit_repeats(claim.reason, claim.place)}")
    return parts + [f"![{picture.title}]({picture.name}.png)" for picture in claim.pictures]


def _count_of_verdicts(entries: Sequence[Reproduction]) -> str:
    """Count the claims by verdict, the papers' and ours apart, and say how long they took; a paragraph each."""
    claims = [claim for entry in entries for claim in entry.claims]
    sentences = []
    for is_ours, words in ((False, "claims of the papers"), (True, "beside them, not the papers'")):
        counts = Counter(verdict_words(claim) for claim in claims if claim.is_ours is is_ours)
        if counts:
            order = [OURS[v] if is_ours else v for v in OURS]
            counts_text = ", ".join(_counted(counts[v], v) for v in order if counts[v])
            sentences.append(f"{sum(counts.values())} {words}: {counts_text}.")
    return "\n\n".join([*sentences, f"Took {sum(entry.seconds for entry in entries):.0f} s."])


def _counted(count: int, verdict: str) -> str:
    """Write a verdict's count: `1 holds`, `6 hold`."""
    plural = {"holds": "hold", "does": "do"}
    first, *others = verdict.split(" ")
    return " ".join([str(count), first if count == 1 else plural.get(first, first), *others])


REPORT_FILES = ["report.md", "figures.json"]
"""The files of every report; its pictures are beside them."""


def save_report(folder: RunFolder | Path, entries: Sequence[Reproduction]) -> Path:
    """Write report.md, figures.json and the plots, all at once.

    Args:
        folder: Folder to write into. What is there and was not written by cmg_mj stays.
        entries: The reproductions.

    Returns:
        Where they are: the folder, or one in it (see `RunFolder.write`).

    Raises:
        InputError: The folder, or a file, cannot be written.
    """
    pictures = [picture for entry in entries for claim in entry.claims for picture in claim.pictures]
    writers: Writers = {
        "report.md": lambda path: write_text(path, report_text(entries)),
        "figures.json": lambda path: write_text(path, json.dumps(figures_of(entries), indent=2)),
        **{f"{picture.name}.png": lambda path, picture=picture: draw(path, picture) for picture in pictures},
    }
    with claimed(folder) as target:
        return target.write(writers, complete=all(entry.complete for entry in entries))

"""The report: Markdown, plots, and the figures as JSON."""

from __future__ import annotations

import json
import platform
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from cmg_mj.papers import PAPERS, Reproduction
from cmg_mj.papers.claim import VERDICTS, Claim
from cmg_mj.results.folder import RunFolder, Writers, claimed, write_text
from cmg_mj.results.tables import markdown_table, wrap
from cmg_mj.view.plots.figure import draw


def figures_of(entries: Sequence[Reproduction]) -> dict[str, Any]:
    """Collect everything but the pictures, as `--json` prints it."""
    return {
        "versions": {name: version(name) for name in ("cmg_mj", "mujoco", "numpy", "scipy")}
        | {"python": platform.python_version()},
        "papers": {
            entry.paper: {
                "complete": entry.complete,
                "seconds": entry.seconds,
                "claims": [
                    {
                        "place": claim.place,
                        "says": claim.statement,
                        "found": found(claim),
                        "verdict": claim.verdict,
                        "measures": claim.measures,
                        "assumes": claim.assumes,
                        "general": claim.is_general,
                        "missing": claim.missing_data,
                        "why": claim.reason,
                        "ours": claim.is_ours,
                        "figures": claim.figures,
                        "pictures": [f"{claim.picture.name}.png"] if claim.picture else [],
                    }
                    for claim in entry.claims
                ],
            }
            for entry in entries
        },
    }


SHOWN = 8
"""A row of the report shows at most so many figures; figures.json has all."""


def _flat(name: str, value: Any) -> Iterator[tuple[str, str]]:
    """List a figure, or what is nested in it, by name: numbers to four digits, of a long list only the ends."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _flat(f"{name} {key}".strip(), inner)
    elif not isinstance(value, Sequence) or isinstance(value, str):
        yield name, f"{value:.4g}" if isinstance(value, float) else "none" if value is None else str(value)
    elif len(value) and isinstance(value[0], Mapping):
        for i, inner in enumerate(value):
            yield from _flat(f"{name} {i + 1}", inner)
    else:
        shown = [text for inner in value for _, text in _flat("", inner)]
        yield name, ", ".join(shown if len(shown) <= 4 else [*shown[:2], "...", shown[-1]])


def found(claim: Claim) -> str:
    """Write a claim's figures in one line, with the measures by which it holds."""
    flat = [f"{name} = {text}" for name, text in _flat("", claim.figures)]
    more = [f"{len(flat) - SHOWN} more in figures.json"] if len(flat) > SHOWN else []
    measures = [f"{name}: {'holds' if holds else 'fails'}" for name, holds in claim.measures.items()]
    return "; ".join([*measures, *flat[:SHOWN], *more])


def _place(claim: Claim) -> str:
    return f"{claim.place} (not the paper's)" if claim.is_ours else claim.place


def verdict_table(entries: Sequence[Reproduction]) -> str:
    """Write every claim and its verdict as a Markdown table."""
    rows = [(entry.paper, _place(claim), claim.statement, claim.verdict) for entry in entries for claim in entry.claims]
    return markdown_table(("paper", "place", "claim", "verdict"), rows, text_columns=4)


def _row(claim: Claim) -> tuple[str, ...]:
    place = f"{_place(claim)} [picture]({claim.picture.name}.png)" if claim.picture else _place(claim)
    assumed = "; ".join(f"{name}: {size}" for name, size in claim.assumes.items())
    conditions = " ".join(filter(None, (f"Assumed: {assumed}." if assumed else "", claim.reason)))
    return place, claim.statement, found(claim), claim.verdict, conditions


def report_text(entries: Sequence[Reproduction]) -> str:
    """Write the whole report in Markdown: a table a paper, a row a claim."""
    parts = [
        "# The papers, claim by claim",
        "One rule computes a verdict from the claim's figures and from the assumptions that it declares. No parameter "
        "was tuned to bring a verdict about. If a claim has several measures, all must hold; if a paper leaves open "
        "what its statement depends on, such as the push, one of the settings tried must do. docs/assumptions.md "
        "lists the assumptions about the rig that every claim shares.",
        "\n".join(f"- *{verdict}*: {meaning}." for verdict, meaning in VERDICTS.items()),
    ]
    claims = [claim for entry in entries for claim in entry.claims]
    for is_ours, whose in ((False, "claims of the papers"), (True, "claims beside them, not the papers'")):
        counts = Counter(claim.verdict for claim in claims if claim.is_ours is is_ours)
        counted = ", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS if counts[verdict])
        parts += [f"{counts.total()} {whose}: {counted}."] if counts else []
    for entry in entries:
        parts.append(f"## {entry.paper}: {PAPERS[entry.paper]}")
        if not entry.complete:
            parts.append("**Interrupted: not all of this paper's claims are here.**")
        headings = ("place", "claim", "found", "verdict", "conditions")
        parts.append(markdown_table(headings, [_row(claim) for claim in entry.claims], text_columns=5))
    return "\n\n".join(map(wrap, parts)) + "\n"


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
    pictures = [claim.picture for entry in entries for claim in entry.claims if claim.picture]
    writers: Writers = {
        "report.md": lambda path: write_text(path, report_text(entries)),
        "figures.json": lambda path: write_text(path, json.dumps(figures_of(entries), indent=2)),
        **{f"{picture.name}.png": lambda path, picture=picture: draw(path, picture) for picture in pictures},
    }
    with claimed(folder) as target:
        return target.write(writers, complete=all(entry.complete for entry in entries))

"""Markdown prose is wrapped, and stays the Markdown that it was."""

from __future__ import annotations

import pytest

from cmg_mj.results.tables import WIDTH, markdown_table, wrap

WORDS = "a sentence of several words, " * 12


def test_prose_is_wrapped() -> None:
    lines = wrap(WORDS).splitlines()
    assert len(lines) > 3
    assert max(map(len, lines)) <= WIDTH
    assert " ".join(lines) == WORDS.strip()


def test_the_items_of_a_list_stay_apart() -> None:
    lines = wrap(f"- one\n- {WORDS}\n- three").splitlines()
    assert (lines[0], lines[-1]) == ("- one", "- three")
    assert lines[1].startswith("- a sentence")
    assert all(line.startswith("  a") or line[2:] in WORDS for line in lines[2:-1])


@pytest.mark.parametrize("paragraph", [f"## {WORDS}", markdown_table(("what", "how"), [("tilt", WORDS)])])
def test_what_is_no_prose_keeps_its_lines(paragraph: str) -> None:
    assert wrap(paragraph) == paragraph

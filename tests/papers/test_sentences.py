"""The words of the report: short sentences, and each condition once."""

from __future__ import annotations

import re
from pathlib import Path

from cmg_mj.papers.sentences import LONGEST, SentenceLog, count_words, split_sentences, too_long

DOCS = Path(__file__).parents[2] / "docs"


def test_where_a_sentence_ends() -> None:
    text = "As in Fig. 2 it is 0.5 deg, e.g. at 200 Hz. Not at 50 Hz! (9) fails. Why?"
    parts = ["As in Fig. 2 it is 0.5 deg, e.g. at 200 Hz.", "Not at 50 Hz!", "(9) fails.", "Why?"]
    assert split_sentences(text) == parts
    assert count_words("x1 = 0.5 +- 0.1 rad/s; so.") == 5
    assert list(too_long(f"Short. {'word ' * LONGEST}end.")) == [f"{'word ' * LONGEST}end."]
    assert not list(too_long(f"{'word ' * (LONGEST - 1)}end."))


def test_what_was_said_is_not_said_again() -> None:
    log = SentenceLog()
    assert log.omit_repeats("Ten motions. At 200 Hz.", "Fig. 2") == "Ten motions. At 200 Hz."
    assert log.omit_repeats("Ten motions. At 400 Hz.", "Fig. 3") == "As at Fig. 2. At 400 Hz."
    assert log.omit_repeats("At 400 Hz. Ten motions.", "Table 1") == "As at Fig. 3 and Fig. 2."
    assert log.omit_repeats("Ten motions. Ten motions.", "Fig. 2") == "Ten motions. Ten motions."


def texts(kind: str) -> list[tuple[str, str]]:
    """Paper and text of the paragraphs of a kind in docs/reproduced.md."""
    matches, paper = [], ""
    for paragraph in (DOCS / "reproduced.md").read_text(encoding="utf-8").split("\n\n"):
        if paragraph.startswith("## "):
            paper = paragraph
        elif match := re.match(rf"\*\*(?:{kind}):\*\*\s+(.*)", paragraph, re.DOTALL):
            matches.append((paper, " ".join(match[1].split())))
    return matches


def test_no_sentence_of_the_report_is_long() -> None:
    """The tests of every claim see to it too: tests/papers/conftest.py."""
    long = [sentence for _, text in texts("The paper|Ours|Here|Conditions|Why not|Why") for sentence in too_long(text)]
    assert not long


def test_outright_is_nothing_that_was_assumed() -> None:
    """What is reproduced outright, in docs/reproduced.md, was not tried with a push, an e or a noise of ours."""
    report = (DOCS / "reproduced.md").read_text(encoding="utf-8")
    outright = re.findall(r"^### ([^\n]*): reproduced\n(.*?)(?=^##)", report + "\n## ", re.MULTILINE | re.DOTALL)
    assert len(outright) > 10
    ours = {place for place, text in outright if re.search(r"\bseeds\b|ug/rtHz|\be\s=\s\d|Assumed\sby\sus", text)}
    assert ours == {"Hypotheses 1 and 2"}  # to rounding, whatever push and noise


def test_every_condition_stands_once_in_a_paper() -> None:
    entries = [(paper, s) for paper, text in texts("Conditions|Why not|Why") for s in split_sentences(text)]
    repeats = {entry for entry in entries if entries.count(entry) > 1 and not entry[1].startswith("As at ")}
    assert not repeats

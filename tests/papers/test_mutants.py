"""The list of wrong reports fits the sources: every line is there once, and every test that must catch it exists."""

from __future__ import annotations

import re
from pathlib import Path

from tests.papers.mutants import MUTANTS, PAPERS, TESTS

ROOT = Path(__file__).parents[2]


def test_every_mutant_can_be_made() -> None:
    for mutant in MUTANTS:
        text = (ROOT / PAPERS / mutant.file).read_text(encoding="utf-8")
        assert mutant.apply(text) != text
    assert len({(mutant.file, mutant.old, mutant.new) for mutant in MUTANTS}) == len(MUTANTS) >= 20


def test_every_mutant_has_its_test() -> None:
    for mutant in MUTANTS:
        file, _, name = mutant.test.partition("::")
        assert re.search(rf"^def {name}\(", (ROOT / (TESTS + file)).read_text(encoding="utf-8"), re.MULTILINE), name

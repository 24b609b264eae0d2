"""Limits of style, as `docs/style.py` counts it: once reached, they hold."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

from tests.command import ROOT

LONGEST_PAGE = 3000
"""Words, outside evidence."""
SPLIT_ELSEWHERE = {"README.md", "replay.md", "plugin.md"}
"""Pages that may still be longer."""
UNWRAPPED = {
    "README.md",
    "architecture.md",
    "assumptions.md",
    "beyond.md",
    "glossary.md",
    "gymnasium.md",
    "laws.md",
    "mutations.md",
    "plugin.md",
    "real_rigs.md",
    "recordings.md",
    "replay.md",
    "reproduced.md",
    "results.md",
    "sensor_errors.md",
    "commands_tools.md",
}
"""Pages that still have lines of prose over 100 columns."""
MENDED_ELSEWHERE = {"cmg_mj/scenario/schema.py:78", "cmg_mj/scenario/plant_settings.py:26"}
"""Docstrings that may still begin so."""


def _style() -> ModuleType:
    spec = importlib.util.spec_from_file_location("style", ROOT / "docs" / "style.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules["style"] = module
    spec.loader.exec_module(module)
    return module


STYLE = _style()
PAGES: dict[str, Path] = {page.name: page for page in STYLE.pages(ROOT)}
FOLDERS = [
    *(f"cmg_mj/{path.name}" for path in sorted((ROOT / "cmg_mj").iterdir()) if (path / "__init__.py").exists()),
    "docs/studies",
]
GUIDES = [name for name, page in PAGES.items() if not STYLE.is_evidence(page)]


@pytest.mark.parametrize("name", sorted({*GUIDES} - SPLIT_ELSEWHERE))
def test_pages_outside_evidence_are_short(name: str) -> None:
    assert len(PAGES[name].read_text(encoding="utf-8").split()) <= LONGEST_PAGE


@pytest.mark.parametrize("name", sorted({*PAGES} - UNWRAPPED))
def test_pages_are_wrapped(name: str) -> None:
    assert STYLE.wide_lines(PAGES[name]) == {}


@pytest.mark.parametrize("folder", FOLDERS)
def test_no_docstring_begins_with_a_question_word(folder: str) -> None:
    texts = [text for text in STYLE.code_texts(ROOT, folder)["docstrings"] if text.opens_docstring]
    faulty = [one for one in STYLE.sentences(texts) if one.opens_docstring and "openers" in one.faults()]
    assert [f"{one.place}: {one.text}" for one in faulty if one.place not in MENDED_ELSEWHERE] == []

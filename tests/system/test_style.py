"""Limits of style, as `.ci/style.py` counts it: once reached, they hold."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

from tests.command import ROOT

LONGEST_PAGE = 3000
"""Words, outside evidence."""


def _style() -> ModuleType:
    spec = importlib.util.spec_from_file_location("style", ROOT / ".ci" / "style.py")
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


@pytest.mark.parametrize("name", GUIDES)
def test_pages_outside_evidence_are_short(name: str) -> None:
    assert len(PAGES[name].read_text(encoding="utf-8").split()) <= LONGEST_PAGE


@pytest.mark.parametrize("name", PAGES)
def test_pages_are_wrapped(name: str) -> None:
    assert STYLE.wide_lines(PAGES[name]) == {}


@pytest.mark.parametrize("folder", FOLDERS)
def test_no_docstring_begins_with_a_question_word(folder: str) -> None:
    texts = [text for text in STYLE.code_texts(ROOT, folder)["docstrings"] if text.opens_docstring]
    faulty = [one for one in STYLE.sentences(texts) if one.opens_docstring and "openers" in one.faults()]
    assert [f"{one.place}: {one.text}" for one in faulty] == []

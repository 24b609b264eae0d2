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
MENDED_ELSEWHERE = {
    "cmg_mj/codegen/board/wired_board.py",
    "cmg_mj/inputs/text_files.py",
    "cmg_mj/observers/adaptive.py",
    "cmg_mj/papers/andrieu2009/study.py",
    "cmg_mj/papers/assumed.py",
    "cmg_mj/papers/sokolov2019/rig.py",
    "cmg_mj/plant/without_plugins.py",
    "cmg_mj/results/result.py",
    "cmg_mj/results/wire.py",
    "cmg_mj/scenario/bend_decay.py",
    "cmg_mj/scenario/disturbances.py",
    "cmg_mj/scenario/omissions.py",
    "cmg_mj/scenario/plant_settings.py",
    "cmg_mj/scenario/schema.py",
    "cmg_mj/simulation/physics.py",
    "cmg_mj/studies/push_limits/prospects.py",
    "docs/studies/for_a_builder.py",
    "docs/studies/reproduced.py",
}
"""Files whose docstrings may still begin so."""


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
    faulty = [one for one in faulty if one.place.partition(":")[0] not in MENDED_ELSEWHERE]
    assert [f"{one.place}: {one.text}" for one in faulty] == []

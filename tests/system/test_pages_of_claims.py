"""The script that turns the reports of `cmg-mj reproduce` into pages."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from types import ModuleType

import pytest
from PIL import Image

from cmg_mj.results.markdown import WIDTH
from tests.command import ROOT

REPORT = """# A title

First paragraph.

**Here:** L[0][0] is 3.

![a plot](plot.png)

| a | b |
|---|---|
| 1 | 2 |
"""


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> ModuleType:
    """The script, writing into another folder than docs/."""
    monkeypatch.syspath_prepend(ROOT / "docs" / "studies")
    module = importlib.import_module("reproduced")
    monkeypatch.setattr(module, "DOCS", tmp_path / "docs")
    monkeypatch.setattr(module, "PICTURES", tmp_path / "docs" / "reproduced")
    (tmp_path / "docs").mkdir()
    return module


def run_folder(folder: Path, *papers: str) -> Path:
    folder.mkdir()
    (folder / "report.md").write_text(REPORT, encoding="utf-8")
    (folder / "figures.json").write_text(json.dumps({"papers": {paper: {} for paper in papers}}), encoding="utf-8")
    Image.new("RGB", (1640, 100)).save(folder / "plot.png")
    return folder


def test_the_papers_page_has_small_pictures(script: ModuleType, tmp_path: Path) -> None:
    script.main(run_folder(tmp_path / "run", "dao2023", "andrieu2009"))
    page = (tmp_path / "docs" / "reproduced.md").read_text(encoding="utf-8")
    assert page.startswith("# A title\n\nThis page is the report of `cmg-mj reproduce all`")
    assert "![a plot](reproduced/plot.png)" in page
    assert r"L\[0][0] is 3." in page  # else the site takes it for a link
    with Image.open(tmp_path / "docs" / "reproduced" / "plot.png") as picture:
        assert picture.size == (820, 50)
    assert not (tmp_path / "docs" / "beyond.md").exists()


def test_the_page_beyond_has_no_pictures(script: ModuleType, tmp_path: Path) -> None:
    script.main(run_folder(tmp_path / "run", "beyond"))
    page = (tmp_path / "docs" / "beyond.md").read_text(encoding="utf-8")
    assert page.startswith("# A title\n\nThis page is the report of `cmg-mj reproduce beyond`")
    assert "plot" not in page.replace("its plots", "")
    assert page.endswith("| 1 | 2 |\n")
    assert not (tmp_path / "docs" / "reproduced").exists()


@pytest.mark.parametrize("name", ["reproduced.md", "beyond.md"])
def test_the_pages_are_wrapped(name: str) -> None:
    """Except tables, headings and pictures."""
    lines = (ROOT / "docs" / name).read_text(encoding="utf-8").splitlines()
    prose = [line for line in lines if not line.startswith(("|", "#", "!["))]
    assert not [line for line in prose if len(line) > WIDTH + 2]  # two escaped brackets

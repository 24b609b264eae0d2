"""The page for those who add a claim: its files, taken from it, make a paper that is reproduced."""

from __future__ import annotations

import importlib
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from cmg_mj import papers
from tests.command import ROOT, cmg_mj
from tests.papers.test_floor_plan import imported_from_another_paper, incomplete, needed

PAPER = "levant1998"


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder cmg_mj/ of the page's files, which are importable beside those of the bench."""
    page = (ROOT / "docs" / "add_a_claim.md").read_text(encoding="utf-8")
    files = re.findall(r"```python\n# (\S+)\n(.*?)```", page, flags=re.DOTALL)
    assert len(files) == page.count("```python") == 3
    for name, text in files:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(papers, "__path__", [*papers.__path__, str(tmp_path / "cmg_mj" / "papers")])
    monkeypatch.setitem(papers.PAPERS, PAPER, "Robust exact differentiation via sliding mode technique")
    yield tmp_path / "cmg_mj"
    for name in [name for name in sys.modules if name.startswith(f"cmg_mj.papers.{PAPER}")]:
        del sys.modules[name]
    if hasattr(papers, PAPER):
        delattr(papers, PAPER)


def test_the_paper_of_the_page_is_reproduced(package: Path) -> None:
    run = cmg_mj("reproduce", PAPER, "--json")
    assert run.status == 0, run
    (claim,) = json.loads(run.out)["papers"][PAPER]["claims"]
    assert claim["verdict"] == "illustrated"
    report = (Path("runs") / f"reproduce-{PAPER}" / "report.md").read_text(encoding="utf-8")
    assert "### Theorem 2: illustrated" in report


def test_its_claim_can_fail(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Held against the noise itself instead of its root, the error does not fit."""
    noise = importlib.import_module(f"cmg_mj.papers.{PAPER}.noise")
    monkeypatch.setattr(noise, "noise_error", lambda eps, bound: bound * eps)
    assert noise.noise_claim().verdict == "not reproduced"


def test_it_keeps_the_floor_plan(package: Path) -> None:
    assert incomplete(package) == imported_from_another_paper(package) == []
    assert needed(package, PAPER) - {"numpy"} == set()

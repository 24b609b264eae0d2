"""`cmg-mj reproduce`, with two claims of a paper; those of all four are tested by `python -m pytest -m papers`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from cmg_mj import papers
from cmg_mj.papers.andrieu2009.bioreactor import coordinates, invariance
from cmg_mj.papers.claim import Section
from tests.command import cmg_mj


@pytest.mark.usefixtures("elsewhere")
def test_a_paper_is_reproduced(monkeypatch: pytest.MonkeyPatch) -> None:

    section = Section("the bioreactor's bounds", 1.0, lambda on_share: [invariance(), coordinates()])
    monkeypatch.setattr(papers, "sections_of", {"andrieu2009": [section]}.__getitem__)
    outcome = cmg_mj("reproduce", "andrieu2009", "--json", "--out", "here")
    assert outcome.status == 0, outcome
    paper = json.loads(outcome.out)["papers"]["andrieu2009"]
    assert paper["complete"]
    assert [claim["verdict"] for claim in paper["claims"]] == ["reproduced", "reproduced"]
    assert json.loads(Path("here/figures.json").read_text(encoding="utf-8"))["papers"]["andrieu2009"] == paper
    assert "Section 3, (14), M_eta" in Path("here/report.md").read_text(encoding="utf-8")

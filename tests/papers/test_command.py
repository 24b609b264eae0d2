"""The command `cmg-mj reproduce` and its report, with papers that take no time."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

import pytest

from cmg_mj import papers
from cmg_mj.core.errors import InputError
from cmg_mj.papers.claim import Claim, OnShare, Section
from cmg_mj.papers.report import report_text
from cmg_mj.view.plots.figure import Line, Panel, Picture
from tests.command import cmg_mj

PICTURE = Picture("sokolov2019-fig-1", "a Fig. 1", [Panel("tilt [deg]", [Line([0.0, 1.0], [0.0, 2.0], "true")])])
GOOD = Claim(
    "Fig. 1",
    "it falls | or not",
    holds=True,
    figures={"time_s": 3.0},
    picture=PICTURE,
)
PARTLY = Claim("Remark 1", "always", holds=True, conditions="It is above 100 Hz.")
OURS = Claim(
    "On the rig",
    "it stands",
    holds=False,
    otherwise="It is too light.",
    is_ours=True,
)
UNKNOWN = Claim(
    "Table 2",
    "tuned",
    holds={"(9)": True, "(10)": False},
    missing_data="The paper has no recording.",
    otherwise="Ours is another.",
    assumes={"signal": "a sine", "noise": "none"},
)
NOT = Claim("Section V", "best", holds=False, otherwise="The noise is another.")


def sections(*claims: Claim) -> list[Section]:
    return [Section(claim.place, 1.0, lambda on_share, claim=claim: [claim]) for claim in claims]


@pytest.fixture(autouse=True)
def _quick(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    quick = {
        "aranovskiy2020": sections(GOOD),
        "sokolov2019": sections(NOT),
        "dao2023": sections(PARTLY),
        "andrieu2009": sections(OURS, UNKNOWN),
    }
    monkeypatch.setattr(papers, "sections_of", quick.__getitem__)


def rows(text: str) -> list[list[str]]:
    """The cells of the Markdown tables in a text, without their padding."""
    return [re.split(r"\s+\|\s+", line.strip("| ")) for line in text.splitlines() if line.startswith("|")]


def test_all_papers_make_one_report() -> None:
    run = cmg_mj("reproduce", "all")
    assert run.status == 0, run
    folder = Path("runs/reproduce-all")
    report = (folder / "report.md").read_text()
    counted = "1 reproduced, 1 reproduced within stated conditions, 1 cannot be tested, 1 not reproduced."
    assert f"4 claims of the papers: {counted}" in " ".join(report.split())
    assert [row[-1] for row in rows(run.out)[2:]] == [claim.verdict for claim in (GOOD, NOT, PARTLY, OURS, UNKNOWN)]
    claims = [
        [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in report.splitlines() if line[:1] == "|"
    ]
    assert [row for row in claims if len(row) == 5 and row[0] != "place" and row[0][0] != ":"] == [
        ["Fig. 1 [picture](sokolov2019-fig-1.png)", "it falls \\| or not", "time_s = 3", "reproduced", ""],
        ["Section V", "best", "", "not reproduced", "The noise is another."],
        ["Remark 1", "always", "", "reproduced within stated conditions", "It is above 100 Hz."],
        ["On the rig (not the paper's)", "it stands", "", "not reproduced", "It is too light."],
        [
            "Table 2",
            "tuned",
            "(9): holds; (10): fails",
            "cannot be tested",
            "Assumed: signal: a sine; noise: none. The paper has no recording. Ours is another.",
        ],
    ]
    assert (folder / "sokolov2019-fig-1.png").read_bytes().startswith(b"\x89PNG")


def test_one_papers_figures_as_json() -> None:
    run = cmg_mj("reproduce", "aranovskiy2020", "--json", "--out", "here")
    figures = json.loads(run.out)
    assert run.err == ""
    assert figures == json.loads(Path("here/figures.json").read_text())
    assert list(figures["papers"]) == ["aranovskiy2020"]
    (claim,) = figures["papers"]["aranovskiy2020"]["claims"]
    assert claim["figures"] == {"time_s": 3.0}
    assert (claim["verdict"], claim["why"]) == ("reproduced", "")
    assert claim["pictures"] == ["sokolov2019-fig-1.png"]
    assert {"cmg_mj", "mujoco", "numpy", "scipy", "python"} == set(figures["versions"])


def test_ctrl_c_keeps_what_was_obtained(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(on_share: OnShare) -> list[Claim]:
        raise KeyboardInterrupt

    entries = papers.reproduce(["dao2023"], lambda now, share: None)
    assert entries[0].complete
    monkeypatch.setattr(papers, "sections_of", lambda paper: [*sections(GOOD), Section("endless", 9.0, interrupt)])
    (entry,) = papers.reproduce(["dao2023"], lambda now, share: None)
    assert entry.claims == [GOOD]
    assert not entry.complete
    assert "Interrupted" in report_text([entry])


def test_progress_is_the_share_of_all_sections(monkeypatch: pytest.MonkeyPatch) -> None:
    def halfway(on_share: OnShare) -> list[Claim]:
        on_share(0.5)
        return []

    monkeypatch.setattr(papers, "sections_of", lambda paper: [*sections(GOOD), Section("long", 3.0, halfway)])
    progress: list[tuple[str, float]] = []
    papers.reproduce(["dao2023"], lambda now, share: progress.append((now, share)))
    assert progress == [("dao2023: Fig. 1", 0.0), ("dao2023: long", 0.25), ("dao2023: long", 0.625)]


def test_wrong_input() -> None:
    assert cmg_mj("reproduce", "dao2024").complaint.startswith("'dao2024': no such paper; did you mean 'dao2023'?")


@pytest.mark.parametrize(
    ("declared", "holding", "failing"),
    [
        ({}, "reproduced", "not reproduced"),
        ({"conditions": "A misprint is mended."}, "reproduced within stated conditions", "not reproduced"),
        ({"assumes": {"push": "1 N m"}}, "reproduced within stated conditions", "not reproduced"),
        ({"missing_data": "No recording is given."}, "cannot be tested", "cannot be tested"),
        ({"is_general": True, "conditions": "One system."}, "illustrated", "not reproduced"),
        ({"is_general": True, "assumes": {"signal": "a sine"}}, "illustrated", "not reproduced"),
        ({"missing_data": "No gain is given.", "assumes": {"gains": "2"}}, "cannot be tested", "cannot be tested"),
        (
            {"missing_data": "No gain is given.", "is_general": True, "conditions": "One system."},
            *["cannot be tested"] * 2,
        ),
    ],
)
def test_one_rule_decides(declared: dict[str, Any], holding: str, failing: str) -> None:
    """By what a claim is declared to depend on and by what was found; no verdict is there whatever was found."""

    def verdict(holds: bool | dict[str, bool], *, one_suffices: bool = False) -> str:
        return Claim("Fig. 9", "it is so", holds=holds, one_suffices=one_suffices, **declared).verdict

    assert (verdict(True), verdict(False)) == (holding, failing)
    assert verdict({"tilt": True, "rate": True}) == holding
    assert verdict({"tilt": True, "rate": False}) == failing  # all measures must hold
    some = holding if declared else "reproduced within stated conditions"  # the settings are conditions
    assert verdict({"1 N m": True, "2 N m": False}, one_suffices=True) == some  # one of the settings must
    assert verdict({"1 N m": False, "2 N m": False}, one_suffices=True) == failing


# --- without the packages of the extra [papers] ---------------------------------------------------------------


def test_a_missing_package_ends_it_before_anything_is_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sympy", None)  # import sympy then raises ImportError
    assert cmg_mj("reproduce", "dao2023").status == 0  # which does not need it

    def refuse(paper: str) -> list[Section]:
        raise AssertionError(f"{paper} was begun")

    monkeypatch.setattr(papers, "sections_of", refuse)
    assert cmg_mj("reproduce", "all", "--out", "here").complaint.startswith("aranovskiy2020 and sokolov2019: sympy ")
    assert not Path("here").exists()
    with pytest.raises(InputError, match="sympy"):
        papers.reproduce(["sokolov2019"], lambda now, share: None)

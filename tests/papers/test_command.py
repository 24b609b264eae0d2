"""The command `cmg-mj reproduce` and its report, with papers that take no time."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmg_mj import papers
from cmg_mj.errors import InputError
from cmg_mj.papers.claim import MEANINGS, Claim, OnShare, Section
from cmg_mj.papers.report import report_text
from cmg_mj.visualization.plots.figure_spec import Line, Panel, Picture
from tests.command import cmg_mj

PICTURE = Picture("sokolov2019-fig-1", "a Fig. 1", [Panel("tilt [deg]", [Line([0.0, 1.0], [0.0, 2.0], "true")])])
GOOD = Claim(
    place="Fig. 1",
    statement="it falls | or not",
    result="it fell at 3 s",
    holds=True,
    figures={"time_s": 3.0},
    pictures=[PICTURE],
)
PARTLY = Claim(
    place="Remark 1", statement="always", result="above 100 Hz", holds=True, conditions="It is above 100 Hz."
)
OURS = Claim(
    place="On the rig",
    statement="it stands",
    result="it falls",
    holds=False,
    otherwise="It is too light.",
    is_ours=True,
)
GENERAL = Claim(
    place="Theorem 1",
    statement="any system",
    result="two systems",
    holds=True,
    is_general=True,
    conditions="Two systems were tried.",
    assumes={"signal": "a sine", "noise": "none"},
)
UNKNOWN = Claim(
    place="Table 2",
    statement="tuned",
    result="not tuned",
    holds={"(9)": True, "(10)": False},
    missing_data="The paper has no recording.",
    otherwise="Ours is another.",
)
NOT = Claim(place="Section V", statement="best", result="worst", holds=False, otherwise="The noise is another.")


def sections(*claims: Claim) -> list[Section]:
    return [Section(claim.place, 1.0, lambda on_share, claim=claim: [claim]) for claim in claims]


@pytest.fixture(autouse=True)
def _quick(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    quick = {
        "aranovskiy2020": sections(GOOD),
        "sokolov2019": sections(NOT),
        "dao2023": sections(PARTLY),
        "andrieu2009": sections(OURS),
        "beyond": sections(GOOD),
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
    assert "3 claims of the papers: 1 reproduced, 1 reproduced within stated conditions, 1 not reproduced." in report
    table = [
        ["aranovskiy2020", "Fig. 1", "it falls \\| or not", "reproduced"],
        ["sokolov2019", "Section V", "best", "not reproduced"],
        ["dao2023", "Remark 1", "always", "reproduced within stated conditions"],
        ["andrieu2009", "On the rig (not the paper's)", "it stands", "does not hold"],
    ]
    assert rows(report)[2:] == table
    assert rows(run.out)[2:] == table
    opening = report.partition("## All claims")[0]
    assert "- sokolov2019, Section V: best\n- andrieu2009, On the rig (not the paper's): it stands\n" in opening
    assert "Fig. 1" not in opening  # what holds is in the table
    assert "### Section V: not reproduced" in report
    assert "**Why not:** The noise is another." in report
    assert "**Conditions:** It is above 100 Hz." in report
    assert "![a Fig. 1](sokolov2019-fig-1.png)" in report
    assert "1 beside them, not the papers': 1 does not hold." in report
    assert "### On the rig: does not hold" in report
    assert "**Ours:** it stands" in report
    assert (folder / "sokolov2019-fig-1.png").read_bytes().startswith(b"\x89PNG")
    assert f"Read {folder / 'report.md'}" in run.err


def test_general_claims_and_those_without_data(monkeypatch: pytest.MonkeyPatch) -> None:
    """They are counted, listed and explained apart, for people as for programs."""
    monkeypatch.setattr(papers, "sections_of", lambda paper: sections(GENERAL, UNKNOWN, NOT))
    run = cmg_mj("reproduce", "dao2023")
    assert run.status == 0, run
    report = Path("runs/reproduce-dao2023/report.md").read_text()
    assert "3 claims of the papers: 1 illustrated, 1 cannot be tested, 1 not reproduced." in report
    assert "Not reproduced:\n\n- dao2023, Section V: best\n\nCannot be tested:\n\n- dao2023, Table 2: tuned\n" in report
    assert "### Theorem 1: illustrated" in report
    assert "**Assumed by us:** signal: a sine; noise: none." in report
    assert "### Table 2: cannot be tested" in report
    assert "**By measure:** (9): holds; (10): does not hold." in report
    assert "**Why:** The paper has no recording. Ours is another." in report
    for verdict, meaning in MEANINGS.items():
        assert f"- *{verdict}*: {meaning}." in " ".join(report.split())
    figures = json.loads(cmg_mj("reproduce", "dao2023", "--json").out)
    general, unknown, _ = figures["papers"]["dao2023"]["claims"]
    assert (general["verdict"], general["general"]) == ("illustrated", True)
    assert general["assumes"] == {"signal": "a sine", "noise": "none"}
    assert (unknown["verdict"], unknown["missing"]) == ("cannot be tested", "The paper has no recording.")
    assert unknown["measures"] == {"(9)": True, "(10)": False}


def test_one_papers_figures_as_json() -> None:
    run = cmg_mj("reproduce", "aranovskiy2020", "--json", "--out", "here")
    figures = json.loads(run.out)
    assert run.err == ""
    assert figures == json.loads(Path("here/figures.json").read_text())
    assert list(figures["papers"]) == ["aranovskiy2020"]
    (claim,) = figures["papers"]["aranovskiy2020"]["claims"]
    assert claim["figures"] == {"time_s": 3.0}
    assert claim["verdict"] == "reproduced"
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
    assert report_text([entry]).startswith("# dao2023, reproduced (interrupted: not all of it)")


def test_progress_is_the_share_of_all_sections(monkeypatch: pytest.MonkeyPatch) -> None:
    def halfway(on_share: OnShare) -> list[Claim]:
        on_share(0.5)
        return []

    monkeypatch.setattr(papers, "sections_of", lambda paper: [*sections(GOOD), Section("long", 3.0, halfway)])
    progress: list[tuple[str, float]] = []
    papers.reproduce(["dao2023"], lambda now, share: progress.append((now, share)))
    assert progress == [("dao2023: Fig. 1", 0.0), ("dao2023: long", 0.25), ("dao2023: long", 0.625)]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["dao2024"], "'dao2024': no such paper; did you mean 'dao2023'? allowed: all, andrieu2009, aranovskiy2020, "),
        (["all", "--out", ""], "--out '': name a folder, . for the current one"),
        (["all", "--out", "taken"], "--out taken: cannot be written: File exists"),
        ([], "Missing argument 'PAPER'"),
    ],
)
def test_wrong_input(arguments: list[str], complaint: str) -> None:
    Path("taken").write_text("a file")
    assert cmg_mj("reproduce", *arguments).complaint.startswith(complaint)


def test_the_verdict_follows_from_what_was_found() -> None:
    def claim(holds: bool, conditions: str = "") -> Claim:
        return Claim(
            place="Fig. 9",
            statement="it is so",
            result="it is",
            holds=holds,
            conditions=conditions,
            otherwise="It is far off.",
        )

    outright, partly, failed = claim(True), claim(True, "It is so at 200 Hz."), claim(False, "It is so at 200 Hz.")
    assert (outright.verdict, outright.reason) == ("reproduced", "")
    assert (partly.verdict, partly.reason) == ("reproduced within stated conditions", "It is so at 200 Hz.")
    assert (failed.verdict, failed.reason) == ("not reproduced", "It is far off.")
    assert type(claim(np.float64(1.0) > 0.5).holds) is bool  # type: ignore[arg-type]


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

    def verdict(holds: bool | dict[str, bool]) -> str:
        return Claim(place="Fig. 9", statement="it is so", result="it is", holds=holds, **declared).verdict

    assert (verdict(True), verdict(False)) == (holding, failing)
    assert verdict({"tilt": True, "rate": True}) == holding
    assert verdict({"tilt": True, "rate": False}) == failing  # all measures must hold


@pytest.mark.parametrize(
    ("declared", "complaint"),
    [
        ({"is_general": True}, "conditions: say on which systems"),
        ({"assumes": {"weather": "dry"}}, "assumes: weather: no `Assumption`"),
        ({"holds": {}}, "holds: name a measure"),
    ],
)
def test_a_claim_says_what_it_depends_on(declared: dict[str, Any], complaint: str) -> None:
    fields: dict[str, Any] = {"holds": True} | declared
    with pytest.raises(ValueError, match=rf"Fig\. 9: {complaint}"):
        Claim(place="Fig. 9", statement="it is so", result="it is", **fields)


@pytest.mark.parametrize("name", ["conditions", "otherwise", "missing_data"])
@pytest.mark.parametrize("text", ["conditions", "conditions.", "at 200 Hz"])
@pytest.mark.parametrize("holds", [False, True])
def test_conditions_and_otherwise_are_whole_sentences(name: str, text: str, holds: bool) -> None:
    """Wrong even where it would not be printed: the next seed may print it."""
    fields: Any = {name: text}
    with pytest.raises(ValueError, match=rf"Fig\. 9: {name} = .*: must be a whole sentence"):
        Claim(place="Fig. 9", statement="it is so", result="it is", holds=holds, **fields)


def test_what_does_not_hold_is_explained() -> None:
    with pytest.raises(ValueError, match=r"Fig\. 9: otherwise: say what to make of it"):
        Claim(place="Fig. 9", statement="it is so", result="it is", holds=True, otherwise="")


@pytest.mark.parametrize(("n_claims", "words"), [(1, "1 holds within stated"), (2, "2 hold within stated")])
def test_ours_are_counted_in_good_english(n_claims: int, words: str) -> None:
    claim = replace(OURS, holds=True, conditions="It is so on one rig.")
    entry = papers.Reproduction("beyond", [claim] * n_claims, complete=True)
    assert f"{n_claims} beside them, not the papers': {words} conditions." in report_text([entry])


# --- without the packages of the extra [papers] ---------------------------------------------------------------


@pytest.fixture
def _without_sympy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sympy", None)  # import sympy then raises ImportError


@pytest.mark.usefixtures("_without_sympy")
@pytest.mark.parametrize(
    ("paper", "names"),
    [
        ("aranovskiy2020", "aranovskiy2020"),
        ("sokolov2019", "sokolov2019"),
        ("all", "aranovskiy2020 and sokolov2019"),
    ],
)
def test_a_missing_package_ends_it_before_anything_is_computed(
    paper: str, names: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(paper: str) -> list[Section]:
        raise AssertionError(f"{paper} was begun")

    monkeypatch.setattr(papers, "sections_of", refuse)
    run = cmg_mj("reproduce", paper)
    assert run.complaint == f'{names}: sympy is not installed: python -m pip install "cmg_mj[papers]"'
    assert not Path("runs").exists()
    with pytest.raises(InputError, match="sympy is not installed"):
        papers.reproduce(list(papers.PAPERS), lambda now, share: None)


@pytest.mark.usefixtures("_without_sympy")
@pytest.mark.parametrize("paper", ["dao2023", "andrieu2009", "beyond"])
def test_papers_that_do_not_need_it_are_reproduced_without(paper: str) -> None:
    assert cmg_mj("reproduce", paper).status == 0
    assert (Path("runs") / f"reproduce-{paper}" / "report.md").is_file()


def test_several_claims_of_ours_hold() -> None:
    several = report_text([papers.Reproduction("andrieu2009", [OURS, OURS, NOT], complete=True)])
    assert "2 beside them, not the papers': 2 do not hold." in several
    one = report_text([papers.Reproduction("andrieu2009", [OURS], complete=True)])
    assert "1 beside them, not the papers': 1 does not hold." in one

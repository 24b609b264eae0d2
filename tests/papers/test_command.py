"""The command `cmg-mj reproduce` and its report, with papers that take no time."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from cmg_mj import reproduce
from cmg_mj.papers.claim import Claim, OnShare, Step, verdict
from cmg_mj.picture import Line, Panel, Picture
from tests.command import cmg_mj

PICTURE = Picture("a-fig-1", "a Fig. 1", [Panel("tilt [deg]", [Line([0.0, 1.0], [0.0, 2.0], "true")])])
GOOD = Claim("Fig. 1", "it falls | or not", "it fell at 3 s", "reproduced", figures={"time_s": 3.0}, pictures=[PICTURE])
PARTLY = Claim("Remark 1", "always", "above 100 Hz", verdict(True, "100 Hz"), why="above 100 Hz")
OURS = Claim("On the rig", "it stands", "it falls", "not reproduced", why="too light", ours=True)
NOT = Claim("Section V", "best", "worst", verdict(False), why="the noise is another")


def steps(*claims: Claim) -> list[Step]:
    return [Step(claim.place, 1.0, lambda on_share, claim=claim: [claim]) for claim in claims]


@pytest.fixture(autouse=True)
def _quick(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    quick = {
        "aranovskiy2020": steps(GOOD),
        "sokolov2019": steps(NOT),
        "dao2023": steps(PARTLY),
        "andrieu2009": steps(OURS),
    }
    monkeypatch.setattr(reproduce, "steps_of", quick.__getitem__)


def test_all_papers_make_one_report() -> None:
    said = cmg_mj("reproduce", "all")
    assert said.status == 0, said
    folder = Path("runs/reproduce-all")
    report = (folder / "report.md").read_text()
    assert "3 claims of the papers: 1 reproduced, 1 not reproduced, 1 reproduced within stated conditions." in report
    assert "| aranovskiy2020 | Fig. 1 | it falls \\| or not | reproduced |" in report
    assert "| aranovskiy2020 | Fig. 1 | it falls \\| or not | reproduced |" in said.out
    assert "### Section V: not reproduced" in report
    assert "**Why not:** the noise is another" in report
    assert "**Conditions:** above 100 Hz" in report
    assert "![a Fig. 1](a-fig-1.png)" in report
    assert "1 beside them, not the papers': 1 does not hold." in report
    assert "### On the rig: does not hold" in report
    assert "**Asked:** it stands" in report
    assert (folder / "a-fig-1.png").read_bytes().startswith(b"\x89PNG")
    assert f"Read {folder / 'report.md'}" in said.err


def test_one_papers_figures_as_json() -> None:
    said = cmg_mj("reproduce", "aranovskiy2020", "--json", "--out", "here")
    figures = json.loads(said.out)
    assert said.err == ""
    assert figures == json.loads(Path("here/figures.json").read_text())
    assert list(figures["papers"]) == ["aranovskiy2020"]
    (claim,) = figures["papers"]["aranovskiy2020"]["claims"]
    assert claim["figures"] == {"time_s": 3.0}
    assert claim["verdict"] == "reproduced"
    assert claim["pictures"] == ["a-fig-1.png"]
    assert {"cmg_mj", "mujoco", "numpy", "scipy", "python"} == set(figures["versions"])


def test_ctrl_c_keeps_what_was_obtained(monkeypatch: pytest.MonkeyPatch) -> None:
    def pressed(on_share: OnShare) -> list[Claim]:
        raise KeyboardInterrupt

    found = reproduce.reproduce(["dao2023"], lambda now, share: None)
    assert found[0].complete
    monkeypatch.setattr(reproduce, "steps_of", lambda paper: [*steps(GOOD), Step("endless", 9.0, pressed)])
    (entry,) = reproduce.reproduce(["dao2023"], lambda now, share: None)
    assert entry.claims == [GOOD]
    assert not entry.complete
    assert write.report([entry]).startswith("# dao2023, reproduced (interrupted: not all of it)")


def test_progress_is_the_share_of_all_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    def halfway(on_share: OnShare) -> list[Claim]:
        on_share(0.5)
        return []

    monkeypatch.setattr(reproduce, "steps_of", lambda paper: [*steps(GOOD), Step("long", 3.0, halfway)])
    seen: list[tuple[str, float]] = []
    reproduce.reproduce(["dao2023"], lambda now, share: seen.append((now, share)))
    assert seen == [("dao2023: Fig. 1", 0.0), ("dao2023: long", 0.25), ("dao2023: long", 0.625)]


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        (["dao2024"], "'dao2024': no such paper; did you mean 'dao2023'? allowed: all, andrieu2009, aranovskiy2020, "),
        (["all", "--out", ""], "--out '': name a folder, . for the current one"),
        (["all", "--out", "taken"], "--out taken: cannot be written: File exists"),
        ([], "Missing argument 'PAPER'"),
    ],
)
def test_wrong_input(given: list[str], complaint: str) -> None:
    Path("taken").write_text("a file")
    assert cmg_mj("reproduce", *given).complaint.startswith(complaint)


def test_a_verdict_with_conditions_must_state_them() -> None:
    for kind in ("reproduced within stated conditions", "not reproduced"):
        with pytest.raises(ValueError, match="say under which conditions, or why not"):
            Claim("Fig. 9", "it is so", "it is", kind)  # type: ignore[arg-type]

"""Tracks of the pivot that a study varies: found beside its file, and known by their field."""

from __future__ import annotations

from pathlib import Path

import pytest

from cmg_mj.features.sweeps.study import FieldValue, locate_tracks, parse_axis, varied_tracks
from tests.command import cmg_mj

MOTION = {"kind": "track", "file": "walk.csv"}
STUDY = """
[scenario]
duration_s = 0.1
push = []
[[scenario.pivot]]
kind = "track"
file = "{first}"
[vary]
"pivot.0.file" = ["walk.csv", "ride.csv"]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "there").mkdir()
    for name in ("walk", "ride"):
        (tmp_path / "there" / f"{name}.csv").write_text("t,a\n0,0.1\n1,0.2\n", encoding="utf-8")
    return tmp_path / "there"


@pytest.mark.parametrize(
    ("field", "values"),
    [
        ("pivot.0.file", ["walk.csv", "nowhere.csv"]),
        ("pivot", [[MOTION], [MOTION, {"kind": "step"}], []]),
        ("pivot.1", [MOTION, {"kind": "step"}]),
        ("pivot.0.column+pivot.0.file", ["walk.csv"]),
    ],
    ids=["file", "all motions", "a motion", "together"],
)
def test_tracks_get_whole_paths(field: str, values: list[FieldValue], folder: Path) -> None:
    whole = locate_tracks(parse_axis(field, values, "vary"), folder)
    walk = str(folder / "walk.csv")
    assert str(list(whole.values)) == str(values).replace("walk.csv", walk)
    assert set(varied_tracks(whole)) - {"nowhere.csv"} == {walk}


def test_other_fields_keep_their_values(folder: Path) -> None:
    for axis in (parse_axis("pivot.0.kind", "walk.csv,sine", "vary"), parse_axis("pivot.0.scale", "1:2", "vary")):
        assert locate_tracks(axis, folder) == axis
        assert varied_tracks(axis) == []


@pytest.mark.slow
def test_a_study_file_names_tracks_from_where_it_lies(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that it varies, too; `--vary` likewise."""
    study = folder / "study.toml"
    study.write_text(STUDY.format(first="walk.csv"), encoding="utf-8")
    monkeypatch.chdir(folder.parent)
    for more in ([], ["--vary", "pivot.0.file=ride.csv,walk.csv"]):
        outcome = cmg_mj("sweep", "there/study.toml", *more, "--dry-run")
        assert outcome.status == 0, outcome

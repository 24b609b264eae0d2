"""A sweep whose track has changed is another sweep."""

from __future__ import annotations

from pathlib import Path

import pytest

from cmg_mj.features.sweeps.chunks import hash_of
from tests.features.sweeps.synthetic_trials import BIAS, make_study

MOTIONS = "pivot=[{{kind='track', file='{}'}}],[{{kind='track', file='{}', scale=2.0}}]"


@pytest.mark.parametrize("varied", ["", "pivot.0.file={},{}", MOTIONS], ids=["of the scenario", "varied", "motions"])
def test_an_edited_track_is_another(tmp_path: Path, varied: str) -> None:
    first, track = tmp_path / "first.csv", tmp_path / "track.csv"
    for file in (first, track):
        file.write_text("t,a\n0,0.1\n1,0.2\n", encoding="utf-8")
    field, _, values = (varied or f"{BIAS}=0,1").format(first, track).partition("=")
    settings = (f"pivot=[{{kind='track', file='{first if varied else track}'}}]",)
    sweep = make_study({field: values}, settings=settings)
    before = hash_of(sweep, {})
    track.write_text("t,a\n0,0.1\n1,0.3\n", encoding="utf-8")
    assert hash_of(sweep, {}) != before

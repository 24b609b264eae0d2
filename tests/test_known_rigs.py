"""What is known of the bundled rigs without MuJoCo is what MuJoCo reads off them."""

from __future__ import annotations

import json
from dataclasses import astuple
from pathlib import Path

import pytest

from cmg_mj import known_rigs
from cmg_mj.known_rigs import FILE, known_rig
from cmg_mj.plant import load_plant
from cmg_mj.plant_settings import PlantSettings
from cmg_mj.read_off import read_off
from cmg_mj.resources import folder

RENEW = "models changed: run `python -m cmg_mj.read_off`"


def test_every_bundled_rig_is_known_as_it_is() -> None:
    kept, now = json.loads((folder("models") / FILE).read_text(encoding="utf-8")), read_off()
    assert kept["sha256"] == now["sha256"], RENEW
    assert kept["rigs"].keys() == now["rigs"].keys(), RENEW
    assert len(kept["rigs"]) == 4  # rigs of several axes are loaded
    for name, rig in now["rigs"].items():
        assert kept["rigs"][name]["cubes"] == rig["cubes"]
        assert kept["rigs"][name]["reduced"] == pytest.approx(rig["reduced"], rel=1e-12)


@pytest.mark.parametrize("locked", [False, True])
def test_what_is_known_is_what_is_loaded(locked: bool) -> None:
    settings = PlantSettings(lock_thrust_bearing=locked, equilibrium_bias_deg=1.0)
    known, loaded = known_rig(settings), load_plant(settings).facts
    assert known is not None
    assert (known.path, known.cubes) == (loaded.path, loaded.cubes)
    assert astuple(known.reduced) == pytest.approx(astuple(loaded.reduced), rel=1e-12)


def test_a_changed_model_is_not_known(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(known_rigs, "hash_of_models", lambda: "another")
    assert known_rig(PlantSettings()) is None


def test_a_users_own_model_is_not_known(tmp_path: Path) -> None:
    own = tmp_path / "scissored_pair.xml"
    own.write_text((folder("models") / "scissored_pair.xml").read_text())
    assert known_rig(PlantSettings(model=str(own))) is None


def test_a_link_to_a_bundled_model_is_not_known(tmp_path: Path) -> None:
    """MuJoCo looks for what it includes beside the link, where another cube may lie."""
    link = tmp_path / "scissored_pair.xml"
    link.symlink_to(folder("models") / "scissored_pair.xml")
    assert known_rig(PlantSettings(model=str(link))) is None


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"rigs": {"scissored_pair.xml": 3}}'])
def test_a_broken_file_is_as_good_as_none(text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / FILE).write_text(text)
    models = folder("models")
    monkeypatch.setattr(known_rigs, "FILE", str(tmp_path / FILE))
    assert known_rig(PlantSettings(model=str(models / "scissored_pair.xml"))) is None

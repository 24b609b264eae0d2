"""A chunk is used where it belongs and nowhere else: one line names it, and nothing is deleted."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from cmg_mj.errors import RunStopped
from cmg_mj.inputs.files import folder
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.scenario.resolve import versions
from cmg_mj.studies.sweeps.axes import parse_axis
from cmg_mj.studies.sweeps.chunk_store import Store, run
from cmg_mj.studies.sweeps.fingerprint import KEY, first_difference
from cmg_mj.studies.sweeps.study import SweepStudy
from tests.command import cmg_mj

BIAS = "plant.equilibrium_bias_deg"
SHORT = ["--set", "push=[]", "--set", "duration_s=0.2", "--worlds", "2"]
SWEEP = ["sweep", "push_recovery", "--vary", f"{BIAS}=0,1", "--observers", "linear,gyro_free", *SHORT, "--out"]
CURE = "; delete it, and it is computed again, or name another folder"
MOTIONS = "pivot=[{{kind='track', file='{}'}}],[{{kind='track', file='{}', scale=2.0}}]"
VERSION_RULE = "while trials are missing they must be the same: name another folder"


@pytest.fixture
def out(tmp_path: Path) -> Path:
    assert cmg_mj(*SWEEP, tmp_path / "out").status == 0
    return tmp_path / "out"


def contents(place: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in place.rglob("*.*") if path.is_file()}


def test_chunks_whose_study_is_lost_serve_no_other(out: Path) -> None:
    study = out / "study.toml"
    study.unlink()
    before = contents(out)
    other_sweep = [word.replace("=0,1", "=0,2") for word in SWEEP]
    assert (
        cmg_mj(*other_sweep, out).complaint
        == f"{out / 'chunks' / '000000.parquet'}: holds no trials of this study{CURE}"
    )
    assert contents(out) == before
    rerun = cmg_mj(*SWEEP, out)
    assert "resuming: 8 of 8 trials are done" in rerun.err
    assert contents(out) | {"study.toml": b""} == before | {"study.toml": b""}


@pytest.mark.slow
def test_a_chunk_of_another_folder(out: Path, tmp_path: Path) -> None:
    other_sweep = [word.replace("linear,gyro_free", "linear,ltv") for word in SWEEP]
    assert cmg_mj(*other_sweep, tmp_path / "other").status == 0
    chunk = out / "chunks" / "000001.parquet"
    shutil.copy(tmp_path / "other" / "chunks" / "000001.parquet", chunk)
    assert cmg_mj(*SWEEP, out).complaint == f"{chunk}: holds no trials of this study{CURE}"
    shutil.copy(out / "chunks" / "000000.parquet", chunk)
    assert cmg_mj(*SWEEP, out).complaint == f"{chunk}: is chunk 1 of 2, in the place of 2 of 2{CURE}"
    chunk.unlink()
    trials_bytes = (out / "trials.parquet").read_bytes()
    assert cmg_mj(*SWEEP, out).status == 0
    assert (out / "trials.parquet").read_bytes() == trials_bytes


@pytest.fixture
def model_copy(tmp_path: Path) -> Path:
    for name in ("scissored_pair.xml", "cube.xml"):
        shutil.copy(folder("models") / name, tmp_path / name)
    return tmp_path / "scissored_pair.xml"


@pytest.mark.daily_cases("cube.xml")
@pytest.mark.parametrize("name", ["scissored_pair.xml", "cube.xml"])
def test_an_edited_model_is_another(tmp_path: Path, model_copy: Path, name: str) -> None:
    sweep = [*SWEEP[:-1], "--set", f"plant.model={model_copy}", "--out", tmp_path / "out"]
    assert cmg_mj(*sweep).status == 0
    with (tmp_path / name).open("a", encoding="utf-8") as file:
        file.write("<!-- edited -->\n")
    complaint = "was computed with a model file or a track that has changed since"
    assert cmg_mj(*sweep).complaint == f"{tmp_path / 'out' / 'chunks' / '000000.parquet'}: {complaint}{CURE}"


@pytest.mark.parametrize(
    "varied",
    ["", "pivot.0.file={},{}", pytest.param(MOTIONS, marks=pytest.mark.slow)],
    ids=["of the scenario", "varied", "varied motions"],
)
def test_an_edited_track_is_another(tmp_path: Path, varied: str) -> None:
    """A track of the scenario, a file that is varied, or motions that are."""
    first, track = tmp_path / "first.csv", tmp_path / "track.csv"
    for file in (first, track):
        file.write_text("t,a\n0,0.1\n1,0.2\n", encoding="utf-8")
    pivot = ["--set", f"pivot=[{{kind='track', file='{first if varied else track}'}}]"]
    vary = ["--vary", varied.format(first, track)] if varied else []
    sweep = [*SWEEP[:-1], *pivot, *vary, "--out", tmp_path / "out"]
    assert cmg_mj(*sweep).status == 0
    track.write_text("t,a\n0,0.1\n1,0.3\n", encoding="utf-8")
    complaint = "was computed with a model file or a track that has changed since"
    assert cmg_mj(*sweep).complaint == f"{tmp_path / 'out' / 'chunks' / '000000.parquet'}: {complaint}{CURE}"


def test_a_model_that_is_edited_while_a_sweep_runs(tmp_path: Path, model_copy: Path) -> None:
    scenario = load_scenario("push_recovery", ["duration_s=0.2", "push=[]", f"plant.model={model_copy}"])
    store = Store(tmp_path / "out", SweepStudy(scenario, (parse_axis(BIAS, "0,1", BIAS),), ("linear",), 2))
    store.folder.mkdir()
    store.open()
    model_copy.write_text(model_copy.read_text(encoding="utf-8") + "<!-- edited -->\n", encoding="utf-8")
    with pytest.raises(RunStopped, match="has changed since the sweep began"):
        run(store)
    assert store.left() == [0]


@pytest.mark.slow
def test_other_versions_go_on_with_nothing_and_may_finish_what_is_whole(out: Path) -> None:
    study, (chunk, last_chunk) = out / "study.toml", sorted((out / "chunks").iterdir())
    before = contents(out)
    version = versions()["mujoco"]
    study.write_text(
        study.read_text(encoding="utf-8").replace(f'mujoco = "{version}"', 'mujoco = "2.0"'), encoding="utf-8"
    )
    assert "resuming: 8 of 8 trials are done" in cmg_mj(*SWEEP, out).err
    assert contents(out) == before  # the study says what the chunks do
    study.write_text(
        study.read_text(encoding="utf-8").replace(f'mujoco = "{version}"', 'mujoco = "2.0"'), encoding="utf-8"
    )
    last_chunk.unlink()
    assert cmg_mj(*SWEEP, out).complaint == f"{study}: mujoco 2.0 there, {version} here; {VERSION_RULE}"
    study.unlink()
    table = pq.read_table(chunk)
    mark = json.loads(table.schema.metadata[KEY])
    mark["versions"]["mujoco"] = "3.0"
    pq.write_table(table.replace_schema_metadata({KEY: json.dumps(mark)}), chunk)
    assert cmg_mj(*SWEEP, out).complaint == f"{chunk}: mujoco 3.0 there, {version} here; {VERSION_RULE}"


def test_what_is_no_study_and_what_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "study.toml").touch()
    no_study = f"{tmp_path / 'study.toml'}: is no study as cmg-mj writes it; name another folder"
    assert cmg_mj(*SWEEP, tmp_path).complaint == no_study
    (tmp_path / "study.toml").unlink()
    (tmp_path / "chunks").touch()
    assert cmg_mj(*SWEEP, tmp_path).complaint == f"{tmp_path / 'chunks'}: cannot be written: it is no folder"


def test_the_first_field_that_differs_is_named_in_short() -> None:
    many, push = list(range(300)), [{"start_s": 2.0, "torque_n_m": 1.0}]
    vary = {"plant.a": many, "plant.b": "0:1"}
    assert first_difference({"vary": vary}, {"vary": vary}) is None
    difference = first_difference({"vary": vary}, {"vary": vary | {"plant.a": many[1:], "plant.b": "0:2"}})
    assert difference is not None
    assert difference.startswith("vary.plant.a = [0, 1, 2, ")
    assert len(difference) < 250
    assert first_difference(vary, vary | {"plant.a": [*many[:-1], 7]}) == "plant.a.299 = 299 there, 7 here"
    assert first_difference(vary, vary | {"plant.a": many[:-1]}) == "plant.a has 300 values there, 299 here"
    assert first_difference({"push": push}, {"push": [push[0] | {"torque_n_m": 2.0}]}) == (
        "push.0.torque_n_m = 1.0 there, 2.0 here"
    )
    assert first_difference({}, vary) == f"plant.a = nothing there, {str(many)[:80]}... here"

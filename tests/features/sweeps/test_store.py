"""A chunk is there and reads, or it is computed again; a sweep's folder is its own."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from cmg_mj.core.errors import InputError, RunStopped
from cmg_mj.features.sweeps import chunks as module
from cmg_mj.features.sweeps import study as study_module
from cmg_mj.features.sweeps.chunks import Store, hash_of, resolved, run
from cmg_mj.features.sweeps.study import SweepStudy, Trial
from cmg_mj.inputs.files import folder
from tests.command import cmg_mj
from tests.features.sweeps.synthetic_trials import BIAS, VELOCITY, make_study

SWEEP = ["sweep", "push_recovery", "--vary", f"{BIAS}=0,1", "--worlds", "2", "--set", "push=[]"]
SWEEP += ["--set", "duration_s=0.2", "--observers", "linear,gyro_free,high_gain", "--out"]


def study(values: str = "0:1:20", *settings: str, worlds: int = 2) -> SweepStudy:
    return make_study({BIAS: values}, worlds=worlds, settings=("duration_s=0.2", "push=[]", *settings))


@pytest.fixture
def whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Store:
    """A finished sweep of six chunks, whose rows are made without a run, other ones in every chunk."""

    def rows_of(sweep: SweepStudy, observer: str, trials: list[Trial], *_: object) -> list[dict[str, Any]]:
        common = {"observer": observer, "seed": 0, "outcome": "done"}
        return [
            {"point": number, **sweep.point(number), **common, "world": world, VELOCITY: number + 1e-3 * world}
            for number, world in trials
        ]

    monkeypatch.setattr(study_module, "CHUNK", 16)
    monkeypatch.setattr(module, "compute", rows_of)
    store = Store.open(tmp_path / "out", study())
    run(store, store.left())
    assert store.left() == []
    return store


def test_it_resumes_with_the_chunks_that_are_missing(whole: Store) -> None:
    before = pa.concat_tables(whole.tables())
    for number in (1, 3):
        whole.path(number).unlink()
    begun = whole.path(1).with_name(".000001.parquet.7.partial")
    begun.touch()
    again = Store.open(whole.folder, study())
    assert again.left() == [1, 3]
    assert not begun.exists()
    done: list[float] = []
    run(again, again.left(), done.append)
    assert done[-1] == again.study.trials == 80
    assert pa.concat_tables(again.tables()).equals(before)


def test_interrupted_it_keeps_the_finished_chunks(whole: Store) -> None:
    def stop(n_trials: float) -> None:
        if n_trials > 20:
            raise KeyboardInterrupt

    store = Store.open(whole.folder.with_name("other"), study())
    with pytest.raises(KeyboardInterrupt):
        run(store, store.left(), stop)
    assert store.left() == [2, 3, 4, 5]


def test_every_flipped_bit_is_noticed(whole: Store) -> None:
    """One in each of many bytes: of the values by the pages' checksums, of the rest by what the file says."""
    path = whole.path(0)
    content = path.read_bytes()
    table = whole.read(0)
    assert table is not None
    for place in range(0, len(content), 23):
        flipped = bytearray(content)
        flipped[place] ^= 1 << place % 8
        path.write_bytes(flipped)
        found = whole.read(0)
        assert found is None or found.equals(table), place


@pytest.mark.parametrize(
    "harm",
    [
        lambda path: path.write_bytes(path.read_bytes()[:100]),
        lambda path: pq.write_table(pq.read_table(path)[1:], path),
        lambda path: shutil.copy(path.with_name("000004.parquet"), path),
    ],
    ids=["the first bytes alone", "a row less", "another chunk"],
)
def test_a_damaged_chunk_is_computed_again(whole: Store, harm: Callable[[Path], object]) -> None:
    harm(whole.path(2))
    again = Store.open(whole.folder, study())
    assert again.left() == [2]
    with pytest.raises(InputError, match=r"000002\.parquet: cannot be read"):
        list(again.tables())
    run(again, again.left())
    assert again.left() == []


def test_the_file_of_a_varied_law_is_in_the_hash(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    file = tmp_path / "varied_law.py"
    file.write_text("from cmg_mj.laws.state_feedback import StateFeedback")
    varied = make_study({"controller.kind": ["state_feedback", "varied_law:StateFeedback"]})
    before = hash_of(varied, resolved(varied))
    file.write_text("from cmg_mj.laws.state_feedback import StateFeedback  # changed")
    assert hash_of(varied, resolved(varied)) != before


def test_other_versions_are_another_hash(whole: Store) -> None:
    fields = resolved(whole.study)
    other = {**fields, "scenario": {**fields["scenario"], "versions": {"mujoco": "2.0"}}}
    assert hash_of(whole.study, fields) == whole.hash != hash_of(whole.study, other)
    assert len(Store(whole.folder, whole.study, hash_of(whole.study, other)).left()) == 6


@pytest.mark.parametrize("name", ["scissored_pair.xml", "cube.xml"])
def test_an_edited_model_is_another_sweeps(tmp_path: Path, name: str) -> None:
    for file in ("scissored_pair.xml", "cube.xml"):
        shutil.copy(folder("models") / file, tmp_path / file)
    sweep = study("0,1", f"plant.model={tmp_path / 'scissored_pair.xml'}")
    store = Store.open(tmp_path / "out", sweep)
    run(store, store.left()[:1])
    with (tmp_path / name).open("a", encoding="utf-8") as file:
        file.write("<!-- edited -->\n")
    with pytest.raises(RunStopped, match="has changed since it began"):
        run(store, store.left())
    assert Store.open(tmp_path / "out", sweep).left() == [0, 1]


def test_another_study_takes_the_next_number(whole: Store) -> None:
    before = {path: path.read_bytes() for path in whole.folder.rglob("*.*") if path.is_file()}
    other = Store.open(whole.folder, study(worlds=3))
    assert other.folder == whole.folder.with_name("out-2")
    assert Store.open(whole.folder, study(worlds=3)).folder == other.folder
    assert Store.open(whole.folder, study()).folder == whole.folder
    assert {path: path.read_bytes() for path in whole.folder.rglob("*.*") if path.is_file()} == before
    assert Store.open(whole.folder, study(worlds=3), overwrite=True).left()
    assert len(list(whole.folder.rglob("*.parquet"))) == 0


@pytest.mark.parametrize("name", ["notes", "chunks/notes"])
def test_a_folder_with_a_users_file_is_never_replaced(whole: Store, name: str) -> None:
    (whole.folder / name).write_text("mine", encoding="utf-8")
    assert Store.open(whole.folder, study(worlds=3), overwrite=True).folder != whole.folder
    assert (whole.folder / name).read_text(encoding="utf-8") == "mine"
    assert Store.open(whole.folder, study()).left() == []  # and goes on to be this sweep's


def test_a_disk_that_is_full_is_one_line_and_the_sweep_resumes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    out = tmp_path / "out"
    for place, file in (("chunks.pq.write_table", "chunks/000000.parquet"), ("report.save_figure", "curves.png")):
        monkeypatch.setattr(f"cmg_mj.features.sweeps.{place}", full)
        assert cmg_mj(*SWEEP, out).complaint.startswith(f"{out / file}: cannot be written: No space left on device")
        monkeypatch.undo()
    outcome = cmg_mj(*SWEEP, out)
    assert (outcome.status, "resuming: 12 of 12 trials are done" in outcome.err) == (0, True)
    assert not [path for path in out.rglob(".*") if path.name != ".cmg_mj"]


def test_a_place_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert cmg_mj(*SWEEP, tmp_path / "file" / "out").complaint.startswith(f"--out {tmp_path / 'file' / 'out'}: cannot")

"""A disk that is full, a chunk that has been damaged, two sweeps in one folder: one line each, and nothing lost."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from cmg_mj.results import files
from cmg_mj.results.folder import RunFolder
from cmg_mj.studies.sweeps import chunk_store as store
from tests.command import cmg_mj
from tests.tiers import slow_but

SWEEP = ["sweep", "push_recovery", "--vary", "plant.equilibrium_bias_deg=0,1", "--worlds", "2", "--set", "push=[]"]
SWEEP += ["--set", "duration_s=0.2", "--observers", "linear,gyro_free,high_gain", "--out"]
FULL = OSError(28, "No space left on device")
CONTINUATION = (
    "cannot be written: No space left on device; finished trials are kept, and the same command resumes the sweep"
)


def full(*arguments: Any, **options: Any) -> Any:
    raise FULL


@pytest.fixture(scope="module")
def whole_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("whole") / "out"
    assert cmg_mj(*SWEEP, out).status == 0
    return out


@pytest.fixture(scope="module")
def trials_bytes(whole_folder: Path) -> bytes:
    return (whole_folder / "trials.parquet").read_bytes()


@pytest.fixture
def finished(tmp_path: Path, whole_folder: Path) -> Path:
    """A folder of a finished sweep."""
    return Path(shutil.copytree(whole_folder, tmp_path / "out"))


def times(folder: Path) -> dict[str, int]:
    return {path.name: path.stat().st_mtime_ns for path in folder.iterdir() if not path.name.startswith(".")}


@pytest.mark.slow
def test_a_disk_that_is_full_in_the_middle(
    tmp_path: Path, trials_bytes: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = count()
    monkeypatch.setattr(files.os, "fsync", lambda number: next(calls) == 2 and full())  # the study, a chunk, a chunk
    outcome = cmg_mj(*SWEEP, tmp_path)
    assert outcome.complaint == f"{tmp_path / 'chunks' / '000001.parquet'}: {CONTINUATION}"
    chunk_times = times(tmp_path / "chunks")
    assert list(chunk_times) == ["000000.parquet"]  # nothing half written either
    monkeypatch.undo()
    rerun = cmg_mj(*SWEEP, tmp_path)
    assert rerun.status == 0
    assert "resuming: 4 of 12 trials are done" in rerun.err
    assert chunk_times.items() <= times(tmp_path / "chunks").items()
    assert (tmp_path / "trials.parquet").read_bytes() == trials_bytes


@pytest.mark.slow
def test_a_disk_that_is_full_at_the_end(tmp_path: Path, trials_bytes: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cmg_mj.studies.sweeps.report.merged", full)
    monkeypatch.setattr("cmg_mj.studies.sweeps.report.draw", full)
    complaint = cmg_mj(*SWEEP, tmp_path).complaint
    assert complaint.startswith(f"{tmp_path / 'trials.parquet'}: cannot be written: No space left on device; ")
    assert complaint.endswith(f"{tmp_path / 'curves.png'}: {CONTINUATION}")
    chunk_times = times(tmp_path / "chunks")
    monkeypatch.undo()
    assert cmg_mj(*SWEEP, tmp_path).status == 0
    assert times(tmp_path / "chunks") == chunk_times
    assert (tmp_path / "trials.parquet").read_bytes() == trials_bytes


def test_a_disk_that_is_full_at_the_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "write_bytes", full)
    assert cmg_mj(*SWEEP, tmp_path).complaint == f"{tmp_path}: cannot be written: No space left on device"
    monkeypatch.undo()
    monkeypatch.setattr(files.os, "fsync", full)  # the study too is to outlast a power cut
    assert cmg_mj(*SWEEP, tmp_path).complaint == f"{tmp_path}: cannot be written: No space left on device"


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="may write everywhere")
def test_a_folder_that_may_not_be_written(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    try:
        assert cmg_mj(*SWEEP, tmp_path).complaint == f"--out {tmp_path}: cannot be written: Permission denied"
    finally:
        tmp_path.chmod(0o700)


def test_two_sweeps_in_one_folder(finished: Path) -> None:
    before, trials = times(finished), (finished / "trials.parquet").read_bytes()
    with RunFolder(finished):
        assert cmg_mj(*SWEEP, finished).complaint == f"--out {finished}: another run is writing to it"
    assert times(finished) == before
    assert (finished / "trials.parquet").read_bytes() == trials


def flip_bit(chunk: Path) -> None:
    content = bytearray(chunk.read_bytes())
    content[40] ^= 1
    chunk.write_bytes(content)


def rewrite(chunk: Path, table: pa.Table) -> None:
    """Write other trials under the fingerprint that is there."""
    metadata = pq.read_schema(chunk).metadata
    pq.write_table(table.replace_schema_metadata(metadata), chunk)


def edit_value(chunk: Path) -> None:
    table = pq.read_table(chunk)
    column = table.column_names.index("velocity_rms_rad_s")
    values = [2.0 * value for value in table.column(column).to_pylist()]
    rewrite(chunk, table.set_column(column, "velocity_rms_rad_s", pa.array(values)))


DAMAGES: dict[str, tuple[Callable[[Path], object], str]] = {
    "the first bytes alone": (lambda chunk: chunk.write_bytes(chunk.read_bytes()[:100]), "cannot be read: .*"),
    "no byte": (lambda chunk: chunk.write_bytes(b""), "cannot be read: .*"),
    "one bit": (flip_bit, "cannot be read: .*|holds other values than were computed"),
    "a value": (edit_value, "holds other values than were computed"),
    "one trial less": (lambda chunk: rewrite(chunk, pq.read_table(chunk)[:3]), "holds 3 trials of 4"),
}


@pytest.mark.parametrize("damage", slow_but(DAMAGES, "the first bytes alone", "a value", "one trial less"))
def test_a_damaged_chunk_is_computed_again(finished: Path, trials_bytes: bytes, damage: str) -> None:
    harm, message = DAMAGES[damage]
    chunk = finished / "chunks" / "000002.parquet"
    before = times(finished / "chunks")
    harm(chunk)
    rerun = cmg_mj(*SWEEP, finished)
    assert rerun.status == 0
    assert re.match(
        f"cmg-mj: {chunk}: ({message}); it is computed again, and kept as 000002.damaged, which may be deleted\n",
        rerun.err,
    )
    assert "resuming: 8 of 12 trials are done" in rerun.err
    assert (finished / "trials.parquet").read_bytes() == trials_bytes
    unharmed = ("000000.parquet", "000001.parquet")
    assert {name: times(finished / "chunks")[name] for name in unharmed} == {name: before[name] for name in unharmed}


def test_a_damaged_chunk_is_set_aside_beside_others(finished: Path, trials_bytes: bytes) -> None:
    """Neither what is set aside already nor a folder of that name is written over."""
    chunks = finished / "chunks"
    (chunks / "000002.damaged").write_text("mine")
    (chunks / "000002-2.damaged").mkdir()
    (chunks / "000002.parquet").write_bytes(b"")
    rerun = cmg_mj(*SWEEP, finished)
    assert rerun.status == 0
    line = rerun.err.splitlines()[0]
    assert line.endswith("; it is computed again, and kept as 000002-3.damaged, which may be deleted")
    assert ".;" not in line
    assert (chunks / "000002.damaged").read_text() == "mine"
    assert (chunks / "000002-3.damaged").read_bytes() == b""
    assert (finished / "trials.parquet").read_bytes() == trials_bytes


def test_a_damaged_chunk_that_cannot_be_set_aside(finished: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    chunk = finished / "chunks" / "000002.parquet"
    chunk.write_bytes(b"")
    monkeypatch.setattr(Path, "rename", full)
    complaint = cmg_mj(*SWEEP, finished).complaint
    assert complaint == f"{chunk.with_suffix('.damaged')}: cannot be written: No space left on device"


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: os.symlink("nowhere", path)])
def test_something_else_in_the_place_of_a_chunk(finished: Path, make: Callable[[Path], object]) -> None:
    chunk = finished / "chunks" / "000002.parquet"
    chunk.unlink()
    make(chunk)
    complaint = cmg_mj(*SWEEP, finished).complaint
    assert complaint.startswith(f"{chunk}: is no file that cmg-mj writes; delete it, and it is computed again")


def test_chunks_elsewhere(tmp_path: Path) -> None:
    """A folder from somebody else leads nowhere else."""
    (tmp_path / "user").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "chunks").symlink_to(tmp_path / "user")
    complaint = cmg_mj(*SWEEP, tmp_path / "out").complaint
    assert complaint == f"{tmp_path / 'out' / 'chunks'}: is a link: remove it, or name another folder"
    assert not list((tmp_path / "user").iterdir())

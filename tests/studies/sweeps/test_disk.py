"""A disk that is full, a chunk that has been damaged, two sweeps in one folder: one line each, and nothing lost."""

from __future__ import annotations

import os
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from cmg_mj.results import files
from cmg_mj.results.run_folder import RunFolder
from cmg_mj.studies.sweeps import chunk_store as store
from tests.command import cmg_mj

SWEEP = ["sweep", "push_recovery", "--vary", "plant.equilibrium_bias_deg=0,1", "--worlds", "2", "--set", "push=[]"]
SWEEP += ["--set", "duration_s=0.2", "--observers", "linear,gyro_free,high_gain", "--out"]
FULL = OSError(28, "No space left on device")
CONTINUATION = (
    "cannot be written: No space left on device; what is finished is kept, and the same command goes on from there"
)


def full(*arguments: Any, **options: Any) -> Any:
    raise FULL


@pytest.fixture(scope="module")
def trials_bytes(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    out = tmp_path_factory.mktemp("whole") / "out"
    assert cmg_mj(*SWEEP, out).status == 0
    return (out / "trials.parquet").read_bytes()


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
    assert "4 of 12 trials are there from before" in rerun.err
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


def test_two_sweeps_in_one_folder(tmp_path: Path) -> None:
    assert cmg_mj(*SWEEP, tmp_path).status == 0
    before, trials = times(tmp_path), (tmp_path / "trials.parquet").read_bytes()
    with RunFolder(tmp_path):
        assert cmg_mj(*SWEEP, tmp_path).complaint == f"--out {tmp_path}: another run is writing to it"
    assert times(tmp_path) == before
    assert (tmp_path / "trials.parquet").read_bytes() == trials


@pytest.mark.slow
def test_a_chunk_that_cannot_be_read_is_named(tmp_path: Path, trials_bytes: bytes) -> None:
    assert cmg_mj(*SWEEP, tmp_path).status == 0
    chunk = tmp_path / "chunks" / "000002.parquet"
    chunk.write_bytes(chunk.read_bytes()[:100])
    complaint = cmg_mj(*SWEEP, tmp_path).err.splitlines()[-1]
    assert complaint.startswith(f"cmg-mj: {chunk}: cannot be read: ")
    assert complaint.endswith("; delete it, and it is computed again")
    chunk.unlink()
    assert cmg_mj(*SWEEP, tmp_path).status == 0
    assert (tmp_path / "trials.parquet").read_bytes() == trials_bytes

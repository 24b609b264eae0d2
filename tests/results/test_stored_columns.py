"""Columns that are kept piece by piece, in memory and in a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from cmg_mj.results import stored_columns, trajectory
from cmg_mj.results.stored_columns import ColumnStore, StoredColumns
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.simulation.experiment import Experiment, prepare

PIECES = (7, 7, 7, 7, 3)
WHOLE = np.random.default_rng(0).normal(size=(3, sum(PIECES)))
SHORT = ("duration_s=0.6", 'open_loop_observers=["linear"]', "push=[]")


@pytest.fixture(autouse=True)
def short_stretches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stored_columns, "STRETCH", 14)
    monkeypatch.setattr(trajectory, "STRETCH", 50)


def stored(folder: Path | None) -> ColumnStore:
    store, start = ColumnStore(len(WHOLE), folder), 0
    for size in PIECES:
        store.append([column[start : start + size, None] for column in WHOLE])
        start += size
    return store


@pytest.mark.parametrize("in_file", [True, False])
def test_any_rows_come_back(tmp_path: Path, in_file: bool) -> None:
    store = stored(tmp_path if in_file else None)
    assert store.in_memory is not in_file
    assert list(tmp_path.iterdir()) == []
    for start in range(len(store) + 1):
        for end in range(start, len(store) + 1):
            for column, values in enumerate(WHOLE):
                assert store.read(column, start, end)[:, 0].tolist() == values[start:end].tolist()


def test_a_folder_that_takes_nothing_leaves_all_in_memory(tmp_path: Path) -> None:
    store = stored(tmp_path / "missing")
    assert store.in_memory
    assert store.read(1, 0, len(store))[:, 0].tolist() == WHOLE[1].tolist()


@pytest.mark.parametrize("name", ["push_recovery", "two_axes"])
def test_a_run_on_disk_is_the_run_in_memory(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cmg_mj.simulation.recorder.TICKS_A_PIECE", 16)
    experiment: Experiment = prepare(load_scenario(name, SHORT))
    expected, result = experiment.run(), experiment.run(spool=tmp_path)
    assert result.summaries == expected.summaries
    whole, read = expected.trajectory, result.trajectory
    assert whole is not None
    assert read is not None
    assert isinstance(read.columns, StoredColumns)
    assert_same(read, whole)
    assert_same(read.from_tick(33).rows(slice(2, 60)), whole.from_tick(33).rows(slice(2, 60)))
    for axis in whole.axes:
        assert_same(read.along(axis), whole.along(axis))
    assert np.array_equal(read.qpos(), whole.qpos())
    for each, file in ((read, "read"), (whole, "whole")):
        each.save(tmp_path / file)
        assert pq.ParquetFile(tmp_path / file).num_row_groups == -(-len(whole) // 50)
        assert_same(Trajectory.load(tmp_path / file), whole)


def assert_same(one: Trajectory, two: Trajectory) -> None:
    assert one.layout == two.layout
    assert list(one.columns) == list(two.columns)
    for name, values in two.columns.items():
        assert np.array_equal(one[name], values), name

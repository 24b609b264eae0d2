"""Memory of a sweep does not grow with its trials: what is alive is counted, without physics."""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from cmg_mj.scenario.loading import load_scenario
from cmg_mj.studies.sweeps import cells as cells_module
from cmg_mj.studies.sweeps import chunk_store as store_module
from cmg_mj.studies.sweeps import study as study_module
from cmg_mj.studies.sweeps.axes import parse_axis
from cmg_mj.studies.sweeps.cells import COLUMNS, Trials, cells_in_blocks, cells_schema
from cmg_mj.studies.sweeps.chunk_store import Store, merged, run
from cmg_mj.studies.sweeps.study import Chunk, SweepStudy
from cmg_mj.studies.sweeps.trials import write_tables
from tests.studies.sweeps.synthetic_trials import BIAS, NOISE, VELOCITY

MB = 2**20
TRIALS = 6_000


def study(points: int, worlds: int = 1) -> SweepStudy:
    axes = (parse_axis(BIAS, "-1:1", BIAS), parse_axis(NOISE, "log:100:800", NOISE))
    return SweepStudy(load_scenario("push_recovery"), axes, ("linear",), worlds, "sample", points)


@contextmanager
def peak() -> Iterator[list[float]]:
    """Measure the most memory that Python takes meanwhile [MB]."""
    peaks: list[float] = []
    tracemalloc.start()
    try:
        yield peaks
        peaks.append(tracemalloc.get_traced_memory()[1] / MB)
    finally:
        tracemalloc.stop()


def make_rows(sweep: SweepStudy, chunk: Chunk, *_: Any) -> list[dict[str, Any]]:
    return [
        {"point": number, **sweep.points[number], "observer": "linear", "world": world, "seed": 0, "outcome": "done"}
        | {VELOCITY: 1e-6 * number + world}
        for number, world in chunk.trials
    ]


@pytest.mark.parametrize(("points", "worlds"), [(10_000, 1), (100, 100)])
def test_points_and_chunks_are_made_when_asked_for(points: int, worlds: int) -> None:
    """A list of 10,000 points takes 3 MB, and one of their trials 1.5 MB."""
    sweep = study(points, worlds)
    assert study(2).points[0]  # what it imports is there
    with peak() as peaks:
        trials = sum(len(chunk.trials) for chunk in sweep.chunks)
        biases = (float(str(point[BIAS])) for point in sweep.points)
        assert sum(bias < 0.0 for bias in biases) == points / 2
    assert trials == 10_000
    assert peaks[0] < 1.5


@pytest.mark.slow
def test_a_sweep_keeps_what_it_needs_and_no_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The figures of the cells, 80 bytes a trial; no list of all cells, each of which takes 6 kB."""
    monkeypatch.setattr(store_module, "compute", make_rows)
    monkeypatch.setattr(study_module, "CHUNK", 256)
    monkeypatch.setattr(cells_module, "BLOCK", 256)
    (tmp_path / "first").mkdir()
    first = Store(tmp_path / "first", study(1))
    first.open()
    run(first)  # what it imports is there
    sweep = study(TRIALS)
    store = Store(tmp_path, sweep)
    store.open()
    with peak() as run_peaks:
        run(store)
    assert run_peaks[0] < 3.0
    arrow = pa.total_allocated_bytes()
    with peak() as table_peaks:
        trials = Trials(sweep, store.tables(COLUMNS))
        write_tables(tmp_path / "cells.parquet", cells_schema(sweep), cells_in_blocks(trials))
        merged(store, tmp_path / "trials.parquet")
    assert table_peaks[0] < 10.0
    assert pa.total_allocated_bytes() - arrow < MB
    file = pq.ParquetFile(tmp_path / "trials.parquet")
    assert (file.metadata.num_rows, file.num_row_groups) == (TRIALS, 24)
    cells = pq.read_table(tmp_path / "cells.parquet", columns=["point", VELOCITY]).to_pydict()
    assert cells["point"] == list(range(TRIALS))
    assert cells[VELOCITY][-1] == pytest.approx(1e-6 * (TRIALS - 1))

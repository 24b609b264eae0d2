"""A long log, handled in stretches, is the log handled whole."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from cmg_mj.errors import InputError
from cmg_mj.replay.log_replay import ReplayResult, replay_log
from cmg_mj.replay.logs import ReadOptions, read_log
from cmg_mj.replay.logs.resampling import is_even, resolution_of
from cmg_mj.replay.plot import liveliest_span, plot_replay
from cmg_mj.replay.recording import write_replay
from cmg_mj.replay.save import signals
from cmg_mj.results.stored_columns import StoredColumns
from cmg_mj.results.trajectory import Trajectory

OBSERVERS = ["finite_difference", "linear_high_gain"]
COLUMNS = {"time": "t_s", "tilt": "tilt_rad", "rate": "rate_rad_s", "acceleration": "acceleration_rad_s2"}
N, DT, OMEGA = 1500, 0.005, 9.0


def in_stretches(monkeypatch: pytest.MonkeyPatch, length: int) -> None:
    """Take rows beyond so many for a long log, in every module that asks."""
    for name, module in list(sys.modules.items()):
        if name.startswith("cmg_mj.") and hasattr(module, "LONG"):
            monkeypatch.setattr(module, "LONG", length)
        if name.startswith("cmg_mj.") and hasattr(module, "STRETCH"):
            monkeypatch.setattr(module, "STRETCH", length // 2)


def log_file(folder: Path, kind: str) -> Path:
    """Write a log with even rows; or uneven ones with missing numbers and two gaps."""
    random = np.random.default_rng(1)
    t = DT * np.arange(N)
    if kind == "uneven":
        t += random.uniform(-0.3, 0.3, N) * DT
        t[400:] += 0.5
        t[1100:] += 0.2
    t = np.round(t, 6)
    tilt = 0.1 * np.sin(OMEGA * t) + 0.03 * np.sin(2.3 * OMEGA * t) + 1e-4 * random.standard_normal(N)
    rate = 0.1 * OMEGA * np.cos(OMEGA * (t - 0.01)) + 0.069 * OMEGA * np.cos(2.3 * OMEGA * (t - 0.01))
    rows = np.stack([t, tilt, rate + 1e-3 * random.standard_normal(N), random.standard_normal(N)], axis=1)
    text = [",".join(f"{value:.9g}" for value in row) for row in rows]
    if kind == "uneven":
        text[777] = text[777].replace(text[777].split(",")[1], "", 1)
    path = folder / f"{kind}.csv"
    path.write_text("\n".join([",".join(COLUMNS.values()), *text]) + "\n")
    return path


@pytest.mark.daily_cases("uneven")
@pytest.mark.parametrize("kind", ["even", "uneven"])
def test_stretches_give_what_the_whole_gives(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, options = log_file(tmp_path, kind), ReadOptions(columns=COLUMNS)
    whole = replay_log(read_log(path, options), OBSERVERS, settle_s=0.1)
    in_stretches(monkeypatch, 256)
    long = replay_log(read_log(path, options), OBSERVERS, settle_s=0.1)
    assert isinstance(long.log.columns, StoredColumns)
    assert (long.log.parts, long.log.notes, long.log.dt) == (whole.log.parts, whole.log.notes, whole.log.dt)
    assert len(long.log.parts) == (3 if kind == "uneven" else 1)
    rtol, atol = (1e-9, 1e-11) if kind == "uneven" else (0.0, 0.0)  # splines: to rounding
    for name, values in whole.log.columns.items():
        np.testing.assert_allclose(long.log[name], values, rtol, atol, err_msg=name)
    for kind_of, estimates in whole.estimates.items():
        for name, values in estimates.items():
            estimate = long.estimates[kind_of][name]
            np.testing.assert_allclose(estimate, values, 1e2 * rtol, 1e3 * atol, err_msg=name)  # differences
        assert long.summaries[kind_of] == pytest.approx(whole.summaries[kind_of], rel=1e-7)
    assert long.alignment is not None
    assert whole.alignment is not None
    assert long.alignment.lag_error_s == pytest.approx(whole.alignment.lag_error_s, abs=1e-8)  # to its search's step
    long_alignment, whole_alignment = (fit._replace(lag_error_s=0.0) for fit in (long.alignment, whole.alignment))
    assert long_alignment._asdict() == pytest.approx(whole_alignment._asdict(), rel=1e-5, abs=1e-9)
    assert long.log.white_noise == whole.log.white_noise
    assert liveliest_span(long) == pytest.approx(liveliest_span(whole), abs=2.0 * DT)
    assert_saved_alike(long, whole, tmp_path)


def assert_saved_alike(long: ReplayResult, whole: ReplayResult, folder: Path) -> None:
    signals(long).save(folder / "long.parquet")
    read = Trajectory.load(folder / "long.parquet")
    assert list(read.columns) == list(signals(whole).columns)
    for name, values in signals(long).columns.items():
        np.testing.assert_array_equal(read[name], values)


@pytest.mark.slow
def test_a_long_log_is_drawn_and_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = log_file(tmp_path, "uneven")
    in_stretches(monkeypatch, 256)
    replayed = replay_log(read_log(path, ReadOptions(columns=COLUMNS)), OBSERVERS[:1], settle_s=0.1)
    plot_replay(tmp_path / "plot.png", replayed)
    assert (tmp_path / "plot.png").stat().st_size > 10000
    write_replay(tmp_path / "recording.rrd", [replayed], ["log"], "")
    batches = [
        chunk.to_record_batch()
        for chunk in RrdReader(tmp_path / "recording.rrd").stream().filter(has_timeline="time")
        if chunk.entity_path.endswith("tilt/measured")
    ]
    rows = sorted(
        row
        for batch in batches
        for row in zip(
            batch.column("time").cast("int64").to_pylist(), batch.column("Scalars:scalars").to_pylist(), strict=True
        )
    )
    _, expected = replayed.log.broken(np.degrees(replayed.log["y1_rad"]))
    assert len(batches) == -(-len(replayed.log) // 256)
    np.testing.assert_array_equal([value for _, (value,) in rows], expected)


@pytest.mark.parametrize("last", ["", "no date"])
def test_dates_are_read_piece_by_piece(tmp_path: Path, last: str) -> None:
    """A file of several of Arrow's batches, of a megabyte each: seconds count from the first row of all."""
    n = 40_000
    seconds = 0.005 * np.arange(n)
    stamps = np.datetime64("2026-11-22T23:59:00.000", "ms") + np.rint(1000.0 * seconds).astype("timedelta64[ms]")
    stamps = np.datetime_as_string(stamps).tolist()
    stamps[-1] = last or stamps[-1]
    rows = [f"{stamp},{0.1 * np.sin(second):.15g}" for stamp, second in zip(stamps, seconds, strict=True)]
    path = tmp_path / "dates.csv"
    path.write_text("\n".join(["when,tilt_rad", *rows]) + "\n")
    assert path.stat().st_size > 1 << 20
    options = ReadOptions({"time": "when", "tilt": "tilt_rad"})
    if last:
        with pytest.raises(InputError, match=f"row {n:d}, column 'when': 'no date' is not a date, as the rows before"):
            read_log(path, options)
        return
    log = read_log(path, options)
    assert log["time_s"] == pytest.approx(seconds, abs=1e-9)
    assert np.array_equal(log["y1_rad"], [float(row.split(",")[1]) for row in rows])


@pytest.mark.daily_cases("False-0.0005-*", "True-0.002-0.0001-*")
@pytest.mark.parametrize("jitter", [0.0, 1e-5, 9e-5, 1.1e-4, 1e-3])
@pytest.mark.parametrize("rounded_s", [0.0, 1e-4, 1e-3])
@pytest.mark.parametrize("drift", [0.0, 5e-4, 2e-3])
@pytest.mark.parametrize("gap", [False, True])
def test_evenness(monkeypatch: pytest.MonkeyPatch, jitter: float, rounded_s: float, drift: float, gap: bool) -> None:
    t = 100.0 + DT * (1.0 + drift) * np.arange(N) + jitter * np.random.default_rng(0).uniform(-1.0, 1.0, N)
    t = np.round(t / rounded_s) * rounded_s if rounded_s else t
    t = np.delete(t, slice(500, 503)) if gap else t
    whole = [is_even(t, period, resolution_of(t)) for period in (DT, DT * (1.0 + drift))]
    in_stretches(monkeypatch, 130)
    assert [is_even(t, period, resolution_of(t)) for period in (DT, DT * (1.0 + drift))] == whole

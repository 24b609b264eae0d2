"""The same log in other units, formats and orders is the same log; what cannot be read is said in one line."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from cmg_mj.errors import InputError
from cmg_mj.replay.logs import Log, ReadOptions, read_log
from cmg_mj.replay.logs.columns import ACCELEROMETERS
from cmg_mj.replay.logs.units import unit_of_name
from tests.replay.logs.motion import COLUMNS, DT, OMEGA, N, rate, sine, tilt, write_csv

SIGNALS = ("time_s", "y1_rad", "reference_rad_s")


@pytest.fixture
def plain(tmp_path: Path) -> Log:
    return read_log(write_csv(tmp_path / "plain.csv", sine()), ReadOptions(COLUMNS))


def assert_same(log: Log, plain: Log, tolerance: float = 1e-9) -> None:
    assert log.dt == pytest.approx(plain.dt, rel=1e-9)
    for name in SIGNALS:
        np.testing.assert_allclose(log[name], plain[name], atol=tolerance)


def test_the_plain_one(plain: Log) -> None:
    assert plain.dt == DT
    assert list(plain.parts) == [slice(0, N)]
    assert plain.notes == ()
    assert plain.has == {"reference"}
    np.testing.assert_array_equal(plain["y1_rad"], sine()["tilt_rad"])
    np.testing.assert_array_equal(plain["reference_rad_s"], sine()["gyro_rad_s"])


@pytest.mark.parametrize(
    ("heads", "sizes"),
    [
        (("t_ms", "pitch_deg", "gyro_dps"), (1e3, 180 / math.pi, 180 / math.pi)),
        (("Time [us]", "Pitch (°)", "Gyro [deg/s]"), (1e6, 180 / math.pi, 180 / math.pi)),
        (("timeMs", "tiltMrad", "gyro rad/s"), (1e3, 1e3, 1.0)),
        (("stamp_ns", "pitch_rev", "gyro_rpm"), (1e9, 0.5 / math.pi, 30.0 / math.pi)),
    ],
)
def test_units_by_their_names(heads: tuple, sizes: tuple, plain: Log, tmp_path: Path) -> None:
    columns = {h: v * s for h, v, s in zip(heads, sine().values(), sizes, strict=True)}
    path = write_csv(tmp_path / "other.csv", columns)
    assert_same(read_log(path, ReadOptions(dict(zip(COLUMNS, heads, strict=True)))), plain)


def test_units_as_options(plain: Log, tmp_path: Path) -> None:
    t, y, w = sine().values()
    path = write_csv(tmp_path / "told.csv", {"a": t * 1e3, "b": np.degrees(y), "c": -np.degrees(w)})
    log = read_log(
        path,
        ReadOptions(
            {"time": "a", "tilt": "b", "rate": "c"},
            units={"time": "ms", "tilt": "degrees", "rate": "deg/s"},
            scale={"rate": -1.0},
        ),
    )
    assert_same(log, plain)


@pytest.mark.parametrize(
    ("quantity", "name", "unit"),
    [
        ("rate", "gyr_y_rad_s", "rad_s"),
        ("rate", "alpha_rad_s2", None),
        ("angle", "gyro_deg_s", None),
        ("acceleration", "acc_x (m/s^2)", "m_s2"),
        ("acceleration", "ax_mg", "mg"),
        ("acceleration", "accX", None),
        ("time", "timestamp", None),
        ("angle", "tilt", None),
    ],
)
def test_what_a_name_ends_in(quantity: str, name: str, unit: str | None) -> None:
    assert unit_of_name(quantity, name) == unit  # type: ignore[arg-type]


def parquet(path: Path, columns: dict) -> Path:
    pq.write_table(pa.table(columns), path)
    return path


def test_parquet_with_dates(plain: Log, tmp_path: Path) -> None:
    """Whole nanoseconds are subtracted before they are floats: in 2026 a double has a quarter of a microsecond."""
    t, y, w = sine().values()
    stamps = pa.array(1_790_000_000_000_000_000 + np.rint(t * 1e9).astype(int), pa.timestamp("ns", "UTC"))
    path = parquet(tmp_path / "log.parquet", {"t_s": stamps, "tilt_rad": y.astype("float32"), "gyro_rad_s": w})
    assert_same(read_log(path, ReadOptions(COLUMNS)), plain, 1e-7)


def test_dates_in_a_csv(plain: Log, tmp_path: Path) -> None:
    t, y, w = sine().values()
    stamps = [f"2026-11-22T06:{int(s // 60):02}:{s % 60:06.3f}" for s in t]
    path = write_csv(tmp_path / "dates.csv", {"when": stamps, "tilt_rad": y, "gyro_rad_s": w})
    log = read_log(path, ReadOptions({**COLUMNS, "time": "when"}))
    assert_same(log, plain)


def test_other_ways_to_write_a_csv(plain: Log, tmp_path: Path) -> None:
    """Semicolons with decimal commas, a byte order mark, comments above, Windows' line ends, a torn last line."""
    path = write_csv(tmp_path / "eu.csv", sine(), delimiter=";")
    text = path.read_text().replace(".", ",")
    path.write_bytes(b"\xef\xbb\xbf# a logger\r\n#\r\n\r\n" + text.replace("\n", "\r\n").encode() + b"20,0;0")
    log = read_log(path, ReadOptions(COLUMNS))
    assert_same(log, plain)
    assert any("another number of cells" in note for note in log.notes)


def test_a_rate_instead_of_times(plain: Log, tmp_path: Path) -> None:
    path = write_csv(tmp_path / "rate.csv", sine())
    assert_same(read_log(path, ReadOptions({"tilt": "tilt_rad", "rate": "gyro_rad_s"}, rate_hz=1.0 / DT)), plain)


def test_newest_first(plain: Log, tmp_path: Path) -> None:
    log = read_log(write_csv(tmp_path / "r.csv", {k: v[::-1] for k, v in sine().items()}), ReadOptions(COLUMNS))
    assert_same(log, plain)
    assert "backward" in log.notes[0]


def test_some_stamps_twice(plain: Log, tmp_path: Path) -> None:
    twice = np.sort(np.concatenate([np.arange(N), [100, 2000]]))
    log = read_log(write_csv(tmp_path / "twice.csv", {k: v[twice] for k, v in sine().items()}), ReadOptions(COLUMNS))
    assert_same(log, plain)
    assert log.notes == ("2 rows with the time of the row before discarded, first at 0.5 s",)


def test_stamps_rounded_to_milliseconds_are_even(tmp_path: Path) -> None:
    t = np.arange(3000) * 0.0025
    path = write_csv(tmp_path / "ms.csv", {**sine(t), "t_s": np.round(t, 3)})
    log = read_log(path, ReadOptions(COLUMNS))
    assert log.dt == pytest.approx(0.0025, rel=1e-4)
    np.testing.assert_array_equal(log["y1_rad"], tilt(t))
    np.testing.assert_allclose(log["reference_rad_s"], rate(t), atol=1e-12)
    assert "taken as such" in log.notes[0]


def test_uneven_times_are_resampled(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    t = np.arange(N) * DT + rng.uniform(-0.2, 0.2, N) * DT
    log = read_log(write_csv(tmp_path / "uneven.csv", sine(t)), ReadOptions(COLUMNS))
    assert "uneven sampling" in log.notes[0]
    assert "cubic" in log.notes[0]
    np.testing.assert_allclose(np.diff(log["time_s"]), log.dt, rtol=1e-6)
    np.testing.assert_allclose(log["y1_rad"], tilt(log["time_s"]), atol=1e-7)
    np.testing.assert_allclose(log["reference_rad_s"], rate(log["time_s"]), atol=1e-6)


def test_to_another_rate(tmp_path: Path) -> None:
    log = read_log(write_csv(tmp_path / "s.csv", sine()), ReadOptions(COLUMNS, rate_hz=130.0))
    assert log.dt == 1.0 / 130.0
    np.testing.assert_allclose(log["y1_rad"], tilt(log["time_s"]), atol=1e-7)


def test_a_short_gap_is_bridged_and_a_long_one_parts(tmp_path: Path) -> None:
    mask = np.ones(N, dtype=bool)
    mask[1000:1003] = False
    mask[2000:2200] = False
    log = read_log(write_csv(tmp_path / "gaps.csv", {k: v[mask] for k, v in sine().items()}), ReadOptions(COLUMNS))
    assert [(p.start, p.stop) for p in log.parts] == [(0, 2000), (2000, 3800)]
    short_gap_note, long_gap_note = log.notes
    assert "1 gap bridged by straight lines; the longest is 20 ms at 4.995 s" in short_gap_note
    assert "1 gap not bridged" in long_gap_note
    assert "1005 ms at 9.995 s" in long_gap_note
    measured_rows = np.isin(np.arange(3800), np.arange(1000, 1003), invert=True)
    np.testing.assert_allclose(log["y1_rad"][measured_rows], tilt(log["time_s"])[measured_rows], atol=1e-12)
    np.testing.assert_allclose(log["y1_rad"], tilt(log["time_s"]), atol=3e-4)
    assert np.isnan(log["reference_rad_s"][1001])
    assert log.duration_s == pytest.approx((1999 + 1799) * DT)
    longer = read_log(tmp_path / "gaps.csv", ReadOptions(COLUMNS, max_gap_s=2.0))
    assert len(longer.parts) == 1


def test_missing_numbers_are_gaps(tmp_path: Path) -> None:
    columns = {name: list(values) for name, values in sine().items()}
    columns["tilt_rad"][100] = None
    columns["tilt_rad"][101] = float("nan")
    columns["gyro_rad_s"][500] = None
    log = read_log(write_csv(tmp_path / "nan.csv", columns), ReadOptions(COLUMNS))
    assert "2 rows of 4,000 without a number (y1_rad in 2) discarded: the first is row 101" in log.notes[0]
    assert len(log) == N
    assert np.isfinite(log["y1_rad"]).all()
    assert np.isnan(log["reference_rad_s"]).sum() == 1


def test_a_reference_at_times_of_its_own(tmp_path: Path) -> None:
    """Tilt and gyro in rows of their own, as a merged log has them."""
    t = np.arange(2 * N) * DT / 2.0
    tilts, rates = list(tilt(t)), list(rate(t))
    for k in range(2 * N):
        (rates if k % 2 == 0 else tilts)[k] = None  # type: ignore[call-overload]
    log = read_log(
        write_csv(tmp_path / "merged.csv", {"t_s": t, "tilt_rad": tilts, "gyro_rad_s": rates}), ReadOptions(COLUMNS)
    )
    assert log.dt == pytest.approx(DT)
    measured_rows = np.isfinite(log["reference_rad_s"])
    assert measured_rows.sum() >= N - 2
    np.testing.assert_allclose(log["reference_rad_s"][measured_rows], rate(log["time_s"])[measured_rows], atol=1e-6)


def test_a_tilt_that_starts_again_after_a_turn(tmp_path: Path) -> None:
    t = np.arange(N) * DT
    wrapped_tilt = (2.0 * t + math.pi) % (2.0 * math.pi) - math.pi
    log = read_log(
        write_csv(tmp_path / "turns.csv", {"t_s": t, "tilt_rad": wrapped_tilt}),
        ReadOptions({"time": "t_s", "tilt": "tilt_rad"}),
    )
    np.testing.assert_allclose(np.diff(log["y1_rad"]), 2.0 * DT, atol=1e-9)
    assert "jumps by a turn" in log.notes[0]


def test_two_accelerometers_give_tilt_and_acceleration(tmp_path: Path) -> None:
    """a = r alpha tangentially, -r w^2 radially, less gravity, in g and for any motion."""
    t = np.arange(N) * DT
    y, w, alpha = tilt(t), rate(t), -(OMEGA**2) * tilt(t)
    columns: dict[str, np.ndarray] = {"t_ms": t * 1e3}
    for place, r in (("in", 0.05), ("out", 0.15)):
        columns[f"{place}_x_g"] = (r * alpha - 9.80665 * np.sin(y)) / 9.80665
        columns[f"{place}_z_mg"] = (-r * w**2 + 9.80665 * np.cos(y)) / 9.80665e-3
    path = write_csv(tmp_path / "imu.csv", columns)
    roles = {"time": "t_ms", "inner_x": "in_x_g", "inner_z": "in_z_mg", "outer_x": "out_x_g", "outer_z": "out_z_mg"}
    log = read_log(path, ReadOptions(roles, radii_m=(0.05, 0.15)))
    np.testing.assert_allclose(log["y1_rad"], y, atol=1e-9)
    np.testing.assert_allclose(log["acceleration_rad_s2"], alpha, atol=1e-9)
    assert log.has == {"acceleration"}


def test_gimbals_and_command(tmp_path: Path) -> None:
    """Half the difference of two encoders; a command is held, not drawn out, when it is resampled."""
    t = np.arange(N) * DT
    columns = {**sine(), "g1_deg": np.degrees(0.1 * t), "g2_deg": np.degrees(-0.1 * t), "u_rad_s": (t // 1.0) % 2.0}
    path = write_csv(tmp_path / "g.csv", columns)
    roles = {**COLUMNS, "gimbal1": "g1_deg", "gimbal2": "g2_deg", "command": "u_rad_s"}
    log = read_log(path, ReadOptions(roles))
    assert log.has == {"reference", "gimbals"}
    np.testing.assert_allclose(log["y2_rad"], 0.1 * t, atol=1e-12)
    assert set(read_log(path, ReadOptions(roles, rate_hz=333.0))["u_rad_s"]) == {0.0, 1.0}
    del roles["command"]
    half = read_log(path, ReadOptions(roles))
    assert half.has == {"reference"}
    assert "need both" in half.notes[-1]


def test_between(tmp_path: Path) -> None:
    log = read_log(write_csv(tmp_path / "s.csv", sine()), ReadOptions(COLUMNS, time_range_s=(2.0, 5.0)))
    assert (log["time_s"][0], len(log)) == (pytest.approx(2.0), 601)


Edit = Callable[[dict], object]


def backwards(columns: dict) -> None:
    columns["t_s"] = np.concatenate([columns["t_s"][:500], columns["t_s"][: N - 500]])


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda c: c.pop("gyro_rad_s"), "has no column 'gyro_rad_s'; it has: 't_s', 'tilt_rad'"),
        (lambda c: c.update(tilt_rad=["x", *[0.1] * (N - 1)]), "row 1, column 'tilt_rad': 'x' is not a number"),
        (lambda c: c.update(t_s=[*c["t_s"][:-1], "now"]), "row 4000, column 't_s': 'now' is not a number or a date"),
        (lambda c: c.update(tilt_rad=np.full(N, 0.3)), "the tilt is 0.3 rad in every row: nothing moves"),
        (lambda c: c.update(gyro_rad_s=np.full(N, 0.3)), "the reference is 0.3 rad/s in every row: leave it out"),
        (lambda c: c.update(tilt_rad=[None] * N), "column 'tilt_rad', the tilt, has no number at all"),
        (lambda c: c.update(gyro_rad_s=[None] * N), "column 'gyro_rad_s', the rate, has no number at all"),
        (
            lambda c: c.update(gyro_rad_s=[None] * (N // 2) + [0.1] * 10 + [None] * (N // 2 - 10)),
            "the reference has no number where the tilt has one",
        ),
        (
            lambda c: c.update(
                t_s=[None if i % 2 else t for i, t in enumerate(c["t_s"])],
                tilt_rad=[y if i % 2 else None for i, y in enumerate(c["tilt_rad"])],
            ),
            "no row has a number in each of its columns",
        ),
        (lambda c: c.update(t_s=np.zeros(N)), "3,999 of 4,000 rows have the same time as the row before"),
        (lambda c: c.update(t_s=c["t_s"] * 1e4), "rows are 50 s apart, which is 0.02 Hz; a log has 0.1 to 1e+06 Hz"),
        (backwards, "time goes back from 2.495 s to 0 s, there alone: cut the log there"),
        (lambda c: c.update({k: v[:7] for k, v in c.items()}), "7 rows with all that is needed; at least 20"),
        (lambda c: c.update({k: v[:0] for k, v in c.items()}), "has a heading and no row"),
    ],
)
def test_what_cannot_be(edit: Edit, message: str, tmp_path: Path) -> None:
    columns = dict(sine())
    edit(columns)
    path = write_csv(tmp_path / "wrong.csv", columns)
    with pytest.raises(InputError) as info:
        read_log(path, ReadOptions(COLUMNS))
    assert str(path) in str(info.value)
    assert message in str(info.value)
    assert "\n" not in str(info.value)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"columns": {"tild": "a"}}, "--columns tild: no such role; did you mean 'tilt'?"),
        ({"columns": {"rate": "a_dps"}}, "there is no tilt"),
        ({"columns": {"tilt": "pitch"}}, "does not end in a unit; say --units tilt=UNIT, one of rad, mrad, deg"),
        ({"columns": {"tilt": "a"}, "units": {"tilt": "m"}}, "'m' is no unit of an angle"),
        ({"columns": {"tilt": "a_deg"}, "units": {"rate": "dps"}}, "--units rate: there is no such column"),
        ({"columns": {"tilt": "a_deg"}, "scale": {"tilt": 0.0}}, "must be a finite number other than 0"),
        ({"columns": {"tilt": "a_deg", "inner_x": "b_g"}}, "not both"),
        ({"columns": {"inner_x": "b_g"}}, "of two accelerometers inner_z, outer_x, outer_z is missing"),
        ({"columns": {"tilt": "tilt_rad"}}, "no time: name its column, --columns time=..., or give --rate HZ"),
        ({"columns": {"tilt": "tilt_rad"}, "delay_s": 0.1}, "there is no reference to shift"),
        ({"columns": COLUMNS, "radii_m": (0.1, 0.2)}, "there are no accelerometers"),
        ({"columns": COLUMNS, "time_range_s": (100.0, 200.0)}, "has no row there; it lasts 19.995 s"),
        ({"columns": COLUMNS, "rate_hz": 1e6}, "at most 5,000,000"),
        (
            {
                "columns": {"time": "t_s", **dict.fromkeys(ACCELEROMETERS, "tilt_rad")},
                "units": dict.fromkeys(ACCELEROMETERS, "g"),
                "radii_m": (67.0, 201.5),
            },
            "--radii 67,201.5: in metres, at most 10; are these millimetres?",
        ),
        ({}, "say which columns are what"),
    ],
)
def test_arguments_that_cannot_be(arguments: dict, message: str, tmp_path: Path) -> None:
    path = write_csv(tmp_path / "s.csv", sine())
    with pytest.raises(InputError) as info:
        read_log(path, ReadOptions(**arguments))
    assert message in str(info.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "empty"),
        (b"\n \n", "empty"),
        (b"# only\n# comments\n", "no heading"),
        (b"\x7fELF\0\0\0", "neither CSV nor Parquet"),
        (b"PAR1 and no more", "cannot be read"),
        (b"t_s,tilt_rad,tilt_rad,gyro_rad_s\n0,1,2,3\n", "has the column 'tilt_rad' 2 times"),
        (
            b"t_s,tilt_rad,gyro_rad_s\n0,0,0,1,1,2\n",
            "no line has as many cells as the heading; the first, 6 cells instead of 3",
        ),
        (b"t_s,tilt_rad,gyro_rad_s\n0,1,2\n", "1 row with all that is needed; at least 20"),
        (b"t_s,tilt_rad,gyro_rad_s\n0," + b"9" * 3_000_000 + b",1\n", "a line is longer than a megabyte"),
        ("t_s,tilt_rad,gyro_rad_s\n0,1,2\n".encode("utf-32"), "is written in UTF-32; save it as UTF-8"),
    ],
)
def test_files_that_are_none(content: bytes, message: str, tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_log(path, ReadOptions(COLUMNS))


def test_parquet_with_blanks_dots_and_nested_columns(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    t, y = sine()["t_s"], sine()["tilt_rad"]
    nested = pa.array([{"tilt_rad": one} for one in y])
    path = tmp_path / "log.parquet"
    pq.write_table(pa.table({" t_s": t, "tilt_rad ": y, "imu.tilt_rad": 2.0 * y, "imu": nested}), path)
    np.testing.assert_array_equal(read_log(path, ReadOptions({"time": "t_s", "tilt": "tilt_rad"}))["y1_rad"], y)
    np.testing.assert_array_equal(
        read_log(path, ReadOptions({"time": "t_s", "tilt": "imu.tilt_rad"}))["y1_rad"], 2.0 * y
    )
    with pytest.raises(InputError, match=r"column 'imu' holds struct<tilt_rad: double>, not numbers"):
        read_log(path, ReadOptions({"time": "t_s", "tilt": "imu"}, units={"tilt": "rad"}))
    pq.write_table(pa.table({"t_s": t, "tilt_rad": y, " tilt_rad": y}), path)
    with pytest.raises(InputError, match="has the column 'tilt_rad' 2 times"):
        read_log(path, ReadOptions({"time": "t_s", "tilt": "tilt_rad"}))


def test_truth_values_are_no_numbers(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    pq.write_table(pa.table({"t_s": sine()["t_s"], "tilt_rad": sine()["tilt_rad"] > 0.0}), path)
    with pytest.raises(InputError, match="column 'tilt_rad' holds bool, not numbers"):
        read_log(path, ReadOptions({"time": "t_s", "tilt": "tilt_rad"}))


@pytest.mark.parametrize(("rate", "samples"), [(0.1, 2), (0.5, 10)])
def test_a_rate_that_leaves_too_few_samples(rate: float, samples: int, tmp_path: Path) -> None:
    path = write_csv(tmp_path / "log.csv", sine())
    with pytest.raises(InputError, match=f"s at {rate:g} Hz are {samples} samples; at least 20"):
        read_log(path, ReadOptions(COLUMNS, rate_hz=rate))
    assert len(read_log(path, ReadOptions(COLUMNS, rate_hz=1.05))) == 21


@pytest.mark.parametrize(
    ("n_lines", "message"),
    [
        (1, "1 line has another number of cells and was discarded; 2 cells instead of 3: "),
        (2, "2 lines have another number of cells and were discarded; the first, 2 cells instead of 3: "),
    ],
)
def test_torn_lines(n_lines: int, message: str, tmp_path: Path) -> None:
    path = write_csv(tmp_path / "log.csv", sine())
    lines = path.read_text().splitlines()
    for i in range(n_lines):
        lines[100 + 500 * i] = "1,2"
    path.write_text("\n".join(lines))
    assert read_log(path, ReadOptions(COLUMNS)).notes[0].startswith(message)


def test_no_file_and_no_regular_file(tmp_path: Path) -> None:
    for path, message in (
        (tmp_path / "not.csv", "no such file"),
        (tmp_path, "no file"),
        (Path("/dev/zero"), "no file"),
    ):
        with pytest.raises(InputError, match=message):
            read_log(path, ReadOptions(COLUMNS))


def test_too_many_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cmg_mj.replay.logs.table.MOST_ROWS", 100)
    with pytest.raises(InputError, match="more than 100 rows"):
        read_log(write_csv(tmp_path / "long.csv", sine()), ReadOptions(COLUMNS))
    with pytest.raises(InputError, match="4,000 rows, more than 100 rows"):
        read_log(parquet(tmp_path / "long.parquet", sine()), ReadOptions(COLUMNS))


def test_milliseconds_are_not_taken_as_seconds(tmp_path: Path) -> None:
    columns = {"clock": sine()["t_s"] * 1e3, "tilt_rad": sine()["tilt_rad"]}
    names = {"time": "clock", "tilt": "tilt_rad"}
    path = write_csv(tmp_path / "ms.csv", columns)
    with pytest.raises(InputError, match=r"would be 5 s apart, 0.2 Hz, and no unit is said: --units time=ms"):
        read_log(path, ReadOptions(names))
    assert read_log(path, ReadOptions(names, units={"time": "ms"})).dt == pytest.approx(DT)
    assert read_log(path, ReadOptions(names, units={"time": "s"})).dt == pytest.approx(1e3 * DT)


def test_dates_are_not_assumed_to_be_seconds(tmp_path: Path) -> None:
    start = np.datetime64("2024-05-01T12:00:00.000")
    dates = [str(start + np.timedelta64(round(t * 1e3), "ms")) for t in sine()["t_s"]]
    for heading in ("when", "when_ms"):
        path = write_csv(tmp_path / "dates.csv", {heading: dates, "tilt_rad": sine()["tilt_rad"]})
        log = read_log(path, ReadOptions({"time": heading, "tilt": "tilt_rad"}))
        assert not log.notes
        assert log.dt == pytest.approx(DT)


def test_a_spike_is_no_turn(tmp_path: Path) -> None:
    """One row that leaps by 300 degrees, or by a turn out of what the angle's range can be: kept, and named."""
    for leap in (math.radians(300.0), 2.0 * math.pi):
        columns = dict(sine(), tilt_rad=sine()["tilt_rad"] + leap * (np.arange(N) == 1000))
        log = read_log(write_csv(tmp_path / "spike.csv", columns), ReadOptions(COLUMNS))
        np.testing.assert_allclose(log["y1_rad"], columns["tilt_rad"], atol=1e-12)
        (note,) = log.notes
        assert "and back in row 1001 alone: a spike, kept as it is" in note


def test_a_tilt_that_flickers_at_the_end_of_its_turn_runs_on(tmp_path: Path) -> None:
    t = np.arange(N) * DT
    truth = 0.4 * t + 0.003 * np.random.default_rng(1).standard_normal(N)
    columns = {"t_s": t, "tilt_rad": (truth + math.pi) % (2.0 * math.pi) - math.pi}
    log = read_log(write_csv(tmp_path / "turns.csv", columns), ReadOptions({"time": "t_s", "tilt": "tilt_rad"}))
    assert np.ptp(log["y1_rad"] - truth) < 1e-9
    assert len(log.notes) == 1
    assert "jumps by a turn" in log.notes[0]

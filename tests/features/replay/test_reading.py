"""The same log in other units, formats and orders is the same log; what cannot be read is said in one line."""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.core.types import STANDARD_GRAVITY
from cmg_mj.features.replay.log import ACCELEROMETERS, Log, ReadOptions, assignments, unit_of_name
from cmg_mj.features.replay.reading import read_channels, read_log
from tests.features.replay.motion import (
    AMPLITUDE,
    COLUMNS,
    DT,
    OMEGA,
    N,
    rate,
    read,
    sine,
    tilt,
    two_accelerometers,
    write_csv,
)

T = DT * np.arange(N)
ONE = {"time": "t_s", "tilt": "tilt_rad"}


def assert_plain(log: Log, tolerance: float = 1e-9) -> None:
    """It is the sine at its own rate."""
    assert log.dt == pytest.approx(DT, rel=1e-9)
    for name, expected in zip(("time_s", "y1_rad", "reference_rad_s"), sine().values(), strict=True):
        np.testing.assert_allclose(log[name], expected, atol=tolerance)


def assert_sine(log: Log, tolerance: float) -> None:
    """Tilt and reference are the sine's at the log's times, where the reference is known."""
    np.testing.assert_allclose(log["y1_rad"], tilt(log["time_s"]), atol=tolerance)
    known = np.isfinite(log["reference_rad_s"])
    np.testing.assert_allclose(log["reference_rad_s"][known], rate(log["time_s"])[known], atol=10.0 * tolerance)


def test_the_plain_one(tmp_path: Path) -> None:
    plain = read(tmp_path, sine())
    assert (plain.dt, list(plain.parts), plain.notes, plain.has) == (DT, [slice(0, N)], (), {"reference"})
    assert_plain(plain, 0.0)


@pytest.mark.parametrize(
    ("heads", "sizes"),
    [
        (("t_ms", "pitch_deg", "gyro_dps"), (1e3, 180 / math.pi, 180 / math.pi)),
        (("Time [us]", "Pitch (°)", "Gyro [deg/s]"), (1e6, 180 / math.pi, 180 / math.pi)),
        (("timeMs", "tiltMrad", "gyro rad/s"), (1e3, 1e3, 1.0)),
    ],
)
def test_units_by_their_names(heads: tuple, sizes: tuple, tmp_path: Path) -> None:
    columns = {h: v * s for h, v, s in zip(heads, sine().values(), sizes, strict=True)}
    assert_plain(read(tmp_path, columns, dict(zip(COLUMNS, heads, strict=True))))


def test_units_as_options(tmp_path: Path) -> None:
    t, y, w = sine().values()
    columns = {"a": t * 1e3, "b": np.degrees(y), "c": -np.degrees(w)}
    units = {"time": "ms", "tilt": "degrees", "rate": "deg/s"}
    assert_plain(read(tmp_path, columns, {"time": "a", "tilt": "b", "rate": "c"}, units=units, scale={"rate": -1.0}))


@pytest.mark.parametrize(
    ("quantity", "name", "unit"),
    [
        ("rate", "alpha_rad_s2", None),
        ("angle", "gyro_deg_s", None),
        ("acceleration", "acc_x (m/s^2)", "m_s2"),
        ("acceleration", "accX", None),
        ("time", "timestamp", None),
    ],
)
def test_what_a_name_ends_in(quantity: str, name: str, unit: str | None) -> None:
    assert unit_of_name(quantity, name) == unit  # type: ignore[arg-type]


def test_parquet_with_dates(tmp_path: Path) -> None:
    """Whole nanoseconds are subtracted before they are floats: in 2026 a double has a quarter of a microsecond.

    Nested columns and truth values beside are not numbers; spaces around a heading do not count.
    """
    t, y, w = sine().values()
    stamps = pa.array(1_790_000_000_000_000_000 + np.rint(t * 1e9).astype(int), pa.timestamp("ns", "UTC"))
    columns = {" t_s": stamps, "tilt_rad ": y.astype("float32"), "gyro_rad_s": w, "imu.tilt_rad": 2.0 * y}
    columns |= {"imu": pa.array([{"tilt_rad": one} for one in y]), "up_rad": y > 0.0}
    path = tmp_path / "log.parquet"
    pq.write_table(pa.table(columns), path)
    assert_plain(read_log(path, ReadOptions(COLUMNS)), 1e-7)
    np.testing.assert_array_equal(read_log(path, ReadOptions({**ONE, "tilt": "imu.tilt_rad"}))["y1_rad"], 2.0 * y)
    for name in ("imu", "up_rad"):
        with pytest.raises(InputError, match=f"column '{name}' holds"):
            read_log(path, ReadOptions({**ONE, "tilt": name}, units={"tilt": "rad"}))


def test_dates_in_a_csv(tmp_path: Path) -> None:
    stamps = [f"2026-11-22T06:{int(s // 60):02}:{s % 60:06.3f}" for s in T]
    assert_plain(read(tmp_path, {**sine(), "t_s": stamps}))


def test_a_csv_is_read_as_told(tmp_path: Path) -> None:
    """Semicolons with decimal commas in Latin-1, as a German Excel writes them, with Windows' line ends."""
    t, y, w = sine().values()
    path = write_csv(tmp_path / "eu.csv", {"t_s": t, "Neigung (°)": np.degrees(y), "gyro_rad_s": w}, delimiter=";")
    path.write_bytes(path.read_text("utf-8").replace(".", ",").replace("\n", "\r\n").encode("latin-1"))
    told = ReadOptions({**COLUMNS, "tilt": "Neigung (°)"}, delimiter=";", encoding="latin-1", decimal=",")
    assert_plain(read_log(path, told))
    for wrong in ({"delimiter": ","}, {"encoding": "utf-8"}, {"decimal": "."}, {"delimiter": ";;"}):
        with pytest.raises(InputError, match="eu"):
            read_log(path, dataclasses.replace(told, **wrong))


def test_a_rate_instead_of_times(tmp_path: Path) -> None:
    assert_plain(read(tmp_path, sine(), {"tilt": "tilt_rad", "rate": "gyro_rad_s"}, rate_hz=1.0 / DT))


def test_a_time_range(tmp_path: Path) -> None:
    log = read(tmp_path, sine(), time_range_s=(2.0, 5.0))
    np.testing.assert_allclose(log["time_s"], T[400:1001])


@pytest.mark.parametrize(("rows", "first"), [([100, 2000], 0.5), (np.arange(N), 0)])
def test_some_or_all_rows_twice(rows: list, first: float, tmp_path: Path) -> None:
    twice = np.sort(np.concatenate([np.arange(N), rows]))
    log = read(tmp_path, {name: values[twice] for name, values in sine().items()})
    assert_plain(log)
    assert log.notes == (f"{len(rows):,} rows with the time of the row before discarded, first at {first} s",)


@pytest.mark.parametrize("rows", [0, slice(500, 503), N - 1])
def test_a_number_that_stands_for_none_is_no_turn(rows: int | slice, tmp_path: Path) -> None:
    columns = sine()
    columns["tilt_rad"][rows] = 1e4
    log = read(tmp_path, columns)
    assert "of 'tilt' beside all others, as 10000: no number" in log.notes[0]
    assert "without a usable number discarded" in log.notes[1]
    assert_sine(log, 3e-4)


def test_a_number_that_stands_for_none_is_no_reference(tmp_path: Path) -> None:
    columns = sine()
    columns["gyro_rad_s"][::50] = -999.0
    log = read(tmp_path, columns)
    assert "80 rows of 'rate' beside all others" in log.notes[0]
    assert_sine(log, 3e-4)


def test_a_dash_is_no_number(tmp_path: Path) -> None:
    columns = sine()
    log = read(tmp_path, {**columns, "gyro_rad_s": [*columns["gyro_rad_s"][:9], "-", *columns["gyro_rad_s"][10:]]})
    assert np.isnan(log["reference_rad_s"][9])
    assert_sine(log, 3e-4)


def test_degrees_taken_as_radians_are_named(tmp_path: Path) -> None:
    log = read(tmp_path, {name: values * (1.0 if name == "t_s" else 57.3) for name, values in sine().items()})
    assert "if these are degrees, --units tilt=deg" in log.notes[0]


def test_swapped_axes_are_refused(tmp_path: Path) -> None:
    columns = {"t_s": T, "x": -np.sin(tilt(T)), "z": np.cos(tilt(T))}
    with pytest.raises(InputError, match=r"gravity lies along ax, 0.99 g in the median: swap"):
        read(tmp_path, columns, {"time": "t_s", "ax": "z", "az": "x"}, units={"ax": "g", "az": "g"})


def test_two_blocks_of_rows_take_no_turns(tmp_path: Path) -> None:
    time = np.concatenate([0.007 * np.arange(1500), 10.5 + 0.037 * np.arange(500)])
    columns = {"t_s": time, "tilt_rad": tilt(time), "gyro_rad_s": rate(time)}
    log = read(tmp_path, columns)
    assert "leave time out" not in " ".join(log.notes)
    assert_sine(log, 5e-3)


@pytest.mark.parametrize("rate_hz", [400.0, 800.0, 900.0, 980.0])
def test_stamps_rounded_to_milliseconds_are_even(rate_hz: float, tmp_path: Path) -> None:
    t = np.arange(3000) / rate_hz
    log = read(tmp_path, {**sine(t), "t_s": np.round(t, 3)})
    assert 1.0 / log.dt == pytest.approx(rate_hz, rel=3e-4)
    np.testing.assert_array_equal(log["y1_rad"], tilt(t))
    assert np.isfinite(log["reference_rad_s"]).all()
    assert "taken as even sampling" in log.notes[0]


def test_every_tenth_row_lost_is_no_rounding(tmp_path: Path) -> None:
    t = 1e-3 * np.arange(N)
    log = read(tmp_path, {name: values[np.arange(N) % 10 > 0] for name, values in sine(t).items()})
    assert log.dt == pytest.approx(1e-3)
    assert "gaps bridged" in log.notes[0]


@pytest.mark.parametrize(("jitter", "rate_hz"), [(0.2, None), (0.0, 130.0)])
def test_resampled(jitter: float, rate_hz: float | None, tmp_path: Path) -> None:
    t = T + np.random.default_rng(3).uniform(-jitter, jitter, N) * DT
    log = read(tmp_path, sine(t), rate_hz=rate_hz)
    assert "resampled" in log.notes[0]
    assert log.dt == pytest.approx(1.0 / (rate_hz or 200.0), rel=1e-4)
    np.testing.assert_allclose(np.diff(log["time_s"]), log.dt, rtol=1e-6)
    assert_sine(log, 1e-7)


def test_a_short_gap_is_bridged_and_a_long_one_parts(tmp_path: Path) -> None:
    mask = np.ones(N, dtype=bool)
    mask[1000:1003] = mask[2000:2200] = False
    columns = {name: values[mask] for name, values in sine().items()}
    log = read(tmp_path, columns)
    assert [(p.start, p.stop) for p in log.parts] == [(0, 2000), (2000, 3800)]
    short_gap_note, long_gap_note = log.notes
    assert "1 gap bridged by straight lines; the longest is 20 ms at 4.995 s" in short_gap_note
    assert "1 gap not bridged" in long_gap_note
    measured_rows = np.isin(np.arange(3800), np.arange(1000, 1003), invert=True)
    np.testing.assert_allclose(log["y1_rad"][measured_rows], tilt(log["time_s"])[measured_rows], atol=1e-12)
    assert_sine(log, 3e-4)
    assert np.isnan(log["reference_rad_s"][1001])
    assert log.duration_s == pytest.approx((1999 + 1799) * DT)
    assert len(read(tmp_path, columns, max_gap_s=2.0).parts) == 1


def test_missing_numbers_are_gaps(tmp_path: Path) -> None:
    columns = {name: list(values) for name, values in sine().items()}
    columns["tilt_rad"][100:102] = None, float("nan")
    columns["gyro_rad_s"][500] = None
    log = read(tmp_path, columns)
    assert "2 rows of 4,000 without a usable number discarded, first row 101" in log.notes[0]
    assert len(log) == N
    assert np.isfinite(log["y1_rad"]).all()
    assert np.isnan(log["reference_rad_s"]).sum() == 1


@pytest.mark.parametrize("together", [1, 2])
def test_a_reference_in_rows_of_its_own(together: int, tmp_path: Path) -> None:
    """Tilt and gyro in turn, as a merged log has them; at times of their own, or at the same."""
    t = np.arange(2 * N) // together * together * DT / 2.0
    tilts, rates = list(tilt(t)), list(rate(t))
    tilts[1::2] = rates[::2] = [None] * N
    log = read(tmp_path, {"t_s": t, "tilt_rad": tilts, "gyro_rad_s": rates})
    assert log.dt == pytest.approx(DT)
    assert np.isfinite(log["reference_rad_s"]).sum() >= N - 2
    assert_sine(log, 1e-7)


@pytest.mark.parametrize(("speed", "flicker"), [(2.0, 0.0), (0.4, 0.003)])
def test_a_tilt_that_starts_again_after_a_turn_runs_on(speed: float, flicker: float, tmp_path: Path) -> None:
    truth = speed * T + flicker * np.random.default_rng(1).standard_normal(N)
    log = read(tmp_path, {"t_s": T, "tilt_rad": (truth + math.pi) % (2.0 * math.pi) - math.pi}, ONE)
    assert np.ptp(log["y1_rad"] - truth) < 1e-9
    assert "jumps by a turn" in log.notes[0]


def test_gimbals_and_command(tmp_path: Path) -> None:
    """Half the difference of two encoders; a command is held, not drawn out, when it is resampled."""
    columns = {**sine(), "g1_deg": np.degrees(0.1 * T), "g2_deg": np.degrees(-0.1 * T), "u_rad_s": (T // 1.0) % 2.0}
    roles = {**COLUMNS, "gimbal1": "g1_deg", "gimbal2": "g2_deg", "command": "u_rad_s"}
    log = read(tmp_path, columns, roles)
    assert log.has == {"reference", "gimbals"}
    np.testing.assert_allclose(log["y2_rad"], 0.1 * T, atol=1e-12)
    assert set(read(tmp_path, columns, roles, rate_hz=333.0)["u_rad_s"]) == {0.0, 1.0}
    del roles["command"]
    half = read(tmp_path, columns, roles)
    assert half.has == {"reference"}
    assert "need both" in half.notes[-1]


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (
            lambda c: {"tilt_rad": [0.1, "x", *[0.1] * (N - 2)]},
            "about line 3, column 2: .x. is no number.*line of units",
        ),
        (lambda c: {"tilt_rad": ["1,2", *[0.1] * (N - 1)]}, "about line 2: Expected 3 columns, got 4"),
        (lambda c: {"note": c["t_s"], "note ": c["t_s"], "tilt_rad ": c["t_s"]}, "has 2 columns 'tilt_rad'"),
        (lambda c: {"tilt_rad": np.full(N, 0.3)}, "nothing moves"),
        (lambda c: {"gyro_rad_s": np.full(N, 0.3)}, "the reference is 0.3 rad/s in every row"),
        (lambda c: {"gyro_rad_s": [None] * N}, "the reference has no number"),
        (lambda c: {"tilt_rad": [None] * N}, "0 rows"),
        (lambda c: {"t_s": np.zeros(N)}, "3,999 of 4,000 rows have the same time"),
        (lambda c: {"t_s": c["t_s"] * 1e4}, "rows are 50 s apart"),
        (lambda c: {"t_s": np.roll(c["t_s"], 500)}, "time goes back.*: cut the log there"),
        (lambda c: {"t_s": c["t_s"][::-1]}, "time goes back.*: sort the rows by time$"),
        (lambda c: {"t_s": [*c["t_s"][:700], "abc", *c["t_s"][701:]]}, "column 't_s': 'abc' in row 701 is no number"),
        (lambda c: {"tilt_rad": [None, 0.1] * (N // 2), "t_s": [0.1, None] * (N // 2)}, "0 rows .* groupby"),
        (lambda c: {k: v[:7] for k, v in c.items()}, "7 rows .*at least 20$"),
        (lambda c: {k: v[:0] for k, v in c.items()}, "has no row"),
    ],
)
def test_a_log_that_cannot_be_is_refused_in_a_line(changed: Callable, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message) as info:
        read(tmp_path, {**sine(), **changed(sine())})
    assert "log.csv: " in str(info.value)
    assert "\n" not in str(info.value)


PAIR, PAIR_SI = dict.fromkeys(ACCELEROMETERS, "tilt_rad"), dict.fromkeys(ACCELEROMETERS, "m_s2")


@pytest.mark.parametrize(
    ("columns", "options", "message"),
    [
        ({"tild": "a"}, {}, "--columns tild: .*'tilt'"),
        ({"rate": "a_dps"}, {}, "--columns: "),
        ({"ax": "b_g"}, {}, "--columns: "),
        ({"tilt": "a_deg", "gimbal1": "b_deg"}, {}, "--columns: "),
        ({"tilt": "pitch"}, {}, "--columns tilt=pitch: "),
        ({"tilt": "a"}, {"units": {"tilt": "m"}}, "--units tilt=m: "),
        ({"tilt": "a_deg"}, {"units": {"rate": "dps"}}, "--units rate: "),
        ({"tilt": "a_deg"}, {"scale": {"tilt": 0.0}}, "--scale tilt=0: "),
        ({**ONE, "tilt": "no_deg"}, {}, "has no column 'no_deg'"),
        ({"tilt": "tilt_rad"}, {}, "no time"),
        (ONE, {"delay_s": 0.1}, "--delay"),
        (COLUMNS, {"delay_s": math.nan}, "--delay nan: "),
        (ONE, {"windows_s": [(1.0, 2.0)]}, "--window: "),
        (COLUMNS, {"windows_s": [(30.0, 40.0)]}, "--window 30:40: "),
        (COLUMNS, {"time_range_s": (100.0, 200.0)}, "--time-range 100:200: "),
        (COLUMNS, {"rate_hz": 1e6}, "at most 5,000,000"),
        (COLUMNS, {"rate_hz": 0.5}, "no part of 20 samples"),
        (PAIR, {"units": PAIR_SI}, "--radii INNER,OUTER"),
        (PAIR, {"units": PAIR_SI, "radii_m": (67.0, 201.5)}, "--radii 67,201.5: "),
        ({}, {}, "--columns"),
    ],
)
def test_arguments_that_cannot_be(columns: dict, options: dict, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        read(tmp_path, sine(), columns, **options)


@pytest.mark.parametrize(
    ("content", "message"),
    [(b"", "is empty$"), (b"\n \n", ""), (b"\x7fELF\0\0\0", ""), (b"PAR1 and no more", "cannot be read")],
)
def test_files_that_are_none(content: bytes, message: str, tmp_path: Path) -> None:
    path, pipe = tmp_path / "x.csv", tmp_path / "pipe"
    path.write_bytes(content)
    os.mkfifo(pipe)
    for file, words in ((path, message), (tmp_path, ""), (tmp_path / "not.csv", ""), (pipe, "no plain file.*a pipe")):
        with pytest.raises(InputError, match=f"{file}: .*{words}"):
            read_log(file, ReadOptions(COLUMNS))


def test_milliseconds_are_not_taken_as_seconds(tmp_path: Path) -> None:
    columns, roles = {"clock": T * 1e3, "tilt_rad": tilt(T)}, {**ONE, "time": "clock"}
    with pytest.raises(InputError, match="--units time=ms"):
        read(tmp_path, columns, roles)
    for unit, size in (("ms", 1.0), ("s", 1e3)):
        assert read(tmp_path, columns, roles, units={"time": unit}).dt == pytest.approx(size * DT)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('tilt="a,rate=b (deg)",rate=c', {"tilt": "a,rate=b (deg)", "rate": "c"}),
        ('time = t , tilt = "5"" tube" ,rate=w', {"time": "t", "tilt": '5" tube', "rate": "w"}),
        ('tilt=the "raw" one,rate=w', {"tilt": 'the "raw" one', "rate": "w"}),
        ('tilt="a,b', None),
        ("tilt=", None),
        ("tilt=a,tilt=b", None),
    ],
)
def test_headings_with_commas_go_into_quotes(text: str, expected: dict[str, str] | None) -> None:
    if expected is None:
        with pytest.raises(InputError, match="--columns"):
            assignments([text], "--columns")
    else:
        assert assignments([text], "--columns") == expected


def one_accelerometer(folder: Path, turn: float = 1.0, **options) -> Log:
    """Specific force at the pivot."""
    columns = {"t_s": T, "ax_g": -turn * np.sin(tilt(T)), "az": turn * 9.80665 * np.cos(tilt(T))}
    return read(folder, columns, {"time": "t_s", "ax": "ax_g", "az": "az"}, units={"az": "m/s2"}, **options)


def test_one_accelerometer(tmp_path: Path) -> None:
    downward = one_accelerometer(tmp_path, -1.0)
    assert "--scale ax=-1,az=-1 if the sensor shows gravity itself, --scale az=-1 if" in downward.notes[-2]
    for log in (one_accelerometer(tmp_path), one_accelerometer(tmp_path, -1.0, scale={"ax": -1.0, "az": -1.0})):
        np.testing.assert_allclose(log["y1_rad"], tilt(T), atol=1e-12)
        assert (log.has, log.tilt, len(log.notes)) == (frozenset(), None, 1)


def test_two_accelerometers_give_tilt_and_acceleration(tmp_path: Path) -> None:
    """For any motion, and in any unit."""
    for unit, factor in (("m_s2", 1.0), ("mg", 1e3 / STANDARD_GRAVITY)):
        log = two_accelerometers(tmp_path, 0.2, factor, **dict.fromkeys(ACCELEROMETERS, unit))
        np.testing.assert_allclose(log["y1_rad"], tilt(T), atol=1e-9)
        np.testing.assert_allclose(log["acceleration_rad_s2"], -(OMEGA**2) * tilt(T), atol=1e-9)
        assert (log.has, log.notes) == ({"acceleration"}, ())


@pytest.mark.parametrize("swing", [1e-5, 0.2])
def test_accelerometers_in_a_wrong_unit(swing: float, tmp_path: Path) -> None:
    """The cure that is named is one."""
    wrong = two_accelerometers(tmp_path, swing, outer_x="g", outer_z="g").notes[-1]
    assert ": --scale outer_x=0.10" in wrong, wrong
    assert "--scale inner_x=0.00059" in two_accelerometers(tmp_path, swing, 16384.0 / STANDARD_GRAVITY).notes[0]


SIGNS = [
    (["# {}"], ""),
    (["# Run 5, by me", "", "// {}"], ""),
    (["# Run 5, with care", "{}"], ""),
    (["#,{}"], "1,"),
]


@pytest.mark.parametrize(("beginning", "before"), SIGNS)
def test_a_heading_behind_a_comment_sign(beginning: list[str], before: str, tmp_path: Path) -> None:
    heading, *rows = write_csv(tmp_path / "log.csv", sine()).read_text().splitlines()
    lines = [line.format(heading) for line in beginning] + [before + row for row in rows]
    (tmp_path / "log.csv").write_text("\n".join(lines))
    assert_plain(read_log(tmp_path / "log.csv", ReadOptions(COLUMNS)))


@pytest.mark.parametrize(
    "stamp",
    ["{}Z", "{}000000000 +02:00", "{} UTC"],
)
def test_dates_with_a_zone(stamp: str, tmp_path: Path) -> None:
    """Zones change, and the fraction is left out where it is zero."""
    stamps = [f"2026-11-22 06:{int(s // 60):02}:{s % 60:06.3f}" for s in T]
    marked = [stamp.format(text) for text in stamps]
    assert_plain(read(tmp_path, {**sine(), "t_s": marked}))
    later = [f"2026-11-22T11:{int(s // 60):02}:{s % 60:06.3f}".removesuffix(".000") + "+05:00" for s in T]
    marked[2000:] = later[2000:]
    if stamp == "{}Z":
        assert_plain(read(tmp_path, {**sine(), "t_s": marked}))
    with pytest.raises(InputError, match="some stamps have a zone and some have none"):
        read(tmp_path, {**sine(), "t_s": stamps[:1000] + marked[1000:]})


PACKET_STAMPS = {
    "two": lambda i: i // 2 * 0.01 + i % 2 * 0.0002,
    "five with jitter": lambda i: i // 5 * 0.025 + i % 5 * 0.0002 + np.sin(i // 5) * 0.004,
    "stamped once": lambda i: i // 4 * 0.02,
    "a pause": lambda i: i // 3 * 0.015 + i % 3 * 2e-4 + (i > 1500) * 9.0,
}


@pytest.mark.parametrize("kind", PACKET_STAMPS)
@pytest.mark.parametrize("rows", [slice(None), slice(1, -1)])
def test_packets_are_refused_with_the_cure(kind: str, rows: slice, tmp_path: Path) -> None:
    columns = {**sine(), "t_s": PACKET_STAMPS[kind](np.arange(N))}
    for max_gap_s in (None, 0.5):
        with pytest.raises(InputError, match=r"leave time out and give --rate (\d+\.?\d*)$") as info:
            read(tmp_path, {name: values[rows] for name, values in columns.items()}, max_gap_s=max_gap_s)
        assert float(str(info.value).split()[-1]) == pytest.approx(200.0, rel=0.005)


@pytest.mark.parametrize(("kept", "of", "parts"), [(140, 200, 20), (100, 200, 20), (32, 50, 80), (38, 80, 50)])
def test_pauses_are_no_packets(kept: int, of: int, parts: int, tmp_path: Path) -> None:
    """A pause of half a period too, across which the tilt changes by nothing."""
    columns = sine()
    columns["tilt_rad"] += 1e-3 * np.random.default_rng(5).standard_normal(N)
    log = read(tmp_path, {name: values[np.arange(N) % of < kept] for name, values in columns.items()})
    assert (log.dt, len(log.parts)) == (DT, parts)
    assert_sine(log, 6e-3)


@pytest.mark.parametrize("rows", [slice(None), slice(1, -1)])
@pytest.mark.parametrize("steps", [(4, 16), (7, 7, 16)])
def test_steps_that_take_turns_are_sampled_at_their_mean(steps: tuple, rows: slice, tmp_path: Path) -> None:
    t = 1e-3 * np.concatenate([[0.0], np.cumsum(np.resize(steps, 3000))])[rows]
    log = read(tmp_path, sine(t))
    assert log.dt == pytest.approx(0.01, rel=1e-3)
    assert f"uneven steps, {steps[0]} to {steps[-1]} ms, are resampled to" in log.notes[0]
    assert_sine(log, 2e-3)  # straight lines over 16 ms: 0.2 (2 pi 0.016)^2 / 8
    assert np.isfinite(log["reference_rad_s"]).mean() > 0.99


@pytest.mark.parametrize(
    "late", [lambda r: r.exponential(0.4, N), lambda r: r.normal(0.0, 0.2, N), lambda r: r.normal(0.0, 0.5, N)]
)
def test_stamps_of_arrival_distort_nothing(late: Callable, tmp_path: Path) -> None:
    stamps = np.maximum.accumulate(T + DT * late(np.random.default_rng(8)))
    log = read(tmp_path, {**sine(), "t_s": np.sort(stamps) + 1e-6 * np.arange(N)})
    assert log.dt == pytest.approx(DT, rel=1e-3)
    assert "by straight lines; if they were measured evenly, leave time out and give --rate" in log.notes[0]
    assert_sine(log, 5.0 * DT * AMPLITUDE * OMEGA)


@pytest.mark.parametrize("lost", [0.02, 0.18])
def test_lost_rows_leave_the_others_where_they_are(lost: float, tmp_path: Path) -> None:
    kept = np.random.default_rng(2).uniform(size=N) > lost
    log = read(tmp_path, {name: values[kept] for name, values in sine().items()})
    assert log.dt == pytest.approx(DT, rel=1e-6)
    assert_sine(log, 0.02)


@pytest.mark.parametrize(
    ("place", "low", "high"), [("gyro_rad_s", -9, 1), ("gyro_rad_s", -1, 1.1), ("tilt_rad", -9, 0.15)]
)
def test_what_is_clipped_is_named_and_not_compared(place: str, low: float, high: float, tmp_path: Path) -> None:
    columns = sine()
    columns[place] = np.clip(columns[place], low, high)
    log = read(tmp_path, columns)
    ends = {f"largest value, {high}": columns[place] == high, f"smallest value, {low}": columns[place] == low}
    found = ", and ".join(f"{rows.sum():,} rows at its {end}" for end, rows in ends.items() if rows.any())
    assert log.notes == (f"'{place}' stands {found}: clipped, and the reference is not compared there",)
    np.testing.assert_array_equal(np.isnan(log["reference_rad_s"]), np.logical_or.reduce(list(ends.values())))
    if place == "tilt_rad":
        assert read(tmp_path, columns, ONE).notes == (f"'{place}' stands {found}: clipped, or at a stop",)


@pytest.mark.parametrize("step", [0.001, 0.1])
@pytest.mark.parametrize("noise", [0.0, 1.5])
def test_a_quantiser_is_not_clipped(step: float, noise: float, tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    for size, name in ((1.0, "tilt_rad"), (5.0, "gyro_rad_s")):
        columns, q = sine(), step * size
        columns[name] = q * np.round(columns[name] / q + noise * random.standard_normal(N))
        assert not any("clipped" in note for note in read(tmp_path, columns).notes)


@pytest.mark.parametrize("place", ["tilt_rad", "gyro_rad_s"])
def test_a_signal_that_is_held_is_clipped_where_it_is(place: str, tmp_path: Path) -> None:
    columns = sine()
    columns[place] = (columns[place] + 1e-3 * np.random.default_rng(6).standard_normal(N))[np.arange(N) // 5 * 5]
    assert read(tmp_path, columns).notes == ()
    columns[place] = np.minimum(columns[place], 0.8 * columns[place].max())
    assert f"'{place}' stands" in read(tmp_path, columns).notes[0]


def test_a_tilt_at_rest_is_not_clipped(tmp_path: Path) -> None:
    """It comes to its stop at full speed, and lies there."""
    swing, still = 0.3 * np.sin(T), np.abs(0.3 * np.sin(T)) > 0.2
    rate = np.where(still, 0.0, 0.3 * np.cos(T)) + 1e-3 * np.random.default_rng(4).standard_normal(N)
    log = read(tmp_path, {"t_s": T, "tilt_rad": np.round(np.clip(swing, -0.2, 0.2), 4), "gyro_rad_s": rate})
    assert log.notes == ()


@pytest.mark.parametrize("at", [0, 1000, N])
def test_nul_bytes_are_named(at: int, tmp_path: Path) -> None:
    path = write_csv(tmp_path / "log.csv", sine())
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[: at + 1]) + bytes(40) + b"".join(lines[at + 1 :]))
    with pytest.raises(InputError, match=f"byte {len(b''.join(lines[: at + 1])):,} is NUL.* power cut"):
        read_log(path, ReadOptions(COLUMNS))


@pytest.mark.parametrize(
    ("encoding", "cure"),
    [("utf-16", "--encoding utf-16$"), ("utf-16-be", "--encoding utf-16$"), ("latin-1", "not utf-8.*--encoding")],
)
def test_another_encoding_is_named(encoding: str, cure: str, tmp_path: Path) -> None:
    path = write_csv(tmp_path / "log.csv", {"t_s": T, "Neigung_°": tilt(T)})
    path.write_bytes(path.read_text("utf-8").encode(encoding))
    options = ReadOptions({**ONE, "tilt": "Neigung_°"})
    with pytest.raises(InputError, match=cure):
        read_log(path, options)
    assert len(read_log(path, dataclasses.replace(options, encoding=encoding))) == N


@pytest.mark.parametrize(("end", "n_lines"), [(295, 195), (101, 1), (N, N - 101)])
def test_a_quote_that_swallows_rows_is_named(end: int, n_lines: int, tmp_path: Path) -> None:
    note = ["ok"] * N + ['x"']
    note[100], note[end] = '"oops', 'x"'
    for name in ("note", "t_s2"):
        with pytest.raises(InputError, match=f"column '{name}', about line 102, ends {n_lines:,} lines later"):
            read(tmp_path, {**sine(), name: note[:N]})


def test_text_of_two_lines_is_none(tmp_path: Path) -> None:
    assert_plain(read(tmp_path, {"note": ['"a, ""b""\nand c"', "ok"] * (N // 2), **sine()}))


@pytest.mark.parametrize(("place", "size"), [("tilt_rad", 1e308), ("gyro_rad_s", 1e200), ("t_s", 3e307)])
def test_a_number_beyond_all_sizes_is_none(place: str, size: float, tmp_path: Path) -> None:
    """Squares of these overflow."""
    columns = sine()
    columns[place][1000] = size
    log = read(tmp_path, columns)
    assert np.isfinite(log["y1_rad"]).all()
    np.testing.assert_allclose(np.nanmax(np.abs(log["reference_rad_s"])), AMPLITUDE * OMEGA, rtol=1e-3)
    for sizes in (np.linspace(0.5, 1.0, N), np.linspace(-1e-250, 1.0, N), np.sin(60.0 * T)):
        with pytest.raises(InputError, match=f"column '{place}': .* numbers are beyond"):
            read(tmp_path, {**columns, place: size * sizes})


def test_a_clipped_gyro_identifies_nothing(tmp_path: Path) -> None:
    columns = sine()
    columns["gyro_rad_s"] = np.clip(columns["gyro_rad_s"], -9.0, 1.0)
    with pytest.raises(InputError, match=r"'gyro_rad_s' stands .*: clipped; leave that out, --time-range START:END"):
        read_channels(write_csv(tmp_path / "log.csv", columns), ReadOptions(COLUMNS))

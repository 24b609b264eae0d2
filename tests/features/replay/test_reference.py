"""Remarks on a reference beside the tilt, in a replay and in tuning alike."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cmg_mj.features.replay.log import LogNoise, ReadOptions, WhiteNoise
from cmg_mj.features.replay.reading import read_log
from cmg_mj.features.replay.reference import AGREES, SURE, alignment, alignment_of, remarks_on
from tests.command import ROOT
from tests.features.replay.motion import COLUMNS, DT, N, sine, write_csv

REAL = ROOT / "examples" / "data" / "stepper_encoder_gyro.csv"
ENCODER = {"time": "time_s", "tilt": "encoder_rad", "rate": "gyr_y_rad_s"}


def remarks(path: Path, columns: dict[str, str] = COLUMNS, **options) -> list[str]:
    log = read_log(path, ReadOptions(columns, **options))
    return remarks_on(log, alignment_of(log))


def write_sine(folder: Path, **columns: np.ndarray) -> Path:
    return write_csv(folder / "log.csv", {**sine(), **columns})


def test_a_tilt_that_freezes_is_offered_no_cure(tmp_path: Path) -> None:
    tilt = sine()["tilt_rad"].copy()
    tilt[N // 2 :] = tilt[N // 2]
    (remark,) = remarks(write_sine(tmp_path, tilt_rad=tilt))
    assert "(correlation 0.71)" in remark
    assert "--" not in remark


@pytest.mark.daily_cases("True-0.0", "True-0.02", "False-0.02", "False-0.1")
@pytest.mark.parametrize("noise", [0.0, 0.02, 0.1])
@pytest.mark.parametrize("is_white", [True, False])
def test_a_cure_is_offered_from_the_criterion_on(noise: float, is_white: bool, tmp_path: Path) -> None:
    """Half of the rate is missing. White noise of the tilt is no disagreement; a smooth error of that size is one."""
    log = sine()
    error = np.random.default_rng(0).standard_normal(N)
    if not is_white:
        error = 5.0 * np.convolve(error, np.hanning(41) / np.hanning(41).sum(), "same")
    path = write_sine(tmp_path, tilt_rad=log["tilt_rad"] + noise * error, gyro_rad_s=0.5 * log["gyro_rad_s"])
    fit = alignment_of(read_log(path, ReadOptions(COLUMNS)))
    assert fit is not None
    assert fit.correlation is not None
    (remark,) = remarks(path)
    assert (fit.correlation >= AGREES) == (noise < 0.05)
    assert ("--scale rate=" in remark) == (is_white or fit.correlation >= AGREES)


@pytest.mark.daily_cases("0.05")
@pytest.mark.parametrize("noise", [0.05, 0.1])
def test_a_faultless_log_is_not_blamed_for_its_noise(noise: float, tmp_path: Path) -> None:
    """By chance one of a hundred is: here at most one of ten."""
    log, agree = read_log(write_sine(tmp_path), ReadOptions(COLUMNS)), 0
    for seed in range(10):
        error = noise * np.random.default_rng(seed).standard_normal(N)
        noisy = replace(
            log,
            columns={**log.columns, "y1_rad": log["y1_rad"] + error},
            white_noise=LogNoise(WhiteNoise(noise, noise, noise), None, 0.0),
        )
        (remark,) = remarks_on(noisy, alignment_of(noisy))
        assert "does not go with" not in remark
        agree += remark.startswith("Tilt and reference agree")
    assert agree >= 9
    error = noise * np.random.default_rng(0).standard_normal(N)
    (remark,) = remarks(write_sine(tmp_path, tilt_rad=sine()["tilt_rad"] + error))
    assert "does not go with" not in remark


def test_a_small_bias_and_a_small_scale_error_are_told(tmp_path: Path) -> None:
    """2.9 deg/s of bias and 3 % of scale, of a motion of 0.89 rad/s RMS; the cures take them out."""
    noise = 0.01 * np.random.default_rng(0).standard_normal((2, N))
    columns = {"tilt_rad": sine()["tilt_rad"] + noise[0], "gyro_rad_s": sine()["gyro_rad_s"] / 1.03 + 0.05 + noise[1]}
    path = write_sine(tmp_path, **columns)
    (remark,) = remarks(path)
    assert remark.startswith("Beside the tilt 1.03")
    assert "plus -0.051" in remark
    assert "(to take it out: --scale rate=1.03 --offset rate=-0.051" in remark
    (cured,) = remarks(path, scale={"rate": 1.03}, offset={"rate": -0.0515})
    assert cured.startswith("Tilt and reference agree")
    degrees = {**columns, "gyro_rad_s": np.degrees(columns["gyro_rad_s"])}
    assert "--offset rate=-2.9" in remarks(write_sine(tmp_path, **degrees), units={"rate": "deg_s"})[0]


def multisine(seed: int) -> tuple[np.ndarray, np.ndarray]:
    random, t = np.random.default_rng(seed), DT * np.arange(N)
    pairs = list(zip(random.uniform(2.0, 20.0, 6), random.uniform(0.0, 2.0 * np.pi, 6), strict=True))
    tilt = np.sum([0.03 * np.sin(w * t + phase) for w, phase in pairs], axis=0)
    return tilt, np.sum([0.03 * w * np.cos(w * t + phase) for w, phase in pairs], axis=0)


def covered(seeds: range, sigma: float) -> np.ndarray:
    """Return how often the intervals hold a scale of 1.02 and an offset of 0.03 rad/s."""
    held = np.zeros(2)
    for seed in seeds:
        tilt, rate = multisine(seed)
        noise = np.random.default_rng(seed).standard_normal((2, N))
        fit = alignment([tilt + sigma * noise[0]], [(rate + 0.02 * noise[1] - 0.03) / 1.02], DT)
        assert fit.scale is not None
        assert fit.offset_rad_s is not None
        assert fit.scale_error is not None
        assert fit.offset_error_rad_s is not None
        held += [
            abs(fit.scale - 1.02) < SURE * fit.scale_error,
            abs(fit.offset_rad_s - 0.03) < SURE * fit.offset_error_rad_s,
        ]
    return held


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [0.002, 0.02])
def test_intervals_of_scale_and_offset(sigma: float) -> None:
    assert (covered(range(200), sigma) >= 0.91 * 200).all()


def test_intervals_of_scale_and_offset_in_short() -> None:
    assert (covered(range(8), 0.01) >= 6).all()


def test_a_delay_below_its_error_is_none(tmp_path: Path) -> None:
    error = 0.1 * np.random.default_rng(0).standard_normal(N)
    path = write_sine(tmp_path, tilt_rad=sine()["tilt_rad"] + error, gyro_rad_s=2.0 * sine()["gyro_rad_s"])
    fit = alignment_of(read_log(path, ReadOptions(COLUMNS)))
    assert fit is not None
    assert fit.lag_s is not None
    assert abs(fit.lag_s) > 0.1 * DT
    (remark,) = remarks(path)
    assert " ms " not in remark
    assert "--delay" not in remark


def test_an_unknown_delay_is_not_mentioned(tmp_path: Path) -> None:
    tilt = sine()["tilt_rad"] * 0.02 + 0.006 * np.random.default_rng(0).standard_normal(N)
    path = write_sine(tmp_path, tilt_rad=tilt, gyro_rad_s=0.04 * sine()["gyro_rad_s"])
    fit = alignment_of(read_log(path, ReadOptions(COLUMNS)))
    assert fit is not None
    assert fit.lag_s is None
    (remark,) = remarks(path)
    assert remark.startswith("Beside the tilt 0.")
    assert "unknown" not in remark


def test_the_other_way_round(tmp_path: Path) -> None:
    (remark,) = remarks(write_sine(tmp_path, gyro_rad_s=-sine()["gyro_rad_s"]))
    assert remark.endswith("it counts the other way: --scale rate=-1.")
    remark = remarks(REAL, ENCODER, scale={"rate": -1.0})[-1]
    assert remark.endswith("it counts the other way: --scale rate=1.")
    tilt = sine()["tilt_rad"].copy()
    tilt[N // 2 :] = tilt[N // 2]
    (remark,) = remarks(write_sine(tmp_path, tilt_rad=-tilt))
    assert "(correlation -0.71)" in remark


def test_late_is_late_by_the_logs_own_rows() -> None:
    """A delay of 0.2 ms is nothing for rows at 100 Hz, to however quick a rate they are resampled."""
    scale = {"rate": 1.0153}
    for rate in (None, 1000.0):
        notes = remarks(REAL, ENCODER, delay_s=0.0119, rate_hz=rate, scale=scale)
        assert [line for line in notes if "Beside the tilt" in line] == []
    late = remarks(REAL, ENCODER, delay_s=0.010, rate_hz=1000.0)
    assert "--delay 0.012" in late[-1]


def offered(remark: str) -> dict[str, float]:
    """Return the numbers of the options that a remark offers."""
    options = remark.partition("take it out")[2].partition(": ")[2].partition(")")[0].replace("rate=", "")
    words = options.split()
    return {name.removeprefix("--"): float(number) for name, number in zip(words[::2], words[1::2], strict=True)}


def test_the_delay_of_a_fast_log_is_offered_so_that_it_cures(tmp_path: Path) -> None:
    """Late by 0.16 ms at 5 kHz; after a first delay of 0.1 ms the whole one is offered."""
    t = 2e-4 * np.arange(N)
    y, w = 0.2 * np.sin(30.0 * t), 6.0 * np.cos(30.0 * (t - 1.6e-4))
    path = write_csv(tmp_path / "fast.csv", {"t_s": t, "tilt_rad": y, "gyro_rad_s": w})
    (remark,) = remarks(path)
    assert "comes 0.160 ms behind" in remark
    assert offered(remark)["delay"] == pytest.approx(1.6e-4, abs=4e-6)
    (again,) = remarks(path, delay_s=1e-4)
    assert "--delay 0.00016" in again
    (cured,) = remarks(path, delay_s=offered(again)["delay"])
    assert cured.startswith("Tilt and reference agree")


def test_what_is_offered_beyond_what_is_set_is_the_whole(tmp_path: Path) -> None:
    log = sine()
    path = write_sine(tmp_path, gyro_rad_s=np.degrees(log["gyro_rad_s"] - 0.1) / 2.0)
    units = {"rate": "deg_s"}
    (remark,) = remarks(path, units=units, scale={"rate": 1.5}, offset={"rate": 3.0})
    assert offered(remark) == pytest.approx({"scale": 2.0, "offset": np.degrees(0.1)}, rel=0.01)
    (half,) = remarks(path, units=units, scale={"rate": 1.0}, offset={"rate": np.degrees(0.05)})
    assert offered(half) == pytest.approx({"scale": 2.0, "offset": np.degrees(0.1)}, rel=0.01)
    cures = offered(half)
    (cured,) = remarks(path, units=units, scale={"rate": cures["scale"]}, offset={"rate": cures["offset"]})
    assert cured.startswith("Tilt and reference agree")

"""Remarks on a reference beside the tilt, in a replay and in tuning alike."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmg_mj.features.replay.log import Log, ReadOptions
from cmg_mj.features.replay.reading import read_log
from cmg_mj.features.replay.reference import AGREES, SURE, alignment, alignment_of, judge
from tests.command import ROOT
from tests.features.replay.motion import DT, N, read, sine

TILT, RATE = sine()["tilt_rad"], sine()["gyro_rad_s"]
FREEZES = np.where(np.arange(N) < N // 2, TILT, TILT[N // 2])
AGREE = "Tilt and reference agree"


def noise(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(N)


def last_remark(log: Log) -> str:
    aligned = alignment_of(log)
    assert aligned is not None
    return judge(log, aligned)


def remark(folder: Path, tilt: np.ndarray = TILT, rate: np.ndarray = RATE, **options: Any) -> str:
    return last_remark(read(folder, {**sine(), "tilt_rad": tilt, "gyro_rad_s": rate}, **options))


def real_remark(**options) -> str:
    columns = {"time": "time_s", "tilt": "encoder_rad", "rate": "gyr_y_rad_s"}
    return last_remark(read_log(ROOT / "examples/data/stepper_encoder_gyro.csv", ReadOptions(columns, **options)))


def test_a_tilt_that_freezes_is_offered_no_cure(tmp_path: Path) -> None:
    for sign in (1.0, -1.0):
        said = remark(tmp_path, sign * FREEZES)
        assert f"correlate by {0.71 * sign:.2f}:" in said
        assert "--" not in said


def test_a_cure_is_offered_from_the_criterion_on(tmp_path: Path) -> None:
    """Half of the rate is missing."""
    for size in (0.0, 0.02, 0.1):
        log = read(tmp_path, {**sine(), "tilt_rad": TILT + size * noise(), "gyro_rad_s": 0.5 * RATE})
        fit = alignment_of(log)
        assert fit is not None
        assert fit.correlation is not None
        assert ("--scale rate=" in last_remark(log)) == (fit.correlation >= AGREES) == (size < 0.05)


def test_a_faultless_log_is_not_blamed_for_its_noise(tmp_path: Path) -> None:
    """By chance one of a hundred is: here at most one of ten."""
    log = read(tmp_path, sine())
    logs = (replace(log, columns={**log.columns, "y1_rad": TILT + 0.02 * noise(seed)}) for seed in range(10))
    assert sum(last_remark(noisy).startswith(AGREE) for noisy in logs) >= 9


def test_a_small_bias_and_a_small_scale_error_are_told(tmp_path: Path) -> None:
    """2.9 deg/s of bias and 3 % of scale, of a motion of 0.89 rad/s RMS; the cures take them out."""
    error = 0.01 * np.random.default_rng(0).standard_normal((2, N))
    tilt, rate = TILT + error[0], RATE / 1.03 + 0.05 + error[1]
    said = remark(tmp_path, tilt, rate)
    assert said.startswith("Beside the tilt 1.03")
    assert "(to take it out: --scale rate=1.03 --offset rate=-0.051" in said
    assert remark(tmp_path, tilt, rate, scale={"rate": 1.03}, offset={"rate": -0.0515}).startswith(AGREE)
    assert "--offset rate=-2.9" in remark(tmp_path, tilt, np.degrees(rate), units={"rate": "deg_s"})


@pytest.mark.parametrize("blur", [0.02 * noise(1), np.linspace(0.0, 0.05, N)])
def test_a_clipped_rate_is_offered_no_scale(blur: np.ndarray, tmp_path: Path) -> None:
    """Noise or a drift hides the end of its range."""
    tilt, rate = multisine(2)
    tilt += 1e-3 * noise()
    said = remark(tmp_path, tilt, blur + np.clip(rate, -0.5 * rate.max(), 0.5 * rate.max()))
    assert "it is clipped, or not linear" in said
    assert "--" not in said
    assert "--scale rate=" in remark(tmp_path, tilt, blur + 0.9 * rate)


def multisine(seed: int) -> tuple[np.ndarray, np.ndarray]:
    random, t = np.random.default_rng(seed), DT * np.arange(N)
    pairs = list(zip(random.uniform(2.0, 20.0, 6), random.uniform(0.0, 2.0 * np.pi, 6), strict=True))
    tilt = np.sum([0.03 * np.sin(w * t + phase) for w, phase in pairs], axis=0)
    return tilt, np.sum([0.03 * w * np.cos(w * t + phase) for w, phase in pairs], axis=0)


@pytest.mark.parametrize(
    ("sigma", "seeds", "share"),
    [
        (0.01, 8, 0.75),
        pytest.param(0.002, 200, 0.91, marks=pytest.mark.slow),
        pytest.param(0.02, 200, 0.91, marks=pytest.mark.slow),
    ],
)
def test_intervals_of_scale_and_offset(sigma: float, seeds: int, share: float) -> None:
    """They hold a scale of 1.02 and an offset of 0.03 rad/s."""
    held = np.zeros(2)
    for seed in range(seeds):
        tilt, rate = multisine(seed)
        error = np.random.default_rng(seed).standard_normal((2, N))
        fit = alignment([tilt + sigma * error[0]], [(rate + 0.02 * error[1] - 0.03) / 1.02], DT)
        found = np.array([fit.scale, fit.offset_rad_s], float)
        held += np.abs(found - [1.02, 0.03]) < SURE * np.array([fit.scale_error, fit.offset_error_rad_s], float)
    assert (held >= share * seeds).all()


def test_a_delay_below_its_error_is_none(tmp_path: Path) -> None:
    log = read(tmp_path, {**sine(), "tilt_rad": TILT + 0.03 * noise(), "gyro_rad_s": 2.0 * RATE})
    fit = alignment_of(log)
    assert fit is not None
    assert fit.lag_s is not None
    assert abs(fit.lag_s) > 0.1 * DT
    assert " ms " not in last_remark(log)
    assert "--delay" not in last_remark(log)


def test_what_cannot_be_compared_says_why(tmp_path: Path) -> None:
    """Too short, with gaps, or without motion."""
    for rows in (np.arange(N) < 40, np.arange(N) % 30 > 4):
        rate = np.where(rows, RATE, np.nan)
        assert "nowhere are both known for 0.4 s on end" in remark(tmp_path, rate=rate)
    log = read(tmp_path, sine())
    still = replace(log, columns={**log.columns, "y1_rad": np.zeros(N)})
    assert "too little motion" in last_remark(still)


def test_the_other_way_round(tmp_path: Path) -> None:
    assert remark(tmp_path, rate=-RATE).startswith("The reference counts the other way")
    assert real_remark(scale={"rate": -1.0}).endswith(": --scale rate=1.")


def test_late_is_late_by_the_logs_own_rows() -> None:
    """A delay of 0.2 ms is nothing for rows at 100 Hz, to however quick a rate they are resampled."""
    for rate in (None, 1000.0):
        assert real_remark(delay_s=0.0119, rate_hz=rate, scale={"rate": 1.0153}).startswith(AGREE)
    assert "--delay 0.012" in real_remark(delay_s=0.010, rate_hz=1000.0)


def offered(remark: str) -> dict[str, float]:
    """Return the numbers of the options that a remark offers."""
    options = remark.partition("take it out")[2].partition(": ")[2].partition(")")[0].replace("rate=", "")
    words = options.split()
    return {name.removeprefix("--"): float(number) for name, number in zip(words[::2], words[1::2], strict=True)}


def test_the_delay_of_a_fast_log_is_offered_so_that_it_cures(tmp_path: Path) -> None:
    """Late by 0.16 ms at 5 kHz; after a first delay of 0.1 ms the whole one is offered."""
    t = 2e-4 * np.arange(N)
    columns = {"t_s": t, "tilt_rad": 0.2 * np.sin(30.0 * t), "gyro_rad_s": 6.0 * np.cos(30.0 * (t - 1.6e-4))}
    first = last_remark(read(tmp_path, columns))
    assert "comes 0.16 ms behind" in first
    again = last_remark(read(tmp_path, columns, delay_s=1e-4))
    for said in (first, again):
        assert offered(said)["delay"] == pytest.approx(1.6e-4, abs=4e-6)
    assert last_remark(read(tmp_path, columns, delay_s=offered(again)["delay"])).startswith(AGREE)


def test_what_is_offered_beyond_what_is_set_is_the_whole(tmp_path: Path) -> None:
    rate, units = np.degrees(RATE - 0.1) / 2.0, {"rate": "deg_s"}
    for scale, offset in ((1.5, 3.0), (1.0, np.degrees(0.05))):
        said = remark(tmp_path, rate=rate, units=units, scale={"rate": scale}, offset={"rate": offset})
        assert offered(said) == pytest.approx({"scale": 2.0, "offset": np.degrees(0.1)}, rel=0.01)
    cures: dict[str, Any] = {name: {"rate": value} for name, value in offered(said).items()}
    assert remark(tmp_path, rate=rate, units=units, **cures).startswith(AGREE)

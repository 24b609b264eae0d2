"""The noise that observers assume in a replay: told, else by the log itself, else the default."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmg_mj import load_scenario, prepare
from cmg_mj.core.types import STANDARD_GRAVITY
from cmg_mj.features.replay.log import Log, ReadOptions
from cmg_mj.features.replay.log_replay import replay_log, replay_prepared
from cmg_mj.features.replay.noise import noise_figures, noise_of, noise_remarks
from cmg_mj.features.replay.reading import read_log
from tests.features.replay.motion import DT, N, read, sine, two_accelerometers
from tests.recorded import recorded

RUN_COLUMNS = {
    "time": "time_s",
    "tilt": "y1_rad",
    "acceleration": "acceleration_rad_s2",
    "gimbal": "y2_rad",
    "command": "u_rad_s",
    "rate": "x2_rad_s",
}


def noisy_log(folder: Path, degrees: float) -> Log:
    noise = np.radians(degrees) * np.random.default_rng(0).standard_normal(N)
    return read(folder, {**sine(), "tilt_rad": sine()["tilt_rad"] + noise})


def accelerometers_of_800_ug(folder: Path) -> Log:
    return two_accelerometers(folder, 0.1, noise=800e-6 * STANDARD_GRAVITY * math.sqrt(0.5 / DT))


@pytest.mark.slow
@pytest.mark.parametrize("density", [400.0, 600.0, 1000.0, 1500.0])
def test_a_run_replayed_without_being_told_its_noise(density: float, tmp_path: Path) -> None:
    """At 400 ug/rtHz the tilt's noise is 0.36 deg; the default of 0.1 deg gives 0.034 and 0.166 for 0.014 and 0.069."""
    sensor = f"sensors.accelerometer.noise_density_ug_rthz={density}"
    for seed in range(2):
        settings = ["observer.kind=gyro_free", sensor, f"seed={seed}", "duration_s=15.0"]
        experiment = prepare(load_scenario("push_recovery", settings))
        recorded(experiment.run()).save(tmp_path / "run.parquet")
        log = read_log(tmp_path / "run.parquet", ReadOptions(RUN_COLUMNS))
        _, model, truth = experiment.design.constructor_arguments
        errors = []
        for noises in ({"tilt": math.degrees(truth.tilt), "acceleration": truth.acceleration}, {}):
            result = replay_prepared(log, ["gyro_free", "kalman"], model=model, noises=noises).summaries
            errors.append([result[name]["velocity_rms_error_rad_s"] for name in ("gyro_free", "kalman")])
        told, by_the_log = errors
        assert by_the_log == pytest.approx(told, rel=0.1)


def test_a_noise_is_told_or_else_the_logs(tmp_path: Path) -> None:
    log = noisy_log(tmp_path, 0.36)
    assert math.degrees(noise_of(log).tilt) == pytest.approx(0.36, rel=0.04)
    assert replay_log(log, ["linear"]).noise == noise_of(log)
    assert math.degrees(noise_of(log, {"tilt": 0.2}).tilt) == pytest.approx(0.2, rel=1e-12)
    assert math.degrees(noise_of(noisy_log(tmp_path, 0.0)).tilt) == pytest.approx(0.1, rel=1e-12)


def test_the_noise_of_two_accelerometers(tmp_path: Path) -> None:
    """Tilt and acceleration as the two make them, with the model's correlation."""
    log = accelerometers_of_800_ug(tmp_path)
    noise, expected = noise_of(log), noise_of(log, {"accelerometer": 800.0})
    assert noise.tilt == pytest.approx(expected.tilt, rel=0.04)
    assert noise.acceleration == pytest.approx(expected.acceleration, rel=0.04)
    assert noise.correlation == pytest.approx(expected.correlation, abs=0.02)
    assert noise.gimbal == expected.gimbal
    (remark,) = noise_remarks(log, noise)
    assert "--noise" not in remark
    (told,) = noise_remarks(log, noise_of(log, {"accelerometer": 400.0}))
    assert "give --noise accelerometer=8" in told


@pytest.mark.parametrize("rate", [100.0, 400.0, 1000.0])
@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_resampled_noise_has_the_density_that_observers_assume(rate: float, jitter: float, tmp_path: Path) -> None:
    """Below 20 Hz, where observers look; white noise of that density is larger at quicker rates."""
    random = np.random.default_rng(0)
    t = DT * (np.arange(N) + random.uniform(-jitter, jitter, N))
    tilt = 0.01 * random.standard_normal(N)
    log = read(tmp_path, {"t_s": t, "tilt_rad": tilt}, {"time": "t_s", "tilt": "tilt_rad"}, rate_hz=rate)
    density = np.abs(np.fft.rfft(log["y1_rad"])) ** 2 / len(log)
    band = np.arange(len(density)) / (len(log) * log.dt) < 20.0
    noise = log.white_noise.tilt
    assert not isinstance(noise, str)
    assert noise.sigma == pytest.approx(math.sqrt(float(density[band].mean())), rel=0.1)


def test_a_told_density_is_that_of_the_rows(tmp_path: Path) -> None:
    """A sample at a slower rate than the rows' has all of a row's noise, since nothing filters it."""
    log = accelerometers_of_800_ug(tmp_path)
    told = {"accelerometer": 800.0}
    slow, quick = replace(log, dt=2.0 * log.dt), replace(log, dt=log.dt / 2.0)
    assert noise_of(slow, told) == noise_of(log, told)
    assert noise_of(quick, told).tilt == pytest.approx(math.sqrt(2.0) * noise_of(log, told).tilt, rel=1e-3)


def test_json_has_the_logs_noise(tmp_path: Path) -> None:
    log, fine = noisy_log(tmp_path, 0.36), noisy_log(tmp_path, 0.0)
    for noises, used in ({}, True), ({"tilt": 0.1}, False):
        figures: Any = noise_figures(log, noise_of(log, noises))
        assert figures["noise_by_the_log"]["tilt_rad"]["used"] is used
    figures = noise_figures(fine, noise_of(fine))
    assert figures["noise_by_the_log"]["tilt_rad"] == {"sigma": None, "reason": "there is hardly any", "used": False}

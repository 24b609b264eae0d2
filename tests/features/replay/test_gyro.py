"""A log's gyro, which `mems_fused` takes: its noise, its offset, and a second gyro as the reference."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.features.replay.log import Log
from cmg_mj.features.replay.log_replay import replay_prepared
from cmg_mj.features.replay.reference import remarks_on
from tests.features.replay.motion import COLUMNS, DT, N, rate, read, sine, tilt

OFFSET, SIGMA = 0.3, 0.004


def log(folder: Path, white: float = SIGMA, step: float = 0.0, **roles: str) -> Log:
    rng, t = np.random.default_rng(0), DT * np.arange(N)
    gyro = rate(t) + OFFSET + white * rng.normal(size=N)
    columns = sine() | {"mems_rad_s": np.round(gyro / step) * step if step else gyro}
    columns["tilt_rad"] = tilt(t) + 1e-3 * rng.normal(size=N)
    return read(folder, columns, COLUMNS | {"gyro": "mems_rad_s"} | roles)


def test_an_offset_is_found_and_what_is_left_is_the_gyros_noise(tmp_path: Path) -> None:
    result = replay_prepared(log(tmp_path), ["mems_fused", "linear"], settle_s=5.0)
    error = result.summaries["mems_fused"]["velocity_rms_error_rad_s"]
    assert error == pytest.approx(SIGMA, rel=0.2)  # without the offset's estimate 0.3
    assert result.noise.gyro == pytest.approx(SIGMA * math.sqrt(2.0 * DT), rel=0.05)


def test_a_coarse_gyro_counts_with_its_upper_band(tmp_path: Path) -> None:
    """A step of 0.02 rad/s has the noise of 0.02/sqrt(12), spread over more than the band."""
    coarse = log(tmp_path, white=0.0, step=0.02)
    result = replay_prepared(coarse, ["mems_fused"])
    assert result.noise.gyro == pytest.approx(0.02 / math.sqrt(12.0) * math.sqrt(2.0 * DT), rel=0.5)
    assert any("upper band" in line for line in remarks_on(coarse, result.alignment, result.noise))
    told = replay_prepared(coarse, ["mems_fused"], noises={"gyro": 0.01})
    assert told.noise.gyro == pytest.approx(math.radians(0.01))


def test_without_a_gyro_it_does_not_take_part(tmp_path: Path) -> None:
    plain = read(tmp_path, sine(), COLUMNS)
    assert "needs a gyro" in replay_prepared(plain, ["mems_fused", "linear"]).left_out["mems_fused"]
    with pytest.raises(InputError, match="--noise gyro: the log has no gyro; name its column"):
        replay_prepared(plain, ["linear"], noises={"gyro": 0.01})
    with pytest.raises(InputError, match="gyro=gyro_rad_s: is the reference too; name another column, or leave"):
        log(tmp_path, gyro="gyro_rad_s")

"""The cheap gyro beside its datasheet, and open loop beside a run."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from scipy.signal import welch

from cmg_mj.core.noise import NoiseStream, normals
from cmg_mj.core.sensor import Site
from cmg_mj.results.baselines import GYROS, Baselines
from cmg_mj.sensors.gyros import MemsGyro
from tests.recorded import assert_same_bits, push_recovery, recorded
from tests.sensors.test_sampled import assert_mean, assert_sigma, shown, turning

DT = 0.005


def quiet(**settings: float) -> dict[str, Any]:
    """A gyro without errors but for those that a test is about."""
    none = ("noise_density_deg_s_rthz", "bias_instability_deg_h", "scale_error", "counts_per_deg_s")
    return dict.fromkeys(none, 0.0) | settings


def read_rate(rate: np.ndarray, dt: float = DT, world: int = 0, **settings: Any) -> np.ndarray:
    """Read one world's rate with a gyro, (n,) [rad/s] -> (n,) [deg/s]."""
    rates = rate.tolist()
    gyro = MemsGyro(reading="calibrated", **settings).at_work(Site("sensors.mems_gyro", dt), dt)
    return np.degrees(shown(gyro, lambda step: turning(rates[step]), len(rates), worlds=world)[:, 0])


@pytest.mark.parametrize(("density", "dt", "sigma"), [(0.005, 0.005, 0.05), (0.02, 0.02, 0.1)])
def test_white_noise_is_density_times_root_of_half_the_rate(density: float, dt: float, sigma: float) -> None:
    noise = read_rate(np.zeros(20_000), dt, **quiet(noise_density_deg_s_rthz=density, calibration_s=0.0))
    assert_sigma(noise, sigma)
    assert_mean(noise, 0.0, sigma)


@pytest.mark.parametrize(("worlds", "tolerance"), [(1, 0.1), pytest.param(8, 0.05, marks=pytest.mark.slow)])
def test_noise_is_that_of_the_datasheet(worlds: int, tolerance: float) -> None:
    """PS-MPU-6000A, 6.1: 0.033 deg/s RMS from 1 to 10 Hz, and 0.005 deg/s/rtHz of white noise beyond."""
    noise = np.stack([read_rate(np.zeros(80_000), world=world) for world in range(worlds)])
    frequency, density = welch(noise, 200.0, nperseg=8192)
    low = (frequency > 1.0) & (frequency < 10.0)
    width = frequency[1] - frequency[0]
    assert math.sqrt(density[:, low].sum(axis=1).mean() * width) == pytest.approx(0.033, rel=tolerance)
    high = frequency > 60.0
    assert math.sqrt(density[:, high].mean()) == pytest.approx(0.005, rel=0.1)


@pytest.mark.parametrize(("worlds", "tolerance"), [(1, 0.2), pytest.param(8, 0.1, marks=pytest.mark.slow)])
def test_allan_deviation_of_the_flicker_is_the_bias_instability(worlds: int, tolerance: float) -> None:
    """The same whatever is averaged over."""
    flicker = quiet(bias_instability_deg_h=36.0, calibration_s=0.0)
    noise = np.stack([read_rate(np.zeros(80_000), world=world, **flicker) for world in range(worlds)])
    for tau_s in (0.25, 1.0, 4.0):
        averages = noise.reshape(worlds, -1, round(tau_s / DT)).mean(axis=2)
        allan = math.sqrt(0.5 * np.mean(np.diff(averages, axis=1) ** 2))
        assert allan * 3600.0 == pytest.approx(36.0, rel=tolerance), tau_s


def test_the_mean_at_rest_is_taken_off() -> None:
    """The reading before the run, for a second, is on the mean zero."""
    noise = quiet(bias_instability_deg_h=82.0, noise_density_deg_s_rthz=0.005)
    raw = read_rate(np.zeros(500), calibration_s=0.0, **noise)
    calibrated = read_rate(np.zeros(300), calibration_s=1.0, **noise)
    np.testing.assert_allclose(calibrated, raw[200:] - raw[:200].mean(), atol=1e-12)


def test_scale_offset_range_and_resolution() -> None:
    rate = np.radians(np.array([0.0, 10.0, -100.0, 300.0]))
    assert read_rate(rate, **quiet(scale_error=0.03)) == pytest.approx([0.0, 10.3, -103.0, 250.0])
    assert read_rate(rate, **quiet(bias_deg_s=0.5)) == pytest.approx([0.5, 10.5, -99.5, 250.0])
    assert read_rate(np.radians([0.1, 0.3]), **quiet(counts_per_deg_s=2.0)) == pytest.approx([0.0, 0.5])


@pytest.mark.parametrize("sigmas", [[0.006, 0.006, 0.006], [0.006, 0.002, 0.0]])
@pytest.mark.parametrize("name", GYROS)
def test_a_world_reads_the_same_alone_and_in_a_batch_and_in_any_pieces(name: str, sigmas: list[float]) -> None:
    rate, y1 = np.random.default_rng(0).normal(size=(2, 700, 3))
    batch = Baselines(MemsGyro(), DT, 5, [4, 0, 7], sigmas).rates(rate, y1)[name]
    for i, world in enumerate((4, 0, 7)):
        alone = Baselines(MemsGyro(), DT, 5, world, sigmas[i : i + 1])
        parts = zip(*(np.split(signal[:, [i]], (1, 256, 300)) for signal in (rate, y1)), strict=True)
        pieces = [alone.rates(*part)[name] for part in parts]
        np.testing.assert_array_equal(np.concatenate(pieces)[:, 0], batch[:, i])
    assert not np.array_equal(batch[:, 0] - rate[:, 0], batch[:, 1] - rate[:, 1])
    other = Baselines(MemsGyro(), DT, 6, [4, 0, 7], sigmas).rates(rate, y1)[name]
    assert not np.array_equal(batch, other)


def test_as_bought_it_is_offset_and_drifts_to_either_side() -> None:
    """PS-MPU-6000A, 6.1: 20 deg/s, and 20 deg/s more over 60 K; a degree warmer in a minute."""
    gyro, rate = MemsGyro(**quiet()), np.radians(np.full((12_001, 40), 10.0))
    part = np.random.default_rng(3).normal(size=(2, 40))
    shown = np.degrees(gyro.make_both(DT, normals(0, range(40), 3, gyro.channels), part)(rate)[1])
    offset, drift = shown[0] - 10.0, shown[-1] - shown[0]
    np.testing.assert_allclose(offset, 20.0 * np.sign(part[0]))
    np.testing.assert_allclose(drift, 0.33 * np.sign(part[1]), rtol=1e-9)
    assert {*np.sign(offset), *np.sign(offset * drift)} == {-1.0, 1.0}
    assert gyro.as_bought_drift_deg_s_k == pytest.approx(20.0 / (85.0 - 25.0), rel=0.02)


def test_observers_read_what_the_baselines_read() -> None:
    """To the last bit; and the part as bought takes no number of the calibrated one's noise."""
    rate = np.random.default_rng(1).normal(size=(600, 2))
    gyro = MemsGyro(bias_deg_s=0.1)

    def both(part: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return gyro.make_both(DT, normals(2, [3, 8], NoiseStream.MEMS_GYRO, gyro.channels), part)(rate)

    pair = both(np.array(next(normals(2, [3, 8], NoiseStream.MEMS_PART, 2))))
    for reading, expected in zip(("calibrated", "as_bought"), pair, strict=True):
        read = dataclasses.replace(gyro, reading=reading).at_work(Site("sensors.mems_gyro", DT), DT)
        alone = shown(read, lambda step: turning(rate[step]), len(rate), seed=2, worlds=[3, 8])
        np.testing.assert_array_equal(alone[:, 0], expected)
    as_bought = both(np.array([[1.0, -1.0], [1.0, -1.0]]))[1]
    resting = both(np.zeros((2, 2)))[1]
    np.testing.assert_allclose(as_bought[0] - resting[0], np.radians([20.0, -20.0]), atol=2e-4)


def test_it_is_open_loop_and_changes_nothing() -> None:
    """The other sensors' noise is as it was without it."""
    plain = push_recovery("duration_s=2.5").run()
    noisy = push_recovery("duration_s=2.5", "sensors.mems_gyro.scale_error=0.5").run()
    assert_same_bits(recorded(plain), recorded(noisy))
    plain_fit, noisy_fit = (result.values("velocity_fit", "mems_gyro")[0] for result in (plain, noisy))
    assert plain_fit > 0.9
    assert noisy_fit == pytest.approx(0.5, abs=0.02)

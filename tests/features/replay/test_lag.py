"""Lags that are known, over seeds, and peaks that say nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cmg_mj.features.replay.reference import alignment
from cmg_mj.features.replay.scores import lag
from tests.features.replay.motion import DT

N = 4000
SEEDS = range(20)


def make_delayed_pair(
    rng: np.random.Generator, dt: float, corner_hz: float, delay: float
) -> tuple[np.ndarray, np.ndarray]:
    """Noise that falls off above a corner, and the same later: exactly, by its transform."""
    f = np.fft.rfftfreq(2 * N, dt)
    spectrum = (rng.standard_normal(len(f)) + 1j * rng.standard_normal(len(f))) / (1.0 + (f / corner_hz) ** 2)
    signal = np.fft.irfft(spectrum, 2 * N)[:N]
    delayed_signal = np.fft.irfft(spectrum * np.exp(-2j * np.pi * f * delay), 2 * N)[:N]
    return signal / signal.std(), delayed_signal / signal.std()


@pytest.mark.daily_cases("0.005-1.0", "0.01-40.0")
@pytest.mark.parametrize(("dt", "corner_hz"), [(0.005, 1.0), (0.005, 20.0), (0.01, 20.0), (0.01, 40.0)])
def test_known_delays(dt: float, corner_hz: float) -> None:
    """To a hundredth of a sample, up to signals that are almost white, whatever their size and offset."""
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        delay = rng.uniform(-0.05, 0.05)
        signal, delayed_signal = make_delayed_pair(rng, dt, corner_hz, delay)
        result = lag([7.0 * delayed_signal + 3.0], [signal], dt)
        assert result is not None
        assert abs(result - delay) < 0.01 * dt, seed


def test_known_delays_in_noise() -> None:
    """Over the seeds the mean error is none, and each is below a fifth of a sample."""
    errors = []
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        delay = rng.uniform(-0.05, 0.05)
        signal, delayed_signal = make_delayed_pair(rng, 0.005, 20.0, delay)
        result = lag([delayed_signal + rng.standard_normal(N)], [signal], 0.005)
        assert result is not None
        errors.append((result - delay) / 0.005)
    assert np.abs(errors).max() < 0.2
    assert abs(np.mean(errors)) < 3.0 * np.std(errors) / np.sqrt(len(errors))


@pytest.mark.parametrize("rows", [9, 20, 37, 60, 100])
def test_short_logs(rows: int) -> None:
    """So short that the correlation cannot be smoothed, or hardly: three samples late, or nothing is said."""
    t = np.arange(rows)
    result = lag([np.sin(0.5 * (t - 3.0))], [np.sin(0.5 * t)], 0.005)
    assert result is None or result == pytest.approx(3.0 * 0.005, abs=0.1 * 0.005)
    assert (result is None) == (rows < 20)


def test_in_parts_with_gaps_it_is_the_same() -> None:
    rng = np.random.default_rng(3)
    signal, delayed_signal = make_delayed_pair(rng, 0.005, 5.0, 0.0123)
    delayed_signal[500:700] = np.nan
    parts = [slice(0, 1300), slice(1300, 1340), slice(1340, N)]
    result = lag([delayed_signal[part] for part in parts], [signal[part] for part in parts], 0.005)
    assert result == pytest.approx(0.0123, abs=1e-4)


def test_what_is_folded_down_does_not_count() -> None:
    """A ripple whose fourth harmonic, 51.2 Hz, is sampled at 100 Hz: there a later signal looks like an earlier one."""
    t, delay = 0.01 * np.arange(N), 0.005

    def motion(t: np.ndarray) -> np.ndarray:
        return np.cos(2.0 * np.pi * 0.7 * t) + np.cos(2.0 * np.pi * 12.8 * t) + 0.3 * np.cos(2.0 * np.pi * 51.2 * t)

    assert lag([motion(t - delay)], [motion(t)], 0.01) == pytest.approx(delay, abs=1e-4)


def test_a_peak_that_one_stretch_makes_is_none() -> None:
    """A large motion seen 60 ms early and a small one seen 10 ms late: the whole's peak is neither's."""
    rng = np.random.default_rng(1)
    fast_motion, early_view = make_delayed_pair(rng, 0.005, 1.0, -0.06)
    slow_motion, late_view = make_delayed_pair(rng, 0.005, 1.0, 0.01)
    loud = np.where((np.arange(N) > 500) & (np.arange(N) < 1000), 3.0, 0.0)
    signal, view = slow_motion + loud * fast_motion, late_view + loud * early_view
    assert lag([view], [signal], 0.005) is None
    assert lag([view[:500]], [signal[:500]], 0.005) == pytest.approx(0.01, abs=2e-3)


@pytest.mark.parametrize(("share", "has_lag"), [(0.4, False), (0.6, True)])
def test_a_faint_likeness_has_no_lag(share: float, has_lag: bool) -> None:
    """An estimate that is the reference, 20 ms early, and another motion: they correlate by `share`."""
    from scipy.signal import butter, sosfiltfilt

    motion, disturbance = sosfiltfilt(butter(4, 0.1, output="sos"), np.random.default_rng(5).standard_normal((2, N)))
    mixture = share * np.roll(motion, -4) + math.sqrt(1.0 - share**2) * disturbance * motion.std() / disturbance.std()
    result = lag([mixture], [motion], DT)
    assert (result is not None) == has_lag
    assert result is None or result == pytest.approx(-0.02, abs=2e-3)


def test_a_reference_beside_a_noisy_tilt() -> None:
    """3 ms behind a tilt of 0.2 rad with noise of 0.02: found to a millisecond, where slopes would say anything."""
    lags = []
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        t = 0.005 * np.arange(N)
        tilt = 0.2 * np.sin(2.0 * np.pi * t) + 0.06 * np.sin(2.0 * np.pi * 2.3 * t)
        late = t - 0.003
        rate = 0.4 * np.pi * np.cos(2.0 * np.pi * late) + 0.276 * np.pi * np.cos(2.0 * np.pi * 2.3 * late)
        fit = alignment([tilt + 0.02 * rng.standard_normal(N)], [rate], 0.005)
        assert fit.lag_s is not None
        lags.append(fit.lag_s)
    assert np.mean(lags) == pytest.approx(0.003, abs=5e-4)
    assert np.std(lags) < 1.5e-3

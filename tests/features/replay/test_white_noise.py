"""White noise of a log: its size and interval over seeds, and signals that have no white floor."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfilt

from cmg_mj.core.tilt import PairTilt
from cmg_mj.features.replay.log import LogNoise, Segment, WhiteNoise
from cmg_mj.features.replay.white_noise import _agreeing, white_noise_of

DT, SIGMA, N = 0.005, 0.004, 4000
CLOCK = DT * np.arange(N)

MakeSignal = Callable[[np.random.Generator], np.ndarray]


def motion(t: np.ndarray) -> np.ndarray:
    return 0.1 * np.sin(3.0 * t) + 0.03 * np.sin(9.3 * t + 1.0)


def noise_of_rows(t: np.ndarray, *parts: slice, **signals: np.ndarray) -> LogNoise:
    segments = []
    for part in parts or [slice(None)]:
        rows = {name: values[part] for name, values in signals.items()}
        segments.append(Segment(t[part], rows, t[part], t[part], rows))
    return white_noise_of(segments, DT, DT)


def tilt_noise(signal: MakeSignal, seed: int = 0) -> WhiteNoise | str:
    return noise_of_rows(CLOCK, y1_rad=signal(np.random.default_rng(seed))).tilt


def assert_size(noise: WhiteNoise | str | None, expected: float) -> None:
    assert isinstance(noise, WhiteNoise), noise
    assert noise.sigma == pytest.approx(expected, rel=0.04)


def white(random: np.random.Generator) -> np.ndarray:
    return SIGMA * random.standard_normal(N)


def fused(random: np.random.Generator) -> np.ndarray:
    """A complementary filter of an accelerometer and a gyro."""
    accelerometer = motion(CLOCK) + white(random)
    gyro = np.gradient(motion(CLOCK), DT) + 0.01 * random.standard_normal(N)
    tilt = accelerometer.copy()
    for k in range(1, N):
        tilt[k] = 0.98 * (tilt[k - 1] + gyro[k] * DT) + 0.02 * accelerometer[k]
    return tilt


def times(kind: str, n: int, random: np.random.Generator) -> np.ndarray:
    t = DT * np.arange(n)
    if kind == "uneven":
        return t + random.uniform(-0.3, 0.3, n) * DT
    return t[random.random(n) > 0.02] if kind == "missing rows" else t


@pytest.mark.parametrize("kind", ["even", "uneven", "missing rows"])
@pytest.mark.parametrize(
    ("n", "seeds", "least", "most"),
    [(1500, 60, 0.87, 1.0), *(pytest.param(n, 300, 0.92, 0.985, marks=pytest.mark.slow) for n in (1200, 4000, 20_000))],
)
def test_the_interval_covers_the_truth(kind: str, n: int, seeds: int, least: float, most: float) -> None:
    """95 % of 60 seeds are 57; 52 or fewer come once in a hundred times."""
    covered, sizes = 0, []
    for seed in range(seeds):
        random = np.random.default_rng(seed)
        t = times(kind, n, random)
        noise = noise_of_rows(t, y1_rad=motion(t) + SIGMA * random.standard_normal(len(t))).tilt
        if isinstance(noise, WhiteNoise):
            covered += noise.low <= SIGMA <= noise.high
            sizes.append(noise.sigma / SIGMA)
            assert seeds > 60 or noise.high / noise.low < 1.2
    assert len(sizes) >= 0.99 * seeds
    assert least < covered / len(sizes) <= most
    assert np.mean(sizes) == pytest.approx(1.0, abs=0.015)


def low_passed(random: np.random.Generator, cutoff: float) -> np.ndarray:
    return np.asarray(sosfilt(butter(2, cutoff, output="sos"), white(random)))


FILTERED: dict[str, MakeSignal] = {
    "first order": lambda random: motion(CLOCK) + lfilter([0.4], [1.0, -0.6], white(random)),
    "second order, at 94 Hz of 100": lambda random: motion(CLOCK) + low_passed(random, 0.94),
    "second order, at 20 Hz": lambda random: motion(CLOCK) + low_passed(random, 0.2),
    "mean of 2 rows": lambda random: motion(CLOCK) + np.convolve(white(random), np.ones(2) / 2, "same"),
    "mean of 6 rows": lambda random: motion(CLOCK) + np.convolve(white(random), np.ones(6) / 6, "same"),
    "random walk": lambda random: motion(CLOCK) + 0.1 * np.cumsum(white(random)),
    "fusion": fused,
    "every row twice": lambda random: np.repeat((motion(CLOCK) + white(random))[::2], 2),
}


@pytest.mark.parametrize("name", FILTERED)
def test_a_filtered_tilt_has_no_white_floor(name: str) -> None:
    for seed in range(3 if name == "fusion" else 10):
        assert "no white floor" in str(tilt_noise(FILTERED[name], seed))


@pytest.mark.parametrize("step", [0.5, 1.0, 1.5])
def test_a_fine_quantiser_adds_a_twelfth_of_its_step_squared(step: float) -> None:
    q = step * SIGMA
    noise = tilt_noise(lambda random: q * np.round((motion(CLOCK) + white(random)) / q))
    assert_size(noise, SIGMA * np.sqrt(1.0 + step**2 / 12.0))


@pytest.mark.parametrize("sigma", [0.0, 0.3])
def test_a_coarse_quantiser_hides_the_noise(sigma: float) -> None:
    q = np.radians(0.08)
    noise = tilt_noise(lambda random: q * np.round((motion(CLOCK) + sigma * q / SIGMA * white(random)) / q))
    assert "smallest step" in str(noise)


def test_without_noise_there_is_none_to_tell() -> None:
    assert tilt_noise(lambda random: motion(CLOCK)) == "there is hardly any"
    assert tilt_noise(lambda random: np.round(motion(CLOCK), 9)) == "there is hardly any"


@pytest.mark.parametrize(
    "disturbance", [0.005 * np.sin(2.0 * np.pi * 45.0 * CLOCK), np.where(CLOCK % 5.0 == 2.0, 3.0, 0.0)]
)
def test_a_vibration_below_the_floor_and_spikes_are_no_noise(disturbance: np.ndarray) -> None:
    assert_size(tilt_noise(lambda random: motion(CLOCK) + white(random) + disturbance), SIGMA)


def test_short_parts_tell_nothing_and_gaps_nothing_wrong() -> None:
    random = np.random.default_rng(0)
    y = motion(CLOCK) + white(random)
    short = noise_of_rows(CLOCK, slice(0, 1000), y1_rad=y).tilt
    assert str(short).endswith("there are 936")
    t = np.where(np.arange(N) < 1800, CLOCK, CLOCK + 7.0)
    parts = noise_of_rows(t, slice(0, 1800), slice(1800, 1900), slice(1900, N), y1_rad=np.where(t > 9.0, y + 1.0, y))
    assert_size(parts.tilt, SIGMA)


def test_tilt_and_acceleration_of_the_same_sensors_are_correlated() -> None:
    geometry, random = PairTilt(0.1, 0.3), np.random.default_rng(0)
    inner, outer = 0.05 * random.standard_normal((2, N))
    y = motion(CLOCK) - (1.5 * inner - 0.5 * outer) / 9.81
    noise = noise_of_rows(CLOCK, y1_rad=y, acceleration_rad_s2=(outer - inner) / 0.2)
    expected = geometry.noise(0.05, 9.81)
    assert_size(noise.tilt, expected.tilt)
    assert_size(noise.acceleration, expected.acceleration)
    assert noise.correlation == pytest.approx(expected.correlation, abs=0.02)
    other = noise_of_rows(CLOCK, y1_rad=y, acceleration_rad_s2=random.standard_normal(N))
    assert other.correlation == 0.0


def test_what_follows_from_the_command_is_no_noise_of_the_acceleration() -> None:
    """The command knows the noise of the row before, and moves the acceleration up to half the row rate."""
    random = np.random.default_rng(0)
    n, true, u = 0.4 * random.standard_normal(N), np.zeros(N), np.zeros(N)
    for k in range(1, N):
        true[k] = 0.5 * true[k - 1] + u[k - 1]
        u[k] = -0.8 * (true[k] + n[k])
    y = motion(CLOCK) + white(random)
    assert_size(noise_of_rows(CLOCK, y1_rad=y, acceleration_rad_s2=true + n, u_rad_s=u).acceleration, 0.4)


@pytest.mark.parametrize("seed", range(4))
def test_what_a_command_that_no_column_shows_does_is_motion_too(seed: int) -> None:
    """The loop's acceleration has no white floor; the noise is that at which the tilt agrees with it."""
    random = np.random.default_rng(seed)
    n, y, true, rate, u = 0.4 * random.standard_normal(N), np.zeros(N), np.zeros(N), 0.0, 0.0
    for k in range(1, N):
        true[k] = 0.5 * true[k - 1] + u + np.sin(3.0 * CLOCK[k])
        y[k] = y[k - 1] + DT * rate + DT * DT * (2.0 * true[k - 1] + true[k]) / 6.0
        rate += 0.5 * DT * (true[k - 1] + true[k])
        u = -0.8 * (true[k] + n[k]) - 40.0 * y[k] - 8.0 * rate
    noise = noise_of_rows(CLOCK, y1_rad=y + white(random), acceleration_rad_s2=true + n)
    assert isinstance(noise.acceleration, WhiteNoise)
    assert noise.acceleration.low < 0.4 < noise.acceleration.high < 0.7
    assert_size(noise.tilt, SIGMA)


@pytest.mark.parametrize("correlation", [0.0, 0.9])
def test_tilt_and_acceleration_agree_at_their_noise_where_vibration_hides_a_floor(correlation: float) -> None:
    """Of many intervals 95 % hold the truth; the motion moves both and cancels."""
    hits, worlds = np.zeros(2), 40
    for seed in range(worlds):
        random = np.random.default_rng(seed)
        v, other = random.standard_normal((2, N))
        n = correlation * v + np.sqrt(1.0 - correlation**2) * other
        moves = {"y1_rad": motion(CLOCK), "acceleration_rad_s2": np.gradient(np.gradient(motion(CLOCK), DT), DT)}
        noisy = {"y1_rad": SIGMA * v, "acceleration_rad_s2": 0.4 * n}
        rows = {name: moves[name] + noisy[name] for name in moves}
        found = _agreeing([Segment(CLOCK, rows, CLOCK, CLOCK, rows)], DT, correlation)
        hits += [noise.low < size < noise.high for noise, size in zip(found, (SIGMA, 0.4), strict=True)]
    assert (hits >= 0.85 * worlds).all()

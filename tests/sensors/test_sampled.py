"""The sensors' readings of an ideal reading, by closed forms and by statistics with confidence bounds.

Seeds are fixed, so that nothing here fails by chance; the bounds are those a correct sensor meets 999 times of 1000.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from scipy import stats

from cmg_mj.core.errors import InputError
from cmg_mj.core.noise import Normals, normals
from cmg_mj.core.sensor import Sensor, Site
from cmg_mj.core.types import IdealReading
from cmg_mj.sensors.accelerometer import Accelerometer, Encoder
from cmg_mj.sensors.gyros import Fog
from tests.recorded import push_recovery, recorded

G = 9.80665
READING_AT_REST = IdealReading((0.0, G, 0.0, G), [0.0, 0.0], 0.0, 0.0)
QUIET: dict[str, Any] = {"noise_density_ug_rthz": 0.0, "counts_per_g": 0.0}
N = 20_000


def shown(
    sensor: Sensor,
    ideal: Callable[[int], IdealReading],
    n: int,
    every: int = 0,
    seed: int = 0,
    worlds: int | Sequence[int] = 0,
) -> np.ndarray:
    """Return n readings of a sensor at work, one in so many physics steps, by default in its period."""
    every = every or sensor.period
    tables = {stream: Normals(seed, worlds, stream, width) for stream, width in sensor.draws.items()}
    state, result = sensor.init(ideal(0), tables), []
    for step in range(0, n * every, math.gcd(every, sensor.steps_per_sample)):
        if step:
            state = sensor.sample(state, step, ideal(step), tables)
        if step % every == 0:
            result.append(sensor.read(state, step))
    return np.array(result)


def readings(part: Any, *ideals: IdealReading, n: int = 0, seed: int = 0, world: int = 0) -> np.ndarray:
    """Return what one world's part shows of one reading after the other, (n, channels); the last one stays."""
    sensor = part.at_work(Site("sensors", 1.0 / part.rate_hz))
    return shown(sensor, lambda step: ideals[min(step, len(ideals) - 1)], n or len(ideals), seed=seed, worlds=world)


def assert_sigma(values: np.ndarray, sigma: float) -> None:
    """The sample variance of normal numbers follows chi^2."""
    n = len(values)
    low, high = stats.chi2.ppf([0.0005, 0.9995], n - 1) / (n - 1)
    assert low < np.var(values, ddof=1) / sigma**2 < high


def assert_mean(values: np.ndarray, mean: float, sigma: float) -> None:
    assert abs(np.mean(values) - mean) < stats.norm.ppf(0.9995) * sigma / math.sqrt(len(values))


# --- accelerometers ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("density_ug_rthz", "rate_hz", "sigma"),
    [
        (400.0, 200.0, 400e-6 * 9.80665 * 10.0),  # 4 mg
        (400.0, 1000.0, 400e-6 * 9.80665 * math.sqrt(500.0)),
        (100.0, 50.0, 100e-6 * 9.80665 * 5.0),
    ],
)
def test_accelerometer_noise_is_density_times_root_of_half_the_rate(
    density_ug_rthz: float, rate_hz: float, sigma: float
) -> None:
    sensor = Accelerometer(rate_hz=rate_hz, noise_density_ug_rthz=density_ug_rthz, counts_per_g=0.0)
    noise = readings(sensor, READING_AT_REST, n=N) - [0.0, G, 0.0, G]
    assert noise.shape == (N, 4)
    for channel in noise.T:
        assert_sigma(channel, sigma)
        assert_mean(channel, 0.0, sigma)
        assert stats.kstest(channel / sigma, "norm").pvalue > 1e-3


def test_accelerometer_counts() -> None:
    """16384 counts a g (MPU-6050): readings are whole counts, and rounding adds step^2/12 to the variance."""
    noise = readings(Accelerometer(), READING_AT_REST, n=N)[:, 0]
    counts = noise * 16384.0 / G
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    coarse = readings(Accelerometer(counts_per_g=100.0, noise_density_ug_rthz=2000.0), READING_AT_REST, n=N)[:, 0]
    sigma, step = 2000e-6 * G * 10.0, G / 100.0
    assert_sigma(coarse, math.sqrt(sigma**2 + step**2 / 12.0))


@pytest.mark.parametrize(("force", "reading"), [(5.0, 2.0), (-5.0, -2.0), (1.5, 1.5)])
def test_accelerometer_saturates_at_its_range(force: float, reading: float) -> None:
    ideal = IdealReading([force * G] * 4, [0.0, 0.0], 0.0, 0.0)
    for sensor in (Accelerometer(noise_density_ug_rthz=0.0), Accelerometer(range_g=2.0, **QUIET)):
        np.testing.assert_allclose(readings(sensor, ideal)[0], reading * G, rtol=1e-12)
    noisy = readings(Accelerometer(), ideal, n=500)
    assert np.abs(noisy).max() <= 2.0 * G * (1.0 + 1e-12)


def test_accelerometer_bias_and_equilibrium_bias_move_the_loop_alike() -> None:
    """e is what a tilt shift of -e is: the rig ends upright either way, and the integrator at +k_e1/k_e4 e."""
    e = math.radians(0.5)
    bias_mg = 1e3 * math.tan(e) / 1.5  # on the inner accelerometer
    quiet = ["sensors.accelerometer.noise_density_ug_rthz=0", "controller.feedback=truth", "push=[]", "duration_s=25"]
    ends = []
    for setting in ("plant.equilibrium_bias_deg=0.5", f"sensors.accelerometer.bias_mg=[{bias_mg}, 0.0]"):
        other = [] if "equilibrium" in setting else ["plant.equilibrium_bias_deg=0.0"]
        trajectory = recorded(push_recovery(setting, *other, *quiet).run())
        ends.append([np.mean(trajectory[name][-400:]) for name in ("x1_rad", "y1_rad", "x_e_rad_times_s")])
    for x1, y1, x_e in ends:
        assert x1 == pytest.approx(0.0, abs=0.02 * e)
        assert y1 == pytest.approx(-e, rel=0.02)
        assert x_e == pytest.approx(35.0 / 0.3 * e, rel=0.02)
    assert ends[0] == pytest.approx(ends[1], rel=0.02, abs=0.01 * e)


# --- encoders ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("encoder", "counts"), [(Encoder(), 2**12), (Encoder(counts_per_revolution=360.0), 360)])
def test_encoder_shows_the_nearest_count(encoder: Encoder, counts: int) -> None:
    """12 bits (AS5045), and another resolution."""
    step = 2.0 * math.pi / counts
    angles = np.outer(np.linspace(-2.0, 2.0, 1001), (1.0, 0.5))
    shown_angles = readings(encoder, *(IdealReading((), pair, 0.0, 0.0) for pair in angles.tolist()))
    assert np.abs(shown_angles - angles).max() <= step / 2.0 * (1.0 + 1e-9)
    np.testing.assert_allclose(shown_angles / step, np.round(shown_angles / step), atol=1e-9)


def test_encoder_without_resolution_is_ideal() -> None:
    angles = IdealReading((), [0.1, 0.2], 0.0, 0.0)
    assert readings(Encoder(counts_per_revolution=0.0), angles).tolist() == [[0.1, 0.2]]


# --- fibre-optic gyro --------------------------------------------------------------------------------------


def turning(rate: float) -> IdealReading:
    """Return the reading of a frame that turns at a rate [rad/s]."""
    return IdealReading((), [], rate, rate)


@pytest.mark.daily_cases("0.02-200.0")
@pytest.mark.parametrize(("walk_deg_rth", "rate_hz"), [(0.02, 200.0), (0.1, 1000.0)])
def test_fog_angle_walks_randomly(walk_deg_rth: float, rate_hz: float) -> None:
    """The integral of a still gyro has the variance N^2 t: 400 gyros of 0.5 s each."""
    gyros, n = 400, int(0.5 * rate_hz)
    walk = math.radians(walk_deg_rth) / math.sqrt(3600.0)  # rad/sqrt(s)
    sensor = Fog(rate_hz=rate_hz, angle_random_walk_deg_rth=walk_deg_rth)
    angles = np.array([readings(sensor, turning(0.0), n=n, seed=1, world=w).sum() / rate_hz for w in range(gyros)])
    assert_sigma(angles, walk * math.sqrt(0.5))
    assert_mean(angles, 0.0, walk * math.sqrt(0.5))


def test_fog_bias_and_range() -> None:
    quiet = {"angle_random_walk_deg_rth": 0.0}
    assert readings(Fog(bias_deg_h=30.0, **quiet), turning(0.0)) == pytest.approx(
        math.radians(30.0 / 3600.0), rel=1e-12
    )
    for rate in (20.0, -20.0):
        reading = readings(Fog(**quiet), turning(rate))
        assert reading == pytest.approx(math.copysign(math.radians(490.0), rate), rel=1e-12)
        assert readings(Fog(range_deg_s=2000.0, **quiet), turning(rate)) == pytest.approx(rate)


@pytest.mark.parametrize(
    ("arguments", "bandwidth_hz", "rate_hz"),
    [
        ({"rate_hz": 1000.0}, 440.0, 1000.0),  # DSP-1750
        ({"bandwidth_hz": 10.0}, 10.0, 200.0),
        ({"bandwidth_hz": 10.0, "rate_hz": 1000.0}, 10.0, 1000.0),
    ],
)
def test_fog_step_response(arguments: dict[str, Any], bandwidth_hz: float, rate_hz: float) -> None:
    """A first-order low-pass: 1 - exp(-2 pi f t), the step coming right after the sample at t = 0."""
    reading = readings(Fog(angle_random_walk_deg_rth=0.0, **arguments), turning(0.0), turning(1.0), n=30)[:, 0]
    t = np.arange(30) / rate_hz
    np.testing.assert_allclose(reading, 1.0 - np.exp(-2.0 * math.pi * bandwidth_hz * t), rtol=1e-12, atol=1e-14)


def test_fog_without_bandwidth_shows_the_step_at_once_and_starts_settled() -> None:
    quick = Fog(bandwidth_hz=0.0, angle_random_walk_deg_rth=0.0)
    assert readings(quick, turning(0.3), turning(-0.2)).tolist() == [[0.3], [-0.2]]
    assert readings(Fog(angle_random_walk_deg_rth=0.0), turning(0.3)) == 0.3


# --- rates and latency -------------------------------------------------------------------------------------


COUNTING = {"angle_random_walk_deg_rth": 0.0, "bandwidth_hz": 0.0, "range_deg_s": 1e6}


@pytest.mark.parametrize(
    ("rate_hz", "latency_s", "expected"),
    [
        pytest.param(200.0, 0.0, [0, 5, 10, 15, 20, 25], id="control rate"),
        pytest.param(100.0, 0.0, [0, 0, 10, 10, 20, 20], id="slower is held"),
        pytest.param(125.0, 0.0, [0, 0, 8, 8, 16, 24], id="no multiple of the other"),
        pytest.param(200.0, 0.005, [0, 0, 5, 10, 15, 20], id="one period late"),
        pytest.param(1000.0, 0.003, [0, 2, 7, 12, 17, 22], id="fast and late"),
        pytest.param(200.0, 0.012, [0, 0, 0, 0, 5, 10], id="late by more than two periods"),
    ],
)
def test_newest_delivered_sample_at_each_tick(rate_hz: float, latency_s: float, expected: list[int]) -> None:
    """At 200 Hz control and 1 ms physics. Before the first delivery the rig stood still."""
    gyro = Fog(rate_hz=rate_hz, latency_s=latency_s, **COUNTING).at_work(Site("sensors.fog", 0.001))
    assert shown(gyro, lambda step: turning(float(step)), 6, every=5)[:, 0].tolist() == expected


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("rate_hz", 300.0, r"sensors\.{kind}\.rate_hz = 300 Hz: not a whole number of physics steps of 0\.001 s"),
        ("rate_hz", 5000.0, r"sensors\.{kind}\.rate_hz = 5000 Hz: not a whole number"),
        ("latency_s", -0.001, r"sensors\.{kind}\.latency_s = -0\.001: .*greater than or equal to 0"),
        ("rate_hz", 0.0, r"sensors\.{kind}\.rate_hz = 0\.0: .*greater than or equal to 0\.1"),
    ],
)
@pytest.mark.parametrize("kind", ["accelerometer", "encoder", "fog"])
def test_what_does_not_fit_the_physics_step_is_refused(kind: str, field: str, value: float, message: str) -> None:
    with pytest.raises(InputError, match=message.replace("{kind}", kind)):
        push_recovery("plant.timestep_s=0.001", f"sensors.{kind}.{field}={value}")


# --- randomness --------------------------------------------------------------------------------------------


def draw(seed: int, worlds: int | list[int], stream: int, n: int, channels: int = 1) -> np.ndarray:
    return np.array(list(itertools.islice(normals(seed, worlds, stream, channels), n)))


def test_noise_depends_on_seed_and_world_alone() -> None:
    """Not on the batch, nor on the order in it, nor on whether the world runs alone; across blocks of numbers too."""
    batch = draw(5, [3, 0, 7], 1, 600, 4)
    assert batch.shape == (600, 4, 3)
    for i, world in enumerate((3, 0, 7)):
        np.testing.assert_array_equal(draw(5, world, 1, 600, 4), batch[:, :, i])
    np.testing.assert_array_equal(draw(5, [7, 3], 1, 600, 4), batch[:, :, [2, 0]])
    assert all(type(number) is float for number in next(normals(5, 3, 1, 4)))


def test_streams_are_uncorrelated_standard_normals() -> None:
    """Seeds, worlds, sensors and channels: no pair correlates, and neighbours in time do not."""
    sources = list(itertools.product((0, 1), (0, 1, 2), (0, 2)))
    streams = [channel for source in sources for channel in draw(*source, N, 2).T]
    correlation = np.corrcoef(np.stack(streams))[np.triu_indices(len(streams), 1)]
    assert np.abs(correlation).max() < stats.norm.ppf(1.0 - 0.0005 / len(correlation)) / math.sqrt(N)
    for stream in streams:
        assert_sigma(stream, 1.0)
        assert_mean(stream, 0.0, 1.0)
        assert abs(np.corrcoef(stream[:-1], stream[1:])[0, 1]) < stats.norm.ppf(0.9999) / math.sqrt(N)

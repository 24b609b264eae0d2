"""Errors of a cheap part and its mounting, against closed forms: at the sensor, and in the loop.

Seeds are fixed; statistical bounds are those a correct sensor meets 999 times of 1000.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.signal import butter, lfilter

import cmg_mj
from cmg_mj.core.controller import Controller
from cmg_mj.core.errors import InputError
from cmg_mj.core.noise import NoiseStream
from cmg_mj.core.sensor import Site
from cmg_mj.core.tilt import PairTilt
from cmg_mj.core.types import IdealReading
from cmg_mj.plant.plant import load_plant
from cmg_mj.sensors import Sensors
from cmg_mj.sensors.accelerometer import Accelerometer
from cmg_mj.stages.low_pass import noise_gain
from tests.recorded import assert_same_bits, push_recovery, recorded
from tests.sensors.test_sampled import G, assert_sigma, readings, shown

QUIET: dict[str, Any] = {"noise_density_ug_rthz": 0.0, "counts_per_g": 0.0}
TILT = PairTilt(0.06717514421272202, 0.20152543263816603)
FORCES_AT_REST = (0.0, G, 0.0, G)
MS = 0.001


def ideal(forces: Any) -> IdealReading:
    return IdealReading(forces, [0.0], 0.0, 0.0)


def read_forces(forces: Any, **errors: Any) -> np.ndarray:
    """Read specific forces, (4,), with parts without noise."""
    return readings(Accelerometer(**QUIET, **errors), ideal(forces))[0]


def deliver(
    sensor: Accelerometer,
    n: int,
    forces: Callable[[float], Any] = lambda _: FORCES_AT_REST,
    timestep: float = MS,
    worlds: int | list[int] = 0,
) -> np.ndarray:
    """Return the first n samples that a pair delivers of forces over time, (n, 4, ...)."""
    pair = sensor.at_work(Site("sensors.accelerometer", timestep))
    return shown(pair, lambda step: ideal(forces(step * timestep)), n, seed=7, worlds=worlds)


# --- mounting and scale ------------------------------------------------------------------------------------


def test_each_part_is_turned_then_crossed_then_scaled_then_offset() -> None:
    forces = np.random.default_rng(3).uniform(-1.0, 1.0, (50, 4)) * G
    errors = {"scale_error": (0.01, -0.02), "misalignment_deg": (0.2, -1.0), "cross_axis": (0.02, -0.01)}
    parts = []
    for i in range(2):
        scale, angle, cross = (values[i] for values in errors.values())
        c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        parts.append((1.0 + scale) * np.array([[1.0, cross], [cross, 1.0]]) @ np.array([[c, -s], [s, c]]))
    offset = np.array([3e-3 * G, 0.0, -4e-3 * G, 0.0])
    for force in forces:
        expected = np.concatenate([parts[0] @ force[:2], parts[1] @ force[2:]]) + offset
        np.testing.assert_allclose(read_forces(force.tolist(), bias_mg=(3.0, -4.0), **errors), expected, atol=1e-13)


@pytest.mark.parametrize("tilt_deg", [-3.0, 0.0, 5.0])
def test_what_mounting_and_scale_do_to_the_tilt(tilt_deg: float) -> None:
    theta = math.radians(tilt_deg)
    forces = (-G * math.sin(theta), G * math.cos(theta)) * 2

    def y1(**errors: Any) -> float:
        return math.degrees(TILT(*read_forces(forces, **errors).tolist()))

    assert y1(misalignment_deg=(1.0, 1.0)) == pytest.approx(tilt_deg + 1.0, abs=1e-12)
    assert y1(scale_error=(0.01, 0.01)) == pytest.approx(tilt_deg, abs=1e-12)
    # The weights of sites at 1/4 and 3/4 are 1.5 and -0.5, to first order in the angle.
    assert y1(misalignment_deg=(1.0, 0.0)) - tilt_deg == pytest.approx(1.5, abs=0.02)
    assert y1(misalignment_deg=(0.0, 1.0)) - tilt_deg == pytest.approx(-0.5, abs=0.02)
    if tilt_deg == 0.0:
        assert y1(cross_axis=(0.02, 0.02)) == pytest.approx(-math.degrees(math.atan(0.02)), rel=1e-12)
        assert y1(scale_error=(0.03, -0.03)) == 0.0


EVERYTHING: dict[str, Any] = {
    "bias_mg": (5.0, -5.0),
    "scale_error": (0.01, -0.01),
    "misalignment_deg": (0.2, 1.0),
    "cross_axis": (0.02, -0.02),
    "skew_s": 0.003,
    "bias_instability_ug": 400.0,
    "bandwidth_hz": 94.0,
}


@pytest.mark.parametrize("arguments", [{}, *({name: value} for name, value in EVERYTHING.items()), EVERYTHING], ids=str)
def test_floats_and_arrays_show_the_same_bits(arguments: dict[str, Any]) -> None:
    """Worlds 4, 0, 7 together and each alone."""
    numbers = [4, 0, 7]
    motion = np.random.default_rng(0).normal(size=(500, 4, 3)) + np.array(FORCES_AT_REST)[:, None]
    sensor = Accelerometer(**arguments)
    batch = deliver(sensor, 40, lambda t: motion[round(t / MS)], worlds=numbers)
    for i, number in enumerate(numbers):
        alone = deliver(sensor, 40, lambda t, i=i: tuple(motion[round(t / MS), :, i].tolist()), worlds=number)
        np.testing.assert_array_equal(batch[:, :, i], alone)


def test_what_is_off_draws_nothing() -> None:
    """1/f noise has a stream of its own: the white noise is as it was."""
    sensor, drifting_sensor = (
        deliver(Accelerometer(counts_per_g=0.0, bias_instability_ug=b), 50) for b in (0.0, 1e-20)
    )
    np.testing.assert_allclose(sensor, drifting_sensor, rtol=0.0, atol=1e-15)


# --- skew --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("skew_s", [0.001, 0.0025, 0.005])
def test_the_outers_sample_is_older_by_the_skew(skew_s: float) -> None:
    """Forces that grow with time; before the start they were what they are at the start."""
    times = np.arange(30) * 0.005
    result = deliver(Accelerometer(skew_s=skew_s, **QUIET), 30, lambda t: (t, 2.0 * t, 3.0 * t, 4.0 * t), 0.0005)
    np.testing.assert_allclose(result[:, :2], np.outer(times, (1.0, 2.0)), atol=1e-14)
    older = np.maximum(times - skew_s, 0.0)
    np.testing.assert_allclose(result[:, 2:], np.outer(older, (3.0, 4.0)), atol=1e-14)


# --- low-pass ----------------------------------------------------------------------------------------------


@pytest.mark.daily_cases("5.0", "94.0", "400.0")
@pytest.mark.parametrize("bandwidth_hz", [5.0, 44.0, 94.0, 184.0, 400.0])
def test_noise_after_the_low_pass(bandwidth_hz: float) -> None:
    """The closed form against the sum of the squared impulse response, and against what is delivered."""
    b, a = np.array(butter(2, bandwidth_hz, fs=1000.0)).tolist()
    impulse = np.asarray(lfilter(b, a, np.eye(1, 5000)[0]))
    assert noise_gain(bandwidth_hz, 1000.0) == pytest.approx(float(np.sum(impulse**2)), rel=1e-9)

    sensor = Accelerometer(bandwidth_hz=bandwidth_hz, rate_hz=100.0, counts_per_g=0.0)
    # Samples so far apart that they are independent, all but those of the narrowest.
    noise = (deliver(sensor, 500, lambda _: np.zeros((4, 8)), worlds=list(range(8)))).swapaxes(0, 1).reshape(4, -1)
    if bandwidth_hz > 10.0:
        assert_sigma(noise.ravel(), sensor.white_noise_sigma)
    else:
        assert noise.std() == pytest.approx(sensor.white_noise_sigma, rel=0.1)
        # A narrow filter's noise is the density's over pi/(2 sqrt 2) bandwidths.
        white = 400e-6 * G * math.sqrt(bandwidth_hz * math.pi / (2.0 * math.sqrt(2.0)))
        assert sensor.white_noise_sigma == pytest.approx(white, rel=1e-3)


@pytest.mark.parametrize(("frequency_hz", "alias_hz"), [(20.0, 20.0), (180.0, -20.0), (330.0, -70.0)])
@pytest.mark.parametrize("bandwidth_hz", [0.0, 44.0, 94.0])
def test_a_vibration_is_filtered_before_it_aliases(frequency_hz: float, alias_hz: float, bandwidth_hz: float) -> None:
    """At 200 Hz, 180 Hz look like 20 Hz turned round; with a low-pass, by |H(180 Hz)| less."""
    w = 2.0 * math.pi * frequency_hz
    sensor = Accelerometer(bandwidth_hz=bandwidth_hz, **QUIET)
    result = deliver(sensor, 500, lambda t: (math.sin(w * t),) * 4)[100:, 0]
    times = np.arange(100, 500) * 0.005
    waves = np.column_stack([f(2.0 * math.pi * alias_hz * times) for f in (np.sin, np.cos)])
    parts, residual, *_ = np.linalg.lstsq(waves, result)
    ratio = math.tan(math.pi * frequency_hz / 1e3) / math.tan(math.pi * bandwidth_hz / 1e3) if bandwidth_hz else 0.0
    assert np.hypot(*parts) == pytest.approx(1.0 / math.sqrt(1.0 + ratio**4), rel=1e-6)
    assert residual.sum() < 1e-12


@pytest.mark.parametrize(("bandwidth_hz", "datasheet_ms"), [(94.0, 3.0), (44.0, 4.9)])
def test_the_low_pass_lags_a_ramp_by_its_delay(bandwidth_hz: float, datasheet_ms: float) -> None:
    """sqrt(2) over the warped corner; the MPU-6050's register map (RM-MPU-6000A, register 26) has 3.0 and 4.9 ms."""
    delay = math.sqrt(2.0) / (2000.0 * math.tan(math.pi * bandwidth_hz / 1e3))
    assert 1e3 * delay == pytest.approx(datasheet_ms, abs=0.7)
    sensor = Accelerometer(bandwidth_hz=bandwidth_hz, skew_s=0.002, **QUIET)
    late = np.arange(200) * 0.005 - deliver(sensor, 200, lambda t: (t,) * 4).T
    np.testing.assert_allclose(late[:2, 100:], delay, rtol=1e-9)
    np.testing.assert_allclose(late[2:, 100:], delay + 0.002, rtol=1e-9)


def test_a_reading_out_of_range_is_cut_before_the_low_pass() -> None:
    """A vibration of 3 g shows less than its amplitude, although 180 Hz are filtered to a quarter of it."""

    def amplitude(g: float) -> float:
        forces = lambda t: (g * G * math.sin(2.0 * math.pi * 180.0 * t),) * 4  # noqa: E731
        return float(np.abs(deliver(Accelerometer(bandwidth_hz=94.0, **QUIET), 300, forces)[50:]).max())

    assert amplitude(3.0) < 0.95 * 3.0 * amplitude(1.0)
    assert amplitude(1.9) == pytest.approx(1.9 * amplitude(1.0), rel=1e-12)


def test_the_low_pass_starts_settled() -> None:
    result = deliver(Accelerometer(bandwidth_hz=5.0, **QUIET), 20, lambda _: (1.0, 2.0, 3.0, 4.0))
    np.testing.assert_allclose(result, np.tile((1.0, 2.0, 3.0, 4.0), (20, 1)), rtol=1e-12)


# --- 1/f noise ---------------------------------------------------------------------------------------------


def test_allan_deviation_of_the_drift_is_the_bias_instability() -> None:
    """The same whatever is averaged over, and no two channels' alike."""
    sensor = Accelerometer(bias_instability_ug=36.0, rate_hz=50.0, **QUIET)
    noise = deliver(sensor, 20_000, lambda _: np.zeros((4, 4)), 0.005, worlds=list(range(4))).reshape(20_000, 16)
    for tau_s in (0.4, 2.0, 10.0):
        averages = noise.reshape(-1, round(tau_s * 50.0), 16).mean(axis=1)
        allan = math.sqrt(0.5 * np.mean(np.diff(averages, axis=0) ** 2))
        assert 1e6 * allan / G == pytest.approx(36.0, rel=0.1), tau_s
    correlation = np.corrcoef(np.diff(noise[::50], axis=0).T)[np.triu_indices(16, 1)]
    assert np.abs(correlation).max() < 0.25


def test_every_sensor_of_every_axis_has_a_stream_of_its_own() -> None:
    numbers = [stream.on_axis(axis) for axis in range(3) for stream in NoiseStream]
    assert sorted(numbers)[: len(NoiseStream)] == list(range(12))
    assert len(set(numbers)) == len(numbers)


# --- an unbalanced wheel -----------------------------------------------------------------------------------

G_6_3 = 0.61 * 6.3e-3 / 314.0
"""Permissible unbalance of a wheel of 0.61 kg at 314 rad/s in ISO 21940-11's grade G 6.3: m times 6.3 mm/s over the
speed, 1.22e-5 kg m."""


def test_vibration_of_unbalanced_wheels_at_the_accelerometers() -> None:
    """Each pulls with m r w^2 on its axis, l/2 above the tilt axis: the rig's inertia makes an acceleration of that."""
    lever, speed = 0.095, 314.0
    plants = [
        load_plant(equilibrium_bias_deg=0.0, initial_tilt_deg=0.0, flywheel_imbalance_kg_m=u) for u in (0.0, G_6_3)
    ]
    inertia = 2.0 * plants[0].reduced.J1
    differences = []
    for angle in np.linspace(0.0, 2.0 * math.pi, 8, endpoint=False):
        forces = []
        for plant in plants:
            data = plant.new_data()
            for module in plant.axis.modules:
                data.qpos[module.flywheel] += math.copysign(angle, module.speed)
            mujoco.mj_forward(plant.model, data)
            forces.append(plant.ideal_readings(data.sensordata.tolist(), data.qvel.tolist()).accelerations)
        differences.append(np.subtract(*forces[::-1]))
    tangential = np.array(differences)[:, [0, 2]]
    amplitude = np.abs(np.fft.rfft(tangential, axis=0)[1]) / 4.0
    expected = 2.0 * G_6_3 * speed**2 * lever / inertia * np.array([TILT.r_inner, TILT.r_outer])
    np.testing.assert_allclose(amplitude, expected, rtol=0.01)


# --- in the loop -------------------------------------------------------------------------------------------

ALL = tuple(
    f"sensors.accelerometer.{name}={list(value) if isinstance(value, tuple) else value}"
    for name, value in EVERYTHING.items()
)


def test_the_callback_sees_what_the_loop_sees() -> None:
    """Bit for bit, everything switched on, an unbalanced wheel too."""
    settings = ["duration_s=0.5", "push.0.start_s=0.2", f"plant.flywheel_imbalance_kg_m={G_6_3}", *ALL]
    experiment = push_recovery(*settings)
    assert experiment.plant.timestep == pytest.approx(MS)
    assert_same_bits(*(recorded(experiment.run(driver=driver)) for driver in ("native", "callback")))


def test_a_controller_of_ones_own_is_refused_what_does_not_fit() -> None:
    plant = load_plant()
    for name, sensor in (("skew_s", Accelerometer(skew_s=0.0021)), ("bandwidth_hz", Accelerometer(bandwidth_hz=94.0))):
        with pytest.raises(InputError, match=rf"sensors\.accelerometer\.{name} = .*not a whole number"):
            cmg_mj.controller(plant, sensors=Sensors(accelerometer=sensor))
    assert isinstance(cmg_mj.controller(plant, sensors=Sensors(accelerometer=Accelerometer(skew_s=0.005))), Controller)

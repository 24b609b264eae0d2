"""Vibration of accelerometers: of the RMS and in the band that it is told, and tones that follow the flywheels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.core.sensor import Site
from cmg_mj.core.types import STANDARD_GRAVITY, IdealReading
from cmg_mj.runs.experiment import Experiment
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.sensors.accelerometer import Accelerometer
from tests.recorded import push_recovery, recorded
from tests.sensors.test_sampled import shown

MG = 1e-3 * STANDARD_GRAVITY
SILENT = {"noise_density_ug_rthz": 0.0, "counts_per_g": 0.0}


def shaken(n: int, dt: float = 0.005, worlds: int | Sequence[int] = 0, rates: Any = (), **fields: Any) -> np.ndarray:
    """Return n samples of accelerometers at rest, weightless and otherwise perfect, (n, 4[, n_worlds]) [mg].

    Rates are those of the flywheels, one each, or a row of them a sample [rad/s].
    """
    pair = Accelerometer(rate_hz=1.0 / dt, **SILENT, **fields).at_work(Site("sensors.accelerometer", dt))
    forces: Any = [0.0] * 4
    wheels: Any = np.broadcast_to(rates, (n, np.shape(rates)[-1])).tolist()
    if not isinstance(worlds, int):
        forces = np.zeros((4, len(worlds)))
        wheels = [[np.full(len(worlds), rate) for rate in row] for row in wheels]
    return shown(pair, lambda step: IdealReading(forces, [0.0], 0.0, 0.0, wheels[step]), n, worlds=worlds) / MG


# --- broadband -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("band_hz", "dt"), [((20.0, 500.0), 0.005), ((20.0, 500.0), 1e-4), ((90.0, 110.0), 1e-3)])
def test_the_rms_is_the_same_at_any_sample_rate(band_hz: tuple[float, float], dt: float) -> None:
    """From the first sample on; and the covariance of two samples is the band-pass'."""
    samples = shaken(20, dt, range(4000), vibration_mg=1.0, vibration_band_hz=band_hz)
    assert float(samples[0].std()) == pytest.approx(1.0, rel=0.02)
    assert float(samples[-1].std()) == pytest.approx(1.0, rel=0.02)
    f = np.arange(0.005, 2e5, 0.25) if dt < 0.005 else np.arange(0.005, 1e5, 0.1)
    low, high = band_hz
    power = (f * (high - low)) ** 2 / ((low * high - f * f) ** 2 + (f * (high - low)) ** 2)
    expected = float((power * np.cos(2.0 * np.pi * f * dt)).sum() / power.sum())
    together = float((samples[10] * samples[11]).mean())
    assert together == pytest.approx(expected, abs=0.02)


def test_axes_vibrate_each_by_itself() -> None:
    samples = shaken(1, worlds=range(4000), vibration_mg=1.0)[0]
    np.testing.assert_allclose(np.corrcoef(samples), np.eye(4), atol=0.06)


def test_accelerometers_show_it_in_mg() -> None:
    assert float(shaken(20, worlds=range(2000), vibration_mg=4.0).std()) == pytest.approx(4.0, rel=0.02)


def test_one_world_of_many_vibrates_as_alone() -> None:
    fields = {"rates": (314.0, -313.0), "vibration_mg": 4.0, "wheel_harmonics_mg": (5.0, 0.0, 2.0)}
    alone, many = (shaken(40, worlds=worlds, **fields) for worlds in (3, [1, 3, 2]))
    np.testing.assert_array_equal(many[:, :, 1], alone)


# --- tones -----------------------------------------------------------------------------------------------------


def tone(rates: np.ndarray, dt: float, harmonics: Sequence[float] = (1.0,)) -> np.ndarray:
    """Return the first axis' samples with one wheel at these rates [mg]."""
    return shaken(len(rates), dt, rates=rates[:, None], wheel_harmonics_mg=tuple(harmonics))[:, 0]


def strongest(samples: np.ndarray, dt: float) -> float:
    """The frequency of the largest peak above 10 Hz [Hz]."""
    f = np.fft.rfftfreq(len(samples), dt)
    spectrum = np.where(f > 10.0, np.abs(np.fft.rfft(samples * np.hanning(len(samples)))), 0.0)
    return float(f[int(np.argmax(spectrum))])


def test_a_tone_has_its_amplitude_and_its_multiple() -> None:
    rates = np.full(4000, 2.0 * np.pi * 50.0)
    samples = tone(rates, 0.001, (0.0, 0.0, 3.0))
    assert strongest(samples, 0.001) == pytest.approx(150.0, abs=0.3)
    assert float(samples.std()) == pytest.approx(3.0 / math.sqrt(2.0), rel=1e-3)


def test_a_tone_shifts_with_the_wheel() -> None:
    """A wheel that runs up from 40 to 60 Hz: the phase is the integral of its rate, to the first order of the step."""
    dt, t = 0.001, np.arange(2000) * 0.001
    rates = 2.0 * np.pi * (40.0 + 10.0 * t)
    samples = tone(rates, dt)
    angle = 2.0 * np.pi * (40.0 * t + 5.0 * t * t)
    basis = np.array([np.sin(angle), np.cos(angle)]).T
    rest = samples - basis @ np.linalg.lstsq(basis, samples, rcond=None)[0]
    assert np.abs(rest).max() < 1e-9
    assert strongest(samples[:400], dt) == pytest.approx(42.0, abs=2.6)
    assert strongest(samples[-400:], dt) == pytest.approx(58.0, abs=2.6)


def experiment(*settings: str) -> Experiment:
    return push_recovery("duration_s=2.0", "push=[]", *settings, observer="gyro_free")


@pytest.mark.parametrize("speed", [314.0, 220.0])
def test_the_rigs_own_wheels_make_the_tone(speed: float) -> None:
    """In the angular acceleration that the accelerometers show; the frequency moves with the wheels' speed."""
    quiet = [f"sensors.accelerometer.{name}={value:g}" for name, value in SILENT.items()]
    rig = experiment(*quiet, "sensors.accelerometer.wheel_harmonics_mg=[20.0]", f"plant.flywheel_speed_rad_s={speed:g}")
    assert strongest(recorded(rig.run())["acceleration_rad_s2"][40:], 0.005) == pytest.approx(
        speed / (2.0 * math.pi), abs=0.6
    )


# --- in a run --------------------------------------------------------------------------------------------------


def test_a_world_without_vibration_has_the_floor_and_the_others_do_not() -> None:
    """In one batch; each world's summary is its own, as if it had run alone."""
    rig = experiment("duration_s=0.3")
    vary = {"sensors.accelerometer.vibration_mg": [0.0, 4.0]}
    result = rig.run_many([1, 1], settings=vary)
    for summary, one in zip(result.summaries, rig.with_varied(vary), strict=True):
        assert summary == one.run(world=1).summaries[0]
    floors = result.values("velocity_rms_error_rad_s", "floor_accel")
    assert np.isnan(floors).tolist() == [False, True]
    table = result.table().to_pylist()
    assert [row["velocity_rms_error_rad_s"] is None for row in table if row["observer"] == "floor_accel"] == [0, 1]


@pytest.mark.slow
def test_four_mg_cost_gyro_free_what_as_much_noise_costs() -> None:
    """4 mg behind no low-pass are to samples at 200 Hz as white as 400 ug/rtHz are: the error grows by root two."""
    still, vibrating = (
        experiment("duration_s=6.0", f"sensors.accelerometer.vibration_mg={rms}").run_many(4) for rms in (0, 4)
    )
    errors = [result.values("velocity_rms_error_rad_s").mean() for result in (still, vibrating)]
    assert errors[1] / errors[0] == pytest.approx(math.sqrt(2.0), rel=0.12)


@pytest.mark.parametrize(
    "setting",
    [
        "vibration_mg=-1",
        "vibration_band_hz=[500, 20]",
        "vibration_band_hz=[0, 20]",
        "wheel_harmonics_mg=[1, -1]",
        f"wheel_harmonics_mg={[1.0] * 21}",
        "wheel_harmonics_mg=3",
    ],
)
def test_what_does_not_vibrate_is_refused(setting: str) -> None:
    with pytest.raises(InputError, match=rf"^.*sensors\.accelerometer\.{setting.partition('=')[0]}\b"):
        load_scenario("push_recovery", [f"sensors.accelerometer.{setting}"])

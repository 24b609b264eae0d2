"""The sensors' noise that observers assume."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

from cmg_mj.core.tilt import TiltNoise
from cmg_mj.core.types import STANDARD_GRAVITY
from cmg_mj.errors import InputError
from cmg_mj.replay.logs import Log
from cmg_mj.replay.logs.white_noise import LogNoise, WhiteNoise
from cmg_mj.replay.parameter_options import numbers
from cmg_mj.sensors.accelerometer import Accelerometer
from cmg_mj.sensors.encoder import Encoder

TILT_NOISE_DEG = 0.1
"""Assumed noise of a tilt from an unknown sensor: standard deviation of one sample [deg]."""
ACCELERATION_NOISE_RAD_S2 = 1.0
"""Assumed noise of an angular acceleration that does not come from two accelerometers [rad/s^2]."""
NOISE_DENSITY_UG_RTHZ = 400.0
"""Assumed noise density of two accelerometers, the bench's own [ug/sqrt(Hz)]."""
NOISES = ("accelerometer", "tilt", "acceleration")
"""Names of `--noise`."""


def noise_of(log: Log, noises: Mapping[str, float] | None = None) -> TiltNoise:
    """Return the noise of a log's sensors that observers assume: the user's, else the log's own, else a default.

    Args:
        log: With two accelerometers, both noises follow from a given density, and the resolution is the bench's.
        noises: Noises from `noise_numbers` that replace the log's.

    Returns:
        The noise of tilt and acceleration, and their correlation.

    Raises:
        InputError: A noise belongs to another sensor than the log's.
    """
    noises, estimate = noises or {}, noise_in(log)
    if log.tilt is not None:
        if {"tilt", "acceleration"} & noises.keys():
            raise InputError("--noise: for two accelerometers give accelerometer [ug/rtHz]; the others follow from it")
        gimbal = Encoder().sample_sigma
        if isinstance(estimate.tilt, WhiteNoise) and not noises:
            if isinstance(estimate.acceleration, WhiteNoise):
                tilt, acceleration = estimate.tilt.sigma, estimate.acceleration.sigma
                return TiltNoise(tilt, acceleration, estimate.correlation, gimbal)
            sigma = estimate.tilt.sigma / log.tilt.noise(1.0, STANDARD_GRAVITY).tilt
            return dataclasses.replace(log.tilt.noise(sigma, STANDARD_GRAVITY), gimbal=gimbal)
        density = noises.get("accelerometer", NOISE_DENSITY_UG_RTHZ)
        sensor = Accelerometer(rate_hz=_sampling_rate(log), noise_density_ug_rthz=density)
        return dataclasses.replace(log.tilt.noise(sensor.sample_sigma, STANDARD_GRAVITY), gimbal=gimbal)
    if "accelerometer" in noises:
        raise InputError("--noise accelerometer: the tilt is not that of two accelerometers; give tilt [deg]")
    tilt = _told_or_estimated(math.radians(noises.get("tilt", TILT_NOISE_DEG)), "tilt" in noises, estimate.tilt)
    acceleration = noises.get("acceleration", ACCELERATION_NOISE_RAD_S2)
    acceleration = _told_or_estimated(acceleration, "acceleration" in noises, estimate.acceleration)
    correlation = 0.0 if {"tilt", "acceleration"} <= noises.keys() else estimate.correlation
    return TiltNoise(tilt, acceleration, correlation, Encoder().sample_sigma)


def _told_or_estimated(value: float, is_told: bool, estimate: WhiteNoise | str | None) -> float:
    return estimate.sigma if isinstance(estimate, WhiteNoise) and not is_told else value


def noise_in(log: Log) -> LogNoise:
    """Return the white noise of one sample of a log, as its rows show it.

    Resampling to a quicker rate keeps the density at low frequencies: white noise of that density is larger, sample for
    sample, than that of the rows. A spline at a slower rate lets all of a row's noise through.

    Args:
        log: The log. The recording of a run is not looked at: its sensors' noise is known.

    Returns:
        The noise, or why it cannot be told.
    """
    noise = log.white_noise
    if noise is None:
        return LogNoise("the sensors are known", None, 0.0)
    factor = math.sqrt(max(1.0, (log.row_period_s or log.dt) / log.dt))

    def scaled(sigma: WhiteNoise | str) -> WhiteNoise | str:
        return WhiteNoise(*(factor * value for value in sigma)) if isinstance(sigma, WhiteNoise) else sigma

    acceleration = None if noise.acceleration is None else scaled(noise.acceleration)
    return LogNoise(scaled(noise.tilt), acceleration, noise.correlation)


def noise_numbers(text: str) -> dict[str, float]:
    """Parse `--noise tilt=0.05,acceleration=2` [ug/rtHz, deg, rad/s^2]."""
    noises = numbers(text, "--noise", NOISES) if text.strip() else {}
    for name, value in noises.items():
        if not value > 0.0:
            raise InputError(f"--noise {name}={value:g}: must be greater than 0")
    return noises


def density_of(log: Log, tilt: float) -> float:
    """Return the density of two accelerometers that makes a noise of the tilt of one sample [ug/sqrt(Hz)].

    Args:
        log: A log of two accelerometers.
        tilt: Standard deviation [rad].
    """
    assert log.tilt is not None
    sigma = tilt / log.tilt.noise(1.0, STANDARD_GRAVITY).tilt
    return sigma / (1e-6 * STANDARD_GRAVITY * math.sqrt(_sampling_rate(log) / 2.0))


def _sampling_rate(log: Log) -> float:
    """Return the rate whose white noise of a density is that of a sample: the rows' own if samples are slower [Hz]."""
    period = log.row_period_s or log.dt
    return 1.0 / period if log.dt > 1.000001 * period else 1.0 / log.dt

"""The sensors' noise that observers assume."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

from cmg_mj.errors import InputError
from cmg_mj.replay.logs import Log
from cmg_mj.replay.parameter_options import numbers
from cmg_mj.sensors.accelerometer import STANDARD_GRAVITY, Accelerometer
from cmg_mj.sensors.encoder import Encoder
from cmg_mj.sensors.tilt import TiltNoise

TILT_NOISE_DEG = 0.1
"""Assumed noise of a tilt from an unknown sensor: standard deviation of one sample [deg]."""
ACCELERATION_NOISE_RAD_S2 = 1.0
"""Assumed noise of an angular acceleration that does not come from two accelerometers [rad/s^2]."""
NOISE_DENSITY_UG_RTHZ = 400.0
"""Assumed noise density of two accelerometers, the bench's own [ug/sqrt(Hz)]."""
NOISES = ("accelerometer", "tilt", "acceleration")
"""Names of `--noise`."""


def noise_of(
    log: Log,
    *,
    accelerometer_ug_rthz: float | None = None,
    tilt_deg: float | None = None,
    acceleration_rad_s2: float | None = None,
) -> TiltNoise:
    """Return the sensors' noise that observers are told.

    Args:
        log: With two accelerometers, both noises follow from theirs.
        accelerometer_ug_rthz: Noise density of the accelerometers [ug/sqrt(Hz)]; their resolution is the bench's.
        tilt_deg: One sample's standard deviation of another tilt [deg].
        acceleration_rad_s2: One sample's of another angular acceleration [rad/s^2].

    Returns:
        The noise of tilt and acceleration, and their correlation.
    """
    if log.tilt is not None:
        density = NOISE_DENSITY_UG_RTHZ if accelerometer_ug_rthz is None else accelerometer_ug_rthz
        sensor = Accelerometer(rate_hz=1.0 / log.dt, noise_density_ug_rthz=density)
        return dataclasses.replace(log.tilt.noise(sensor.sample_sigma, STANDARD_GRAVITY), gimbal=Encoder().sample_sigma)
    tilt = TILT_NOISE_DEG if tilt_deg is None else tilt_deg
    acceleration = ACCELERATION_NOISE_RAD_S2 if acceleration_rad_s2 is None else acceleration_rad_s2
    return TiltNoise(math.radians(tilt), acceleration, 0.0, Encoder().sample_sigma)


def noise_numbers(text: str) -> dict[str, float]:
    """Parse `--noise tilt=0.05,acceleration=2` [ug/rtHz, deg, rad/s^2]."""
    noises = numbers(text, "--noise", NOISES) if text.strip() else {}
    for name, value in noises.items():
        if not value > 0.0:
            raise InputError(f"--noise {name}={value:g}: must be greater than 0")
    return noises


def noise_from(log: Log, noises: Mapping[str, float]) -> TiltNoise | None:
    """Return the noise of a user's log from `noise_numbers`; None without any."""
    if not noises:
        return None
    if log.tilt is not None and ({"tilt", "acceleration"} & noises.keys()):
        raise InputError("--noise: for two accelerometers give accelerometer [ug/rtHz]; the others follow from it")
    if log.tilt is None and "accelerometer" in noises:
        raise InputError("--noise accelerometer: the tilt is not that of two accelerometers; give tilt [deg]")
    return noise_of(
        log,
        accelerometer_ug_rthz=noises.get("accelerometer"),
        tilt_deg=noises.get("tilt"),
        acceleration_rad_s2=noises.get("acceleration"),
    )

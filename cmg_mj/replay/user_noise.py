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


def noise_of(log: Log, noises: Mapping[str, float] | None = None) -> TiltNoise:
    """Return the noise of a log's sensors that observers assume.

    Args:
        log: With two accelerometers, both noises follow from theirs, whose resolution is the bench's.
        noises: Noises from `noise_numbers` that replace the assumed ones.

    Returns:
        The noise of tilt and acceleration, and their correlation.

    Raises:
        InputError: A noise belongs to another sensor than the log's.
    """
    noises = noises or {}
    if log.tilt is not None:
        if {"tilt", "acceleration"} & noises.keys():
            raise InputError("--noise: for two accelerometers give accelerometer [ug/rtHz]; the others follow from it")
        density = noises.get("accelerometer", NOISE_DENSITY_UG_RTHZ)
        sensor = Accelerometer(rate_hz=1.0 / log.dt, noise_density_ug_rthz=density)
        return dataclasses.replace(log.tilt.noise(sensor.sample_sigma, STANDARD_GRAVITY), gimbal=Encoder().sample_sigma)
    if "accelerometer" in noises:
        raise InputError("--noise accelerometer: the tilt is not that of two accelerometers; give tilt [deg]")
    acceleration = noises.get("acceleration", ACCELERATION_NOISE_RAD_S2)
    return TiltNoise(math.radians(noises.get("tilt", TILT_NOISE_DEG)), acceleration, 0.0, Encoder().sample_sigma)


def noise_numbers(text: str) -> dict[str, float]:
    """Parse `--noise tilt=0.05,acceleration=2` [ug/rtHz, deg, rad/s^2]."""
    noises = numbers(text, "--noise", NOISES) if text.strip() else {}
    for name, value in noises.items():
        if not value > 0.0:
            raise InputError(f"--noise {name}={value:g}: must be greater than 0")
    return noises

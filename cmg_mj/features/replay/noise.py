"""What observers assume of a log's noise: the user's, the log's own, the rig file's, or a default."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.core.types import STANDARD_GRAVITY
from cmg_mj.features.replay.log import Log, WhiteNoise
from cmg_mj.features.replay.white_noise import (
    FLOORS,
    MIN_ROWS,
    SEGMENT,
    TAPS,
    smallest_step,
    steady_segments,
    transforms,
    upper_columns,
    white_floor,
    without_motion,
)
from cmg_mj.observers.parameter_options import numbers
from cmg_mj.results.summary_keys import SummaryValue
from cmg_mj.results.trajectory import GYRO
from cmg_mj.sensors.accelerometer import Accelerometer, Encoder
from cmg_mj.sensors.gyros import MemsGyro

TILT_NOISE_DEG = 0.1
"""Assumed noise of a tilt from an unknown sensor: standard deviation of one sample [deg]."""
ACCELERATION_NOISE_RAD_S2 = 1.0
"""Assumed noise of an angular acceleration that does not come from two accelerometers [rad/s^2]."""
NOISE_DENSITY_UG_RTHZ = 400.0
"""Assumed noise density of two accelerometers, the bench's own [ug/sqrt(Hz)]."""
APART = 1.5
"""Ratio of the noise that is used and the noise that the log shows, from which it is reported."""


def noise_of(log: Log, noises: Mapping[str, float] | None = None) -> MeasurementNoise:
    """Return the noise of a log's sensors that observers assume: see `_without_gyro`; the gyro's if it has one.

    The walk of the gyro's bias is the datasheet's of the bench's cheap gyro: no log of minutes tells it.
    """
    noises = dict(noises or {})
    given = noises.pop("gyro", None)
    if given is not None and "gyro" not in log.has:
        raise InputError("--noise gyro: the log has no gyro; name its column, --columns gyro=...")
    noise = _without_gyro(log, noises)
    if "gyro" not in log.has:
        return noise
    density = gyro_noise(log)[0] if given is None else math.radians(given)
    return replace(noise, gyro=density, gyro_walk=MemsGyro().flicker_floor)


def gyro_noise(log: Log) -> tuple[float, str]:
    """Return the density of the white noise of a log's gyro [rad/s/sqrt(Hz)], and its origin in words.

    Without a white floor (vibration, resolution) it is that of the upper band, which is no less than the noise.
    """
    residuals = [
        without_motion(np.arange(part.stop - part.start), log[GYRO][part])
        for part in log.parts
        if part.stop - part.start >= 2 * TAPS + SEGMENT
    ]
    if sum(map(len, residuals)) < MIN_ROWS:
        return math.radians(MemsGyro().noise_density_deg_s_rthz), "the datasheet's of a cheap one: the log is short"
    power = np.concatenate([np.abs(transforms(residual[None])[0]) ** 2 for residual in residuals])
    floor = white_floor(1.0, power, smallest_step(log[GYRO]), float(np.std(log[GYRO])))
    if isinstance(floor, str):
        upper = math.sqrt(float(power[steady_segments(power)][:, upper_columns(FLOORS[-1][0])].mean()))
        return upper * math.sqrt(2.0 * log.dt), f"that of the log's upper band, for {floor}"
    origin = f"that of the log's upper band, for {floor.doubt}" if floor.doubt else "the log's white floor"
    return floor.sigma * math.sqrt(2.0 * log.dt), origin


def _without_gyro(log: Log, noises: Mapping[str, float]) -> MeasurementNoise:
    """Return the noise of a log's sensors that observers assume: the user's, the log's, the rig file's, or a default.

    Args:
        log: With two accelerometers, both noises follow from a given density, and the resolution is the bench's.
        noises: Noises from `noise_numbers` that replace the log's.

    Returns:
        The noise of tilt and acceleration, and their correlation.

    Raises:
        InputError: A noise belongs to another sensor than the log's.
    """
    shown, gimbal = log.white_noise, Encoder().sample_sigma
    own = {name: noise.sigma for name, noise in shown._asdict().items() if isinstance(noise, WhiteNoise)}
    placed = log.options.rig.accelerometer
    known = log.tilt is not None and placed and all(one.noise_m_s2 for one in placed)
    if known and not noises and len(own) < 2:
        angle = math.radians(log.options.rig.angle_noise_deg or TILT_NOISE_DEG)
        assert log.tilt is not None
        return replace(log.tilt.noise(angle), gimbal=gimbal)
    if log.tilt is None or log.tilt.has_angle:
        if "accelerometer" in noises:
            raise InputError("--noise accelerometer: the tilt is not that of two accelerometers; give tilt [deg]")
        given = {name: math.radians(size) if name == "tilt" else size for name, size in noises.items()}
        sizes = {"tilt": math.radians(TILT_NOISE_DEG), "acceleration": ACCELERATION_NOISE_RAD_S2, **own, **given}
        return MeasurementNoise(**sizes, correlation=0.0 if len(given) > 1 else shown.correlation, gimbal=gimbal)
    if noises.keys() - {"accelerometer"}:
        raise InputError("--noise: for two accelerometers give accelerometer [ug/rtHz]; the others follow from it")
    if "tilt" not in own or noises:
        density = noises.get("accelerometer", NOISE_DENSITY_UG_RTHZ)
        sigma = Accelerometer(rate_hz=_sampling_rate(log), noise_density_ug_rthz=density).sample_sigma
    elif "acceleration" not in own:
        sigma = own["tilt"] / log.tilt.noise().tilt
    else:
        return MeasurementNoise(**own, correlation=shown.correlation, gimbal=gimbal)
    return replace(log.tilt.scaled(sigma).noise(), gimbal=gimbal)


def noise_numbers(text: str) -> dict[str, float]:
    """Parse `--noise tilt=0.05,acceleration=2` [ug/rtHz, deg, rad/s^2]."""
    noises = numbers(text, "--noise", ("accelerometer", "tilt", "acceleration", "gyro")) if text.strip() else {}
    for name, value in noises.items():
        if not value > 0.0:
            raise InputError(f"--noise {name}={value:g}: must be greater than 0")
    return noises


def _sampling_rate(log: Log) -> float:
    """Return the rate whose white noise of a density is that of a sample: the rows' own if samples are slower [Hz]."""
    period = log.row_period_s or log.dt
    return 1.0 / period if log.dt > 1.000001 * period else 1.0 / log.dt


def noise_remarks(log: Log, noise: MeasurementNoise) -> list[str]:
    """Describe the noise that observers assume, and what the log shows.

    Args:
        log: The log.
        noise: The noise of one sample that observers assume.

    Returns:
        A line for each noise; none for a run's recording, whose sensors are known.
    """
    if log.scenario is not None:
        return []
    shown = log.white_noise
    if log.tilt is not None and not log.tilt.has_angle:
        density = 1e-6 * STANDARD_GRAVITY * math.sqrt(_sampling_rate(log) / 2.0)
        of_tilt = 1.0 / (log.tilt.noise().tilt * density)
        return [_remark("accelerometer", noise.tilt, shown.tilt, of_tilt, "ug/rtHz"), *_gyro_remark(log, noise)]
    lines = [_remark("tilt", noise.tilt, shown.tilt, math.degrees(1.0), "deg")]
    if shown.acceleration is not None:
        lines.append(_remark("acceleration", noise.acceleration, shown.acceleration, 1.0, "rad/s^2"))
    return [*lines, *_gyro_remark(log, noise)]


def _gyro_remark(log: Log, noise: MeasurementNoise) -> list[str]:
    """Describe the noise of a gyro, if the log has one."""
    if "gyro" not in log.has:
        return []
    (shown, origin), used = gyro_noise(log), f"{math.degrees(noise.gyro):.3g} deg/s/rtHz is used"
    if noise.gyro == shown:
        return [f"Noise of the gyro: {used}: {origin}."]
    return [f"Noise of the gyro: {used}; {math.degrees(shown):.3g} is {origin}."]


def _remark(name: str, used: float, shown: WhiteNoise | str, factor: float, unit: str) -> str:
    """Describe one noise of `--noise`, converted by a factor to its unit."""
    start = f"Noise of the {name}: {factor * used:.3g} {unit} is used; the log"
    if isinstance(shown, str):
        return f"{start} cannot tell: {shown}."
    sigma, low, high = (factor * size for size in shown[:3])
    remark = f"{start} shows {sigma:.3g} ({low:.3g} to {high:.3g})"
    if shown.doubt:
        remark = f"{start}'s upper band shows {sigma:.3g}, but {shown.doubt}"
    if 1.0 / APART < shown.sigma / used < APART:
        return f"{remark}."
    return f"{remark}: give --noise {name}={sigma:.3g}, or no {name} for the log's own."


def noise_figures(log: Log, noise: MeasurementNoise) -> dict[str, SummaryValue]:
    """Return the noise that a log shows as `--json` prints it; nothing for a run's recording."""
    if log.scenario is not None:
        return {}
    shown = log.white_noise
    figures: dict[str, SummaryValue] = {"tilt_rad": _figures(shown.tilt, noise.tilt)}
    if shown.acceleration is not None:
        figures["acceleration_rad_s2"] = _figures(shown.acceleration, noise.acceleration)
        figures["correlation"] = shown.correlation
    return {"noise_by_the_log": figures}


def _figures(shown: WhiteNoise | str, used: float) -> dict[str, SummaryValue]:
    if isinstance(shown, str):
        return {"sigma": None, "reason": shown, "used": False}
    return {**shown._asdict(), "used": math.isclose(used, shown.sigma, rel_tol=1e-9)}

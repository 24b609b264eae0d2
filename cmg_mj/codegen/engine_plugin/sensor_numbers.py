"""Describes sensors as the plugin's C takes them: the same numbers that `cmg_mj.sensors` computes with."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypedDict

import numpy as np

from cmg_mj.core.noise import CORNERS_HZ, NoiseStream, spread_of
from cmg_mj.core.sensor import steps_until, whole_steps
from cmg_mj.core.types import STANDARD_GRAVITY
from cmg_mj.sensors.accelerometer import Accelerometer
from cmg_mj.sensors.encoder import Encoder
from cmg_mj.sensors.fog import Fog
from cmg_mj.sensors.mems_gyro import PIECE, MemsGyro
from cmg_mj.stages.low_pass import INSIDE_HZ


def steps_of(duration: float, timestep: float) -> int:
    """Count the physics steps of a time of a sensor."""
    return whole_steps(duration, timestep, "a sensor's time", f"{duration:g} s")


@dataclass(frozen=True)
class Delivery:
    """`delivery_type` in C."""

    width: int
    latency: int
    capacity: int


@dataclass(frozen=True)
class Pair:
    """`pair_type` in C."""

    noise_stream: int
    flicker_stream: int
    spacing: int
    period: int
    raw: int
    skew: int
    settling: int
    outer_capacity: int
    limit: float
    is_distorted: int
    by_same: Sequence[float]
    by_other: Sequence[float]
    offset: Sequence[float]
    is_filtered: int
    b: Sequence[float]
    a: Sequence[float]
    has_flicker: int
    flicker_sigma: float
    decay: Sequence[float]
    spread: Sequence[float]
    delivery: Delivery


@dataclass(frozen=True)
class Encoders:
    """`encoder_type` in C."""

    period: int
    delivery: Delivery


@dataclass(frozen=True)
class FogNumbers:
    """`fog_type` in C."""

    stream: int
    period: int
    share: float
    bias: float
    sigma: float
    limit: float
    delivery: Delivery


@dataclass(frozen=True)
class TurnGyro:
    """`turn_gyro_type` in C."""

    stream: int
    resting: int
    piece: int
    sigma: float
    limit: float
    step: float
    scale: float
    bias: float
    flicker_sigma: float
    decay: Sequence[float]
    spread: Sequence[float]


@dataclass(frozen=True)
class Settings:
    """`sensor_settings` in C."""

    force_sigma: float
    force_step: float
    angle_step: float


class Clock(NamedTuple):
    """Counts times in instants."""

    timestep: float
    steps: int
    """Physics steps between two instants."""
    period: int
    """Physics steps between two decisions."""

    def count(self, duration: float) -> int:
        """Count the instants of a duration that is a multiple of them [s]."""
        return steps_of(duration, self.timestep) // self.steps

    def delivery(self, width: int, rate_hz: float, latency_s: float) -> Delivery:
        """Describe how a sensor's samples of so many numbers are delivered."""
        latency = -(-steps_until(latency_s, self.timestep) // self.steps)
        on_the_way = latency + self.period // self.steps
        return Delivery(width, latency, on_the_way // max(1, self.count(1.0 / rate_hz)) + 2 if latency else 0)


def describe_pair(sensor: Accelerometer, axis: int, clock: Clock) -> Pair:
    """Describe the accelerometers of an axis, with the numbers that `Accelerometer` computes with."""
    period, skew = clock.count(1.0 / sensor.rate_hz), clock.count(sensor.skew_s)
    raw = clock.count(1.0 / INSIDE_HZ) if sensor.bandwidth_hz else period
    uneven = bool(sensor.skew_s or sensor.bandwidth_hz)
    same, other, offset = _weights(sensor)
    return Pair(
        noise_stream=NoiseStream.ACCELEROMETER.on_axis(axis),
        flicker_stream=NoiseStream.FLICKER.on_axis(axis),
        spacing=math.gcd(period, raw, skew) if uneven else period,
        period=period,
        raw=raw,
        skew=skew,
        settling=math.ceil(2.0 * INSIDE_HZ / sensor.bandwidth_hz) if sensor.bandwidth_hz else 0,
        outer_capacity=-(-skew // raw) + 2 if skew else 0,
        limit=sensor.range_g * STANDARD_GRAVITY,
        is_distorted=int(same != [1.0] * 4 or other != [0.0] * 4),
        by_same=same,
        by_other=other,
        offset=offset,
        is_filtered=int(bool(sensor.bandwidth_hz)),
        **_low_pass(sensor),
        has_flicker=int(bool(sensor.bias_instability_ug)),
        **_flicker(sensor.flicker_floor, 1.0 / sensor.raw_rate_hz),
        delivery=clock.delivery(4, sensor.rate_hz, sensor.latency_s),
    )


def _weights(sensor: Accelerometer) -> tuple[list[float], list[float], list[float]]:
    """Compute each channel's weights of its own and the other axis, and its offset: see `constant_errors`."""
    same, other = sensor.mounting_weights()
    inner, outer = sensor.bias
    return same, other, [inner, 0.0, outer, 0.0]


class LowPassNumbers(TypedDict):
    """Coefficients of the low-pass in C."""

    b: Sequence[float]
    a: Sequence[float]


def _low_pass(sensor: Accelerometer) -> LowPassNumbers:
    """Compute the coefficients of the low-pass."""
    if not sensor.bandwidth_hz:
        return {"b": (0.0, 0.0, 0.0), "a": (0.0, 0.0, 0.0)}
    from scipy.signal import butter  # 1 s of import, which only a part with a low-pass needs

    b, a = np.array(butter(2, sensor.bandwidth_hz, fs=INSIDE_HZ)).tolist()  # as `low_pass` has them
    return {"b": b, "a": a}


def describe_encoders(sensor: Encoder, gimbals: int, clock: Clock) -> Encoders:
    """Describe the encoders of an axis."""
    return Encoders(clock.count(1.0 / sensor.rate_hz), clock.delivery(gimbals, sensor.rate_hz, sensor.latency_s))


def describe_settings(accelerometer: Accelerometer, encoder: Encoder) -> Settings:
    """Describe what a model's <config> may change."""
    counts, turn = accelerometer.counts_per_g, encoder.counts_per_revolution
    return Settings(
        accelerometer.raw_sigma,
        STANDARD_GRAVITY / counts if counts else 0.0,
        2.0 * math.pi / turn if turn else 0.0,
    )


def describe_fog(sensor: Fog, axis: int, clock: Clock) -> FogNumbers:
    """Describe the fibre-optic gyro of an axis, with the numbers that `Fog` computes with."""
    return FogNumbers(
        stream=NoiseStream.FOG.on_axis(axis),
        period=clock.count(1.0 / sensor.rate_hz),
        share=1.0 - math.exp(-2.0 * math.pi * sensor.bandwidth_hz / sensor.rate_hz) if sensor.bandwidth_hz else 1.0,
        bias=math.radians(sensor.bias_deg_h) / 3600.0,
        sigma=sensor.white_noise_sigma,
        limit=math.radians(sensor.range_deg_s),
        delivery=clock.delivery(1, sensor.rate_hz, sensor.latency_s),
    )


def describe_turn_gyro(gyro: MemsGyro, dt: float) -> TurnGyro:
    """Describe the gyro about the vertical, read every dt [s], with the numbers that `MemsGyro` computes with."""
    return TurnGyro(
        stream=NoiseStream.TURN_GYRO,
        resting=round(gyro.calibration_s / dt),
        piece=PIECE,
        sigma=gyro.white_noise_sigma(dt),
        limit=math.radians(gyro.range_deg_s),
        step=math.radians(1.0 / gyro.counts_per_deg_s) if gyro.counts_per_deg_s else 0.0,
        scale=1.0 + gyro.scale_error,
        bias=math.radians(gyro.bias_deg_s),
        **_flicker(gyro.flicker_floor, dt),
    )


class FlickerNumbers(TypedDict):
    """Numbers of 1/f noise in C."""

    flicker_sigma: float
    decay: Sequence[float]
    spread: Sequence[float]


def _flicker(floor: float, dt: float) -> FlickerNumbers:
    """Compute the numbers of 1/f noise, as `Flicker` does."""
    sigma, decay = spread_of(floor), np.exp(-2.0 * math.pi * np.array(CORNERS_HZ) * dt)
    return {"flicker_sigma": sigma, "decay": decay.tolist(), "spread": (sigma * np.sqrt(1.0 - decay**2)).tolist()}

"""Describes a rig and its controllers as the plugin's C takes them, and refuses what that C does not have."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cmg_mj.controllers.controller import Controller
from cmg_mj.errors import InputError
from cmg_mj.sensors.accelerometer import INSIDE_HZ, STANDARD_GRAVITY, Accelerometer
from cmg_mj.sensors.encoder import Encoder
from cmg_mj.sensors.flicker_noise import CORNERS_HZ, spread_of
from cmg_mj.sensors.noise_streams import NoiseStream
from cmg_mj.sensors.timing import steps_until, whole_steps

MOST_GIMBALS = 8
MOST_ESTIMATES = 64
LARGEST_SEED = 2**53
"""Seeds and worlds lie in the plugin's state, whose numbers are doubles."""


class PluginModule(NamedTuple):
    """A module of an axis."""

    name: str
    """What its elements' names begin with, such as `cube1` or `roll/cube1`."""
    direction: float
    """Sign of u that its gimbal is given."""
    speed: float
    """Of its flywheel [rad/s]."""


@dataclass(frozen=True)
class PluginAxis:
    """An axis of a rig, with its controller.

    Attributes:
        prefix: What its sensors' names begin with: empty, or `AXIS/`.
        modules: Its modules.
        controller: Its controller.
    """

    prefix: str
    modules: tuple[PluginModule, ...]
    controller: Controller


@dataclass(frozen=True)
class PluginRig:
    """A rig with its controllers.

    Attributes:
        axes: The axes.
        plugin: Name under which MuJoCo knows the plugin.
    """

    axes: tuple[PluginAxis, ...]
    plugin: str

    @property
    def instant_steps(self) -> int:
        """Physics steps between the instants at which a sensor or the controller may be due."""
        spacings = [step for axis in self.axes for step in _sampling_steps(axis.controller)]
        return math.gcd(self.axes[0].controller.period, *spacings)

    @property
    def instant(self) -> float:
        """The time between these instants [s]."""
        return self.instant_steps * self.axes[0].controller.timestep

    def refuse_unsupported(self) -> None:
        """Refuse by name what the plugin does not have.

        Raises:
            InputError: It does not have something that is in use.
        """
        if len(self.axes) > 1:
            raise InputError("a plugin holds one axis until now; lock the others with plant.locked_axes")
        for axis in self.axes:
            controller = axis.controller
            if controller.feedback != "observer":
                raise InputError(
                    f"controller.feedback = {controller.feedback!r}: the plugin has the observer's rate alone"
                )
            if len(axis.modules) > MOST_GIMBALS:
                raise InputError(f"{len(axis.modules)} modules on an axis: a plugin takes at most {MOST_GIMBALS}")
            if 3 + len(controller.extra_signals[0]) > MOST_ESTIMATES:
                raise InputError(f"an estimate of more than {MOST_ESTIMATES} parts: a plugin takes no more")
            if not isinstance(controller.worlds, int):
                raise InputError("a plugin is made from the controller of one world")
            for name, number in (("seed", controller.seed), ("world", controller.worlds)):
                if not 0 <= number <= LARGEST_SEED:
                    raise InputError(f"{name} = {number}: a plugin takes {name}s from 0 to 2^53")


def _sampling_steps(controller: Controller) -> tuple[int, ...]:
    """Physics steps that divide all instants at which accelerometers and encoders are due."""
    sensors, h = controller.sensors, controller.timestep
    pair = sensors.accelerometer
    steps = [_steps(1.0 / pair.rate_hz, h), _steps(1.0 / sensors.encoder.rate_hz, h)]
    if pair.bandwidth_hz:
        steps.append(_steps(1.0 / INSIDE_HZ, h))
    return *steps, _steps(pair.skew_s, h)


def _steps(duration: float, timestep: float) -> int:
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
    uneven: int
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
        return _steps(duration, self.timestep) // self.steps

    def delivery(self, width: int, rate_hz: float, latency_s: float) -> Delivery:
        """Describe how a sensor's samples of so many numbers are delivered."""
        latency = -(-steps_until(latency_s, self.timestep) // self.steps)
        on_the_way = latency + self.period // self.steps
        return Delivery(width, latency, on_the_way // max(1, self.count(1.0 / rate_hz)) + 2 if latency else 0)


def make_clock(rig: PluginRig) -> Clock:
    """Make the clock of a rig."""
    controller = rig.axes[0].controller
    return Clock(controller.timestep, rig.instant_steps, controller.period)


def describe_pair(sensor: Accelerometer, axis: int, clock: Clock) -> Pair:
    """Describe the accelerometers of an axis, with the numbers that `Accelerometer` computes with."""
    period, skew = clock.count(1.0 / sensor.rate_hz), clock.count(sensor.skew_s)
    raw = clock.count(1.0 / INSIDE_HZ) if sensor.bandwidth_hz else period
    uneven = bool(sensor.skew_s or sensor.bandwidth_hz)
    decay = np.exp(-2.0 * math.pi * np.array(CORNERS_HZ) * (1.0 / sensor.raw_rate_hz))
    flicker_sigma = spread_of(sensor.flicker_floor)
    same, other, offset = _weights(sensor)
    return Pair(
        noise_stream=NoiseStream.ACCELEROMETER.on_axis(axis),
        flicker_stream=NoiseStream.FLICKER.on_axis(axis),
        spacing=math.gcd(period, raw, skew) if uneven else period,
        period=period,
        raw=raw,
        skew=skew,
        uneven=int(uneven),
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
        flicker_sigma=flicker_sigma,
        decay=decay.tolist(),
        spread=(flicker_sigma * np.sqrt(1.0 - decay**2)).tolist(),
        delivery=clock.delivery(4, sensor.rate_hz, sensor.latency_s),
    )


def _weights(sensor: Accelerometer) -> tuple[list[float], list[float], list[float]]:
    """Compute each channel's weights of its own and the other axis, and its offset: see `constant_errors`."""
    same, other = [], []
    parts = zip(sensor.scale_error, sensor.misalignment_deg, sensor.cross_axis, strict=True)
    for scale, misalignment, cross in parts:
        c, s = math.cos(math.radians(misalignment)), math.sin(math.radians(misalignment))
        same += [(1.0 + scale) * (c + cross * s), (1.0 + scale) * (c - cross * s)]
        other += [(1.0 + scale) * (cross * c - s), (1.0 + scale) * (cross * c + s)]
    inner, outer = sensor.bias
    return same, other, [inner, 0.0, outer, 0.0]


def _low_pass(sensor: Accelerometer) -> dict[str, Sequence[float]]:
    """Compute the coefficients of the low-pass."""
    if not sensor.bandwidth_hz:
        return {"b": (0.0, 0.0, 0.0), "a": (0.0, 0.0, 0.0)}
    from scipy.signal import butter  # 1 s of import, which only a part with a low-pass needs

    b, a = np.array(butter(2, sensor.bandwidth_hz, fs=INSIDE_HZ)).tolist()
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


def fields_of(value: Pair | Encoders | Settings | Delivery) -> dict[str, object]:
    """Return the fields of a description by name."""
    return {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}

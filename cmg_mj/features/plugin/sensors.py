"""Describes a rig's sensors and clock as the plugin's C takes them: the numbers that `cmg_mj.sensors` computes with."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from cmg_mj.core.axis import AxisControl
from cmg_mj.core.errors import InputError
from cmg_mj.core.noise import NoiseStream, spread_of, wander_shares
from cmg_mj.core.sensor import steps_until, whole_steps
from cmg_mj.core.types import STANDARD_GRAVITY, reads_gyro
from cmg_mj.sensors.accelerometer import Accelerometer
from cmg_mj.sensors.gyros import PIECE, Fog, MemsGyro
from cmg_mj.stages.low_pass import INSIDE_HZ, coefficients
from cmg_mj.stages.mounting_errors import PERFECT
from cmg_mj.stages.turning import YawCoupling

MAX_AXES = 4
MAX_GIMBALS = 8
MAX_ESTIMATES = 64
MAX_SEED = 2**53
"""Seeds and worlds lie in the plugin's state, whose numbers are doubles."""

Value = int | float | str | Sequence["Value"] | Mapping[str, "Value"]
"""A value in C; a mapping is a struct, by its fields."""
Struct = dict[str, Value]


class PluginAxis(NamedTuple):
    """An axis of a rig, with its controller.

    Attributes:
        prefix: What its sensors' names begin with: empty, or `AXIS/`.
        modules: A module's name, the sign of u that its gimbal is given, its flywheel's speed [rad/s], and the angle
            of its gimbal at which the flywheel's axis is upright [rad].
        joint: Name of the joint that it tilts about.
        shares: Of the joint's degrees of freedom in the tilt rate: of a hinge one, of a free joint those of the turn.
        controller: Its control.
    """

    prefix: str
    modules: tuple[tuple[str, float, float, float], ...]
    joint: str
    shares: tuple[float, ...]
    controller: AxisControl


class PluginRig(NamedTuple):
    """A rig with its controllers.

    Attributes:
        axes: The axes.
        plugin: Name under which MuJoCo knows the plugin.
        seed: Seed of its noise.
        world: The world whose noise it has.
        turning: The coupling of the axes in a turn, and the gyro that shows it; None if turns are not compensated.
    """

    axes: list[PluginAxis]
    plugin: str
    seed: int
    world: int
    turning: tuple[YawCoupling, MemsGyro] | None


def refuse_unsupported(rig: PluginRig) -> None:
    """Refuse by name what the plugin does not have.

    Raises:
        InputError: It does not have something that is in use.
    """
    counts = [(len(rig.axes), "axes", MAX_AXES)]
    counts += [(len(axis.modules), "modules on an axis", MAX_GIMBALS) for axis in rig.axes]
    counts += [(3 + len(axis.controller.extra_signals[0]), "estimates", MAX_ESTIMATES) for axis in rig.axes]
    for count, what, most in counts:
        if count > most:
            raise InputError(f"{count} {what}: a plugin takes at most {most}")
    check_noise(rig.seed, rig.world)


def check_noise(seed: float, world: float) -> None:
    """Refuse a seed or world that no plugin's state holds.

    Raises:
        InputError: It is out of range, or no whole number.
    """
    for name, number in (("seed", seed), ("world", world)):
        if not 0 <= number <= MAX_SEED or number != int(number):
            raise InputError(f"{name} = {number}: a plugin takes {name}s from 0 to 2^53, as whole numbers")


class Clock(NamedTuple):
    """Counts times in instants."""

    timestep: float
    steps: int
    """Physics steps between two instants."""
    period: int
    """Physics steps between two decisions."""

    @property
    def instant(self) -> float:
        """The time between two instants [s]."""
        return self.steps * self.timestep

    def count(self, duration: float) -> int:
        """Count the instants of a duration that is a multiple of them [s]."""
        return whole_steps(duration, self.timestep, "a sensor's time", f"{duration:g} s") // self.steps

    def delivery(self, width: int, rate_hz: float, latency_s: float) -> Struct:
        """Describe how a sensor's samples of so many numbers are delivered: `delivery_type` in C."""
        latency = -(-steps_until(latency_s, self.timestep) // self.steps)
        on_the_way = latency + self.period // self.steps
        capacity = on_the_way // max(1, self.count(1.0 / rate_hz)) + 2 if latency else 0
        return {"width": width, "latency": latency, "capacity": capacity}


def clock_of(rig: PluginRig) -> Clock:
    """Return the clock of a plugin, at whose instants a sensor or the controller may be due."""
    first = rig.axes[0].controller
    steps = Clock(first.timestep, 1, first.period)
    spacings = [first.period]
    for axis in rig.axes:
        sensors = axis.controller.sensors
        pair = sensors.accelerometer
        times = [1.0 / pair.rate_hz, 1.0 / sensors.encoder.rate_hz, pair.skew_s]
        times += [1.0 / INSIDE_HZ] if pair.bandwidth_hz else []
        times += [1.0 / sensors.fog.rate_hz] if axis.controller.feedback == "fog" else []
        spacings += map(steps.count, times)
    return steps._replace(steps=math.gcd(*spacings))


def describe_axis(axis: PluginAxis, clock: Clock) -> Struct:
    """Describe an axis but for its controller: `axis_type` in C."""
    controller = axis.controller
    pair, encoder, fog = controller.sensors.accelerometer, controller.sensors.encoder, controller.sensors.fog
    return {
        "prefix": axis.prefix,
        "gimbals": len(axis.modules),
        "modules": axis.modules,
        "pair": _describe_pair(pair, controller.number, clock),
        "encoder": {
            "period": clock.count(1.0 / encoder.rate_hz),
            "delivery": clock.delivery(len(axis.modules), encoder.rate_hz, encoder.latency_s),
        },
        "settings": {  # what a model's <config> may change
            "force_sigma": pair.raw_sigma,
            "force_step": pair.resolution,
            "angle_step": encoder.resolution,
        },
        **({"fog": _describe_fog(fog, controller.number, clock)} if controller.feedback == "fog" else {}),
        **({"mems_gyro": _describe_own_gyro(controller)} if reads_gyro(controller.observer) else {}),
        "raw_rate": pair.raw_rate_hz,
        "joint": axis.joint,
        "dofs": len(axis.shares),
        "shares": axis.shares,
    }


def _describe_pair(sensor: Accelerometer, axis: int, clock: Clock) -> Struct:
    """Describe the accelerometers of an axis: `pair_type` in C."""
    period, skew = clock.count(1.0 / sensor.rate_hz), clock.count(sensor.skew_s)
    raw = clock.count(1.0 / INSIDE_HZ) if sensor.bandwidth_hz else period
    uneven = bool(sensor.skew_s or sensor.bandwidth_hz)
    same, other = sensor.mounting_weights()
    inner, outer = sensor.bias
    b, a = coefficients(sensor.bandwidth_hz, INSIDE_HZ) if sensor.bandwidth_hz else [[0.0] * 3] * 2
    return {
        "noise_stream": NoiseStream.ACCELEROMETER.on_axis(axis),
        "flicker_stream": NoiseStream.FLICKER.on_axis(axis),
        "spacing": math.gcd(period, raw, skew) if uneven else period,
        "period": period,
        "raw": raw,
        "skew": skew,
        "settling": sensor.settle_samples,
        "outer_capacity": -(-skew // raw) + 2 if skew else 0,
        "limit": sensor.range_g * STANDARD_GRAVITY,
        "is_distorted": int((same, other) != PERFECT),
        "by_same": same,
        "by_other": other,
        "offset": [inner, 0.0, outer, 0.0],
        "is_filtered": int(bool(sensor.bandwidth_hz)),
        "b": b,
        "a": a,
        "has_flicker": int(bool(sensor.bias_instability_ug)),
        **_flicker(sensor.flicker_floor, 1.0 / sensor.raw_rate_hz),
        "delivery": clock.delivery(4, sensor.rate_hz, sensor.latency_s),
    }


def _describe_fog(sensor: Fog, axis: int, clock: Clock) -> Struct:
    """Describe the fibre-optic gyro of an axis: `fog_type` in C."""
    return {
        "stream": NoiseStream.FOG.on_axis(axis),
        "period": clock.count(1.0 / sensor.rate_hz),
        "share": sensor.step_share,
        "bias": math.radians(sensor.bias_deg_h) / 3600.0,
        "sigma": sensor.white_noise_sigma,
        "limit": math.radians(sensor.range_deg_s),
        "delivery": clock.delivery(1, sensor.rate_hz, sensor.latency_s),
    }


def _describe_own_gyro(controller: AxisControl) -> Struct:
    """Describe the cheap gyro of an axis, whose reading the observer takes."""
    streams = (stream.on_axis(controller.number) for stream in (NoiseStream.MEMS_GYRO, NoiseStream.MEMS_PART))
    return describe_mems_gyro(controller.sensors.mems_gyro, controller.law.dt, *streams)


def describe_mems_gyro(gyro: MemsGyro, dt: float, stream: int, part_stream: int = 0) -> Struct:
    """Describe a cheap gyro, read every dt [s]: `mems_gyro_type` in C."""
    return {
        "stream": stream,
        "part_stream": part_stream,
        "resting": gyro.resting_samples(dt),
        "piece": PIECE,
        "sigma": gyro.white_noise_sigma(dt),
        "limit": math.radians(gyro.range_deg_s),
        "step": math.radians(1.0 / gyro.counts_per_deg_s) if gyro.counts_per_deg_s else 0.0,
        "scale": 1.0 + gyro.scale_error,
        "bias": math.radians(gyro.bias_deg_s),
        "is_as_bought": int(gyro.reading == "as_bought"),
        "offset": math.radians(gyro.as_bought_offset_deg_s),
        "drift": math.radians(gyro.as_bought_drift_deg_s_k * gyro.warming_k_min / 60.0) * dt,
        **_flicker(gyro.flicker_floor, dt),
    }


def _flicker(floor: float, dt: float) -> Struct:
    """Return the numbers of 1/f noise."""
    decays, spreads = wander_shares(floor, dt)
    return {"flicker_sigma": spread_of(floor), "decay": decays, "spread": spreads}

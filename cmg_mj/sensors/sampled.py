"""What real sensors make of an ideal reading, and when they show it: encoders, gyro; rate, latency, skew.

The accelerometers are in `accelerometer.py`, the cheap gyro in `mems_gyro.py`.

Defaults are those of a datasheet class, named in each docstring. A value of zero for a resolution, a noise
or a bandwidth switches that effect off.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.elementwise import Scalar, clip, digitise, radians
from cmg_mj.inputs.field_types import STRICT, Instant, NonNegative, Positive, Rate
from cmg_mj.sensors.accelerometer import INSIDE_HZ, Accelerometer
from cmg_mj.sensors.flicker_noise import CORNERS_HZ, Flicker
from cmg_mj.sensors.ideal import IdealReading
from cmg_mj.sensors.mems_gyro import MemsGyro
from cmg_mj.sensors.timing import steps_until, whole_steps

FLICKER_STREAM = 4
"""The stream of the accelerometers' 1/f noise: 0 to 2 are the sensors' white noise, 3 is the cheap gyro's."""
STREAMS_PER_AXIS = 16
"""So many streams are an axis'."""


@dataclass(frozen=True, config=STRICT)
class Encoder:
    """The gimbals' absolute encoders (AS5045 in the Dynamixel MX-106: 12 bit).

    Attributes:
        rate_hz: Samples a second (the servo is polled once a control period).
        counts_per_revolution: Resolution; 0 for none.
        latency_s: From sampling to delivery [s].
    """

    rate_hz: Rate = 200.0
    counts_per_revolution: NonNegative = 4096.0
    latency_s: Instant = 0.0

    channels = 0

    @property
    def sample_sigma(self) -> float:
        """Of one reading from the angle, by the resolution [rad]."""
        return 2.0 * math.pi / self.counts_per_revolution / math.sqrt(12.0) if self.counts_per_revolution else 0.0

    def make_reading_function(self) -> Callable[[IdealReading, Sequence[Scalar]], Sequence[Scalar]]:
        """A function (ideal reading, nothing) -> gimbal angles [rad]."""
        if not self.counts_per_revolution:
            return lambda ideal, normal: ideal.gimbals
        step = 2.0 * math.pi / self.counts_per_revolution
        return lambda ideal, normal: [digitise(angle, math.inf, step) for angle in ideal.gimbals]


@dataclass(frozen=True, config=STRICT)
class Fog:
    """A fibre-optic gyro on the frame, along the tilt axis: what estimates are judged by on a real rig.

    The class of KVH's DSP-1750 (angle random walk 0.013 deg/rt(h), range 490 deg/s, bandwidth 440 Hz), with
    a margin on the noise.

    Attributes:
        rate_hz: Samples a second.
        angle_random_walk_deg_rth: White rate noise N; one sample's sigma is N * sqrt(rate).
        bias_deg_h: Constant offset [deg/h].
        bandwidth_hz: First-order low-pass, exact between samples; 0 for none.
        range_deg_s: Readings saturate here [deg/s].
        latency_s: From sampling to delivery [s].
    """

    rate_hz: Rate = 200.0
    angle_random_walk_deg_rth: NonNegative = 0.02
    bias_deg_h: float = 0.0
    bandwidth_hz: NonNegative = 440.0
    range_deg_s: Positive = 490.0
    latency_s: Instant = 0.0

    channels = 1

    @property
    def white_noise_sigma(self) -> float:
        """Standard deviation of one sample [rad/s]."""
        return radians(self.angle_random_walk_deg_rth) / 60.0 * math.sqrt(self.rate_hz)

    def make_reading_function(self) -> Callable[[IdealReading, Sequence[Scalar]], Scalar]:
        """A function (ideal reading, standard normals) -> tilt rate [rad/s]. It remembers its low-pass."""
        sigma = self.white_noise_sigma
        bias = math.radians(self.bias_deg_h) / 3600.0
        limit = math.radians(self.range_deg_s)
        # The share of a step that a first-order low-pass has taken after one sample period.
        share = 1.0 - math.exp(-2.0 * math.pi * self.bandwidth_hz / self.rate_hz) if self.bandwidth_hz else 1.0
        passed: Scalar = None

        def measure(ideal: IdealReading, normal: Sequence[Scalar]) -> Scalar:
            nonlocal passed
            passed = ideal.gyro if passed is None else passed + share * (ideal.gyro - passed)
            return clip(passed + bias + sigma * normal[0], -limit, limit)

        return measure


@dataclass(frozen=True, config=STRICT)
class Sensors:
    """The rig's sensors.

    Attributes:
        accelerometer: The two accelerometers of the tilt estimate.
        encoder: The gimbals' encoders.
        fog: The fibre-optic gyro.
        mems_gyro: A cheap gyro that estimates are judged beside; nothing else uses it.
    """

    accelerometer: Accelerometer = Field(default_factory=Accelerometer)
    encoder: Encoder = Field(default_factory=Encoder)
    fog: Fog = Field(default_factory=Fog)
    mems_gyro: MemsGyro = Field(default_factory=MemsGyro)


def normals(seed: int, worlds: int | Sequence[int], stream: int, channels: int) -> Iterator[Sequence[Scalar]]:
    """Standard normal numbers, sample after sample, that depend on (seed, world, stream) alone.

    Args:
        seed: The run's seed.
        worlds: The number of one world, on floats, or the numbers of many, on arrays.
        stream: Which sensor.
        channels: Numbers a sample.

    Yields:
        One sample: `channels` floats, or an array (channels, n_worlds).
    """
    block = 256  # drawing one by one costs more than the rest of a sensor
    single = isinstance(worlds, int)
    different, places = np.unique([worlds] if single else worlds, return_inverse=True)
    alone = np.array_equal(places, range(len(places)))  # every world once, in order
    generators = [
        np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(int(world), stream))) for world in different
    ]
    while True:
        drawn = np.stack([g.standard_normal((block, channels)) for g in generators], axis=-1)
        yield from drawn[:, :, 0].tolist() if single else drawn if alone else drawn[:, :, places]


class SampledSensor:
    """One sensor at work: it samples at its own rate and delivers after its latency.

    Args:
        sensor: What it is.
        timestep: Physics step [s].
        noise: Standard normals, a sample's at a time.
        where: The scenario's section.
        measure: What it makes of an ideal reading and a sample's normals; by default that of its datasheet.

    Attributes:
        steps_per_sample: Physics steps between the moments at which it may be due.
    """

    def __init__(
        self,
        sensor: Accelerometer | Encoder | Fog,
        timestep: float,
        noise: Iterator,
        where: str,
        measure: Callable[[IdealReading, Any], Any] | None = None,
    ) -> None:
        self.period = whole_steps(1.0 / sensor.rate_hz, timestep, f"{where}.rate_hz", f"{sensor.rate_hz:g} Hz")
        self.steps_per_sample = self.period
        self.latency = steps_until(sensor.latency_s, timestep)
        self._measure = measure or sensor.make_reading_function()
        self._noise = noise
        self._on_the_way: deque = deque()
        self._newest: Any = None
        self._delivered: Any = None

    def sample(self, step: int, ideal: IdealReading) -> None:
        """Take what is due, at a physics step that is a multiple of `steps_per_sample`, or at the first one."""
        self._newest = self._measure(ideal, next(self._noise))
        if self.latency:
            self._on_the_way.append((step + self.latency, self._newest))

    def read(self, step: int) -> Any:
        """The newest sample delivered by a physics step; before the start the rig stood still."""
        if not self.latency:
            return self._newest
        while self._on_the_way and (self._on_the_way[0][0] <= step or self._delivered is None):
            self._delivered = self._on_the_way.popleft()[1]
        return self._delivered


class UnevenPair(SampledSensor):
    """Two accelerometers at work that sample each at its own instants, or filter more samples than they deliver."""

    def __init__(
        self,
        sensor: Accelerometer,
        timestep: float,
        noise: Iterator,
        where: str,
        measure: Callable[[IdealReading, Any], Any] | None = None,
    ) -> None:
        super().__init__(sensor, timestep, noise, where, measure)
        inside = f"{sensor.bandwidth_hz:g} Hz, sampled at {INSIDE_HZ:g} Hz inside the part"
        self._raw = self.period
        if sensor.bandwidth_hz:
            self._raw = whole_steps(1.0 / INSIDE_HZ, timestep, f"{where}.bandwidth_hz", inside)
        self._skew = whole_steps(sensor.skew_s, timestep, f"{where}.skew_s", f"{sensor.skew_s:g} s")
        self.steps_per_sample = math.gcd(self.period, self._raw, self._skew)
        # So long a low-pass needs to forget its start, all but 1e-4 of it.
        self._settling = math.ceil(2.0 * INSIDE_HZ / sensor.bandwidth_hz) if sensor.bandwidth_hz else 0
        self._outer: deque = deque()

    def sample(self, step: int, ideal: IdealReading) -> None:
        """Take what is due: a sample of the inner one, together with the outer's that is older by the skew."""
        first = self._newest is None
        if self._skew:
            if first or (step + self._skew) % self._raw == 0:
                self._outer.append((step, ideal.accelerations))
            while len(self._outer) > 1 and self._outer[1][0] <= step - self._skew:
                self._outer.popleft()
        if not first and step % self._raw:
            return
        if self._skew:
            ideal = ideal._replace(accelerations=_combine_samples(ideal.accelerations, self._outer[0][1]))
        reading = self._measure(ideal, next(self._noise))
        if first:  # before the start the rig stood still
            for _ in range(self._settling):
                reading = self._measure(ideal, next(self._noise))
        if first or step % self.period == 0:
            self._newest = reading
            if self.latency:
                self._on_the_way.append((step + self.latency, reading))


def _combine_samples(inner: Any, outer: Any) -> Any:
    """The inner accelerometer's forces at one instant and the outer's at another."""
    if isinstance(inner, np.ndarray):
        return np.concatenate([inner[:2], outer[2:]])
    return (*inner[:2], *outer[2:])


def _flicker_source(sensor: Accelerometer, noise: Iterator) -> Callable[[], Any]:
    """What the 1/f noise adds to the next sample of each channel: four floats, or an array (4, n_worlds) [m/s^2]."""

    def drawn() -> np.ndarray:
        numbers = np.asarray(next(noise))
        return numbers.reshape(len(CORNERS_HZ), sensor.channels, *numbers.shape[1:])

    flicker = Flicker(sensor.flicker_floor, 1.0 / sensor.raw_rate_hz, drawn())

    def drift() -> Any:
        added = flicker.advance(drawn()[None])[0]
        return added.tolist() if added.ndim == 1 else added

    return drift


def sampled_sensors(
    sensors: Sensors, timestep: float, seed: int, worlds: int | Sequence[int], axis: int = 0
) -> list[SampledSensor]:
    """What the controller reads, at work: the accelerometers, the encoders, the gyro.

    Args:
        sensors: The sensors.
        timestep: Physics step [s].
        seed: The run's seed.
        worlds: The number of one world, on floats, or the numbers of many, on arrays.
        axis: The number of the axis whose they are: each has noise of its own.

    Returns:
        The sensors, sampled.

    Raises:
        InputError: A rate or a time does not fit the physics step.
    """

    def noise(stream: int, channels: int) -> Iterator[Sequence[Scalar]]:
        return normals(seed, worlds, stream + STREAMS_PER_AXIS * axis, channels) if channels else itertools.repeat(())

    pair = sensors.accelerometer
    drift = (
        _flicker_source(pair, noise(FLICKER_STREAM, len(CORNERS_HZ) * pair.channels))
        if pair.bias_instability_ug
        else None
    )
    kind = UnevenPair if pair.skew_s or pair.bandwidth_hz else SampledSensor
    return [
        kind(pair, timestep, noise(0, pair.channels), "sensors.accelerometer", pair.make_reading_function(drift)),
        SampledSensor(sensors.encoder, timestep, noise(1, sensors.encoder.channels), "sensors.encoder"),
        SampledSensor(sensors.fog, timestep, noise(2, sensors.fog.channels), "sensors.fog"),
    ]

"""What a real sensor makes of an ideal reading: noise, bias, range, resolution, rate, latency.

Defaults are those of a datasheet class, named in each docstring. A value of zero for a resolution, a noise
or a bandwidth switches that effect off.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.elementwise import Scalar, clip, digitise
from cmg_mj.fields import STRICT, Instant, NonNegative, Positive, Rate
from cmg_mj.mems_gyro import MemsGyro
from cmg_mj.timing import steps_until, whole_steps

STANDARD_GRAVITY = 9.80665  # m/s^2, the g of a datasheet's mg


class Ideal(NamedTuple):
    """What perfect sensors would show at one instant (floats, or arrays (n_worlds,))."""

    accelerations: Any
    """Specific force: inner x, inner z, outer x, outer z [m/s^2]; floats, or one array (4, n_worlds)."""
    gimbals: Sequence[Scalar]
    """Gimbal angles, one a gimbal [rad]."""
    gyro: Scalar
    """What a gyro on the frame shows along the tilt axis [rad/s]."""
    rate: Scalar
    """The true tilt rate, q_b' [rad/s]: no sensor's, but what `feedback = "truth"` uses."""


@dataclass(frozen=True, config=STRICT)
class Accelerometer:
    """A pair of accelerometers of the MPU-6050 class (InvenSense PS-MPU-6000A: 400 ug/rtHz, +-2 g, 16384 counts/g).

    Its zero-g offset is tens of mg before calibration; the default is what calibration leaves, zero. An offset
    on the tangential axes acts like the equilibrium bias e.

    Attributes:
        rate_hz: Samples a second.
        noise_density_ug_rthz: White noise, one-sided density; one sample's sigma is density * sqrt(rate/2).
        bias_mg: Offsets of the tangential axes of the inner and the outer accelerometer [mg].
        range_g: Readings saturate here [g].
        counts_per_g: Resolution; 0 for none.
        latency_s: From sampling to delivery [s].
    """

    rate_hz: Rate = 200.0
    noise_density_ug_rthz: NonNegative = 400.0
    bias_mg: tuple[float, float] = (0.0, 0.0)
    range_g: Positive = 2.0
    counts_per_g: NonNegative = 16384.0
    latency_s: Instant = 0.0

    channels = 4

    @property
    def sigma(self) -> float:
        """Standard deviation of one sample [m/s^2]."""
        return self.noise_density_ug_rthz * 1e-6 * STANDARD_GRAVITY * math.sqrt(self.rate_hz / 2.0)

    @property
    def deviation(self) -> float:
        """Of one sample from the mean, with what the resolution adds: what a filter is told [m/s^2]."""
        step = STANDARD_GRAVITY / self.counts_per_g if self.counts_per_g else 0.0
        return math.hypot(self.sigma, step / math.sqrt(12.0))

    @property
    def bias(self) -> tuple[float, float]:
        """Offsets of the tangential axes of the inner and the outer accelerometer [m/s^2]."""
        inner, outer = (bias * 1e-3 * STANDARD_GRAVITY for bias in self.bias_mg)
        return inner, outer

    def meter(self) -> Callable[[Ideal, Sequence[Scalar]], Sequence[Scalar]]:
        """A function (ideal reading, standard normals) -> reading: inner x, z, outer x, z [m/s^2]."""
        sigma = self.sigma
        limit = self.range_g * STANDARD_GRAVITY
        step = STANDARD_GRAVITY / self.counts_per_g if self.counts_per_g else 0.0
        inner, outer = self.bias
        bias = np.array([[inner], [0.0], [outer], [0.0]])

        def measure(ideal: Ideal, normal: Sequence[Scalar]) -> Sequence[Scalar]:
            forces = ideal.accelerations
            if isinstance(forces, np.ndarray):
                return digitise(forces + bias + sigma * np.asarray(normal), limit, step)
            ix, iz, ox, oz = forces
            n0, n1, n2, n3 = normal
            return (
                digitise(ix + inner + sigma * n0, limit, step),
                digitise(iz + sigma * n1, limit, step),
                digitise(ox + outer + sigma * n2, limit, step),
                digitise(oz + sigma * n3, limit, step),
            )

        return measure


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

    def meter(self) -> Callable[[Ideal, Sequence[Scalar]], Sequence[Scalar]]:
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
    def sigma(self) -> float:
        """Standard deviation of one sample [rad/s]."""
        return math.radians(self.angle_random_walk_deg_rth) / 60.0 * math.sqrt(self.rate_hz)

    def meter(self) -> Callable[[Ideal, Sequence[Scalar]], Scalar]:
        """A function (ideal reading, standard normals) -> tilt rate [rad/s]. It remembers its low-pass."""
        sigma = self.sigma
        bias = math.radians(self.bias_deg_h) / 3600.0
        limit = math.radians(self.range_deg_s)
        # The share of a step that a first-order low-pass has taken after one sample period.
        share = 1.0 - math.exp(-2.0 * math.pi * self.bandwidth_hz / self.rate_hz) if self.bandwidth_hz else 1.0
        passed: Scalar = None

        def measure(ideal: Ideal, normal: Sequence[Scalar]) -> Scalar:
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
    if channels == 0:
        while True:
            yield ()
    single = isinstance(worlds, int)
    generators = [
        np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(world, stream)))
        for world in ([worlds] if single else worlds)
    ]
    while True:
        drawn = np.stack([g.standard_normal((block, channels)) for g in generators], axis=-1)
        yield from drawn[:, :, 0].tolist() if single else drawn


class SampledSensor:
    """One sensor at work: it samples at its own rate and delivers after its latency."""

    def __init__(self, sensor: Accelerometer | Encoder | Fog, timestep: float, noise: Iterator, where: str) -> None:
        self.period = whole_steps(1.0 / sensor.rate_hz, timestep, f"{where}.rate_hz", f"{sensor.rate_hz:g} Hz")
        self.latency = steps_until(sensor.latency_s, timestep)
        self._measure = sensor.meter()
        self._noise = noise
        self._on_the_way: deque = deque()
        self._delivered: Any = None

    def sample(self, step: int, ideal: Ideal) -> None:
        """Take a sample at a physics step that is a multiple of `period`."""
        reading = self._measure(ideal, next(self._noise))
        # Before the start the rig stood still, so the first sample counts as delivered.
        if self.latency == 0 or self._delivered is None:
            self._delivered = reading
        if self.latency:
            self._on_the_way.append((step + self.latency, reading))

    def read(self, step: int) -> Any:
        """The newest sample delivered by a physics step."""
        while self._on_the_way and self._on_the_way[0][0] <= step:
            self._delivered = self._on_the_way.popleft()[1]
        return self._delivered

"""Sensors that sample at their own rate and deliver after their latency."""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Generic, TypeVar

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.core.noise import CORNERS_HZ, Flicker, NoiseStream, normals
from cmg_mj.core.sensor import steps_until, whole_steps
from cmg_mj.core.types import Forces, IdealReading
from cmg_mj.elementwise import Scalar
from cmg_mj.inputs.field_types import STRICT
from cmg_mj.sensors.accelerometer import INSIDE_HZ, STANDARD_GRAVITY, Accelerometer
from cmg_mj.sensors.encoder import Encoder
from cmg_mj.sensors.fog import Fog
from cmg_mj.sensors.mems_gyro import MemsGyro
from cmg_mj.stages.vibration import BroadbandVibration, WheelTones, vibration

Reading = TypeVar("Reading")
"""A sensor's reading: a number, a number for each gimbal, or the forces of the accelerometers."""


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

    def with_noise_density(self, ug_rthz: float) -> Sensors:
        """Return the sensors with another noise density of the accelerometers [ug/sqrt(Hz)]."""
        return replace(self, accelerometer=replace(self.accelerometer, noise_density_ug_rthz=ug_rthz))


class SampledSensor(Generic[Reading]):
    """One sensor at work: it samples at its own rate and delivers after its latency.

    Args:
        sensor: What it is.
        timestep: Physics step [s].
        noise: Standard normals, a sample's at a time.
        where: The scenario's section.
        measure: What it makes of an ideal reading and a sample's normals: `sensor.make_reading_function()`.

    Attributes:
        steps_per_sample: Physics steps between the instants at which it may be due.
    """

    _newest: Reading
    _delivered: Reading

    def __init__(
        self,
        sensor: Accelerometer | Encoder | Fog,
        timestep: float,
        noise: Iterator,
        where: str,
        measure: Callable[[IdealReading, Sequence[Scalar]], Reading],
    ) -> None:
        self.period = whole_steps(1.0 / sensor.rate_hz, timestep, f"{where}.rate_hz", f"{sensor.rate_hz:g} Hz")
        self.steps_per_sample = self.period
        self.latency = steps_until(sensor.latency_s, timestep)
        self._measure = measure
        self._noise = noise
        self._on_the_way: deque[tuple[int, Reading]] = deque()
        self._has_delivered = False

    def sample(self, step: int, ideal: IdealReading) -> None:
        """Take what is due, at a physics step that is a multiple of `steps_per_sample`, or at the first one."""
        self._newest = self._measure(ideal, next(self._noise))
        if self.latency:
            self._on_the_way.append((step + self.latency, self._newest))

    def read(self, step: int) -> Reading:
        """Return the newest sample delivered by a physics step; before the start the rig stood still."""
        if not self.latency:
            return self._newest
        while self._on_the_way and (self._on_the_way[0][0] <= step or not self._has_delivered):
            self._delivered = self._on_the_way.popleft()[1]
            self._has_delivered = True
        return self._delivered


class UnevenPair(SampledSensor[Forces]):
    """Two accelerometers at work that sample each at its own instants, or filter more samples than they deliver."""

    def __init__(
        self,
        sensor: Accelerometer,
        timestep: float,
        noise: Iterator,
        where: str,
        measure: Callable[[IdealReading, Sequence[Scalar]], Forces],
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
        self._outer: deque[tuple[int, Forces]] = deque()
        self._has_sampled = False

    def sample(self, step: int, ideal: IdealReading) -> None:
        """Take what is due: a sample of the inner one, together with the outer's that is older by the skew."""
        first = not self._has_sampled
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
            self._has_sampled = True
            for _ in range(self._settling):
                reading = self._measure(ideal, next(self._noise))
        if first or step % self.period == 0:
            self._newest = reading
            if self.latency:
                self._on_the_way.append((step + self.latency, reading))


def _combine_samples(inner: Forces, outer: Forces) -> Forces:
    """Combine the inner accelerometer's forces at one instant with the outer's at another."""
    if isinstance(inner, np.ndarray):
        return np.concatenate([inner[:2], outer[2:]])
    return (*inner[:2], *outer[2:])


def _flicker_source(sensor: Accelerometer, noise: Iterator) -> Callable[[], Forces]:
    """Make the source of each channel's 1/f noise: four floats a sample, or an array (4, n_worlds) [m/s^2]."""

    def drawn() -> np.ndarray:
        numbers = np.asarray(next(noise))
        return numbers.reshape(len(CORNERS_HZ), sensor.channels, *numbers.shape[1:])

    flicker = Flicker(sensor.flicker_floor, 1.0 / sensor.raw_rate_hz, drawn())

    def drift() -> Forces:
        added = flicker.advance(drawn()[None])[0]
        return added.tolist() if added.ndim == 1 else added

    return drift


def _vibration_source(
    sensor: Accelerometer, noise: Callable[[NoiseStream, int], Iterator[Sequence[Scalar]]]
) -> Callable[[IdealReading], Forces] | None:
    """Make what shakes the accelerometers; None if nothing does."""
    dt, milli_g = 1.0 / sensor.raw_rate_hz, 1e-3 * STANDARD_GRAVITY
    broadband = tones = None
    if np.any(sensor.vibration_mg):
        numbers = noise(NoiseStream.VIBRATION, BroadbandVibration.channels)
        broadband = BroadbandVibration(sensor.vibration_band_hz, dt, numbers)
    if any(sensor.wheel_harmonics_mg):
        amplitudes = [milli_g * amplitude for amplitude in sensor.wheel_harmonics_mg]
        tones = WheelTones(amplitudes, dt, noise(NoiseStream.WHEEL_TONES, 2))
    return vibration(broadband, milli_g * sensor.vibration_mg, tones)


def sampled_sensors(
    sensors: Sensors, timestep: float, seed: int, worlds: int | Sequence[int], axis: int = 0
) -> tuple[SampledSensor[Forces], SampledSensor[Sequence[Scalar]], SampledSensor[Scalar]]:
    """Start the sensors that the controller reads: the accelerometers, the encoders, the gyro.

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

    def noise(stream: NoiseStream, channels: int) -> Iterator[Sequence[Scalar]]:
        return normals(seed, worlds, stream.on_axis(axis), channels) if channels else itertools.repeat(())

    pair = sensors.accelerometer
    flicker_noise = noise(NoiseStream.FLICKER, len(CORNERS_HZ) * pair.channels)
    drift = _flicker_source(pair, flicker_noise) if pair.bias_instability_ug else None
    vibration = _vibration_source(pair, noise)
    kind = UnevenPair if pair.skew_s or pair.bandwidth_hz else SampledSensor[Forces]
    encoder, fog = sensors.encoder, sensors.fog
    pair_noise = noise(NoiseStream.ACCELEROMETER, pair.channels)
    encoder_noise, fog_noise = noise(NoiseStream.ENCODER, encoder.channels), noise(NoiseStream.FOG, fog.channels)
    return (
        kind(pair, timestep, pair_noise, "sensors.accelerometer", pair.make_reading_function(drift, vibration)),
        SampledSensor(encoder, timestep, encoder_noise, "sensors.encoder", encoder.make_reading_function()),
        SampledSensor(fog, timestep, fog_noise, "sensors.fog", fog.make_reading_function()),
    )

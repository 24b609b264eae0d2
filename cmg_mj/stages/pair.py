"""A pair of accelerometers: sampling, offsets and white noise, range and resolution."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from pydantic.dataclasses import dataclass as settings

from cmg_mj.core.arrays import Scalar, dot
from cmg_mj.core.noise import NoiseStream
from cmg_mj.core.sensor import Memory, SensorStage, Signal, Site, each
from cmg_mj.core.straight_line import Tables
from cmg_mj.core.types import STANDARD_GRAVITY, IdealReading
from cmg_mj.inputs.types import STRICT, Batched, Latency, NoiseSize, NonNegative, Positive, Rate


@settings(frozen=True, config=STRICT)
class PairSettings:
    """Sampling, white noise, offsets, range and resolution of the accelerometers.

    Attributes:
        rate_hz: Sampling rate of both accelerometers.
        noise_density_ug_rthz: One-sided density of the white noise; one sample's sigma is density * sqrt(rate/2).
        bias_mg: Offsets of the tangential axes of the inner and the outer accelerometer [mg].
        range_g: Largest acceleration that a reading shows [g].
        counts_per_g: Resolution; 0 for readings that are not rounded.
        latency_s: Delay from the sampling of a reading to its use by the controller [s].
        averaged: Whether a sample is the mean since the one before, as behind a low-pass, and no instant's. The model
            then has sensors framelinvel, framexaxis and framezaxis of both sites, which end in _velocity, _x and _z.
    """

    rate_hz: Rate = 200.0
    noise_density_ug_rthz: Annotated[NoiseSize, Batched()] = 400.0
    bias_mg: Annotated[tuple[float, float], Batched()] = (0.0, 0.0)
    range_g: Positive = 2.0
    counts_per_g: NonNegative = 16384.0
    latency_s: Latency = 0.0
    averaged: bool = False

    inside_hz = 0.0
    """Samples a second that the part takes; 0: as many as it delivers."""
    noise_gain = 1.0
    """The variance of white noise that is delivered, by that which the part takes."""
    channels = 4

    @property
    def raw_rate_hz(self) -> float:
        """Samples a second that the part takes: more than it delivers if it filters them."""
        return self.inside_hz or self.rate_hz

    @property
    def raw_sigma(self) -> float:
        """Standard deviation of the white noise of one sample that the part takes [m/s^2]."""
        return self.noise_density_ug_rthz * 1e-6 * STANDARD_GRAVITY * math.sqrt(self.raw_rate_hz / 2.0)

    @property
    def white_noise_sigma(self) -> float:
        """Standard deviation of the white noise of one sample that is delivered [m/s^2]."""
        return self.raw_sigma * math.sqrt(self.noise_gain)

    @property
    def resolution(self) -> float:
        """Step between two readings; 0 for readings that are not rounded [m/s^2]."""
        return STANDARD_GRAVITY / self.counts_per_g if self.counts_per_g else 0.0

    @property
    def sample_sigma(self) -> float:
        """Standard deviation of one sample with the quantisation, as filters assume it [m/s^2]."""
        return math.hypot(self.white_noise_sigma, self.resolution / math.sqrt(12.0))

    @property
    def bias(self) -> tuple[float, float]:
        """Offsets of the tangential axes of the inner and the outer accelerometer [m/s^2]."""
        inner, outer = (bias * 1e-3 * STANDARD_GRAVITY for bias in self.bias_mg)
        return inner, outer


@dataclass(frozen=True)
class Averaged(SensorStage):
    """The mean specific force since the last sample, by the velocity's difference, in the axes of the last instant.

    A pass of the physics shows the acceleration of an instant, in which stiff servos and contacts answer to a setpoint
    or a command that has just changed.

    Attributes:
        period_s: Time between two samples [s].
    """

    period_s: float

    def init(self, signal: Signal, ideal: IdealReading, tables: Tables) -> Memory:
        """Return the motion of both."""
        return signal

    def step(
        self, memory: Memory, signal: Signal, ideal: IdealReading, sample: int, tables: Tables
    ) -> tuple[Memory, Signal]:
        """Return the forces by the motion of both."""
        forces = []
        for first in (0, 9):
            v, x, z = (signal[first + i : first + i + 3] for i in (0, 3, 6))
            before = memory[first : first + 3]
            a = [(now - then) / self.period_s for now, then in zip(v, before, strict=True)]
            a[2] = a[2] + signal[-1]
            forces += [dot(list(x), a), dot(list(z), a)]
        return signal, forces


@dataclass(frozen=True)
class White(SensorStage):
    """Constant offsets, and white noise.

    Attributes:
        stream: Number of the noise stream.
        sigma: Standard deviation of the noise, a float or an array (n_worlds,).
        offsets: Offset of each channel, likewise.
    """

    stream: int
    sigma: Scalar
    offsets: tuple[Scalar, ...]

    @property
    def draws(self) -> dict[int, int]:
        """See `SensorStage`."""
        return {self.stream: len(self.offsets)}

    def step(
        self, memory: Memory, signal: Signal, ideal: IdealReading, sample: int, tables: Tables
    ) -> tuple[Memory, Signal]:
        """See `SensorStage`."""
        normals = tables[self.stream](sample)
        if not self._is_off:
            return memory, each(self._white, signal, normals)
        offsets = self._column if type(signal) is np.ndarray else self.offsets
        return memory, each(self._noisy, signal, offsets, normals)

    @cached_property
    def _is_off(self) -> bool:
        return any(np.any(offset) for offset in self.offsets)

    def _white(self, x: Scalar, normal: Scalar) -> Scalar:
        return x + self.sigma * normal

    @cached_property
    def _column(self) -> np.ndarray:
        return np.array(np.broadcast_arrays(*self.offsets)).reshape(len(self.offsets), -1)

    def _noisy(self, x: Scalar, offset: Scalar, normal: Scalar) -> Scalar:
        return x + offset + self.sigma * normal


def white(part: PairSettings, site: Site) -> White:
    """Make the stage of constant offsets and white noise."""
    inner, outer = part.bias
    stream = NoiseStream.ACCELEROMETER.on_axis(site.axis)
    return White(stream, part.raw_sigma, (inner, 0.0, outer, 0.0))


def averaged(part: PairSettings, site: Site) -> Averaged:
    """Make the stage of means."""
    return Averaged(1.0 / part.raw_rate_hz)

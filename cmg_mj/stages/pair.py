"""A pair of accelerometers: sampling, offsets and white noise, range and resolution."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import dot
from cmg_mj.core.noise import NoiseStream
from cmg_mj.core.sensor import SensorStage, Site
from cmg_mj.core.types import STANDARD_GRAVITY, Forces, IdealReading
from cmg_mj.inputs.types import STRICT, Batched, Latency, NoiseSize, NonNegative, Positive, Rate


@dataclass(frozen=True, config=STRICT)
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


class Averaged:
    """The mean specific force since the last sample, by the velocity's difference, in the axes of the last instant.

    A pass of the physics shows the acceleration of an instant, in which stiff servos and contacts answer to a setpoint
    or a command that has just changed.
    """

    def __init__(self, part: PairSettings, site: Site) -> None:
        self._period, self._last = 1.0 / part.raw_rate_hz, None

    def __call__(self, motion: Any, ideal: IdealReading) -> Forces:
        """Return the forces by the motion of both."""
        last, self._last = self._last or motion, motion
        forces = []
        for first in (0, 9):
            v, x, z = (motion[first + i : first + i + 3] for i in (0, 3, 6))
            a = [(now - before) / self._period for now, before in zip(v, last[first : first + 3], strict=True)]
            a[2] = a[2] + motion[-1]
            forces += [dot(x, a), dot(z, a)]
        return np.array(forces) if isinstance(forces[0], np.ndarray) else forces


def white(part: PairSettings, site: Site) -> SensorStage:
    """Make the stage of constant offsets and white noise."""
    (inner, outer), sigma = part.bias, part.raw_sigma
    offsets = np.array(np.broadcast_arrays(inner, 0.0, outer, 0.0)).reshape(4, -1)
    noise = site.noise(NoiseStream.ACCELEROMETER, part.channels)

    def add(forces: Forces, ideal: IdealReading) -> Forces:
        normal = next(noise)
        if isinstance(forces, np.ndarray):
            return forces + offsets + sigma * np.asarray(normal)
        n0, n1, n2, n3 = normal
        ix, iz, ox, oz = forces
        return ix + inner + sigma * n0, iz + sigma * n1, ox + outer + sigma * n2, oz + sigma * n3

    return add

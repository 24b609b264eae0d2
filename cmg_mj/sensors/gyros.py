"""A gyro of about two dollars, calibrated and as bought: what an estimate of the rate is judged beside."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import chain, islice
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar, clip, digitise, radians
from cmg_mj.core.noise import CORNERS_HZ, FlickerNoise, NoiseStream
from cmg_mj.core.sensor import SampledSensor, Site
from cmg_mj.core.types import IdealReading
from cmg_mj.inputs.types import STRICT, Batched, Latency, NonNegative, Positive, Rate

PIECE = 1000
"""Samples before the run that are made together, whatever the rate."""


@dataclass(frozen=True, config=STRICT)
class MemsGyro:
    """A gyro of the MPU-6050 class: it sits in the accelerometers' own package (InvenSense PS-MPU-6000A, 3.4, 6.1).

    The gyro shows the rate at every sample of the controller, without the delay of the chip's own filter. The white
    noise is the datasheet's 0.005 deg/s/rtHz. The bias instability follows from the datasheet's noise from 1 to 10 Hz,
    0.033 deg/s RMS. Less the white noise's part, 0.005 sqrt(9), this noise is 1/f noise of 0.0194^2/f (deg/s)^2/Hz,
    whose Allan deviation stays at 82 deg/h. The scale error is the largest that the datasheet allows at 25 degrees
    Celsius.

    As bought, a gyro has an offset of up to 20 deg/s at 25 degrees. The temperature, -40 to 85 degrees, adds up to
    20 deg/s: 0.33 deg/s/K over the 60 K above 25 degrees. Both offsets have these sizes, with random signs in every
    world, and the gyro warms up all the time at an assumed rate. A calibrated gyro has lost its offset by a mean at
    rest, just before a run at constant temperature.

    Attributes:
        reading: What an observer reads that needs the gyro: the gyro `as_bought`, or `calibrated`.
        noise_density_deg_s_rthz: One-sided density of the white noise; one sample's sigma is density * sqrt(rate/2).
        bias_instability_deg_h: Bias instability: the floor of the Allan deviation, made by 1/f noise [deg/h].
        scale_error: Relative scale error of the reading.
        bias_deg_s: Constant offset that the calibration does not remove [deg/s].
        calibration_s: Duration of the calibration, a mean at rest before the run; 0 for no calibration [s].
        as_bought_offset_deg_s: Size of the offset of a gyro as bought [deg/s].
        as_bought_drift_deg_s_k: Change of the offset of a gyro as bought with the temperature [deg/s/K].
        warming_k_min: Rate at which the gyro warms up from the start on [K/min].
        range_deg_s: Largest rate that a reading shows [deg/s].
        counts_per_deg_s: Resolution; 0 for readings that are not rounded.
    """

    reading: Literal["as_bought", "calibrated"] = "as_bought"
    noise_density_deg_s_rthz: NonNegative = 0.005
    bias_instability_deg_h: NonNegative = 82.0
    scale_error: Annotated[float, Field(gt=-1.0, lt=1.0)] = 0.03
    bias_deg_s: float = 0.0
    calibration_s: Annotated[float, Field(ge=0.0, le=10.0)] = 1.0
    as_bought_offset_deg_s: NonNegative = 20.0
    as_bought_drift_deg_s_k: NonNegative = 0.33
    warming_k_min: float = 1.0
    range_deg_s: Positive = 250.0
    counts_per_deg_s: NonNegative = 131.0

    channels = 1 + len(CORNERS_HZ)

    def white_noise_sigma(self, dt: float) -> float:
        """Standard deviation of one sample's white noise [rad/s].

        Args:
            dt: Sample period [s].

        Returns:
            The standard deviation [rad/s].
        """
        return math.radians(self.noise_density_deg_s_rthz) * math.sqrt(0.5 / dt)

    @property
    def flicker_floor(self) -> float:
        """Floor of the Allan deviation of the 1/f noise [rad/s]."""
        return math.radians(self.bias_instability_deg_h) / 3600.0

    def make_reading_function(self, dt: float, noise: Iterator) -> Callable[[np.ndarray], np.ndarray]:
        """Return the gyro at work.

        Args:
            dt: Sample period [s].
            noise: Standard normals, a sample after the other: `channels` numbers, or an array (channels, n_worlds).

        Returns:
            A function: the next samples' true rate (n_rows, n_worlds) -> what the gyro shows, the same shape [rad/s].
        """
        errors, mean = self._errors(dt, noise)
        offset = math.radians(self.bias_deg_s) - mean
        return lambda rate: self._shown(rate, errors(len(rate)) + offset)

    def make_both(
        self, dt: float, noise: Iterator, part: np.ndarray
    ) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """Make one part at work twice: calibrated, as `make_reading_function` does, and as bought.

        Args:
            dt: Sample period [s].
            noise: Standard normals: see `make_reading_function`.
            part: Numbers whose signs are those of the offset and of the drift, (2, n_worlds).

        Returns:
            A function: the next samples' true rate -> what both show, (n_rows, n_worlds) each [rad/s].
        """
        errors, mean = self._errors(dt, noise)
        bias = math.radians(self.bias_deg_s)
        calibrated = bias - mean
        signs = np.sign(part)
        offset = bias + math.radians(self.as_bought_offset_deg_s) * signs[0]
        drift = math.radians(self.as_bought_drift_deg_s_k * self.warming_k_min / 60.0) * dt * signs[1]
        start = 0

        def read(rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            nonlocal start
            n = len(rate)
            common = errors(n)
            as_bought = common + (offset + drift * np.arange(start, start + n)[:, None])
            start += n
            return self._shown(rate, common + calibrated), self._shown(rate, as_bought)

        return read

    def started(
        self, dt: float, noise: Callable[[NoiseStream, int], Iterator]
    ) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """Make the gyro of a run at work twice, as `make_both` does, from the noise of a stream."""
        part = np.array(next(noise(NoiseStream.MEMS_PART, 2))).reshape(2, -1)
        return self.make_both(dt, noise(NoiseStream.MEMS_GYRO, self.channels), part)

    def at_work(self, site: Site, dt: float) -> SampledSensor:
        """Start the gyro that observers read, every dt [s]: as bought or calibrated."""
        read, is_calibrated = self.started(dt, site.noise), self.reading == "calibrated"

        def show(rate: Scalar, ideal: IdealReading) -> Scalar:
            calibrated, as_bought = read(np.atleast_2d(rate))
            shown = (calibrated if is_calibrated else as_bought)[0]
            return shown if np.ndim(rate) else shown.item()

        return SampledSensor(1.0 / dt, 0.0, site, "gyro", [show])

    def _shown(self, rate: np.ndarray, errors: np.ndarray) -> np.ndarray:
        """Read a true rate with these errors of the zero, (n_rows, n_worlds) [rad/s]."""
        step = math.radians(1.0 / self.counts_per_deg_s) if self.counts_per_deg_s else 0.0
        return digitise((1.0 + self.scale_error) * rate + errors, math.radians(self.range_deg_s), step)

    def _errors(self, dt: float, noise: Iterator) -> tuple[Callable[[int], np.ndarray], np.ndarray | float]:
        """Return the noise of the next n samples, (n, n_worlds), and its mean over the rest before the run [rad/s]."""
        sigma = self.white_noise_sigma(dt)

        def drawn(n: int) -> np.ndarray:
            """Draw noise, (n, channels, n_worlds)."""
            samples = list(islice(noise, n))
            if isinstance(samples[0], list):  # of floats: np.array takes three times as long over nested ones
                return np.fromiter(chain.from_iterable(samples), float).reshape(n, self.channels, 1)
            return np.array(samples)

        flicker = FlickerNoise(self.flicker_floor, dt, drawn(1)[0, 1:])

        def errors(n: int) -> np.ndarray:
            """Return the errors of the next n samples, (n, n_worlds) [rad/s]."""
            normals = drawn(n)
            return sigma * normals[:, 0] + flicker.advance(normals[:, 1:])

        resting = round(self.calibration_s / dt)
        pieces = [min(PIECE, resting - start) for start in range(0, resting, PIECE)]
        # Added one after the other: NumPy's sum takes another order for one world than for many.
        sums = (np.add.accumulate(errors(n))[-1] for n in pieces)
        return errors, sum((total / resting for total in sums), 0.0)


@dataclass(frozen=True, config=STRICT)
class Fog:
    """A fibre-optic gyro on the frame, along the tilt axis: the reference for estimates on a real rig.

    Its class is that of KVH's DSP-1750 (angle random walk 0.013 deg/rt(h), range 490 deg/s, bandwidth 440 Hz), with
    a margin on the noise.

    Attributes:
        rate_hz: Sampling rate of the gyro.
        angle_random_walk_deg_rth: Angle random walk N, made by white noise; one sample's sigma is N * sqrt(rate).
        bias_deg_h: Constant offset of the rate [deg/h].
        bandwidth_hz: Bandwidth of the gyro's first-order low-pass; 0 for no low-pass.
        range_deg_s: Largest rate that a reading shows [deg/s].
        latency_s: Delay from the sampling of a reading to its use by the controller [s].
    """

    rate_hz: Rate = 200.0
    angle_random_walk_deg_rth: Annotated[NonNegative, Batched()] = 0.02
    bias_deg_h: float = 0.0
    bandwidth_hz: NonNegative = 440.0
    range_deg_s: Positive = 490.0
    latency_s: Latency = 0.0

    @property
    def white_noise_sigma(self) -> float:
        """Standard deviation of one sample [rad/s]."""
        return radians(self.angle_random_walk_deg_rth) / 60.0 * math.sqrt(self.rate_hz)

    @property
    def step_share(self) -> float:
        """Share of a step that the low-pass has taken after one sample period."""
        return 1.0 - math.exp(-2.0 * math.pi * self.bandwidth_hz / self.rate_hz) if self.bandwidth_hz else 1.0

    def at_work(self, site: Site) -> SampledSensor:
        """Start the gyro: its low-pass, noise, offset and range."""
        noise, sigma = site.noise(NoiseStream.FOG, 1), self.white_noise_sigma
        bias, limit = math.radians(self.bias_deg_h) / 3600.0, math.radians(self.range_deg_s)
        share, passed = self.step_share, None

        def show(rate: Scalar, ideal: IdealReading) -> Scalar:
            nonlocal passed
            passed = rate if passed is None else passed + share * (rate - passed)
            (normal,) = next(noise)
            return clip(passed + bias + sigma * normal, -limit, limit)

        return SampledSensor(self.rate_hz, self.latency_s, site, "gyro", [show])

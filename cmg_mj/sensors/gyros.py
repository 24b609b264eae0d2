"""A gyro of about two dollars, calibrated and as bought: what an estimate of the rate is judged beside."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from itertools import chain, count, islice
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar, Symbolic, digitise, radians
from cmg_mj.core.noise import CORNERS_HZ, FlickerNoise, NoiseStream, spread_of, wander_shares
from cmg_mj.core.sensor import Digital, Memory, Sensor, SensorStage, Signal, Site, steps_until
from cmg_mj.core.straight_line import Tables
from cmg_mj.core.types import IdealReading
from cmg_mj.inputs.types import STRICT, Batched, Latency, NonNegative, Positive, Rate
from cmg_mj.stages.pair import White

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

    def make_both(
        self, dt: float, noise: Iterator, part: np.ndarray
    ) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """Make one part at work twice: calibrated, and as bought.

        Args:
            dt: Sample period [s].
            noise: Standard normals, a sample after the other: `channels` numbers, or an array (channels, n_worlds).
            part: Numbers whose signs are those of the offset and of the drift, (2, n_worlds).

        Returns:
            A function: the next samples' true rate -> what both show, (n_rows, n_worlds) each [rad/s].
        """
        errors, _, mean = self._errors(dt, noise)
        calibrated, _ = self._offset(dt, mean, part, "calibrated")
        offset, drift = self._offset(dt, mean, part, "as_bought")
        start = 0

        def read(rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            nonlocal start
            n = len(rate)
            common = errors(n)
            as_bought = common + (offset + drift * np.arange(start, start + n)[:, None])
            start += n
            return self.shown(rate, common + calibrated), self.shown(rate, as_bought)

        return read

    def started(
        self, dt: float, noise: Callable[[NoiseStream, int], Iterator]
    ) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """Make the gyro of a run at work twice, as `make_both` does, from the noise of a stream."""
        part = np.array(next(noise(NoiseStream.MEMS_PART, 2))).reshape(2, -1)
        return self.make_both(dt, noise(NoiseStream.MEMS_GYRO, self.channels), part)

    def at_work(self, site: Site, dt: float) -> Sensor:
        """Make the gyro that observers read, every dt [s]: as bought or calibrated."""
        stage = CheapGyro(self, dt, NoiseStream.MEMS_GYRO.on_axis(site.axis), NoiseStream.MEMS_PART.on_axis(site.axis))
        return Sensor("gyro", (stage,), period=site.steps(dt, "rate_hz", f"{1.0 / dt:g} Hz"))

    def turn_gyro(self, dt: float) -> CheapGyro:
        """Make such a gyro about the frame's vertical, calibrated and read every dt [s]."""
        return CheapGyro(dataclasses.replace(self, reading="calibrated"), dt, NoiseStream.TURN_GYRO)

    def rested(self, dt: float, noise: Iterator, part: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the state after the rest before a run: the arguments are those of `make_both`.

        Returns:
            The processes of the 1/f noise, (len(CORNERS_HZ), n_worlds); the offset, and its drift in a sample
            (n_worlds,) [rad/s].
        """
        _, flicker, mean = self._errors(dt, noise)
        offset, drift = self._offset(dt, mean, part, self.reading)
        shape = np.shape(part[0])
        return flicker.wander, np.broadcast_to(offset, shape), np.broadcast_to(drift, shape)

    def resting_samples(self, dt: float) -> int:
        """Count the samples of the calibration, one every dt [s]."""
        return round(self.calibration_s / dt)

    def _offset(self, dt: float, mean: Any, part: Sequence[Any] | np.ndarray, reading: str) -> tuple[Any, Any]:
        """Return the offset that remains, and its drift in a sample [rad/s]."""
        bias = math.radians(self.bias_deg_s)
        if reading == "calibrated":
            return bias - mean, 0.0
        first, second = map(np.sign, part)
        offset = bias + math.radians(self.as_bought_offset_deg_s) * first
        return offset, math.radians(self.as_bought_drift_deg_s_k * self.warming_k_min / 60.0) * dt * second

    def shown(self, rate: Scalar, errors: Scalar) -> Scalar:
        """Read a true rate with these errors of the zero, elementwise [rad/s]."""
        step = math.radians(1.0 / self.counts_per_deg_s) if self.counts_per_deg_s else 0.0
        return digitise((1.0 + self.scale_error) * rate + errors, math.radians(self.range_deg_s), step)

    def _errors(
        self, dt: float, noise: Iterator
    ) -> tuple[Callable[[int], np.ndarray], FlickerNoise, np.ndarray | float]:
        """Return the noise of the next n samples, (n, n_worlds), its 1/f part, and its mean over the rest [rad/s]."""
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

        resting = self.resting_samples(dt)
        pieces = [min(PIECE, resting - start) for start in range(0, resting, PIECE)]
        # Added one after the other: NumPy's sum takes another order for one world than for many.
        sums = (np.add.accumulate(errors(n))[-1] for n in pieces)
        return errors, flicker, sum((total / resting for total in sums), 0.0)


@dataclasses.dataclass(frozen=True)
class CheapGyro(SensorStage):
    """A cheap gyro at work.

    Attributes:
        gyro: Its settings.
        dt: Sample period [s].
        stream: Number of its noise stream.
        part_stream: Number of the stream of the part, if it is read as bought.
    """

    gyro: MemsGyro
    dt: float
    stream: int
    part_stream: int = -1

    @property
    def draws(self) -> dict[int, int]:
        """See `SensorStage`."""
        bought = {self.part_stream: 2} if self.gyro.reading == "as_bought" else {}
        return {self.stream: self.gyro.channels, **bought}

    def init(self, signal: Signal, ideal: IdealReading, tables: Tables) -> Memory:
        """Return the processes of the 1/f noise, the offset, its drift in a sample, and the samples taken."""
        part = tables[self.part_stream](0) if self.part_stream in self.draws else [0.0 * signal[0]] * 2
        if isinstance(signal[0], Symbolic):
            return self._recorded(part, tables[self.stream])
        rests = map(tables[self.stream], count())
        part = np.array(part).reshape(2, -1)
        *wander, offset, drift = (row for rows in self.gyro.rested(self.dt, rests, part) for row in np.atleast_2d(rows))
        numbers = [*wander, offset, drift, np.zeros_like(offset)]
        return tuple(number.copy() if np.ndim(signal[0]) else number.item() for number in numbers)

    def step(
        self, memory: Memory, signal: Signal, ideal: IdealReading, sample: int, tables: Tables
    ) -> tuple[Memory, Signal]:
        """See `SensorStage`."""
        *wander, offset, drift, taken = memory
        after, common = self._noise(wander, tables[self.stream](sample + self._before))
        shown = self.gyro.shown(signal[0], common + (offset + drift * taken))
        return (*after, offset, drift, taken + 1.0), (shown,)

    def _noise(self, wander: Sequence[Scalar], normals: Sequence[Scalar]) -> tuple[list[Scalar], Scalar]:
        """Advance the 1/f noise by a sample: return its processes, and the error with the white noise [rad/s]."""
        white, *normals = normals
        decays, spreads = self._shares
        moved = zip(spreads, normals, decays, wander, strict=True)
        after = [spread * normal + decay * before for spread, normal, decay, before in moved]
        one, two, three, four = after
        return after, self.gyro.white_noise_sigma(self.dt) * white + (one + two + three + four)

    def _recorded(self, part: Sequence[Scalar], stream: Any) -> Memory:
        """Return what `init` does for symbols, whose stream records the rest before the run as a loop."""
        spread = spread_of(self.gyro.flicker_floor)
        start = [spread * normal for normal in stream(0)[1:]]
        wander, mean = stream.mean(self._noise, start, self.gyro.resting_samples(self.dt), PIECE)
        offset, drift = self.gyro._offset(self.dt, mean, part, self.gyro.reading)
        return (*wander, offset, drift, 0.0)

    @cached_property
    def _before(self) -> int:
        """Samples of the stream before the run: the start of the 1/f noise, and the calibration."""
        return 1 + self.gyro.resting_samples(self.dt)

    @cached_property
    def _shares(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        return wander_shares(self.gyro.flicker_floor, self.dt)


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

    def at_work(self, site: Site) -> Sensor:
        """Make the gyro of a run: its low-pass, noise, offset and range."""
        bias = math.radians(self.bias_deg_h) / 3600.0
        stages = (
            Lag(self.step_share),
            White(NoiseStream.FOG.on_axis(site.axis), self.white_noise_sigma, (bias,)),
            Digital(math.radians(self.range_deg_s)),
        )
        return Sensor(
            "gyro",
            stages,
            period=site.steps(1.0 / self.rate_hz, "rate_hz", f"{self.rate_hz:g} Hz"),
            latency=steps_until(self.latency_s, site.timestep),
        )


@dataclasses.dataclass(frozen=True)
class Lag(SensorStage):
    """A low-pass of first order, settled on the first signal.

    Attributes:
        share: Share of a step that it has taken after one sample period.
    """

    share: float

    def step(
        self, memory: Memory, signal: Signal, ideal: IdealReading, sample: int, tables: Tables
    ) -> tuple[Memory, Signal]:
        """See `SensorStage`."""
        if not sample:
            return tuple(signal), signal
        passed = tuple(before + self.share * (x - before) for before, x in zip(memory, signal, strict=True))
        return passed, passed

"""The random numbers of the sensors: a stream for each sensor, axis and world."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from enum import IntEnum, unique
from itertools import count
from typing import Any

import numpy as np

from cmg_mj.core.arrays import Scalar

STREAMS_PER_AXIS = 16


@unique
class NoiseStream(IntEnum):
    """Numbers of the noise streams of an axis: two sensors never share one, and a number never changes."""

    ACCELEROMETER = 0
    ENCODER = 1
    FOG = 2
    MEMS_GYRO = 3
    FLICKER = 4
    """1/f noise of the accelerometers."""
    TURN_GYRO = 5
    """The gyro about the vertical, which a plant of several axes has once."""
    MEMS_PART = 6
    """The signs of the cheap gyro's offset and drift: which part was bought."""
    PIVOT = 7
    """The acceleration of the pivot; its motions have the streams that axes would have."""
    VIBRATION = 8
    """The accelerometers' broadband vibration."""
    WHEEL_TONES = 9
    """The phases of the tones that flywheels make in the accelerometers."""
    FOOT_SWITCH = 10
    """How the contacts of foot switches bounce."""
    FLOOR = 11
    """The heights of a floor's tiles."""

    def on_axis(self, axis: int) -> int:
        """Return the number of the stream of one axis of several."""
        return self + STREAMS_PER_AXIS * axis


BLOCK = 256
"""Samples that are drawn together: one by one they cost more than the rest of a sensor."""


class Normals:
    """Standard normal numbers that depend on (seed, world, stream) and the number of their sample alone.

    Samples may be asked for in any order. Those that follow on each other are drawn once; for those before, the
    generators' states at the beginning of each block are kept.

    Args:
        seed: The run's seed.
        world_ids: The number of one world, on floats, or the numbers of many, on arrays.
        stream: `NoiseStream.on_axis` of the sensor and its axis.
        channels: Numbers a sample.
    """

    def __init__(self, seed: int, world_ids: int | Sequence[int], stream: int, channels: int) -> None:
        self._single = isinstance(world_ids, int)
        different, places = np.unique([world_ids] if self._single else world_ids, return_inverse=True)
        self._places = None if np.array_equal(places, range(len(places))) else places  # every world once, in order
        self._generators = [
            np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(int(world), stream))) for world in different
        ]
        self._channels = channels
        self._starts = [self._positions()]
        self._number = -1
        self._block: Any = ()

    def __call__(self, sample: int) -> Sequence[Scalar]:
        """Return the numbers of a sample: `channels` floats, or an array (channels, n_worlds)."""
        number = sample // BLOCK
        if number != self._number:
            self._block = self._block_of(number)
            self._number = number
        return self._block[sample % BLOCK]

    def _block_of(self, number: int) -> Any:
        first = min(number, len(self._starts) - 1)
        drawn = np.empty(0)
        for earlier in range(first, number + 1):
            drawn = self._drawn(earlier)
        if self._single:
            return drawn[:, :, 0].tolist()
        return drawn if self._places is None else drawn[:, :, self._places]

    def _drawn(self, number: int) -> np.ndarray:
        """Draw a block whose beginning is known; (BLOCK, channels, different worlds)."""
        for generator, position in zip(self._generators, self._starts[number], strict=True):
            before = generator.bit_generator.state
            generator.bit_generator.state = {**before, "state": {**before["state"], "state": position}}
        drawn = [generator.standard_normal((BLOCK, self._channels)) for generator in self._generators]
        if number + 1 == len(self._starts):
            self._starts.append(self._positions())
        return np.stack(drawn, axis=-1)

    def _positions(self) -> list[int]:
        return [generator.bit_generator.state["state"]["state"] for generator in self._generators]


def normals(seed: int, world_ids: int | Sequence[int], stream: int, channels: int) -> Iterator[Sequence[Scalar]]:
    """Yield the `Normals` of one sample after the other."""
    return map(Normals(seed, world_ids, stream, channels), count())


CORNERS_HZ = (0.01, 0.1, 1.0, 10.0)
"""Corner frequencies of the Gauss-Markov processes whose sum is the 1/f noise: one a decade, so it waves by 6 %.
Above 15 Hz the white noise of a part that costs a few dollars is the larger."""


def spread_of(floor: float) -> float:
    """Standard deviation of each Gauss-Markov process.

    1/f noise of one-sided density K^2/f has an Allan deviation of K sqrt(2 ln 2) whatever is averaged over;
    processes of variance v with corners a factor r apart sum to K^2 = v/ln r.

    Args:
        floor: Of the Allan deviation, in the reading's unit.

    Returns:
        In the reading's unit.
    """
    k = floor / math.sqrt(2.0 * math.log(2.0))
    return k * math.sqrt(math.log(CORNERS_HZ[1] / CORNERS_HZ[0]))


def wander_shares(floor: float, dt: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the share of each Gauss-Markov process that is left after a sample, and the spread of what it gains.

    Args:
        floor: Of the Allan deviation, in the reading's unit.
        dt: Sample period [s].

    Returns:
        A number a corner each, the second ones in the reading's unit.
    """
    decays = np.exp(-2.0 * math.pi * np.array(CORNERS_HZ) * dt)
    spreads = spread_of(floor) * np.sqrt(1.0 - decays**2)
    return tuple(decays.tolist()), tuple(spreads.tolist())


class FlickerNoise:
    """1/f noise at work, as if it had been on for ever.

    Args:
        floor: Of the Allan deviation, in the reading's unit.
        dt: Sample period [s].
        normals: Standard normals that it starts from, a row a corner, (len(CORNERS_HZ), ...).

    Attributes:
        decay: Share of each corner's process that is left after a sample, a row a corner.
        spread: Standard deviation of what it gains in a sample, likewise, in the reading's unit.
        wander: The processes, likewise.
    """

    def __init__(self, floor: float, dt: float, normals: np.ndarray) -> None:
        decays, spreads = wander_shares(floor, dt)
        self.decay, self.spread = (np.reshape(shares, (-1, *[1] * (normals.ndim - 1))) for shares in (decays, spreads))
        self.wander = spread_of(floor) * normals

    def advance(self, normals: np.ndarray) -> np.ndarray:
        """Return the noise of the next samples.

        Args:
            normals: Standard normals, (n, len(CORNERS_HZ), ...).

        Returns:
            (n, ...), in the reading's unit.
        """
        driven = self.spread * normals
        if self.wander.size > len(CORNERS_HZ):
            for row in driven:
                row += self.decay * self.wander
                self.wander = row
            return driven.sum(axis=1)
        numbers = driven.reshape(len(driven), -1)
        for i, decay in enumerate(self.decay.ravel().tolist()):  # a float costs a fifth of an array of one
            start = self.wander.flat[i].item()
            numbers[:, i] = list(_wandered(numbers[:, i].tolist(), decay, start))
        self.wander = driven[-1]
        return driven.sum(axis=1)


def _wandered(gains: Sequence[float], decay: float, value: float) -> Iterator[float]:
    """Yield a Gauss-Markov process after each gain."""
    for gain in gains:
        value = gain + decay * value
        yield value

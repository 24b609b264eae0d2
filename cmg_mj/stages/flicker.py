"""1/f noise of the accelerometers."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic.dataclasses import dataclass as settings

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.noise import CORNERS_HZ, NoiseStream, spread_of, wander_shares
from cmg_mj.core.sensor import Memory, SensorStage, Signal, Site, each, together
from cmg_mj.core.straight_line import Tables
from cmg_mj.core.types import STANDARD_GRAVITY, IdealReading
from cmg_mj.inputs.types import STRICT, NoiseSize
from cmg_mj.stages.pair import PairSettings


@settings(frozen=True, config=STRICT)
class FlickerSettings(PairSettings):
    """1/f noise of the accelerometers.

    Attributes:
        bias_instability_ug: Bias instability of each axis: the floor of its Allan deviation, made by 1/f noise [ug].
    """

    bias_instability_ug: NoiseSize = 0.0

    @property
    def flicker_floor(self) -> float:
        """Floor of the Allan deviation of each axis' 1/f noise [m/s^2]."""
        return self.bias_instability_ug * 1e-6 * STANDARD_GRAVITY


@dataclass(frozen=True)
class Flicker(SensorStage):
    """1/f noise, independent in each channel: a Gauss-Markov process a corner, as if it had been on for ever.

    Attributes:
        stream: Number of the noise stream.
        channels: Number of channels.
        sigma: Standard deviation of each process, in the reading's unit.
        decays: Share of each corner's process that is left after a sample.
        spreads: Standard deviation of what it gains in a sample.
    """

    stream: int
    channels: int
    sigma: float
    decays: tuple[float, ...]
    spreads: tuple[float, ...]

    @property
    def draws(self) -> dict[int, int]:
        """See `SensorStage`."""
        return {self.stream: len(CORNERS_HZ) * self.channels}

    def init(self, signal: Signal, ideal: IdealReading, tables: Tables) -> Memory:
        """Return the processes, one a corner."""
        return tuple(each(lambda normal: self.sigma * normal, part) for part in self._drawn(0, tables))

    def step(
        self, memory: Memory, signal: Signal, ideal: IdealReading, sample: int, tables: Tables
    ) -> tuple[Memory, Signal]:
        """See `SensorStage`."""
        *after, noisy = together(self._wandered, signal, *memory, *self._drawn(sample + 1, tables))
        return tuple(after), noisy

    def _wandered(self, x: Scalar, *numbers: Scalar) -> tuple[Scalar, ...]:
        """Advance the processes of a channel by their normals, which come last, and add them to its signal."""
        corners = len(CORNERS_HZ)
        moved = zip(self.decays, numbers[:corners], self.spreads, numbers[corners:], strict=True)
        one, two, three, four = (spread * normal + decay * before for decay, before, spread, normal in moved)
        return one, two, three, four, x + (one + two + three + four)

    def _drawn(self, sample: int, tables: Tables) -> list[Signal]:
        """Return the normals of a sample, a part a corner."""
        normals = tables[self.stream](sample)
        n = self.channels
        return [normals[i : i + n] for i in range(0, n * len(CORNERS_HZ), n)]


def flicker(part: FlickerSettings, site: Site) -> Flicker:
    """Make the stage of 1/f noise."""
    floor, dt = part.flicker_floor, 1.0 / part.raw_rate_hz
    stream = NoiseStream.FLICKER.on_axis(site.axis)
    return Flicker(stream, part.channels, spread_of(floor), *wander_shares(floor, dt))

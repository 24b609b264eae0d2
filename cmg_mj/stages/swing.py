"""Swings: sinusoidal torques about the tilt axes, such as those of the legs in a gait."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.core.loop import Disturbance, Outside
from cmg_mj.inputs.types import STRICT, Duration, Held, Instant, Section, Start


@dataclass(frozen=True, config=STRICT)
class Swing(Section):
    """A sinusoidal torque about the tilt axis, such as a gait's. Each sample holds the value at its middle.

    Attributes:
        frequency_hz: Frequency of the torque [Hz].
        amplitude_n_m: Amplitude of the torque about the tilt axis [N m].
        phase_deg: Phase of the torque at its start [deg].
        start_s: Time at which the torque begins [s].
        duration_s: Duration of the torque; without it, to the end of the run [s].
        axis: Name of the tilt axis, on a rig of several axes.
    """

    frequency_hz: Annotated[float, Field(gt=0.0, le=20.0), Held("torque")]
    amplitude_n_m: float = 0.5
    phase_deg: float = 0.0
    start_s: Annotated[Instant, Section, Start()] = 0.0
    duration_s: Duration | None = None
    axis: str | None = None

    @property
    def words(self) -> str:
        """The swing in words."""
        about = f" about {self.axis}" if self.axis else ""
        end = "the end" if self.duration_s is None else f"{self.start_s + self.duration_s:g} s"
        return f"{self.amplitude_n_m:g} N m{about} at {self.frequency_hz:g} Hz from {self.start_s:g} s to {end}"

    def torque(self, time: float) -> float:
        """At a time [N m]."""
        since = time - self.start_s
        if since < 0.0 or (self.duration_s is not None and since >= self.duration_s):
            return 0.0
        return self.amplitude_n_m * math.sin(2.0 * math.pi * self.frequency_hz * since + math.radians(self.phase_deg))


class Swings(Disturbance):
    """The torques of swings, at their value in the middle between two instants.

    Args:
        swings: The swings; one about an axis that the rig does not have, since it is locked, moves nothing.
        timestep: Physics step [s].
        axes: The axes' names.
    """

    def __init__(self, swings: Sequence[Swing], timestep: float, axes: Sequence[str]) -> None:
        self._swings, self._timestep, self._axes = swings, timestep, axes

    def at(self, step: int, steps: int) -> Outside:
        """Return the torques: see `Disturbance`."""
        time = (step + 0.5 * steps) * self._timestep
        return Outside(
            [
                sum(swing.torque(time) for swing in self._swings if (swing.axis or self._axes[0]) == axis)
                for axis in self._axes
            ]
        )

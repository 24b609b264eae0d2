"""A swinging torque on a rig, such as the legs' of a gait: a sinusoid about a tilt axis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.elementwise import Scalar
from cmg_mj.fields import STRICT, Duration, Instant


@dataclass(frozen=True, config=STRICT)
class Swing:
    """A sinusoidal torque from outside. It is held from sample to sample, at its value in the middle.

    Attributes:
        frequency_hz: Of the sinusoid [Hz].
        amplitude_n_m: Of the torque about the tilt axis [N m].
        phase_deg: At its start [deg].
        start_s: When it begins [s].
        duration_s: How long it lasts; left out, to the end [s].
        axis: Name of the axis, on a rig of several.
    """

    frequency_hz: Annotated[float, Field(gt=0.0, le=20.0)]
    amplitude_n_m: float = 0.5
    phase_deg: float = 0.0
    start_s: Instant = 0.0
    duration_s: Duration | None = None
    axis: str | None = None

    def torque(self, time: float) -> float:
        """At a time [N m]."""
        since = time - self.start_s
        if since < 0.0 or (self.duration_s is not None and since >= self.duration_s):
            return 0.0
        return self.amplitude_n_m * math.sin(2.0 * math.pi * self.frequency_hz * since + math.radians(self.phase_deg))


def swung(torques: list[Scalar], swings: Sequence[Swing], axes: Sequence[str], time: float) -> list[Scalar]:
    """Each axis' torque with that of the swings.

    Args:
        torques: Without them, one an axis [N m].
        swings: The swings; one about an axis that the rig does not have, since it is locked, moves nothing.
        axes: The axes' names.
        time: When [s].

    Returns:
        The sums; the list itself if there is no swing.
    """
    if not swings:
        return torques
    added = [sum(swing.torque(time) for swing in swings if (swing.axis or axes[0]) == axis) for axis in axes]
    return [torque + more for torque, more in zip(torques, added, strict=True)]

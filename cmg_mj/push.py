"""A push: a torque on the frame about the tilt axis, for a while."""

from __future__ import annotations

from pydantic.dataclasses import dataclass

from cmg_mj.fields import STRICT, Duration, Instant


@dataclass(frozen=True, config=STRICT)
class Push:
    """A torque from outside.

    Attributes:
        start_s: When it begins [s].
        duration_s: How long it lasts [s].
        torque_n_m: Torque about the tilt axis [N m].
    """

    start_s: Instant
    duration_s: Duration = 0.1
    torque_n_m: float = 1.0

    @property
    def end_s(self) -> float:
        """When it ends [s]."""
        return self.start_s + self.duration_s

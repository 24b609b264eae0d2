"""A frame that bends: the section [bend] of a scenario."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.inputs.types import STRICT, Section

BendBeyond = Literal["sensors", "modules", "both"]


@dataclass(frozen=True, config=STRICT)
class Bend(Section):
    """One torsional mode of the frame about the tilt axis.

    Attributes:
        frequency_hz: Undamped frequency of the mode, with the hinge free and without gravity; 0 for a rigid frame [Hz].
        damping_ratio: Damping ratio of the mode.
        share: Share of the inertia about the tilt axis that lies beyond the bend, seen from the pivot.
        beyond: Parts beyond the bend, seen from the pivot: the `sensors` on a mast, the `modules`, or `both`.
    """

    frequency_hz: Annotated[float, Field(ge=0.0, le=1000.0)] = 0.0
    damping_ratio: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.01
    share: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.2
    beyond: BendBeyond = "sensors"

    @property
    def unmodelled(self) -> str:
        """See `Section`."""
        return "the frame's bend" if self.frequency_hz else ""

"""A frame that bends: the section [bend] of a scenario."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.core.errors import InputError
from cmg_mj.inputs.types import STRICT, Section

STEP_SHARE = 0.25
"""Physics step times the mode's angular frequency, at most.

RK4 is then 3.3e-5 slow (z^4/120) and takes z^5/72 = 1.4e-5 of the mode's energy a radian.
"""
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

    def limit_step(self, step_s: float | None, integrator: str, longest_s: float, path: Path) -> float:
        """See `Section`: of a rigid frame the step that was given."""
        if not self.frequency_hz:
            return longest_s
        hz = f"{self.frequency_hz:g}"
        own = STEP_SHARE / (2.0 * math.pi * self.frequency_hz)
        if step_s is not None and step_s > own * (1.0 + 1e-9):
            raise InputError(
                f"plant.timestep_s = {step_s:g}: does not follow a bend of {hz} Hz, which takes at most "
                f"{own:.3g} s (omega h <= {STEP_SHARE:g}); leave it out"
            )
        if integrator != "RK4":
            raise InputError(
                f"plant.integrator = {integrator!r}: follows no bend (bend.frequency_hz = {hz}) to 0.1 %; take RK4"
            )
        return min(longest_s, own)

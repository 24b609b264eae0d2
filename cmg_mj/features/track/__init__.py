"""Setpoints of a robot's other actuators over time: the sections [[track]] of a scenario."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from pydantic.dataclasses import dataclass

from cmg_mj.inputs.files import whole_path
from cmg_mj.inputs.types import STRICT, NonNegative, Section


@dataclass(frozen=True, config=STRICT)
class Track(Section):
    """Setpoints of actuators that are no gimbal's and no flywheel's, from a CSV file; they run straight in between.

    Attributes:
        file: CSV file: a heading, times [s] in its first column, and a column an actuator, headed by its name. Before
            its first and after its last time the setpoints stay.
        start_s: Time of the run at which the file's time is 0 [s].
    """

    file: str
    start_s: NonNegative = 0.0

    @property
    def unmodelled(self) -> str:
        """See `Section`."""
        return "the motion of the other actuators"

    @property
    def files(self) -> tuple[str, ...]:
        """See `Section`."""
        return (self.file,)

    def located(self, beside: Path) -> Track:
        """See `Section`."""
        return dataclasses.replace(self, file=whole_path(self.file, beside))

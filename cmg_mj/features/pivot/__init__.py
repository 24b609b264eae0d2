"""Accelerations of the pivot, and of everything that the rig stands on: a sine, a step, a recorded track, noise."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from cmg_mj.inputs.files import whole_path
from cmg_mj.inputs.types import STRICT, Batched, Duration, Held, Instant, Section, Start

MAX_ACCELERATION_M_S2 = 50.0
"""No pivot is accelerated by more [m/s^2]."""
MAX_FREQUENCY_HZ = 20.0
"""Highest frequency of a sine and highest corner of the noise [Hz]."""
FIELDS_OF = {
    "sine": ("acceleration_m_s2", "frequency_hz", "phase_deg"),
    "step": ("acceleration_m_s2",),
    "track": ("file", "column", "scale"),
    "noise": ("acceleration_m_s2", "corner_hz"),
}
"""Fields of each kind, beside those of all."""

Acceleration = Annotated[float, Field(ge=-MAX_ACCELERATION_M_S2, le=MAX_ACCELERATION_M_S2)]
Frequency = Annotated[float, Field(gt=0.0, le=MAX_FREQUENCY_HZ)]
HELD = Held("acceleration")


@dataclass(frozen=True, config=STRICT)
class Pivot(Section):
    """An acceleration of the pivot. Each sample holds the mean over its period.

    The tilt axis at the keyframe gives the directions. They do not turn with the rig.

    Attributes:
        kind: Form of the motion.
        direction: Direction of the acceleration: `across` the tilt axis, horizontally to the side of a positive tilt;
            `along` the tilt axis; or `vertical`, upwards.
        acceleration_m_s2: Amplitude of a sine, height of a step, RMS of noise [m/s^2].
        frequency_hz: Frequency of a sine [Hz].
        phase_deg: Phase of a sine at its start [deg].
        corner_hz: Corner frequency of noise: white noise behind a second-order Butterworth low-pass [Hz].
        file: Path of a track's CSV file: a heading, times [s], accelerations [m/s^2].
        column: Heading of a track's acceleration; needed if the file has several columns beside the time.
        scale: Factor on the accelerations of a track.
        start_s: Time at which the motion begins [s].
        duration_s: Duration of the motion; without it, to the end of the track or of the run [s].
        axis: Name of the tilt axis that gives the direction, on a rig of several axes; `vertical` needs no axis.
    """

    kind: Literal["sine", "step", "track", "noise"]
    direction: Literal["across", "along", "vertical"] = "across"
    acceleration_m_s2: Annotated[Acceleration | None, Batched()] = None
    frequency_hz: Annotated[Frequency | None, HELD] = None
    phase_deg: float = 0.0
    corner_hz: Annotated[Frequency | None, HELD] = None
    file: str | None = None
    column: str | None = None
    scale: Annotated[float, Batched()] = 1.0
    start_s: Annotated[Instant, Start()] = 0.0
    duration_s: Duration | None = None
    axis: str | None = None

    @model_validator(mode="after")
    def _has_the_fields_of_its_kind(self) -> Pivot:
        noun = "noise" if self.kind == "noise" else f"a {self.kind}"
        defaults = {field.name: field.default for field in dataclasses.fields(self)}
        for name in dict.fromkeys(name for names in FIELDS_OF.values() for name in names):
            value = getattr(self, name)
            if name in FIELDS_OF[self.kind]:
                if value is None and name != "column":
                    raise ValueError(f"{noun} needs {name}")
            elif value != defaults[name]:
                raise ValueError(f"{noun} has no {name}; it has {', '.join(FIELDS_OF[self.kind])}")
        if self.kind == "noise" and self.acceleration_m_s2 is not None and self.acceleration_m_s2 < 0.0:
            raise ValueError(f"acceleration_m_s2 = {self.acceleration_m_s2:g}: an RMS is not negative")
        return self

    @property
    def size(self) -> float:
        """Factor on the motion of size 1 that `pivot_signals` makes."""
        if self.kind == "track":
            return self.scale
        assert self.acceleration_m_s2 is not None  # as the validator has seen
        return self.acceleration_m_s2

    @property
    def unmodelled(self) -> str:
        """See `Section`; a size may be an array (n_worlds,)."""
        return "the pivot's acceleration" if np.any(self.size) else ""

    @property
    def files(self) -> tuple[str, ...]:
        """See `Section`."""
        return () if self.file is None else (self.file,)

    def located(self, beside: Path) -> Pivot:
        """See `Section`."""
        return self if self.file is None else dataclasses.replace(self, file=whole_path(self.file, beside))

    @property
    def words(self) -> str:
        """The motion in a line."""
        end = "" if self.duration_s is None else f" to {self.start_s + self.duration_s:g} s"
        about = "" if self.axis is None or self.direction == "vertical" else f" {self.axis}"
        what = {
            "sine": f"{self.size:g} m/s2 at {self.frequency_hz or 0.0:g} Hz",
            "step": f"{self.size:g} m/s2",
            "track": f"{self.file}{'' if self.column is None else f', {self.column}'}, times {self.size:g}",
            "noise": f"{self.size:g} m/s2 rms up to {self.corner_hz or 0.0:g} Hz",
        }[self.kind]
        return f"{self.kind}, {what}, {self.direction}{about}, from {self.start_s:g} s{end}"

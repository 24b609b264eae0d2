"""The file of a real rig: where its sensors sit, what is wrong with them, how its logs are read, its pendulum."""

from __future__ import annotations

import logging
import math
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field, ValidationError

from cmg_mj.core.errors import InputError
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.types import STANDARD_GRAVITY
from cmg_mj.inputs.files import read_toml
from cmg_mj.inputs.messages import complaints
from cmg_mj.inputs.types import Positive
from cmg_mj.scenario.schema import FORBID

Place = Annotated[float, Field(ge=-10.0, le=10.0)]
"""Millimetres taken as metres are larger [m]."""


class PlacedAccelerometer(BaseModel):
    """An accelerometer with two axes in the tilting plane.

    Its axes show, with across and up of the body as real and imaginary part of the specific force f,
    scale * (the parts of f exp(-i angle)) + offset.
    """

    model_config = FORBID
    columns: tuple[str, str]
    """Headings of its first and its second axis."""
    unit: str = "m_s2"
    place_m: tuple[Place, Place]
    """Across and up from the pivot, in axes that tilt with the body and are horizontal and vertical at a tilt of 0."""
    angle_deg: float = 0.0
    """Angle from the body's axis across, which points where a growing tilt moves the top, to its first axis."""
    scale: tuple[float, float] = (1.0, 1.0)
    """Factor of each axis; a negative one turns the axis round."""
    offset_m_s2: tuple[float, float] = (0.0, 0.0)
    noise_m_s2: Positive | None = None
    """Standard deviation of a sample of an axis, which is alike in all if it is not given."""

    def force(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Return the specific force in the body's axes by what both axes show, (n,) [m/s^2]."""
        (s1, s2), (o1, o2) = self.scale, self.offset_m_s2
        return ((first - o1) / s1 + 1j * (second - o2) / s2) * np.exp(1j * math.radians(self.angle_deg))


class Pendulum(BaseModel):
    """The numbers of `--model`."""

    model_config = FORBID
    inertia: Positive
    gravity_torque: float
    momentum: float = 0.0
    gimbal_inertia: float = 0.0


class Rig(BaseModel):
    """A rig file."""

    model_config = FORBID
    log: dict[str, Any] = {}
    """Options of reading its logs, by their names in Python: columns, units, scale, offset, rate_hz, ..."""
    delays_s: dict[str, float] = {}
    """Role, or heading of an accelerometer's column -> by how much it comes late [s]."""
    accelerometer: tuple[PlacedAccelerometer, ...] = ()
    pivot_moves: bool = False
    angle_noise_deg: Positive | None = None
    """Standard deviation of a sample of the angle sensor."""
    rate_hz: Positive | None = None
    """Samples a second, of which the noise is."""
    pendulum: Pendulum | None = None

    @property
    def model(self) -> ReducedModel | None:
        """The reduced model of its pendulum, if it is known."""
        if self.pendulum is None:
            return None
        inertia, gravity_torque, momentum, added = self.pendulum.model_dump().values()
        return ReducedModel(inertia, added, momentum, 1.0, gravity_torque)

    def settings(self, source: str, *, with_pendulum: bool = True) -> dict[str, float]:
        """Return what a simulated rig can have of it as fields of a scenario.

        These are places, angles, noise and delay of its accelerometers, and the pendulum, if its flywheels have a
        momentum. Their offsets and scales are those of a log that is not yet corrected, and do not count.

        Args:
            source: The file, for messages.
            with_pendulum: Whether the plant gets its pendulum.

        Returns:
            Field -> value.

        Raises:
            InputError: It has not two accelerometers, or their noise and no rate.
        """
        if len(self.accelerometer) not in (0, 2):
            raise InputError(
                f"{source}: accelerometer: has {len(self.accelerometer)}; a simulated rig has two and no angle sensor"
            )
        placed = sorted(self.accelerometer, key=lambda one: math.hypot(*one.place_m))
        fields: dict[str, float] = {}
        for name, one in zip(("inner", "outer"), placed, strict=False):
            across, up = one.place_m
            values = {"m": up, "across_m": across, "angle_deg": one.angle_deg}
            fields |= {f"plant.accelerometer_{name}_{field}": value for field, value in values.items()}
        noises = [one.noise_m_s2 for one in placed if one.noise_m_s2]
        if noises:
            if self.rate_hz is None:
                raise InputError(f"{source}: rate_hz: give the samples a second, of which noise_m_s2 is")
            density = math.sqrt(2.0 / self.rate_hz) * math.hypot(*noises) / math.sqrt(len(noises)) / STANDARD_GRAVITY
            fields["sensors.accelerometer.noise_density_ug_rthz"] = 1e6 * density
        late = [self.delays_s.get(heading, 0.0) for one in placed for heading in one.columns]
        if any(late):
            fields["sensors.accelerometer.latency_s"] = max(0.0, sum(late) / len(late))
        if with_pendulum and self.pendulum and self.pendulum.momentum:
            fields["plant.tilt_inertia_kg_m2"] = self.pendulum.inertia
            fields["plant.tilt_gravity_n_m"] = self.pendulum.gravity_torque
            fields["plant.flywheel_momentum_n_m_s"] = self.pendulum.momentum
        elif with_pendulum and self.pendulum:
            text = "hint: %s: its pendulum is left out, since the momentum of its flywheels is not known"
            logging.getLogger("cmg_mj").warning(text, source)
        return {field: float(f"{value:.6g}") for field, value in fields.items()}


def load_rig(path: Path | str) -> Rig:
    """Read a rig file.

    Args:
        path: A TOML file.

    Raises:
        InputError: The file is no TOML, or has a field that is unknown or not allowed.
    """
    fields = read_toml(Path(path), f"--rig {path}")
    try:
        return Rig.model_validate(fields)
    except ValidationError as error:
        raise InputError(f"--rig {path}: {'; '.join(complaints(Rig, error.errors(), fields))}") from error

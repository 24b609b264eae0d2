"""Turns the true motion into what a real rig's sensors show, and when: accelerometers, encoders, gyros."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.core.noise import normals
from cmg_mj.core.sensor import SampledSensor, Site
from cmg_mj.inputs.types import STRICT
from cmg_mj.sensors.accelerometer import Accelerometer, Encoder
from cmg_mj.sensors.gyros import Fog, MemsGyro


@dataclass(frozen=True, config=STRICT)
class Sensors:
    """The rig's sensors.

    Attributes:
        accelerometer: The two accelerometers of the tilt estimate.
        encoder: The gimbals' encoders.
        fog: The fibre-optic gyro.
        mems_gyro: A cheap gyro that estimates are judged beside; nothing else uses it.
    """

    accelerometer: Accelerometer = Field(default_factory=Accelerometer)
    encoder: Encoder = Field(default_factory=Encoder)
    fog: Fog = Field(default_factory=Fog)
    mems_gyro: MemsGyro = Field(default_factory=MemsGyro)

    def with_noise_density(self, ug_rthz: float) -> Sensors:
        """Return the sensors with another noise density of the accelerometers [ug/sqrt(Hz)]."""
        return replace(self, accelerometer=replace(self.accelerometer, noise_density_ug_rthz=ug_rthz))

    def at_work(self, timestep: float, seed: int, world_ids: int | Sequence[int], axis: int = 0) -> list[SampledSensor]:
        """Start the sensors that the controller reads: the accelerometers, the encoders, the fibre-optic gyro.

        Args:
            timestep: Physics step [s].
            seed: The run's seed.
            world_ids: The number of one world, on floats, or the numbers of many, on arrays.
            axis: The number of the axis whose they are: each has noise of its own.

        Returns:
            The sensors, sampled.

        Raises:
            InputError: A rate or a time does not fit the physics step.
        """
        return [
            getattr(self, name).at_work(
                Site(
                    f"sensors.{name}",
                    timestep,
                    lambda stream, channels: normals(seed, world_ids, stream.on_axis(axis), channels),
                )
            )
            for name in ("accelerometer", "encoder", "fog")
        ]

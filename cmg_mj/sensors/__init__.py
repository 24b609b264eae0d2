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
        mems_gyro: A cheap gyro that estimates are judged beside, and that an observer may need.
    """

    accelerometer: Accelerometer = Field(default_factory=Accelerometer)
    encoder: Encoder = Field(default_factory=Encoder)
    fog: Fog = Field(default_factory=Fog)
    mems_gyro: MemsGyro = Field(default_factory=MemsGyro)

    def with_noise_density(self, ug_rthz: float) -> Sensors:
        """Return the sensors with another noise density of the accelerometers [ug/sqrt(Hz)]."""
        return replace(self, accelerometer=replace(self.accelerometer, noise_density_ug_rthz=ug_rthz))

    def at_work(
        self,
        timestep: float,
        seed: int,
        world_ids: int | Sequence[int],
        axis: int = 0,
        gyro_period_s: float | None = None,
    ) -> list[SampledSensor]:
        """Start the sensors that the controller reads: accelerometers, encoders, fibre-optic gyro, and any cheap one.

        Args:
            timestep: Physics step [s].
            seed: The run's seed.
            world_ids: The number of one world, on floats, or the numbers of many, on arrays.
            axis: The number of the axis whose they are: each has noise of its own.
            gyro_period_s: Time between two readings of the cheap gyro; None if no observer needs it [s].

        Returns:
            The sensors, sampled.

        Raises:
            InputError: A rate or a time does not fit the physics step.
        """

        def site(name: str) -> Site:
            return Site(
                f"sensors.{name}",
                timestep,
                lambda stream, channels: normals(seed, world_ids, stream.on_axis(axis), channels),
            )

        started = [getattr(self, name).at_work(site(name)) for name in ("accelerometer", "encoder", "fog")]
        if gyro_period_s is not None:
            started.append(self.mems_gyro.at_work(site("mems_gyro"), gyro_period_s))
        return started

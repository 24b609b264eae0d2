"""Turns the true motion into what a real rig's sensors show, and when: accelerometers, encoders, gyros."""

from __future__ import annotations

from dataclasses import replace

from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.core.sensor import Sensor, Site
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

    def at_work(self, timestep: float, axis: int = 0, gyro_period_s: float | None = None) -> tuple[Sensor, ...]:
        """Make the sensors that the controller reads: accelerometers, encoders, fibre-optic gyro, and any cheap one.

        Args:
            timestep: Physics step [s].
            axis: The number of the axis whose they are: each has noise of its own.
            gyro_period_s: Time between two readings of the cheap gyro; None if no observer needs it [s].

        Returns:
            The sensors.

        Raises:
            InputError: A rate or a time does not fit the physics step.
        """
        parts = {"accelerometer": self.accelerometer, "encoder": self.encoder, "fog": self.fog}
        sensors = [part.at_work(Site(f"sensors.{name}", timestep, axis)) for name, part in parts.items()]
        if gyro_period_s is not None:
            sensors.append(self.mems_gyro.at_work(Site("sensors.mems_gyro", timestep, axis), gyro_period_s))
        return tuple(sensors)

"""Describes a rig and its controllers as the plugin's C takes them, and refuses what that C does not have."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from cmg_mj.codegen.engine_plugin.sensor_numbers import Clock, steps_of
from cmg_mj.core.controller import Controller
from cmg_mj.errors import InputError
from cmg_mj.sensors.mems_gyro import MemsGyro
from cmg_mj.stages.low_pass import INSIDE_HZ
from cmg_mj.stages.turning import YawCoupling

MOST_AXES = 4
MOST_GIMBALS = 8
MOST_ESTIMATES = 64
LARGEST_SEED = 2**53
"""Seeds and worlds lie in the plugin's state, whose numbers are doubles."""


class PluginModule(NamedTuple):
    """A module of an axis."""

    name: str
    """Prefix of its elements' names, such as `cube1` or `roll/cube1`."""
    direction: float
    """Sign of u that its gimbal is given."""
    speed: float
    """Speed of its flywheel [rad/s]."""
    zero: float
    """Angle of its gimbal at which the flywheel's axis is upright [rad]."""


@dataclass(frozen=True)
class PluginAxis:
    """An axis of a rig, with its controller.

    Attributes:
        prefix: What its sensors' names begin with: empty, or `AXIS/`.
        modules: Its modules.
        joint: Name of the joint that it tilts about.
        shares: Of the joint's degrees of freedom in the tilt rate: of a hinge one, of a free joint those of the turn.
        controller: Its controller.
    """

    prefix: str
    modules: tuple[PluginModule, ...]
    joint: str
    shares: tuple[float, ...]
    controller: Controller


@dataclass(frozen=True)
class PluginRig:
    """A rig with its controllers.

    Attributes:
        axes: The axes.
        plugin: Name under which MuJoCo knows the plugin.
        turning: The coupling of the axes in a turn, and the gyro that shows it; None if turns are not compensated.
    """

    axes: tuple[PluginAxis, ...]
    plugin: str
    turning: tuple[YawCoupling, MemsGyro] | None = None

    @property
    def clock(self) -> Clock:
        """The clock of the plugin."""
        controller = self.axes[0].controller
        return Clock(controller.timestep, self.instant_steps, controller.period)

    @property
    def instant_steps(self) -> int:
        """Physics steps between the instants at which a sensor or the controller may be due."""
        spacings = [step for axis in self.axes for step in _sampling_steps(axis.controller)]
        return math.gcd(self.axes[0].controller.period, *spacings)

    @property
    def instant(self) -> float:
        """The time between these instants [s]."""
        return self.instant_steps * self.axes[0].controller.timestep

    def refuse_unsupported(self) -> None:
        """Refuse by name what the plugin does not have.

        Raises:
            InputError: It does not have something that is in use.
        """
        if len(self.axes) > MOST_AXES:
            raise InputError(f"{len(self.axes)} axes: a plugin takes at most {MOST_AXES}")
        for axis in self.axes:
            controller = axis.controller
            if len(axis.modules) > MOST_GIMBALS:
                raise InputError(f"{len(axis.modules)} modules on an axis: a plugin takes at most {MOST_GIMBALS}")
            if 3 + len(controller.extra_signals[0]) > MOST_ESTIMATES:
                raise InputError(f"an estimate of more than {MOST_ESTIMATES} parts: a plugin takes no more")
            if not isinstance(controller.worlds, int):
                raise InputError("a plugin is made from the controller of one world")
            for name, number in (("seed", controller.seed), ("world", controller.worlds)):
                if not 0 <= number <= LARGEST_SEED:
                    raise InputError(f"{name} = {number}: a plugin takes {name}s from 0 to 2^53")


def _sampling_steps(controller: Controller) -> tuple[int, ...]:
    """Physics steps that divide all instants at which accelerometers and encoders are due."""
    sensors, h = controller.sensors, controller.timestep
    pair = sensors.accelerometer
    steps = [steps_of(1.0 / pair.rate_hz, h), steps_of(1.0 / sensors.encoder.rate_hz, h)]
    if pair.bandwidth_hz:
        steps.append(steps_of(1.0 / INSIDE_HZ, h))
    if controller.feedback == "fog":
        steps.append(steps_of(1.0 / sensors.fog.rate_hz, h))
    return *steps, steps_of(pair.skew_s, h)

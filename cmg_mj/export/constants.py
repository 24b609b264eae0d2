"""The numbers of a controller beside its observer, with names, units and words: what a user may change in the C."""

from __future__ import annotations

from typing import NamedTuple

from cmg_mj.controller import Controller


class Constant(NamedTuple):
    """A number of the controller."""

    name: str
    value: float
    unit: str
    meaning: str


class Constants(NamedTuple):
    """The numbers that the measurement and the law take."""

    of_measure: list[Constant]
    of_law: list[Constant]
    encoders: int

    @property
    def measure(self) -> list[str]:
        """Names of those that the measurement takes."""
        return [constant.name for constant in self.of_measure]

    @property
    def law(self) -> list[str]:
        """Names of those that the law takes."""
        return [constant.name for constant in self.of_law]


def constants_of(controller: Controller) -> Constants:
    """The numbers of a controller."""
    tilt, law = controller.tilt, controller.law
    measure = [
        Constant("r_inner", tilt.r_inner, "m", "distance of the inner accelerometer from the tilt axis"),
        Constant("r_outer", tilt.r_outer, "m", "distance of the outer accelerometer from the tilt axis"),
    ]
    for i, direction in enumerate(controller.directions, 1):
        measure.append(Constant(f"direction_{i}", direction, "1", f"sign of u that gimbal {i} is given"))
    for i, zero in enumerate(controller.gimbal_zero, 1):
        measure.append(Constant(f"zero_{i}", zero, "rad", f"angle of encoder {i} at which its spin axis is upright"))
    k1, k2, k3, k4 = law.gains
    of_law = [
        Constant("period", law.dt, "s", "from one update to the next"),
        Constant("gain_x1", k1, "1/s", "K_e on the tilt"),
        Constant("gain_x2", k2, "1", "K_e on the tilt rate"),
        Constant("gain_x3", k3, "1/s", "K_e on the gimbal angle"),
        Constant("gain_x_e", k4, "1/s^2", "K_e on the integrator"),
        Constant("rate_limit", law.rate_limit, "rad/s", "largest gimbal rate"),
    ]
    return Constants(measure, of_law, len(controller.directions))

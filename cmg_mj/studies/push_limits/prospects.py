"""Limits of a pair on a robot: the largest push for any controller, and the push margin of this one."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from cmg_mj.errors import InputError
from cmg_mj.observers.reduced_model import ReducedModel
from cmg_mj.plant.mounting.fall_check import simulated_pole
from cmg_mj.plant.mounting.request import SCALES
from cmg_mj.plant.mujoco_state import quiet, set_control_callback
from cmg_mj.simulation.experiment import Experiment
from cmg_mj.studies.push_limits.largest_push import PUSH_S, PushMargin, push_margin
from cmg_mj.studies.push_limits.recoverable_states import RecoverableLimit, ceiling

LOW_LIMIT_DEG = 2.0
"""A pair that recovers less tilt is too small for the robot [deg]."""
POLE_DIFFERENCE = 0.1
"""Relative difference of the simulated pole from the reduced model's, from which the robot is unlike that model."""


@dataclass(frozen=True)
class Prospects:
    """Limits of a pair on a robot.

    Attributes:
        reduced: The robot's reduced model.
        limit: Limits for any controller.
        push_margin: Pushes that the scenario's law, observer and sensors recover from.
        pole: Unstable pole of the simulated robot, uncontrolled and with its flywheels at rest [1/s].
    """

    reduced: ReducedModel
    limit: RecoverableLimit
    push_margin: PushMargin
    pole: float

    @property
    def limit_push_impulse(self) -> float:
        """Impulse of the largest push of 0.1 s that any controller recovers from [N m s]; E cannot exceed it."""
        return self.limit.push_impulse(PUSH_S)

    @property
    def fraction_of_limit(self) -> float:
        """The push margin E, in shares of the limit for any controller."""
        return self.push_margin.median_impulse / self.limit_push_impulse

    @property
    def hints(self) -> list[str]:
        """Clauses on what is likely to make the robot fall, though it is no mistake."""
        hints = []
        if not abs(self.pole / self.limit.pole - 1.0) < POLE_DIFFERENCE:
            hints.append(
                f"the robot starts to fall with a pole of {self.pole:.3g} 1/s, its reduced model's is "
                f"{self.limit.pole:.3g}: what it stands on gives way (soft contacts, or joints held softly), or "
                "the hinge that it tilts about has a spring or damping"
            )
        if self.push_margin.median_impulse == 0.0:
            hints.append("with this controller it falls without a push")
        return hints

    def figures(self) -> dict[str, float]:
        """Return the figures by name, as `cmg-mj mount --json` prints them."""
        model = self.reduced
        n = model.gimbals
        return {
            "inertia_kg_m2": n * model.J1,
            "gravity_torque_n_m": n * model.gravity_torque,
            "momentum_n_m_s": n * model.J_d * model.omega_d,
            "pole_1_s": self.limit.pole,
            "pole_simulated_1_s": self.pole,
            "limit_tilt_deg": math.degrees(self.limit.tilt),
            "limit_impulse_n_m_s": self.limit.impulse,
            "limit_push_impulse_n_m_s": self.limit_push_impulse,
            "limit_push_torque_n_m": self.limit_push_impulse / PUSH_S,
            "push_margin_impulse_n_m_s": self.push_margin.median_impulse,
            "push_margin_worst_impulse_n_m_s": self.push_margin.worst_impulse,
            "push_margin_torque_n_m": self.push_margin.median_impulse / PUSH_S,
        }


def prospects(experiment: Experiment, axis: str = "") -> Prospects:
    """Find the limits of a pair on a robot.

    Args:
        experiment: The robot and its controller.
        axis: Name of the axis, if there are several.

    Returns:
        The limits.
    """
    matches = [part for part in experiment.axes if part.plant.axis.name == axis]
    experiment = matches[0] if matches else experiment
    plant = experiment.plant
    limit = ceiling(plant.reduced, experiment.law.rate_limit)
    with set_control_callback(None), quiet():
        pole = simulated_pole(plant.model, plant.key, plant.axis.line, plant.axis.bias)
    return Prospects(plant.reduced, limit, push_margin(experiment.scenario, experiment.design), pole)


def smallest_sufficient_scale(tilt_at: Callable[[float], float], scale: float) -> float | None:
    """Return a scale of the modules with which a robot recovers `LOW_LIMIT_DEG`, in steps of a tenth.

    Args:
        tilt_at: Scale -> largest tilt that any controller recovers from [rad].
        scale: A scale that does not suffice.

    Returns:
        The scale; None if none suffices up to the largest, or to the largest that can be mounted.
    """
    while (scale := round(1.1 * scale, 2)) <= SCALES[1]:
        try:
            tilt = tilt_at(scale)
        except InputError:  # no room for it, say
            return None
        if tilt >= math.radians(LOW_LIMIT_DEG):
            return scale
    return None

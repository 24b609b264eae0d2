"""What a pair can do on a robot: the ceiling for any controller, and what this one bears."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from cmg_mj.errors import InputError
from cmg_mj.observers.reduced_model import ReducedModel
from cmg_mj.plant.mounting.fall_check import falls_with
from cmg_mj.plant.mounting.request import SCALES
from cmg_mj.plant.mujoco_state import quiet, set_control_callback
from cmg_mj.simulation.experiment import Experiment
from cmg_mj.studies.push_limits.largest_push import PUSH_S, PushMargin, push_margin
from cmg_mj.studies.push_limits.recoverable_states import RecoverableLimit, ceiling

LOW_CEILING_DEG = 2.0
"""A pair that recovers less tilt is too small for the robot [deg]."""
OFF = 0.1
"""A robot that starts to fall so much faster or slower than its reduced model is not what that takes it for."""


@dataclass(frozen=True)
class Prospects:
    """What a pair can do on a robot.

    Attributes:
        reduced: The reduced model read off.
        ceiling: For any controller.
        push_margin: What the law, the observer and the sensors of the scenario bear.
        pole: The rate at which the simulated robot starts to fall with nothing controlled, its flywheels at rest [1/s].
    """

    reduced: ReducedModel
    ceiling: RecoverableLimit
    push_margin: PushMargin
    pole: float

    @property
    def ceiling_push(self) -> float:
        """The impulse of the largest push of 0.1 s that any controller recovers from [N m s]: E cannot exceed it."""
        return self.ceiling.push_impulse(PUSH_S)

    @property
    def fraction_of_limit(self) -> float:
        """E in shares of that."""
        return self.push_margin.median_impulse / self.ceiling_push

    @property
    def hints(self) -> list[str]:
        """What is no mistake and yet likely to make the robot fall, in clauses."""
        off = self.pole / self.ceiling.pole - 1.0
        hints = []
        if not abs(off) < OFF:
            hints.append(
                f"the robot starts to fall with a pole of {self.pole:.3g} 1/s, its reduced model's is "
                f"{self.ceiling.pole:.3g}: what it stands on gives way (soft contacts, or joints held softly), or "
                "the hinge that it tilts about has a spring or damping"
            )
        if self.push_margin.median_impulse == 0.0:
            hints.append("with this controller it falls without a push")
        return hints

    def figures(self) -> dict[str, Any]:
        """The numbers by name, as `--json` prints them."""
        model = self.reduced
        n = model.gimbals
        return {
            "inertia_kg_m2": n * model.J1,
            "gravity_torque_n_m": n * model.gravity_torque,
            "momentum_n_m_s": n * model.J_d * model.omega_d,
            "pole_1_s": self.ceiling.pole,
            "pole_simulated_1_s": self.pole,
            "ceiling_tilt_deg": math.degrees(self.ceiling.tilt),
            "ceiling_impulse_n_m_s": self.ceiling_push,
            "ceiling_push_n_m": self.ceiling_push / PUSH_S,
            "limit_impulse_n_m_s": self.ceiling.impulse,
            "push_margin_impulse_n_m_s": self.push_margin.median_impulse,
            "borne_impulse_least_n_m_s": self.push_margin.worst_impulse,
            "push_margin_torque_n_m": self.push_margin.median_impulse / PUSH_S,
        }


def prospects(experiment: Experiment, axis: str = "") -> Prospects:
    """Find what a pair can do.

    Args:
        experiment: The robot, and the controller it is to have.
        axis: Which axis of several, by its name.

    Returns:
        The prospects.
    """
    of_axis = [own for own in experiment.axes if own.plant.axis.name == axis]
    experiment = of_axis[0] if of_axis else experiment
    plant = experiment.plant
    top = ceiling(plant.reduced, experiment.law.rate_limit)
    with set_control_callback(None), quiet():
        pole = falls_with(plant.model, plant.key, plant.axis.line, plant.axis.bias)
    return Prospects(plant.reduced, top, push_margin(experiment.scenario, experiment.design), pole)


def smallest_sufficient_scale(ceiling_at: Callable[[float], float], scale: float) -> float | None:
    """A scale of the modules, a tenth larger each time, with which a robot recovers two degrees.

    Args:
        ceiling_at: The ceiling's tilt for a scale [rad].
        scale: What does not suffice.

    Returns:
        The scale; None if none suffices up to the largest, or to the largest that can be mounted.
    """
    while (scale := round(1.1 * scale, 2)) <= SCALES[1]:
        try:
            tilt = ceiling_at(scale)
        except InputError:  # no room for it, say
            return None
        if tilt >= math.radians(LOW_CEILING_DEG):
            return scale
    return None

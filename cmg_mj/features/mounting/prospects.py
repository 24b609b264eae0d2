"""Limits of a pair on a robot: the largest push for any controller, and the push margin of this one."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from cmg_mj.core.errors import InputError
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.features.mounting.fall_check import overlap, simulated_pole
from cmg_mj.features.mounting.largest_push import PUSH_S, PushMargin, push_margin
from cmg_mj.features.mounting.recoverable_states import RecoverableLimit, ceiling
from cmg_mj.features.mounting.request import SCALES
from cmg_mj.linear.verdict import SlidingPoles, sliding_poles
from cmg_mj.plant.mjcf import quiet, set_control_callback
from cmg_mj.runs.experiment import Experiment

LOW_LIMIT_DEG = 2.0
"""A pair that recovers less tilt is too small for the robot [deg]."""
START_DEG, START_SHARE = 1.0, 0.25
"""A run starts with one degree of tilt, or with a quarter of the recoverable tilt if that is less."""
POLE_DIFFERENCE = 0.1
"""Relative difference of the simulated pole from the reduced model's, from which the robot is unlike that model."""
NOISY = 0.75
"""Share of E. If the worst world of the reduced model recovers from less, the sensors' noise alone may fell a robot."""

NOISE_HINT = "the pair is so small that the sensors' noise alone may fell the robot"
"""Beginning of the hint that tells so."""


@dataclass(frozen=True)
class Prospects:
    """Limits of a pair on a robot.

    Attributes:
        reduced: The robot's reduced model.
        limit: Limits for any controller.
        push_margin: Pushes that the scenario's law, observer and sensors recover from.
        pole: Unstable pole of the simulated robot, uncontrolled and with its flywheels at rest [1/s].
        overlap: Clause on geoms that overlap where it stands; "" if there are none.
        sliding_poles: Slowest poles of the loop of a rig whose pivot slides freely; None for a pivot at rest.
    """

    reduced: ReducedModel
    limit: RecoverableLimit
    push_margin: PushMargin
    pole: float
    overlap: str = ""
    sliding_poles: SlidingPoles | None = None

    @property
    def limit_push_impulse(self) -> float:
        """Impulse of the largest push of 0.1 s that any controller recovers from [N m s]; E cannot exceed it."""
        return self.limit.push_impulse(PUSH_S)

    @property
    def fraction_of_limit(self) -> float:
        """The push margin E, in shares of the limit for any controller."""
        return self.push_margin.median_impulse / self.limit_push_impulse

    @property
    def noisy(self) -> bool:
        """True if the sensors' noise alone may fell the robot, by its reduced model."""
        return self.push_margin.worst_impulse < NOISY * self.push_margin.median_impulse

    @property
    def start_tilt_deg(self) -> float:
        """The tilt that a run of the robot starts with [deg]."""
        return float(f"{min(START_DEG, START_SHARE * math.degrees(self.limit.tilt)):.3g}")

    @property
    def hints(self) -> list[str]:
        """Clauses on what is likely to make the robot fall, though it is no mistake."""
        hints = []
        if not abs(self.pole / self.limit.pole - 1.0) < POLE_DIFFERENCE:
            reason = self.overlap or (
                "its support rolls or is soft (soft contacts, or joints held softly), or the hinge that it "
                "tilts about has a spring or damping"
            )
            hints.append(
                f"the robot starts to fall with a pole of {self.pole:.3g} 1/s, its reduced model's is "
                f"{self.limit.pole:.3g}: {reason}"
            )
        if self.noisy:
            share = self.push_margin.worst_impulse / self.push_margin.median_impulse
            hints.append(
                f"{NOISE_HINT}; with other noise it may fall of smaller pushes than it stands here (its "
                f"reduced model's worst world recovers from {share:.0%} of E)"
            )
        if self.push_margin.median_impulse == 0.0:
            hints.append("with this controller it falls without a push")
        return hints

    def figures(self) -> dict[str, float]:
        """Return the figures by name, as `cmg-mj mount --json` prints them."""
        model = self.reduced
        n, poles = model.gimbals, self.sliding_poles
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
            **({"pivot_arm_m": model.pivot_arm} if model.pivot_arm else {}),
            **({f"pole_tilt_{name}_1_s": pole for name, pole in poles._asdict().items()} if poles else {}),
        }


def prospects(experiment: Experiment, axis: str = "", *, with_margin: bool = True) -> Prospects:
    """Find the limits of a pair on a robot, by its reduced model.

    Args:
        experiment: The robot and its controller.
        axis: Name of the axis, if there are several.
        with_margin: Whether to find E, which takes longest; otherwise it is 0.

    Returns:
        The limits.
    """
    matches = [part for part in experiment.axes if part.plant.axis.name == axis]
    experiment = matches[0] if matches else experiment
    plant = experiment.plant
    limit = ceiling(plant.reduced, experiment.law.rate_limit)
    with set_control_callback(None), quiet():
        pole = simulated_pole(plant.model, plant.key, plant.axis.line, plant.axis.bias)
        touching = overlap(plant.model, plant.key, plant.axis.line, pole)
    margin = push_margin(experiment.scenario, experiment.design) if with_margin else PushMargin(0.0, 0.0)
    poles = sliding_poles(experiment.law, plant)
    return Prospects(plant.reduced, limit, margin, pole, touching, poles)


def smallest_sufficient_scale(suffices: Callable[[float], bool], scale: float) -> float | None:
    """Return a scale of the modules that suffices for a robot, in steps of a tenth.

    Args:
        suffices: Tries a scale.
        scale: A scale that does not suffice.

    Returns:
        The scale; None if none suffices up to the largest, or to the largest that can be mounted.
    """
    while (scale := round(1.1 * scale, 2)) <= SCALES[1]:
        try:
            if suffices(scale):
                return scale
        except InputError:  # no room for it, say
            return None
    return None

"""A pivot that slides freely, in words: what the sensors show of it, and whether the loop stands that."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cmg_mj.controllers.laws.state_feedback import StateFeedback
from cmg_mj.observers.reduced_model import MARGIN
from cmg_mj.scenario.linear_plant import LinearPlant
from cmg_mj.scenario.plant_parameters import PlantParameters
from cmg_mj.scenario.schema import Scenario

IN_THE_MODEL = "the inertia that is left, and the pivot's acceleration in what the sensors show"
NOT_IN_THE_MODEL = "friction, damping, springs and ends of what it slides on, and that the inertia grows with the tilt"
_FED = "with that angle and the true rate"
_UNKNOWN = "and what it slides on is damped or sprung so much that the mass centre does not stay where it is"
STANDS_STILL = 1e-6
"""A mode of the sampled loop that is so near 1 is the place of what slides, which nothing holds or moves."""


class SlidingPoles(NamedTuple):
    """Slowest pole of the loop fed with the true rate and the tilt taken about a point of the radial line [1/s].

    Attributes:
        about_centre: About the common mass centre.
        about_pivot: About the pivot.
    """

    about_centre: float
    about_pivot: float


def measured_tilt_pole(law: StateFeedback, rig: LinearPlant, height: float, gravity: float) -> float:
    """Find the slowest pole of the loop whose law is fed y1 and the true rate, by sensors without noise and delay.

    Args:
        law: The law.
        rig: The rig whose pivot slides, linearised with its servos.
        height: Height above the pivot of the point that the tilt estimate takes to be at rest [m].
        gravity: g [m/s^2].

    Returns:
        Its real part, as of a continuous loop [1/s]; infinite where a sample's growth is beyond all numbers.
    """
    y1, acceleration, y2, rate, _ = rig.C
    k1, k2, k3, k4 = law.gains
    gains = k1 * (y1 - height / gravity * acceleration) + k2 * rate + k3 * y2
    F, G = rig.hold(law.dt)
    n = len(F)
    closed = np.eye(n + 1)
    closed[:n, :n], closed[:n, n] = F - np.outer(G, gains), -k4 * G[:, 0]
    closed[n, :n] = -law.dt * y2
    if not np.all(np.isfinite(closed)):
        return math.inf
    z = np.linalg.eigvals(closed)
    return math.log(float(np.abs(z[np.abs(z - 1.0) > STANDS_STILL]).max())) / law.dt


def sliding_poles(law: object, rig: PlantParameters) -> SlidingPoles | None:
    """Find the slowest poles of the loop of a rig whose pivot slides; None for a pivot at rest, or another law."""
    if rig.slide is None or not isinstance(law, StateFeedback):
        return None
    linear = rig.slide()
    heights = rig.reduced.pivot_arm, 0.0
    return SlidingPoles(*(measured_tilt_pole(law, linear, height, rig.gravity) for height in heights))


def sliding_words(rig: PlantParameters) -> str:
    """Say what the tilt is taken about, for one line; empty for a pivot at rest."""
    arm = rig.reduced.pivot_arm
    if not arm:
        return ""
    if rig.tilt.height:
        return f"slides; the tilt is taken about the common mass centre, {arm:.3g} m above it, which stays where it is"
    return f"slides, and the tilt is taken about it: {measured_words(rig)}"


def measured_words(rig: PlantParameters) -> str:
    """Say what y1 shows if the tilt is taken about the pivot."""
    c1, d = rig.reduced.measured_tilt(0.0, rig.gravity)
    return f"y1 shows {c1:.3g} x1 + ({d:.3g} s) u"


def loop_words(pole: float) -> str:
    """Say whether a loop with this slowest pole [1/s] is stable."""
    return f"{'stable' if pole < -MARGIN else 'UNSTABLE'} (pole at {pole:.3g} 1/s)"


def sliding_hint(scenario: Scenario, law: object, rig: PlantParameters) -> str | None:
    """Clauses for a rig whose pivot slides: what its tilt is taken about, and a `[[pivot]]` that does nothing."""
    if not rig.reduced.pivot_arm:
        return None
    clauses = [_tilt_clause(scenario, law, rig), _across_clause(scenario)]
    return "; ".join(clause for clause in clauses if clause) or None


def _across_clause(scenario: Scenario) -> str:
    """Name the motions across: they accelerate what the pivot slides on, which friction alone hands on."""
    names = [
        f"pivot.{i}" for i, pivot in enumerate(scenario.pivot) if pivot.direction == "across" and np.any(pivot.size)
    ]
    if not names:
        return ""
    return (
        f"{', '.join(names)}: accelerates across what the pivot slides on, and moves the rig by no more than friction "
        'and damping there hand on; direction = "vertical" does move it'
    )


def _tilt_clause(scenario: Scenario, law: object, rig: PlantParameters) -> str | None:
    """Clause where the tilt is taken about the pivot, or the loop is unstable anyway."""
    measured = scenario.controller.angle_source == "measured"
    poles = sliding_poles(law, rig) if measured else None
    if rig.tilt.height:
        if poles is None or poles.about_centre < -MARGIN:
            return None
        return f"the pivot slides, {_UNKNOWN}: the loop is {loop_words(poles.about_centre)} {_FED}"
    loop = "" if poles is None else f"; the loop is {loop_words(poles.about_pivot)} {_FED}"
    return (
        f"plant.pivot_slides = false: the pivot slides, and {measured_words(rig)}{loop}; with "
        "plant.pivot_slides=true the tilt is taken about the common mass centre"
    )

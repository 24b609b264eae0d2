"""A pivot that slides freely, in words: what the sensors show of it, and whether the loop stands that."""

from __future__ import annotations

import math

import numpy as np

from cmg_mj.controllers.laws.state_feedback import StateFeedback
from cmg_mj.observers.reduced_model import MARGIN
from cmg_mj.scenario.linear_rig import LinearRig
from cmg_mj.scenario.plant_parameters import PlantParameters
from cmg_mj.scenario.schema import Scenario

IN_THE_MODEL = "the inertia that is left, and the pivot's acceleration in what the sensors show"
NOT_IN_THE_MODEL = "friction, damping, springs and ends of what it slides on, and that the inertia grows with the tilt"
STANDS_STILL = 1e-6
"""A mode of the sampled loop that is so near 1 is the place of what slides, which nothing holds or moves."""


def measured_tilt_pole(law: StateFeedback, rig: LinearRig, height: float, gravity: float) -> float:
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
    F, G = rig.held(law.dt)
    n = len(F)
    closed = np.eye(n + 1)
    closed[:n, :n], closed[:n, n] = F - np.outer(G, gains), -k4 * G[:, 0]
    closed[n, :n] = -law.dt * y2
    if not np.all(np.isfinite(closed)):
        return math.inf
    z = np.linalg.eigvals(closed)
    return math.log(float(np.abs(z[np.abs(z - 1.0) > STANDS_STILL]).max())) / law.dt


def pole_about_pivot(law: object, rig: PlantParameters) -> float:
    """Find the slowest pole with the tilt taken about a pivot that slides [1/s]; NaN for a law of another kind."""
    if rig.slide is None or not isinstance(law, StateFeedback):
        return math.nan
    return measured_tilt_pole(law, rig.slide(), 0.0, rig.gravity)


def sliding_words(rig: PlantParameters) -> str:
    """Say where the tilt is taken about, for one line; empty for a pivot at rest."""
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
    return f"{'stable' if pole < -MARGIN else 'unstable'} (pole at {pole:.3g} 1/s)"


def sliding_hint(scenario: Scenario, law: object, rig: PlantParameters) -> str | None:
    """Clause for a rig whose pivot slides while the tilt is taken about the pivot."""
    if not rig.reduced.pivot_arm or rig.tilt.height:
        return None
    pole = pole_about_pivot(law, rig) if scenario.controller.angle_source == "measured" else math.nan
    loop = "" if math.isnan(pole) else f"; fed with it and the true rate, the loop is {loop_words(pole)}"
    return (
        f"plant.pivot_slides = false: the pivot slides, and {measured_words(rig)}{loop}; with "
        "plant.pivot_slides=true the tilt is taken about the common mass centre"
    )

"""A pivot that slides freely, in words: what the sensors show of it, and whether the loop stands that."""

from __future__ import annotations

import math

import numpy as np

from cmg_mj.controllers.laws.state_feedback import StateFeedback
from cmg_mj.observers.reduced_model import MARGIN, ReducedModel
from cmg_mj.scenario.plant_parameters import PlantParameters
from cmg_mj.scenario.schema import Scenario

IN_THE_MODEL = "the inertia that is left, and the pivot's acceleration in what the sensors show"
NOT_IN_THE_MODEL = "friction, damping, springs and ends of what it slides on, and that the inertia grows with the tilt"


def measured_tilt_pole(law: StateFeedback, model: ReducedModel, gravity: float) -> float:
    """Find the slowest pole of the loop whose law is fed y1 with the tilt taken about the pivot, else the true state.

    y1 = c1 x1 + d u has the command in it that was held until the sample. Sensors have no delay, servos no lag.

    Args:
        law: The law.
        model: The reduced model of a rig whose pivot slides.
        gravity: g [m/s^2].

    Returns:
        Its real part, as of a continuous loop [1/s]; infinite where a sample's growth is beyond all numbers.
    """
    c1, d = model.measured_tilt(0.0, gravity)
    k1, *others = law.gains
    gains = np.array([k1 * c1, *others])
    A, B = model.held(law.dt)
    n = len(A)
    F = np.zeros((n + 1, n + 1))
    F[n, :n], F[n, n] = -gains, -k1 * d
    F[:n, :n], F[:n, n] = A - np.outer(B, gains), -k1 * d * B[:, 0]
    if not np.all(np.isfinite(F)):
        return math.inf
    return math.log(max(float(np.abs(np.linalg.eigvals(F)).max()), np.finfo(float).tiny)) / law.dt


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


def verdict(pole: float) -> str:
    """Say whether a loop with this slowest pole is stable [1/s]."""
    return f"{'stable' if pole < -MARGIN else 'unstable'} (pole at {pole:.3g} 1/s)"


def sliding_hint(scenario: Scenario, law: object, rig: PlantParameters) -> str | None:
    """Clause for a rig whose pivot slides while the tilt is taken about the pivot."""
    if not rig.reduced.pivot_arm or rig.tilt.height:
        return None
    loop = ""
    if isinstance(law, StateFeedback) and scenario.controller.angle_source == "measured":
        pole = measured_tilt_pole(law, rig.reduced, rig.gravity)
        loop = f"; fed with it and the true rate, the loop is {verdict(pole)}"
    return (
        f"plant.pivot_slides = false: the pivot slides, and {measured_words(rig)}{loop}; with "
        "plant.pivot_slides=true the tilt is taken about the common mass centre"
    )

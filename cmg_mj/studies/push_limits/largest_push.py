"""What a controller bears: the largest push its loop recovers from, on the reduced model with the sensors' noise."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cmg_mj.controllers.controller import Controller
from cmg_mj.observers.reduced_model import ReducedModel
from cmg_mj.scenario.design import Design
from cmg_mj.scenario.schema import Scenario
from cmg_mj.scenario.time_grid import common_period
from cmg_mj.sensors.ideal import IdealReading
from cmg_mj.sensors.tilt import RadialTilt
from cmg_mj.studies.push_limits.recoverable_states import ceiling

WORLDS = 10
LEVELS = 24
"""So many pushes are tried at once, and then as many between the largest borne and the next."""
PUSH_S = 0.1
BEFORE_S = 1.0
"""The loop runs for so long before the push comes [s]."""
AFTER_TIME_CONSTANTS = 10.0
"""Of the rig's unstable pole: until then it has recovered or fallen."""


class PushMargin(NamedTuple):
    """What a controller bears."""

    median_impulse: float
    """E: the largest impulse about the line, as a push of 0.1 s, that it recovers from, the median of ten worlds
    [N m s]. 0 if it falls without one."""
    worst_impulse: float
    """That of the worst of the worlds [N m s]."""


def bearable(scenario: Scenario, made: Design) -> PushMargin:
    """Find what the law, the observer and the sensors of a scenario bear together.

    The rig is the reduced model (4), upright, its gimbals turning as they are told.

    Args:
        scenario: For its sensors, its rates and its fall angle.
        made: The law and the observer for the rig.

    Returns:
        What they bear.
    """
    low, high = 0.0, 1.5 * ceiling(made.rig.reduced, made.law.rate_limit).push_impulse(PUSH_S)
    borne = _largest_push(scenario, made, np.linspace(low, high, LEVELS))
    if borne is None:
        return PushMargin(0.0, 0.0)
    step = high / (LEVELS - 1)
    finer = _largest_push(
        scenario, made, np.linspace(max(borne.worst_impulse - step, 0.0), borne.median_impulse + step, LEVELS)
    )
    return finer or borne


def _largest_push(scenario: Scenario, made: Design, impulses: np.ndarray) -> PushMargin | None:
    """Of each world the largest of some pushes up to which it stood; None if most fell with the first."""
    stood = _stands(scenario, made, impulses)
    upto = np.where(stood.all(axis=1), len(impulses), np.argmin(stood, axis=1)) - 1  # per world
    if np.median(upto) < 0:
        return None
    largest = np.where(upto < 0, 0.0, impulses[np.maximum(upto, 0)])
    return PushMargin(float(np.median(largest)), float(largest.min()))


def _stands(scenario: Scenario, made: Design, impulses: np.ndarray) -> np.ndarray:
    """Which worlds stood which pushes, (WORLDS, n_impulses)."""
    model, tilt = made.rig.reduced, made.rig.tilt
    numbers = np.repeat(np.arange(WORLDS), len(impulses)).tolist()
    torque = np.tile(impulses / PUSH_S, WORLDS)
    h = common_period(scenario.model_copy(update={"push": [], "duration_s": 1.0}))
    settings = scenario.controller
    controller = Controller(
        made.observer(),
        made.law,
        tilt,
        scenario.sensors,
        directions=[1.0] * model.gimbals,
        gimbal_zero=[0.0] * model.gimbals,
        timestep=h,
        seed=scenario.seed,
        worlds=numbers,
        feedback=settings.feedback,
        angle_source=settings.angle_source,
        bias_trim_s=settings.bias_trim_s,
    )
    after = AFTER_TIME_CONSTANTS / ceiling(model, made.law.rate_limit).pole
    steps = math.ceil((BEFORE_S + PUSH_S + after) / h)
    pushed = range(round(BEFORE_S / h), round((BEFORE_S + PUSH_S) / h))
    x = np.zeros((3, len(numbers)))
    fallen = np.zeros(len(numbers), dtype=bool)
    fall = math.radians(scenario.metrics.fall_angle_deg)
    beat = controller.steps_per_sample
    with np.errstate(all="ignore"):
        for step in range(0, steps, beat):
            push = torque if step in pushed else np.zeros_like(torque)
            held = np.zeros_like(torque) if controller.gimbal_rate is None else np.asarray(controller.gimbal_rate)
            ideal = _ideal(model, tilt, made.rig.gravity, x, held, push)
            if controller.update(step, ideal):
                held = np.asarray(controller.gimbal_rate)
            x = _rk4_step(model, x, held, push, beat * h)
            fallen |= ~(np.abs(x[0]) < fall)
            x[:, fallen] = 0.0
    return ~fallen.reshape(WORLDS, len(impulses))


def _slope(model: ReducedModel, x: np.ndarray, u: np.ndarray, push: np.ndarray) -> np.ndarray:
    x1, x2, x3 = x
    acceleration = model.tilt_acceleration(x1, x2, x3, u) + push / (model.gimbals * model.inertia(x3))
    return np.stack([x2, acceleration, u])


def _rk4_step(model: ReducedModel, x: np.ndarray, u: np.ndarray, push: np.ndarray, h: float) -> np.ndarray:
    """A step of RK4 with the command and the push held."""
    k1 = _slope(model, x, u, push)
    k2 = _slope(model, x + 0.5 * h * k1, u, push)
    k3 = _slope(model, x + 0.5 * h * k2, u, push)
    k4 = _slope(model, x + h * k3, u, push)
    return x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def _ideal(
    model: ReducedModel, tilt: RadialTilt, gravity: float, x: np.ndarray, u: np.ndarray, push: np.ndarray
) -> IdealReading:
    """What perfect sensors show on a rigid body that tilts about a fixed line."""
    x1, x2, x3 = x
    alpha = _slope(model, x, u, push)[1]
    forces = np.stack(
        [
            part
            for r in (tilt.r_inner, tilt.r_outer)
            for part in (r * alpha - gravity * np.sin(x1), gravity * np.cos(x1) - r * x2 * x2)
        ]
    )
    return IdealReading(forces, [x3.copy()] * model.gimbals, x2.copy(), x2.copy())

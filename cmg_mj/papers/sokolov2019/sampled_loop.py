"""The closed loop of one gimbal, linearised and sampled: the servo, the age of the tilt, an observer, the law.

From one control tick to the next the rig is linear near its equilibrium, and so are the linear observers and the law:
the map of a period is a matrix, and the loop oscillates by itself when an eigenvalue leaves the unit circle. The
matrix is made by running the observer and the law themselves on unit vectors, so it is the loop as implemented.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import brentq

from cmg_mj.core.reduced_model import ReducedModel, hold_matrices
from cmg_mj.laws.state_feedback import StateFeedback
from cmg_mj.observers import Measurement, Observer
from cmg_mj.runs.experiment import Experiment


@dataclass(frozen=True)
class Servo:
    """A gimbal's position loop; its setpoint is the integral of the commanded rate.

    Attributes:
        kp: Stiffness [N m/rad].
        kv: Damping [N m s/rad].
        inertia: I_c + I_d [kg m^2].
    """

    kp: float
    kv: float
    inertia: float

    @property
    def lag_s(self) -> float:
        """Delay of the angle behind a setpoint that moves steadily [s]."""
        return self.kv / self.kp

    def damp(self, lag_s: float) -> Servo:
        """Return a servo as stiff, with another lag: more damping."""
        return replace(self, kv=lag_s * self.kp)

    def soften(self, lag_s: float) -> Servo:
        """Return a critically damped servo with another lag: less stiffness."""
        kp = 4.0 * self.inertia / lag_s**2
        return replace(self, kp=kp, kv=lag_s * kp)


def rig_matrices(model: ReducedModel, servo: Servo) -> tuple[np.ndarray, np.ndarray]:
    """Linearise sokolov2019 (1) with the servo's torque upright: x' = A x + B u.

    The state is tilt, tilt rate, gimbal angle, gimbal rate and setpoint. The flywheel's torque -J_d w_d x2 drives the
    gimbal back.

    Returns:
        A (5, 5), B (5, 1).
    """
    h, J1, inertia = model.J_d * model.omega_d, model.J1, servo.inertia
    A = np.zeros((5, 5))
    A[0, 1] = 1.0
    A[1, [0, 3]] = model.gravity_torque / J1, h / J1
    A[2, 3] = 1.0
    A[3, [1, 2, 3, 4]] = -h / inertia, -servo.kp / inertia, -servo.kv / inertia, servo.kp / inertia
    B = np.zeros((5, 1))
    B[4, 0] = 1.0
    return A, B


def period_map(
    experiment: Experiment, servo: Servo, observer: Observer | None, age_steps: int, share: complex
) -> np.ndarray:
    """Return the matrix that takes the loop from one control tick to the next.

    Args:
        experiment: Its rig, but for the servo, and its law; the law's rate limit does not count.
        servo: The gimbal's servo.
        observer: A linear observer; None for the true rate in the law.
        age_steps: Age of y1 at a tick [physics steps]: the latency of the accelerometers.
        share: Share of the commanded rate that reaches the gimbal's setpoint: 1, or the describing function of a gap.

    Returns:
        A square matrix. Its state is that of the rig, the tilts not yet seen, the observer's, x_e and the last u.
    """
    assert isinstance(experiment.law, StateFeedback)
    law, timestep = replace(experiment.law, rate_limit=math.inf), experiment.plant.model.opt.timestep
    Phi, hold, _ = hold_matrices(*rig_matrices(experiment.plant.reduced, servo), timestep)
    start: Any = observer.init(Measurement(0.0, 0.0)) if observer else ()
    parts = np.cumsum([5, age_steps, len(start)])

    def period(v: np.ndarray) -> np.ndarray:
        rig, pending_tilts, observer_state, (x_e, u) = np.split(v, parts)
        y1, y2 = (pending_tilts[-1] if age_steps else rig[0]), rig[2]
        x2 = rig[1]
        if observer:
            state, estimate = observer.step(type(start)(*observer_state), Measurement(y1, y2), u)
            observer_state, x2 = np.array(state), estimate.x2
        u, x_e = law(y1, x2, y2, x_e)
        for _ in range(round(law.dt / timestep)):
            pending_tilts = np.concatenate([rig[:1], pending_tilts])[:age_steps]
            rig = Phi @ rig + hold[:, 0] * (share * u)
        return np.concatenate([rig, pending_tilts, observer_state, [x_e, u]])

    return np.column_stack([period(unit) for unit in np.eye(parts[-1] + 2)])


def modes(matrix: np.ndarray, dt: float) -> np.ndarray:
    """Return the poles s = log(z)/dt of a period's map, the least damped first [1/s]."""
    z = np.linalg.eigvals(matrix)
    s = np.log(z[np.abs(z) > 1e-9].astype(complex)) / dt
    return s[np.argsort(-s.real)]


def oscillation(matrix: np.ndarray, dt: float) -> complex:
    """Find the least damped oscillating pole with a frequency above 1 rad/s [1/s]: the integrator's pair is slower."""
    return complex(next(s for s in modes(matrix, dt) if s.imag > 1.0))


def first_crossing(
    value: Callable[[float], float], low: float, high: float, points: int = 40, xtol: float = 1e-7
) -> float | None:
    """Return the smallest argument at which a function rises through zero, on a grid; None if it does not."""
    grid = np.linspace(low, high, points).tolist()
    values = [value(x) for x in grid]
    for (a, at_a), (b, at_b) in pairwise(zip(grid, values, strict=True)):
        if at_a < 0.0 <= at_b:
            root: Any = brentq(value, a, b, xtol=xtol)
            return root
    return None

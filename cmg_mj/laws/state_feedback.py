"""State feedback with an integrator: (8) of aranovskiy2020, and where its gains come from."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from cmg_mj.core.arrays import Scalar, clip, where
from cmg_mj.core.errors import InputError
from cmg_mj.core.reduced_model import ReducedModel, is_hurwitz
from cmg_mj.core.types import FeedbackState, Measurement, feedback_state
from cmg_mj.observers.scaling import PAPERS_GRAVITY

TABLE_2_GAINS = (35.0, 4.0, -1.0, 0.3)
"""K_e of aranovskiy2020 Table 2, on [x1, x2, x3, x_e]."""
PAPERS_AUTHORITY = 0.3454 / 0.061841
"""b0 = J_d omega_d/J1 of the rig that Table 2's gains were chosen for (aranovskiy2020 Table 1) [1/s]."""


def lqr_gains(model: ReducedModel, state_cost: Sequence[float], input_cost: float) -> tuple[float, ...]:
    """Solve for the gains of (8) with python-control.

    Args:
        model: The reduced model.
        state_cost: Weights of x1, x2, x3, x_e, (4,), not negative.
        input_cost: Weight of u, positive.

    Returns:
        K_e, (4,).

    Raises:
        InputError: The weights do not make a stabilising gain.
    """
    import control  # 1.5 s of import, needed only here

    Q, R = np.diag(state_cost), np.array([[input_cost]])
    K, _ = solved("controller.lqr", lambda: control.lqr(model.A_e, model.B_e, Q, R), is_hurwitz)
    return tuple(float(k) for k in np.ravel(K))


def solved(
    what: str, solve: Callable[[], tuple[Any, Any, Any]], is_stable: Callable[[np.ndarray], bool]
) -> tuple[np.ndarray, np.ndarray]:
    """Return a gain and the Riccati equation's solution.

    Args:
        what: The weights, for the message.
        solve: Returns these and the poles.
        is_stable: Judges the poles.

    Raises:
        InputError: There is no stabilising gain.
    """
    try:
        gain, P, poles = (np.asarray(part) for part in solve())
        if not (np.all(np.isfinite(gain)) and is_stable(poles)):
            raise ValueError("give what is zero or tiny a larger one")
    except Exception as error:
        raise InputError(f"{what}: no stabilising gain for these weights ({error})") from error
    return gain, P


def scaled_gains(model: ReducedModel) -> tuple[float, float, float, float]:
    """Return the gains that make a rig's linearised loop the papers' own, slowed down or sped up.

    With b = J_d omega_d/J1 and g = m g h/J1 of this rig, its time runs tau = sqrt(g0/g) times as slowly as that of the
    papers' rig, and a gimbal rate does 1/r as much, r = b0/b. Then [k1 r/tau^2, k2 r/tau, k3/tau, k4/tau^2] has the
    poles of [k1, k2, k3, k4] on the papers' rig, divided by tau.

    Args:
        model: The rig's reduced model.

    Returns:
        K_e on [x1, x2, x3, x_e].
    """
    k1, k2, k3, k4 = TABLE_2_GAINS
    r = PAPERS_AUTHORITY / (model.J_d * model.omega_d / model.J1)
    tau = math.sqrt(PAPERS_GRAVITY / (model.gravity_torque / model.J1))
    return k1 * r / tau**2, k2 * r / tau, k3 / tau, k4 / tau**2


def closed_loop_poles(model: ReducedModel, gains: Sequence[float]) -> np.ndarray:
    """Poles of the linearisation (6) with the law fed by the true state, (4,) [1/s]."""
    return np.linalg.eigvals(model.A_e - model.B_e @ np.array([gains]))


class Integrated(NamedTuple):
    """The law's memory."""

    x_e: Scalar
    """Integral of -x3 [rad s]."""


_new = tuple.__new__


@dataclass(frozen=True)
class StateFeedback:
    """State feedback with an integrator: (8) of aranovskiy2020, and where its gains come from.

    u = -K_e [x1, x2, x3, x_e], x_e' = -x3 (aranovskiy2020 (8)), with the rate limit and anti-windup.

    While the command is limited, the integrator takes no step that would push it further into the limit.

    Attributes:
        dt: Control period [s].
        gains: K_e, (4,).
        rate_limit: Largest gimbal rate [rad/s].
    """

    arrays: ClassVar[tuple[str, ...]] = ("gains", "rate_limit")

    dt: float
    gains: tuple[float, float, float, float] = TABLE_2_GAINS
    rate_limit: float = 4.7

    @property
    def trim_gain(self) -> Scalar:
        """k_e1/k_e4: with y1 = x1 - e the integrator settles at that times e [s]; infinite where k_e4 is zero."""
        k1, _, _, k4 = self.gains
        return math.inf if np.any(k4 == 0.0) else k1 / k4

    def init(self, y: Measurement) -> Integrated:
        """Nothing integrated yet."""
        return Integrated(0.0 * y.y1)

    def step(self, state: Integrated, y: Measurement, x: FeedbackState, u: Scalar) -> tuple[Integrated, Scalar]:
        """Decide on one sample."""
        x1, x2, x3 = x
        (x_e,) = state
        k1, k2, k3, k4 = self.gains
        limit = self.rate_limit
        demanded = -(k1 * x1 + k2 * x2 + k3 * x3 + k4 * x_e)
        u = clip(demanded, -limit, limit)
        after = x_e - self.dt * x3
        if u is not demanded:  # a float within the limit is what it was
            # The integrator moves the demand at the rate k4 x3.
            after = where((u != demanded) & (k4 * x3 * demanded > 0.0), x_e, after)
        return _new(Integrated, (after,)), u

    def __call__(self, x1: Scalar, x2: Scalar, x3: Scalar, x_e: Scalar) -> tuple[Scalar, Scalar]:
        """Command and the next integrator state.

        Args:
            x1: Tilt, measured or estimated [rad].
            x2: Tilt rate [rad/s].
            x3: Gimbal angle, measured or estimated [rad].
            x_e: Integrator [rad s].

        Returns:
            The gimbal rate u [rad/s] to hold for a period, and x_e at the next tick.
        """
        state, u = self.step(Integrated(x_e), Measurement(x1, x3), feedback_state(x1, x2, x3), 0.0)
        return u, state.x_e

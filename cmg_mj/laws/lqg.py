"""Linear-quadratic-Gaussian control: a steady-state Kalman filter and a state feedback, both optimal for (6)."""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar, clip, dot, where
from cmg_mj.core.reduced_model import ReducedModel, hold_matrices
from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.core.types import FeedbackState, Measurement
from cmg_mj.inputs.types import STRICT, NonNegative, Positive
from cmg_mj.laws.state_feedback import solved
from cmg_mj.observers.kalman import COLUMNS, Kalman

MIN_NOISE = 1e-6
"""Standard deviation that a measurement without noise counts with: the filter's gains need some [rad]."""

Four = tuple[float, float, float, float]


class LqgState(NamedTuple):
    """The filter's prediction of the next sample, and the integrator."""

    x1: Scalar
    x2: Scalar
    x3: Scalar
    torque: Scalar
    x_e: Scalar


@dataclass(frozen=True, config=STRICT)
class Lqg:
    """Linear-quadratic-Gaussian control: a steady-state Kalman filter and a state feedback, both optimal for (6).

    u = -K [x1 + torque/(n M), x2, x3, x_e], all estimated by the law's own filter; x_e' = -x3.

    The model is the linearisation (6) with a torque on the rig beside it, sampled exactly with u held:

        x+ = F x + G u + w,  x = [x1, x2, x3, torque],  y = [x1 + v1, x3 + v2].

    The torque is a random walk with white torque beside it, and the gimbals do not quite turn as commanded: w is that
    of `kalman`, with the same parameters. v1, v2 are as the sensors' datasheet says. The filter is the steady-state
    one (`control.dlqe`): with P = F (P - M C P) F' + Q and M = P C' (C P C' + R)^-1, the estimate at a sample is
    what was expected plus M times what was not.

    K minimises the integral of state_cost . [x1, x2, x3, x_e]^2 + input_cost u^2 on (6) with the integrator, for a u
    held between samples: cost and motion are sampled exactly, cross terms included (`control.dlqr`). With the default
    weights, continuous control has Table 2's gains to their printed digits on the papers' rig.

    Integral action is there twice. A bias e or a constant torque moves the equilibrium: the rig balances where gravity
    cancels the torque, at x1 = -torque/(n M), M the gravity torque of one of n gimbals' shares. The law feeds back the
    tilt from there. While the torque is still being learnt, and where something else turns the gimbals steadily, the
    integrator of (8) brings them back, fed with the estimated angle and exact for a u held: x_e+ = x_e - dt (x3 + dt
    u/2). While the command is limited, it takes no step that would push it further into the limit.

    Attributes:
        dt: Control period [s].
        rate_limit: Largest gimbal rate [rad/s].
        model: The reduced model.
        noise: Of the tilt and of the gimbal angle, by the sensors' datasheet.
        state_cost: Weights of x1, x2, x3, x_e.
        input_cost: Weight of u.
        torque_walk: Random walk of the unknown torque: its standard deviation after a second [N m].
        torque_white: White torque: standard deviation of its integral after a second [N m s].
        gimbal_white: White noise of the gimbals' rate: standard deviation of its integral after a second [rad].
    """

    needs: ClassVar[tuple[str, ...]] = ()
    arrays: ClassVar[tuple[str, ...]] = ("rate_limit",)

    dt: Positive
    rate_limit: Positive
    model: ReducedModel
    noise: MeasurementNoise
    state_cost: tuple[NonNegative, NonNegative, NonNegative, NonNegative] = (405.6, 2.26, 0.223, 0.096)
    input_cost: Positive = 1.0
    torque_walk: Positive = Kalman.torque_walk
    torque_white: Positive = Kalman.torque_white
    gimbal_white: Positive = Kalman.gimbal_white

    def __post_init__(self) -> None:
        _ = self.gains, self.innovation_gain

    @cached_property
    def gains(self) -> Four:
        """K, (4,)."""
        import control  # 1.5 s of import, needed only here

        F, G, Q, N, R = sampled_cost(
            self.model.A_e, self.model.B_e, np.diag(self.state_cost), np.array([[self.input_cost]]), self.dt
        )
        K = solved("state_cost", lambda: control.dlqr(F, G, Q, R, N), _is_stable)
        return tuple(np.ravel(K[0]).tolist())  # type: ignore[return-value]

    @cached_property
    def transition(self) -> tuple[np.ndarray, np.ndarray]:
        """F (4, 4) and G (4, 1): x1, x2, x3, torque a sample later, with u held."""
        return hold_matrices(self._kalman.A, self.model.B_e, self.dt)[:2]

    @property
    def C(self) -> np.ndarray:
        """x1 and x3 are measured, (2, 4)."""
        return np.hstack([self.model.C, np.zeros((2, 1))])

    @cached_property
    def _kalman(self) -> Kalman:
        """Has the same model and the same w."""
        return Kalman(self.dt, self.model, self.noise, self.torque_walk, self.torque_white, self.gimbal_white)

    @property
    def process_noise(self) -> np.ndarray:
        """Q, covariance of w, (4, 4)."""
        return np.array([[self._kalman.process_noise[place] for place in column] for column in COLUMNS])

    @property
    def measurement_noise(self) -> np.ndarray:
        """R, covariance of v1, v2, (2, 2) [rad^2]."""
        return np.diag([max(MIN_NOISE, sigma) ** 2 for sigma in (self.noise.tilt, self.noise.gimbal)])

    @cached_property
    def expected_covariance(self) -> np.ndarray:
        """P, of the error of what is expected at a sample, before the sample, (4, 4)."""
        import control

        F, Q, R = self.transition[0], self.process_noise, self.measurement_noise
        return solved(
            "torque_walk, torque_white, gimbal_white", lambda: control.dlqe(F, np.eye(4), self.C, Q, R), _is_stable
        )[1]

    @cached_property
    def innovation_gain(self) -> np.ndarray:
        """M, on what was not expected, (4, 2)."""
        P, C = self.expected_covariance, self.C
        return np.linalg.solve(C @ P @ C.T + self.measurement_noise, C @ P).T

    @cached_property
    def _numbers(self) -> tuple[list, list, float]:
        """Rows of M, rows of [F G], and tilt per torque."""
        F, G = self.transition
        per_torque = 1.0 / (self.model.gimbals * self.model.gravity_torque)
        return self.innovation_gain.tolist(), np.hstack([F, G]).tolist(), per_torque

    def init(self, y: Measurement) -> LqgState:
        """Start at rest at the measured angles, with no torque."""
        zero = 0.0 * y.y1
        return LqgState(y.y1, zero, y.y2, zero, zero)

    def step(self, state: LqgState, y: Measurement, x: FeedbackState, u: Scalar) -> tuple[LqgState, Scalar]:
        """Decide on one sample."""
        expected = state[:4]
        gain, ahead, per_torque = self._numbers
        off1, off2 = y[0] - expected[0], y[1] - expected[2]
        x1, x2, x3, torque = [p + (m1 * off1 + m2 * off2) for p, (m1, m2) in zip(expected, gain, strict=True)]
        x_e = state[4]

        k1, k2, k3, k4 = self.gains
        demanded = -(k1 * (x1 + per_torque * torque) + k2 * x2 + k3 * x3 + k4 * x_e)
        u = clip(demanded, -self.rate_limit, self.rate_limit)
        winding = (u != demanded) & (k4 * x3 * demanded > 0.0)
        x_e = where(winding, x_e, x_e - self.dt * (x3 + 0.5 * self.dt * u))
        e1, e2, e3, e4 = (dot(row, (x1, x2, x3, torque, u)) for row in ahead)
        return LqgState(e1, e2, e3, e4, x_e), u


def sampled_cost(
    A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray, dt: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the integral of x'Qx + u'Ru along x' = A x + B u, for a u held over a period (Van Loan).

    Args:
        A: State matrix, (n, n).
        B: Input matrix, (n, m).
        Q: Weights of the state, (n, n).
        R: Weights of the input, (m, m).
        dt: Period [s].

    Returns:
        F (n, n), G (n, m) of x+ = F x + G u, and Q (n, n), N (n, m), R (m, m) of x'Qx + 2 x'Nu + u'Ru, a period's cost.
    """
    from scipy.linalg import expm

    n, m = B.shape
    zero = np.zeros((m, n))
    both = np.block([[A, B], [zero, np.zeros((m, m))]])
    weights = np.block([[Q, zero.T], [zero, R]])
    whole = expm(np.block([[-both.T, weights], [np.zeros_like(both), both]]) * dt)
    moved = whole[n + m :, n + m :]
    cost = moved.T @ whole[: n + m, n + m :]
    cost = 0.5 * (cost + cost.T)
    return moved[:n, :n], moved[:n, n:], cost[:n, :n], cost[:n, n:], cost[n:, n:]


def _is_stable(poles: np.ndarray) -> bool:
    return bool(np.all(np.abs(poles) < 1.0))

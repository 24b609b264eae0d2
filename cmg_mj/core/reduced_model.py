"""The papers' reduced model: one inverted pendulum, one gimbal angle, the gimbal rate as its input.

aranovskiy2020 (2)-(6); sokolov2019 (1)-(5) is the same model with other numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cmg_mj.core.arrays import Scalar, cos, sin

if TYPE_CHECKING:
    import control
    from numpy.typing import ArrayLike


Terms = tuple[Scalar, Scalar, Scalar]
"""drift [rad/s^2], gain [1/s] and damping [1] of f2 in (4): f2 = drift + u (gain - damping x2)."""


MARGIN = 1e-6
"""Least rate of a mode that counts as fading [1/s]. 1/MARGIN is eleven days.

Rounding moves a pole at zero by about 1e-16 times the largest entry, to either side and otherwise on every processor.
"""


def is_hurwitz(poles: ArrayLike) -> bool:
    """Check that every mode fades.

    Args:
        poles: Eigenvalues of a system's matrix [1/s].

    Returns:
        Whether all lie left of -MARGIN.
    """
    return bool(np.max(np.real(poles)) < -MARGIN)


@dataclass(frozen=True)
class ReducedModel:
    """Parameters of the reduced model, each for one gimbal's share of the rig.

    State x = [x1, x2, x3]: tilt from the equilibrium [rad], tilt rate [rad/s], gimbal angle from
    the spin axis' upright position [rad]. Input u: gimbal rate [rad/s].

    Attributes:
        J1: I_d + J_b + K_c + m l^2/2 [kg m^2], the tilt inertia at x3 = 0.
        J2: J_c - I_d + J_d - K_c [kg m^2], what the gimbal angle adds to it.
        J_d: Flywheel's spin inertia [kg m^2].
        omega_d: Flywheel's nominal speed [rad/s].
        gravity_torque: m g l/sqrt(2) [N m], the gravity torque at a tilt of 90 degrees.
        gimbals: Among how many gimbals the rig is shared; a torque on the whole rig counts 1/gimbals here.
        pivot_arm: c [m]. A pivot that slides freely, as on a light cart, is accelerated by the rig itself:
            a_p = -c (x2' cos(x1) - x2^2 sin(x1)). The point of the radial line so far above it stays where it is: the
            common mass centre of rig and cart, c = m h/M. J1 is then the inertia that is left, J - m h c/gimbals. 0 for
            a pivot at rest.
    """

    J1: float
    J2: float
    J_d: float
    omega_d: float
    gravity_torque: float
    gimbals: int = 1
    pivot_arm: float = 0.0

    def pivot_acceleration(self, x1: Scalar, x2: Scalar, tilt_acceleration: Scalar) -> Scalar:
        """Acceleration of the pivot across the tilt axis, to the side that a positive tilt leans to [m/s^2]."""
        return -self.pivot_arm * (tilt_acceleration * cos(x1) - x2 * x2 * sin(x1))

    def measured_tilt(self, height: float, gravity: float) -> tuple[float, float]:
        """Return the linearised y1 = c1 x1 + d u, where accelerometers take a point of the radial line to be at rest.

        From y1 = x1 - a/g, a = (height - pivot_arm) x2' the acceleration of that point, and (6).

        Args:
            height: Of that point above the pivot [m]; at `pivot_arm` y1 is x1.
            gravity: g [m/s^2].

        Returns:
            c1 and d [s].
        """
        delay = (self.pivot_arm - height) / gravity
        return 1.0 + delay * self.gravity_torque / self.J1, delay * self.J_d * self.omega_d / self.J1

    def inertia(self, x3: Scalar) -> Scalar:
        """D = J1 + J2 sin(x3)^2, one share's tilt inertia [kg m^2]."""
        s = sin(x3)
        return self.J1 + self.J2 * s * s

    @cached_property
    def _numbers(self) -> tuple[float, float, float, float, float]:
        """J1, J2, m g l/sqrt(2), J_d omega_d and 2 J2."""
        return self.J1, self.J2, self.gravity_torque, self.J_d * self.omega_d, self.J2 * 2.0

    def terms(self, x1: Scalar, x3: Scalar) -> Terms:
        """Parts of f2 in (4) that the angles decide: f2 = drift + u (gain - damping x2)."""
        # Observers spend their time here: floats or arrays is decided once, numbers are looked up once.
        sin, cos = (math.sin, math.cos) if type(x3) is float else (np.sin, np.cos)
        J1, J2, gravity_torque, momentum, twice_J2 = self._numbers
        s, c = sin(x3), cos(x3)
        D = J1 + J2 * s * s
        return gravity_torque * sin(x1) / D, momentum * c / D, twice_J2 * s * c / D

    def tilt_acceleration(self, x1: Scalar, x2: Scalar, x3: Scalar, u: Scalar) -> Scalar:
        """f2(x, u) [rad/s^2], the second line of (4)."""
        drift, gain, damping = self.terms(x1, x3)
        return drift + u * (gain - damping * x2)

    def slopes(
        self, x1: Scalar, x2: Scalar, x3: Scalar, u: Scalar, torque: Scalar
    ) -> tuple[Scalar, Scalar, Scalar, Scalar, Scalar]:
        """f2 of (4) with a tilting torque on the rig beside it, and how it changes.

        Args:
            x1: Tilt [rad].
            x2: Tilt rate [rad/s].
            x3: Gimbal angle [rad].
            u: Gimbal rate [rad/s].
            torque: On the whole rig [N m].

        Returns:
            f2 [rad/s^2]; its slopes in x1 [1/s^2], x2 [1/s], x3 [1/s^2] and in the torque [1/(kg m^2)].
        """
        J1, J2, gravity_torque, momentum, twice_J2 = self._numbers
        s, c = sin(x3), cos(x3)
        per_D, bent = 1.0 / (J1 + J2 * s * s), twice_J2 * s * c  # bent is dD/dx3
        per_torque, damping = per_D / self.gimbals, u * bent * per_D
        f2 = per_D * (gravity_torque * sin(x1) + u * momentum * c) - damping * x2 + per_torque * torque
        turning = -u * (momentum * s + twice_J2 * (c * c - s * s) * x2)  # of D f2, but for the torque
        return f2, gravity_torque * cos(x1) * per_D, -damping, per_D * (turning - bent * f2), per_torque

    @property
    def A(self) -> np.ndarray:
        """State matrix of the linearisation (6), (3, 3)."""
        return np.array([[0.0, 1.0, 0.0], [self.gravity_torque / self.J1, 0.0, 0.0], [0.0, 0.0, 0.0]])

    @property
    def B(self) -> np.ndarray:
        """Input matrix of the linearisation (6), (3, 1)."""
        return np.array([[0.0], [self.J_d * self.omega_d / self.J1], [1.0]])

    @property
    def C(self) -> np.ndarray:
        """Output matrix, (2, 3): tilt and gimbal angle are measured."""
        return np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])

    @property
    def A_e(self) -> np.ndarray:
        """A with the integrator x_e' = -x3 appended, (4, 4)."""
        A_e = np.pad(self.A, (0, 1))
        A_e[3, 2] = -1.0
        return A_e

    @property
    def B_e(self) -> np.ndarray:
        """B with the integrator appended, (4, 1)."""
        return np.vstack([self.B, [[0.0]]])

    def linear_system(self) -> control.StateSpace:
        """Return the linearisation (6) with the measured outputs, for python-control."""
        import control

        return control.StateSpace(self.A, self.B, self.C, np.zeros((2, 1)), **_SIGNALS)

    def nonlinear_system(self) -> control.NonlinearIOSystem:
        """Return the reduced model (4) itself, for python-control."""
        import control

        return control.nlsys(
            lambda t, x, u, params: np.array([x[1], self.tilt_acceleration(x[0], x[1], x[2], u[0]), u[0]]),
            lambda t, x, u, params: self.C @ x,
            **_SIGNALS,
            name="reduced_cmg",
        )


_SIGNALS: dict[str, Any] = {"inputs": ["u"], "outputs": ["y1", "y2"], "states": ["x1", "x2", "x3"]}
"""Names of python-control's signals."""
Coefficients = tuple[list[float], list[float]]


class FilterState(NamedTuple):
    """State of a second-order filter of the tilt, and the last measured tilt."""

    z1: Scalar
    z2: Scalar
    y1: Scalar


def hold_matrices(A: np.ndarray, B: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Discretise x' = A x + B w exactly for inputs that are held or that run straight between samples.

    With w_k = w(t_k): x_k = Phi x_{k-1} + Gamma_hold w_{k-1} + Gamma_ramp (w_k - w_{k-1}); without the last
    term for an input held since k-1. (Van Loan's augmented exponential; both holds from one matrix.)

    Args:
        A: State matrix, (n, n).
        B: Input matrix, (n, m).
        dt: Sample period [s].

    Returns:
        Phi (n, n), Gamma_hold (n, m), Gamma_ramp (n, m).
    """
    from scipy.linalg import expm

    n, m = B.shape
    augmented = np.zeros((n + 2 * m, n + 2 * m))
    augmented[:n, :n] = A * dt
    augmented[:n, n : n + m] = B * dt
    augmented[n : n + m, n + m :] = np.eye(m)
    exponential = expm(augmented)
    return exponential[:n, :n], exponential[:n, n : n + m], exponential[:n, n + m :]


def second_order_rows(A: np.ndarray, B: np.ndarray, dt: float) -> Coefficients:
    """Exact step of z' = A z + B y for a y that runs straight between samples.

    Args:
        A: State matrix, (2, 2).
        B: Input matrix, (2, 1).
        dt: Sample period [s].

    Returns:
        For each of z1, z2 its coefficients of (z1, z2, y_{k-1}, y_k).
    """
    Phi, hold, ramp = hold_matrices(A, B, dt)
    row1, row2 = np.hstack([Phi, hold - ramp, ramp]).tolist()
    return row1, row2


def second_order_step(rows: Coefficients, state: FilterState, y1: Scalar) -> FilterState:
    """Advance a second-order filter by one sample."""
    (a, b, c, d), (e, f, g, h) = rows
    z1, z2, last = state
    return FilterState(a * z1 + b * z2 + c * last + d * y1, e * z1 + f * z2 + g * last + h * y1, y1)


NO_MODEL = ReducedModel(J1=math.nan, J2=math.nan, J_d=math.nan, omega_d=math.nan, gravity_torque=math.nan)
"""Model for observers that need none: a computation with it gives NaN."""

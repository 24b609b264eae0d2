"""A linear rig as matrices: from command and push to its motion and what perfect sensors show."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cmg_mj.observers.reduced_model import ReducedModel

NEGLIGIBLE = 1e-6
"""A direction that a command or a push moves by less than this share of the others is not moved: rounding moves it."""


class LinearRig(NamedTuple):
    """x' = A x + B [command, push], and the outputs C x + D [command, push].

    Outputs are tilt x1, tilt rate x2, gimbal angle x3, the measured tilt y1, its angular acceleration, and the rate
    that a gyro at the sensors shows.

    Attributes:
        A: State matrix, (n, n).
        B: Input matrix, (n, 2).
        C: Output matrix, (6, n).
        D: Feedthrough, (6, 2).
        states: Name of each state; `rig_1`, `rig_2`, ... if empty.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    states: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each state."""
        return self.states or tuple(f"rig_{i + 1}" for i in range(len(self.A)))

    def minimal(self) -> LinearRig:
        """Leave out the states that no input reaches, then those that no output shows."""
        rig = self._within(reached(self.A, self.B))
        return rig._within(reached(rig.A.T, rig.C.T))

    def _within(self, basis: np.ndarray) -> LinearRig:
        """Return the rig in the coordinates of an orthonormal basis, (n, m)."""
        return LinearRig(basis.T @ self.A @ basis, basis.T @ self.B, self.C @ basis, self.D)


def reduced_rig(model: ReducedModel) -> LinearRig:
    """Return the reduced model's linearisation (6), its gimbals turning as commanded.

    Args:
        model: The reduced model, of a pivot at rest.
    """
    per_torque = 1.0 / (model.J1 * model.gimbals)
    B = np.hstack([model.B, [[0.0], [per_torque], [0.0]]])
    x1, x2, x3 = np.eye(3)
    C = np.array([x1, x2, x3, x1, model.A[1], x2])
    D = np.zeros((6, 2))
    D[4] = model.B[1, 0], per_torque
    return LinearRig(model.A, B, C, D, ("x1", "x2", "x3"))


def reached(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Find an orthonormal basis of the states that the inputs of x' = A x + B w reach.

    Args:
        A: State matrix, (n, n).
        B: Input matrix, (n, m).

    Returns:
        The basis, (n, n_reached).
    """
    from scipy.linalg import expm

    # exp(A t) has the invariant subspaces of A. With a t of the fastest mode's size its powers differ by no magnitudes.
    F = expm(A / max(float(np.abs(np.linalg.eigvals(A)).max()), 1.0))
    basis = np.zeros((len(A), 0))
    waiting = list(B.T)
    while waiting:
        vector = waiting.pop(0)
        part = vector - basis @ (basis.T @ vector)
        part = part - basis @ (basis.T @ part)
        if np.linalg.norm(part) > NEGLIGIBLE * np.linalg.norm(vector):
            basis = np.column_stack([basis, part / np.linalg.norm(part)])
            waiting.append(F @ basis[:, -1])
    return basis

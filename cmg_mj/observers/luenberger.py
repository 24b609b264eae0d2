"""The time-invariant full-order observer, sokolov2019 (9); the one aranovskiy2020 could not stabilise its rig with."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from pydantic.dataclasses import dataclass

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.reduced_model import MARGIN, ReducedModel, hold_matrices, is_hurwitz
from cmg_mj.core.types import Estimate, Measurement
from cmg_mj.inputs.types import STRICT, Positive


class State(NamedTuple):
    """The estimate and the last measurement."""

    x1: Scalar
    x2: Scalar
    x3: Scalar
    y1: Scalar
    y2: Scalar


@dataclass(frozen=True, config=STRICT)
class Luenberger:
    """The time-invariant full-order observer, sokolov2019 (9); the one aranovskiy2020 could not stabilise its rig with.

    x' = A x + B u + L (y - C x) with the linearisation (6).

    Discretised exactly for an input held and a measurement that runs straight between samples.

    Attributes:
        dt: Sample period [s].
        model: The reduced model.
        L: Gain matrix, from the errors of y1 and y2 to x1, x2, x3. Default: sokolov2019 Table II.
    """

    dt: Positive
    model: ReducedModel
    L: tuple[tuple[float, float], tuple[float, float], tuple[float, float]] = (
        (20.0, 0.0),
        (150.0, 0.0),
        (0.0, 20.0),
    )

    def __post_init__(self) -> None:
        poles = np.linalg.eigvals(self.error_matrix)
        if not is_hurwitz(poles):
            eigenvalues = ", ".join(f"{p:.3g}" for p in poles)
            raise ValueError(f"L: A - L C must be Hurwitz (left of -{MARGIN:g} 1/s), its eigenvalues are {eigenvalues}")

    @property
    def error_matrix(self) -> np.ndarray:
        """A - L C, (3, 3)."""
        return self.model.A - np.array(self.L) @ self.model.C

    @cached_property
    def _rows(self) -> list[list[float]]:
        """Coefficients of (x1, x2, x3, y1_{k-1}, y2_{k-1}, y1_k, y2_k, u) for each state."""
        Phi, hold_y, ramp_y = hold_matrices(self.error_matrix, np.array(self.L), self.dt)
        _, hold_u, _ = hold_matrices(self.error_matrix, self.model.B, self.dt)
        return np.hstack([Phi, hold_y - ramp_y, ramp_y, hold_u]).tolist()

    def init(self, y: Measurement) -> State:
        """Start at rest at the measured angles."""
        return State(y.y1, 0.0 * y.y1, y.y2, y.y1, y.y2)

    def step(self, state: State, y: Measurement, u: Scalar) -> tuple[State, Estimate]:
        """Advance by one sample period."""
        p1, p2, p3, p4, p5 = state
        y1, y2 = y
        x1, x2, x3 = [
            a * p1 + b * p2 + c * p3 + d * p4 + e * p5 + f * y1 + g * y2 + h * u
            for a, b, c, d, e, f, g, h in self._rows
        ]
        return State(x1, x2, x3, y1, y2), Estimate(x1, x2, x3)

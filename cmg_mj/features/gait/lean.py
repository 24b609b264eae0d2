"""The equilibrium bias found on point feet, and the torso moved until the mass centre stands over them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from cmg_mj.core.arrays import Scalar, clip, where
from cmg_mj.core.controller import Tick
from cmg_mj.core.reduced_model import ReducedModel

SETTLED_S = 0.05
"""Time after a foot lands or lifts in which an impact is no bias [s]."""
FIRST_S, LAST_S = 2.0, 10.0
"""Times over which what is found is averaged: at the first moment, and at most [s]."""
MOST = math.radians(3.0)
"""No larger bias is believed [rad]."""


class Lean:
    """Finds e of each axis, and the lean: the part of e that the torso's place has taken away.

    With the mass centre off by e less the lean, x2' = f2 + (d f2/d x1) (e - lean). That is averaged, over all the
    time in which the axis was free. The lean follows as a second-order filter, lean'' = w^2 (e - lean) - 2 w lean' with
    w = 2/`time_s`; it takes the torso by `height` lean to the other side.

    Args:
        models: The reduced model of each axis.
        dt: Control period [s].
        time_s: Time constant of the lean; 0: nothing is found and the torso stays [s].
        fall_s2: height/g [s^2].
        zero: 0 for one world, or an array (n_worlds,).

    Attributes:
        bias: e of each axis [rad].
        lean: Likewise [rad].
        known_tilt: Tilt by which accelerometers err while the torso is moved [rad].
    """

    def __init__(self, models: Sequence[ReducedModel], dt: float, time_s: float, fall_s2: float, zero: Scalar) -> None:
        self._models, self._dt, self._time, self._fall = models, dt, time_s, fall_s2
        self.bias: list[Scalar] = [zero] * len(models)
        self.lean, self.known_tilt = list(self.bias), list(self.bias)
        self._speed, self._seen = list(self.bias), list(self.bias)
        self._before: list[tuple[Scalar, Scalar]] = []
        self._both, self._settled = zero, zero

    def update(self, ticks: Sequence[Tick], line: np.ndarray, both: Scalar, planned: bool) -> None:
        """Take the decisions of a tick.

        Args:
            ticks: Of each axis, with the command in force.
            line: Components of the feet's line along the axes, (n_axes,).
            both: Whether both feet stand; then the robot tilts about that line alone.
            planned: Whether both are planned to. While a foot lands early or late, nothing is found.
        """
        if not self._time:
            return
        before, self._before = self._before, [self._expected(*each) for each in zip(self._models, ticks, strict=True)]
        self._settled = where((both == self._both) & (both == planned), self._settled + self._dt, 0.0)
        self._both = both
        if not before:
            return
        free = where(self._settled > SETTLED_S, 1.0, 0.0)
        errors = []
        for i, (model, tick, (x2, f2)) in enumerate(zip(self._models, ticks, before, strict=True)):
            slope = model.gravity_torque / model.J1
            beyond = ((tick.estimates[0][1] - x2) / self._dt - f2) / slope
            errors.append(free * (beyond + self.lean[i] - self.bias[i] - self.known_tilt[i]))
        about = sum(share * error for share, error in zip(line, errors, strict=True))
        for i, share in enumerate(line):
            error = where(both, share * about, errors[i])
            self._seen[i] = self._seen[i] + self._dt * free * where(both, share**2, 1.0)
            averaged = clip(FIRST_S + self._seen[i], FIRST_S, LAST_S)
            self.bias[i] = clip(self.bias[i] + self._dt / averaged * error, -MOST, MOST)
            w = 2.0 / self._time
            hastens = w * w * (self.bias[i] - self.lean[i]) - 2.0 * w * self._speed[i]
            self.lean[i] = self.lean[i] + self._dt * self._speed[i]
            self._speed[i] = self._speed[i] + self._dt * hastens
            self.known_tilt[i] = self._fall * hastens

    @staticmethod
    def _expected(model: ReducedModel, tick: Tick) -> tuple[Scalar, Scalar]:
        """Return x2, and f2 with the command that is held now."""
        x1, x2, x3 = tick.estimates[0][:3]
        return x2, model.tilt_acceleration(x1, x2, x3, tick.u)

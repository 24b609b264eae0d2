"""The equilibrium bias found on point feet, and the torso moved until the mass centre stands over them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from cmg_mj.core.arrays import Scalar, clip, dot, where
from cmg_mj.core.axis import Tick
from cmg_mj.core.reduced_model import ReducedModel

SETTLED_S = 0.05
"""Time after a foot lands or lifts in which an impact is no bias [s]."""
FIRST_S, LAST_S = 2.0, 10.0
"""Times over which what is found is averaged: at the first moment, and at most [s]."""
MOST = math.radians(3.0)
"""No larger bias is believed [rad]."""


class Leaning(NamedTuple):
    """The memory of `Lean`; lists have a number an axis."""

    bias: list[Scalar]
    """e [rad]."""
    lean: list[Scalar]
    """The part of e that the torso's place has taken away [rad]."""
    speed: list[Scalar]
    """Rate of the lean [rad/s]."""
    seen: list[Scalar]
    """Time in which the axis was free [s]."""
    known_tilt: list[Scalar]
    """Tilt by which accelerometers err while the torso is moved [rad]."""
    both: Scalar
    """1 if both feet stood."""
    settled: Scalar
    """Time since a foot landed or lifted, or did so early or late [s]."""
    expected: list[tuple[Scalar, Scalar]] | None = None
    """x2, and f2 with the command that is held; None before the first tick."""


@dataclass(frozen=True)
class Lean:
    """Finds e of each axis, and the lean: the part of e that the torso's place has taken away.

    With the mass centre off by e less the lean, x2' = f2 + (d f2/d x1) (e - lean). That is averaged, over all the
    time in which the axis was free. The lean follows as a second-order filter, lean'' = w^2 (e - lean) - 2 w lean' with
    w = 2/`time_s`; it takes the torso by `height` lean to the other side.

    Attributes:
        models: The reduced model of each axis.
        dt: Control period [s].
        time_s: Time constant of the lean; 0: nothing is found and the torso stays [s].
        fall_s2: height/g [s^2].
    """

    models: Sequence[ReducedModel]
    dt: float
    time_s: float
    fall_s2: float

    def init(self, zero: Scalar) -> Leaning:
        """Return the memory before the first tick; zero is a float or an array (n_worlds,)."""
        nothing = [zero] * len(self.models)
        return Leaning(nothing, nothing, nothing, nothing, nothing, zero, zero)

    def step(
        self,
        memory: Leaning,
        ticks: Sequence[Tick],
        told: Sequence[Scalar],
        line: Sequence[float],
        both: Scalar,
        planned: float,
    ) -> Leaning:
        """Take the decisions of a tick.

        Args:
            memory: The memory.
            ticks: The decision of each axis.
            told: The command in force of each axis [rad/s].
            line: Components of the feet's line along the axes.
            both: 1 if both feet stand; then the robot tilts about that line alone.
            planned: 1 if both are planned to. While a foot lands early or late, nothing is found.

        Returns:
            The next memory.
        """
        if not self.time_s:
            return memory
        expected = [self._expected(*each) for each in zip(self.models, ticks, told, strict=True)]
        settled = where((both == memory.both) & (both == planned), memory.settled + self.dt, 0.0)
        if memory.expected is None:
            return memory._replace(both=both, settled=settled, expected=expected)
        free = where(settled > SETTLED_S, 1.0, 0.0)
        errors = []
        for i, (model, tick, (x2, f2)) in enumerate(zip(self.models, ticks, memory.expected, strict=True)):
            slope = model.gravity_torque / model.J1
            beyond = ((tick.estimates[0][1] - x2) / self.dt - f2) / slope
            errors.append(free * (beyond + memory.lean[i] - memory.bias[i] - memory.known_tilt[i]))
        about = dot(line, errors)
        stand = both > 0.5
        w = 2.0 / self.time_s
        bias, lean, speed, seen, known_tilt = [], [], [], [], []
        for i, share in enumerate(line):
            error = where(stand, share * about, errors[i])
            seen.append(memory.seen[i] + self.dt * free * where(stand, share**2, 1.0))
            averaged = clip(FIRST_S + seen[i], FIRST_S, LAST_S)
            bias.append(clip(memory.bias[i] + self.dt / averaged * error, -MOST, MOST))
            hastens = w * w * (bias[i] - memory.lean[i]) - 2.0 * w * memory.speed[i]
            lean.append(memory.lean[i] + self.dt * memory.speed[i])
            speed.append(memory.speed[i] + self.dt * hastens)
            known_tilt.append(self.fall_s2 * hastens)
        return Leaning(bias, lean, speed, seen, known_tilt, both, settled, expected)

    @staticmethod
    def _expected(model: ReducedModel, tick: Tick, u: Scalar) -> tuple[Scalar, Scalar]:
        """Return x2, and f2 with the command that is held now."""
        x1, x2, x3 = tick.estimates[0][:3]
        return x2, model.tilt_acceleration(x1, x2, x3, u)

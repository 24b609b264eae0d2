"""A walk in the loop: the stage between the axes of a robot that stands on one foot or on two."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from cmg_mj.core.arrays import Scalar, clip, where
from cmg_mj.core.controller import Controller
from cmg_mj.core.types import MultiAxisReading, Setpoints
from cmg_mj.features.gait import Gait
from cmg_mj.features.gait.legs import Walk, plan_walk
from cmg_mj.features.gait.switches import FootSwitches
from cmg_mj.plant.plant import Plant

PLAN_S = 0.005
"""Time between two points of a plan [s]."""
RECENTRED_S = 1.0
"""Time constant in which gimbals come back that turn nothing: the feet hold that direction [s]."""
CAUGHT_S = 0.02
"""Time constant in which a rate that the feet hold leaves the observers' model [s]."""
MOST_LEAN = math.radians(3.0)
"""The torso is moved for no larger bias [rad]."""


@cache
def planned(plant: Plant, gait: Gait) -> Walk:
    """Plan a walk for a plant as its file has it: no equilibrium bias is known."""
    return plan_walk(plant.filed.model, plant.key, gait, PLAN_S)


def walking(gait: Gait, plant: Plant) -> Callable[[Controller], Walking] | None:
    """Make the stage between the axes; None without steps."""
    return (lambda first: Walking(planned(plant, gait), gait, plant, first)) if gait.steps else None


class Walking:
    """Moves the legs by the plan, and turns the gimbals of both axes as the feet allow.

    On one foot the axes are free, and each law's command is held. On two feet the robot tilts about the line of the
    feet alone, l, and not about n across it: the commands' part about it is held, and the gimbals' part across comes
    back to the middle. What the feet then add to f2 of the reduced models is -n (n . f2 + n . x2/`CAUGHT_S`).

    The torso's planned acceleration a makes accelerometers show a tilt of -a/g, which is taken off.

    An equilibrium bias e shifts the mass centre by e times its height. The law's integrator settles at
    `trim_gain` e; the torso is moved against that with `Gait.lean_s`.
    """

    def __init__(self, walk: Walk, gait: Gait, plant: Plant, first: Controller) -> None:
        self._walk, self._gait, self._dt = walk, gait, first.law.dt
        self._switches = FootSwitches(gait, first)
        self._models = [axis.reduced for axis in plant.axes]
        self._about = np.array([axis.direction[:2] for axis in plant.axes])  # the torso is level
        self._across = np.array([np.cross(axis.direction, axis.up)[:2] for axis in plant.axes])
        self._known = -walk.acceleration @ self._across.T / plant.gravity
        left, right = walk.feet[:, :, :2]
        self._lines = (left - right) / np.linalg.norm(left - right, axis=1)[:, None]
        self._lean: Sequence[Scalar] = [np.zeros(np.shape(first.world_ids))] * len(plant.axes)

    def __call__(self, controllers: Sequence[Controller], ideals: MultiAxisReading) -> Setpoints:
        """Turn the gimbals, move the legs, and tell the controllers what they will know at the next tick."""
        first, dt = controllers[0], self._dt
        time = (first.step or 0) * first.timestep
        stands = self._switches(ideals.touch)
        both = stands[0] & stands[1]
        l = self._about @ self._at(self._lines, time)
        n = np.array([-l[1], l[0]])
        ticks = [part.tick for part in controllers if part.tick is not None]
        held = sum(share * tick.u for share, tick in zip(l, ticks, strict=True))
        back = -sum(share * tick.y2 for share, tick in zip(n, ticks, strict=True)) / RECENTRED_S
        commands = []
        for part, tick, a, b in zip(controllers, ticks, l, n, strict=True):
            limit = part.law.rate_limit
            commands.append(clip(where(both, a * held + b * back, tick.u), -limit, limit))
        f2 = 0.0
        for share, model, tick, u in zip(n, self._models, ticks, commands, strict=True):
            x1, x2, x3 = tick.estimates[0][:3]
            f2 = f2 + share * (model.tilt_acceleration(x1, x2, x3, u) + x2 / CAUGHT_S)
        known = self._at(self._known, time + 0.5 * dt)  # the samples are means
        for part, tick, u, b, tilt in zip(controllers, ticks, commands, n, known, strict=True):
            part.tick = tick._replace(u=u)
            part.known_tilt = float(tilt)
            part.contact = where(both, -b * f2, 0.0)
            part.command_rate(u)
        return self._walk.servos, self._legs(controllers, ticks, time)

    def _legs(self, controllers, ticks, time) -> np.ndarray:
        """Return the rates at which the servos' setpoints are to run until the next tick."""
        dt, walk = self._dt, self._walk
        now, then = self._at(walk.setpoints, time), self._at(walk.setpoints, time + dt)
        rates = (then - now) / dt
        if not self._gait.lean_s:
            return rates
        move, before = self._at(walk.leaning, time + dt), self._at(walk.leaning, time)
        lean = []
        for part, tick, last in zip(controllers, ticks, self._lean, strict=True):
            found = tick.x_e / getattr(part.law, "trim_gain", math.inf)
            lean.append(clip(last + dt / self._gait.lean_s * found, -MOST_LEAN, MOST_LEAN))
        was, self._lean = self._lean, lean
        for across, last, now in zip(self._across, was, lean, strict=True):
            moved = np.multiply.outer(now, move @ across) - np.multiply.outer(last, before @ across)
            rates = rates - walk.height / dt * moved
        return rates.T

    def _at(self, table: np.ndarray, time: float) -> np.ndarray:
        """Read a table of the plan at a time [s]; after its end it stays."""
        i = min(int(time / PLAN_S + 1e-9), len(table) - 2)
        part = min(time / PLAN_S - i, 1.0)
        return (1.0 - part) * table[i] + part * table[i + 1]

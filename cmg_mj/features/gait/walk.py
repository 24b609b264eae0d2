"""A walk in the loop: what moves the legs, and the control of a robot that stands on one foot or on two."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from functools import cache

import numpy as np

from cmg_mj.core.arrays import clip, where
from cmg_mj.core.controller import Controller
from cmg_mj.core.loop import Disturbance, Outside
from cmg_mj.core.types import MultiAxisReading
from cmg_mj.features.gait import Gait
from cmg_mj.features.gait.legs import Walk, plan_walk
from cmg_mj.plant.plant import Plant

PLAN_S = 0.005
"""Time between two points of a plan [s]."""
STANDS_N = 5.0
"""Force from which a foot switch is closed [N]."""
RECENTRED_S = 1.0
"""Time constant in which gimbals come back that turn nothing: the feet hold that direction [s]."""


@cache
def _walk(plant: Plant, gait: Gait) -> Walk:
    return plan_walk(plant.model, plant.key, gait, PLAN_S)


def leg_motion(
    sections: Sequence[Gait], plants: Sequence[Plant], seed: int, world_ids: int | Sequence[int]
) -> Disturbance | None:
    """Make what moves the legs; None without steps."""
    (gait,) = sections
    return LegMotion(_walk(plants[0], gait), plants[0].timestep) if gait.steps else None


class LegMotion:
    """Sets the legs' servos at every instant to the plan."""

    accelerates = False
    edges: Collection[int] = ()

    def __init__(self, walk: Walk, timestep: float) -> None:
        self._walk, self._timestep = walk, timestep

    def __call__(self, step: int, steps: int, outside: Outside) -> Outside:
        """See `Disturbance`."""
        now, then = (self._setpoints(n * self._timestep) for n in (step, step + steps))
        return outside._replace(setpoints=(self._walk.servos, (then - now) / (steps * self._timestep)))

    def _setpoints(self, time):
        at = time / PLAN_S
        i = min(int(at), len(self._walk.time) - 2)
        a = min(at - i, 1.0)
        return (1-a) * self._walk.setpoints[i] + a * self._walk.setpoints[i+1]


def support(gait: Gait, plant: Plant) -> Callable[[Controller], Support] | None:
    """Make the stage between the axes; None without steps."""
    return (lambda first: Support(_walk(plant, gait), plant, first)) if gait.steps else None


class Support:
    """Knows the plan and the foot switches, and turns the gimbals of both axes as the feet allow.

    On one foot the axes are free, and each law's command is held. On two feet the robot tilts about the line of the
    feet alone: the commands' part about it is held, and the gimbals' part across comes back to the middle.

    The torso's planned acceleration a makes accelerometers show a tilt of -a/g, which is taken off.
    """

    def __init__(self, walk: Walk, plant: Plant, first: Controller) -> None:
        self._walk, self._ticks = walk, first.law.dt / PLAN_S
        self._limit = first.law.rate_limit
        self._about = np.array([axis.direction[:2] for axis in plant.axes])  # the torso is level
        across = np.array([np.cross(axis.direction, axis.up)[:2] for axis in plant.axes])
        self._known = -walk.acceleration @ across.T / plant.gravity
        left, right = walk.plan.feet(walk.time)[:, :, :2]
        self._lines = (left - right) / np.linalg.norm(left - right, axis=1)[:, None]
        self._tick = 0

    def __call__(self, controllers: Sequence[Controller], ideals: MultiAxisReading) -> None:
        """Turn the gimbals, and tell the controllers what they will know at the next tick."""
        last = len(self._walk.time) - 1
        line = self._about @ self._lines[min(round(self._tick * self._ticks), last)]
        both = (ideals.touch[0] > STANDS_N) & (ideals.touch[1] > STANDS_N)
        across = np.array([-line[1], line[0]])
        ticks = [part.tick for part in controllers if part.tick is not None]
        held = sum(share * tick.u for share, tick in zip(line, ticks, strict=True))
        back = -sum(share * tick.y2 for share, tick in zip(across, ticks, strict=True)) / RECENTRED_S
        self._tick += 1
        known = self._known[min(round(self._tick * self._ticks), last)]
        for part, tick, a, b, tilt in zip(controllers, ticks, line, across, known, strict=True):
            u = clip(where(both, a * held + b * back, tick.u), -self._limit, self._limit)
            part.tick = tick._replace(u=u)
            part.known_tilt = float(tilt)
            part.command_rate(u)

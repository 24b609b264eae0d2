"""Finds the largest push that a mounted robot itself stands: all of it in MuJoCo, many worlds, both ways."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cmg_mj.core.loop import ControlLoop
from cmg_mj.features.mounting.limits import AFTER_TIME_CONSTANTS, PUSH_S, WORLDS, PushLimits
from cmg_mj.plant.mjcf import quiet, set_control_callback
from cmg_mj.plant.physics import ManyWorlds
from cmg_mj.runs.batch import stack_worlds
from cmg_mj.runs.experiment import Experiment
from cmg_mj.stages.push import Push, Pushes

MAX_SEARCH_S = 60.0
"""The search ends after so long, with what it has found [s]."""
UNPUSHED_S = 20.0
"""A robot stands if all worlds stand so long without a push [s]."""
BEFORE_S = 2.0
"""The loop runs for so long before the push comes [s]."""
MAX_AFTER_S = 12.0
"""Longest time to wait for a pushed robot to recover or fall [s]."""
OTHER_WORLDS = 20
AFTER_LONGER = 3.0
"""The result is tried on so many other worlds, each way, and so many times longer: where the ceiling is low some
worlds stand the push and fall of the noise while the gimbals come back."""
RESOLUTION = 0.05
"""The search ends where a push that all worlds stand and one that not all stand differ by such a share."""
MIN_SHARE = 0.02
"""Smallest push that is tried, in shares of the ceiling."""
FIRST_SHARE, GROWTH = 0.85, 1.4
"""Share of E that is tried first; where E too is stood, as with damping, each push is so many times the last."""
MAX_CEILINGS = 8.0
"""Largest push that is tried, in shares of the ceiling, which springs and damping let a robot exceed."""
MARGIN = 0.1
"""The largest push found is reduced by this share, and again until the other worlds stand it."""


@dataclass
class TimeLimit:
    """The time that a search may take.

    Args:
        longest_s: So long [s].
        on_progress: Called at every check, with the time that the search has taken [s], and what it tries.
        clock: Returns the time [s].
    """

    longest_s: float = MAX_SEARCH_S
    on_progress: Callable[[float, str], None] = lambda *_: None
    clock: Callable[[], float] = time.monotonic

    def __post_init__(self) -> None:
        self._start = self.clock()

    def check(self, now: str) -> None:
        """Show the progress.

        Raises:
            TimeoutError: The time is over.
        """
        passed = self.clock() - self._start
        self.on_progress(min(passed, self.longest_s), now)
        if passed > self.longest_s:
            raise TimeoutError


class SimulatedPush(NamedTuple):
    """The push that a robot stands in MuJoCo."""

    standing: int | None
    """Worlds that stand 20 s without a push, from the tilt that the scenario starts with; None if the time did not
    suffice to see it."""
    impulse: float = 0.0
    """Largest impulse about the line, as a push of 0.1 s either way, that all worlds stand, less a tenth [N m s]. If
    the search is complete, twenty others stand it too. 0 if it does not stand, or not the smallest push tried."""
    complete: bool = True
    """True if the search came to its end within its time."""
    servo_torque: float | None = None
    """Largest torque of a gimbal servo that this push takes [N m]; None if that was not seen."""
    servo_rate: float | None = None
    """Largest rate of a gimbal that it takes [rad/s]."""
    worlds: int = WORLDS
    """Worlds that were tried without a push: ten, and twenty others where it is `PushLimits.noisy`."""

    @property
    def falls(self) -> bool:
        """True if a world falls without a push."""
        return self.standing is not None and self.standing < self.worlds


def simulated_push(
    experiment: Experiment, limits: PushLimits, axis: str = "", time_limit: TimeLimit | None = None
) -> SimulatedPush:
    """Find the largest push that all worlds of a mounted robot stand, by bisection in MuJoCo.

    Args:
        experiment: The robot and its controller. Pushes of its scenario are ignored.
        limits: The limits by the reduced model.
        axis: Name of the axis, if there are several.
        time_limit: The time that the search may take; by default a minute.

    Returns:
        The push.
    """
    time_limit = time_limit or TimeLimit()
    worlds = WORLDS

    def unpushed(numbers: range) -> int:
        """Count the worlds that stand without a push, from the tilt that a scenario starts with."""
        start, pushes = _tilted(experiment, limits.start_tilt_deg, axis), [(world, 0.0) for world in numbers]
        attempt = _attempt(start, pushes, UNPUSHED_S, axis, time_limit, "no push", early=False)
        return len(numbers) - attempt.fallen

    try:
        standing = unpushed(range(WORLDS))
        if standing == WORLDS and limits.noisy:
            worlds += OTHER_WORLDS
            standing += unpushed(range(WORLDS, worlds))
    except TimeoutError:
        return SimulatedPush(None, complete=False)
    if standing < worlds:
        return SimulatedPush(standing, worlds=worlds)
    upright = _tilted(experiment, 0.0, axis)
    poles = [pole for pole in (limits.pole, limits.limit.pole) if pole > 0.0]
    after = min(AFTER_TIME_CONSTANTS / min(poles), MAX_AFTER_S)
    least = MIN_SHARE * limits.limit_push_impulse
    expected = limits.push_margin.median_impulse or 0.5 * limits.limit_push_impulse
    low, high = 0.0, FIRST_SHARE * expected

    def attempt(impulse: float, worlds: range = range(WORLDS), after: float = after) -> _Attempt:
        text = f"a push of {impulse / PUSH_S:.3g} N m"
        pushes = [(world, sign * impulse) for sign in (1.0, -1.0) for world in worlds]
        return _attempt(upright, pushes, BEFORE_S + PUSH_S + after, axis, time_limit, text)

    found = 0.0
    try:
        if not attempt(high).fallen:
            low, high = high, expected
            while high < MAX_CEILINGS * limits.limit_push_impulse and not attempt(high).fallen:
                low, high = high, GROWTH * high
        while high - low > max(RESOLUTION * high, least):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if attempt(middle).fallen else (middle, high)
        while (found := (1.0 - MARGIN) * (found or low)) > least:
            longer = min(AFTER_LONGER * after, MAX_AFTER_S)
            result = attempt(found, range(WORLDS, WORLDS + OTHER_WORLDS), longer)
            if not result.fallen:
                return SimulatedPush(standing, found, True, result.servo_torque, result.servo_rate, worlds=worlds)
    except TimeoutError:
        return SimulatedPush(standing, found or (1.0 - MARGIN) * low, complete=False, worlds=worlds)
    return SimulatedPush(standing, worlds=worlds)


def _tilted(experiment: Experiment, tilt_deg: float, axis: str) -> Experiment:
    """Return the experiment with another initial tilt of an axis."""
    return experiment.with_settings({f"{f'axes.{axis}.' if axis else ''}plant.initial_tilt_deg": tilt_deg})


class _Attempt(NamedTuple):
    """The outcome of pushes."""

    fallen: int
    servo_torque: float
    servo_rate: float


@quiet()
def _attempt(
    experiment: Experiment,
    pushes: Sequence[tuple[int, float]],
    duration_s: float,
    axis: str,
    time_limit: TimeLimit,
    now: str,
    *,
    early: bool = True,
) -> _Attempt:
    """Push worlds, each with an impulse [N m s]; with `early` only until the first one falls."""
    plant = experiment.plant
    controller = experiment.controller([world for world, _ in pushes])
    push = stack_worlds([Push(BEFORE_S, PUSH_S, impulse / PUSH_S, axis or None) for _, impulse in pushes])
    period = controller.period
    steps = period * math.ceil(duration_s / (period * plant.timestep))
    pushed = Pushes([push], plant.timestep, plant.axis_names)
    modules = plant.single_axis(axis).axis.modules
    servos, gimbals = [module.servo for module in modules], [module.gimbal_dof for module in modules]
    torque = rate = 0.0
    with set_control_callback(None), np.errstate(all="ignore"):
        physics = ManyWorlds([plant] * len(pushes))
        forces = physics.batch.bind("actuator_force")
        fall_angle = math.radians(experiment.scenario.metrics.fall_angle_deg)
        loop = ControlLoop(physics, controller, steps, [pushed], fall_angle)
        for tick in loop.ticks():
            time_limit.check(now)
            if early and loop.endings:
                break
            loop.decide()
            loop.advance()
            torque = max(torque, np.abs(forces[:, servos]).max())
            rate = max(rate, np.abs(np.asarray(tick.v)[gimbals]).max())
    return _Attempt(len(loop.endings), torque, rate)

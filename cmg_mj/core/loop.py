"""Advances physics and controller from one sampling instant to the next: the only loop of samples and decisions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

from cmg_mj.core.axes import AnyController
from cmg_mj.core.outside import Instant
from cmg_mj.elementwise import Scalar
from cmg_mj.simulation.physics import Joints, Physics

_new = tuple.__new__  # a named tuple's own takes twice as long


class ControlTick(NamedTuple):
    """The state at a control tick, before the decision."""

    step: int
    """Number of the physics step."""
    steps: int
    """Physics steps until the next instant."""
    q: Joints
    """Joint angles."""
    v: Joints
    """Joint rates."""
    torques: Sequence[Scalar]
    """The torques from outside about each axis [N m]."""


class Ending(NamedTuple):
    """The end of a world that the loop stopped."""

    step: int
    """Number of the physics step."""
    tilt: float = 0.0
    """Tilt of the world from the keyframe, beyond the fall angle or no number [rad]."""
    message: str = ""
    """Description of the observer's or law's return value, if that is the reason."""


class ControlLoop:
    """Takes a plant and its controller through the instants of a run, up to each control tick.

    At a tick the caller decides, by `decide` or in its own way, and calls `advance`:

        for tick in loop.ticks():
            loop.decide()
            loop.advance()

    Args:
        physics: The physics.
        controller: The controller.
        instants: When something is due, and the torques from outside from then on.
        fall_angle: A world that tilts farther is stepped no more [rad].

    Attributes:
        step: Number of the physics step at the present instant.
        endings: How worlds ended that are stepped no more, by their index.
    """

    def __init__(
        self, physics: Physics, controller: AnyController, instants: Iterable[Instant], fall_angle: float
    ) -> None:
        self.physics = physics
        self.controller = controller
        self.step = 0
        self.endings: dict[int, Ending] = {}
        self._instants = instants
        self._fall_angle = fall_angle
        self._steps = 0
        self._parts = list(enumerate(controller.parts))
        self._sample = self._sampler()

    def ticks(self) -> Iterator[ControlTick]:
        """Go from control tick to control tick, until the instants or the running worlds are at their end."""
        physics, fall_angle = self.physics, self._fall_angle
        steps_per_sample, period = self.controller.steps_per_sample, self.controller.period
        state, tilt, stop_fallen = physics.state, physics.tilt, physics.stop_fallen
        reading, sample = physics.reading, self._sample
        held: Sequence[Scalar] | None = None
        torques: Sequence[Scalar] = ()
        for step, steps, instant_torques in self._instants:
            self.step, self._steps = step, steps
            if instant_torques is not held:
                held = instant_torques
                torques = physics.push(held)
            q, v = state()
            for world, angle in stop_fallen(tilt(q), fall_angle):
                self.endings[world] = Ending(step, angle)
            if not physics.any_running:
                return
            if step % steps_per_sample == 0:
                if sample is not None:
                    sample(step, reading(v))
                if step % period == 0:
                    yield _new(ControlTick, (step, steps, q, v, torques))
                    continue
            physics.advance(steps)

    def decide(self) -> None:
        """Let the controller decide, and command the servos."""
        physics = self.physics
        self.controller.control(self.step)
        stop_failed = physics.stop_failed
        for axis, part in self._parts:
            if stop_failed is not None and part.tick is not None:
                for world, message in stop_failed(part.tick):
                    self.endings[world] = Ending(self.step, message=message)
            physics.command(part.gimbal_rate, axis)

    def advance(self) -> None:
        """Take the physics to the next instant."""
        self.physics.advance(self._steps)

    def _sampler(self) -> Callable[[int, Any], None] | None:
        """Return what takes the samples that are due, of one axis or several; None if something else does."""
        return self.controller.sample

"""Advances physics and controller from one sampling instant to the next: the only loop of samples and decisions."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from itertools import chain, pairwise
from typing import Any, NamedTuple, Protocol

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.axes import ControllerLike
from cmg_mj.core.controller import Tick
from cmg_mj.core.types import IdealReading, MultiAxisReading, Setpoints


class Outside(NamedTuple):
    """What acts on the plant until the next instant."""

    torques: Sequence[Scalar]
    """About each axis, one for all worlds or (n_worlds,) [N m]."""
    acceleration: Sequence[Scalar] | None = None
    """The pivot's: x, y, z, likewise; None: it stays what it was, at first zero [m/s^2]."""
    setpoints: Setpoints | None = None
    """Controls of other actuators; None: they stay."""


class Disturbance(Protocol):
    """Something that acts from outside."""

    edges: Collection[int] = ()
    """Physics steps that become instants."""
    accelerates: bool = False
    """Whether it accelerates the pivot: gravity of the plant's model then changes."""

    def __call__(self, step: int, steps: int, outside: Outside) -> Outside:
        """Add what acts from a physics step on, held or averaged for so many steps, until the next instant.

        Disturbances act one after the other: each is given what those before it made. Torques that stay are the same
        sequence.
        """
        ...


def instants(end: int, grid: int, edges: Iterable[int] = ()) -> Iterator[tuple[int, int]]:
    """Find the physics steps at which a sensor or the controller is due, or a disturbance has an edge.

    Args:
        end: Number of the last step's end.
        grid: Physics steps between the instants at which a sensor or the controller may be due.
        edges: Steps that are instants beside.

    Yields:
        The step, and the steps until the next instant.
    """
    for start, last in pairwise(sorted({0, end, *(step for step in edges if step < end)})):
        for stop in chain(range((start // grid + 1) * grid, last, grid), (last,)):
            yield start, stop - start
            start = stop


Joints = Sequence[Scalar] | np.ndarray
"""Joint angles or rates: a list of floats, or an array (n, n_worlds)."""
State = tuple[Joints, Joints]
"""Joint angles, joint rates."""
Acceleration = Sequence[Scalar]
"""Acceleration of the pivot: x, y, z [m/s^2]."""
Reading = IdealReading | MultiAxisReading


class Physics(Protocol):
    """The physics of one world or of many, as the loop advances it.

    Attributes:
        any_running: Whether any world is still stepped.
    """

    any_running: bool

    @property
    def running(self) -> np.ndarray | None:
        """True for each world that is still stepped, (n_worlds,); None for one world."""
        ...

    @property
    def stop_failed(self) -> Callable[[Tick], Sequence[tuple[int, str]]] | None:
        """Function that stops worlds whose observer or law returned a non-finite value. It returns indices and reasons.

        None for one world, where the controller raises.
        """
        ...

    def state(self) -> State:
        """Read joint angles and rates."""
        ...

    def tilt(self, qpos: Joints, /) -> Scalar:
        """Compute the tilt from the keyframe, of several axes the largest [rad]."""
        ...

    def reading(self, v: Joints) -> Any:
        """Compute what perfect sensors show at the present state, with the torques and the last commands in force."""
        ...

    def push(self, torques: Sequence[Scalar]) -> Sequence[Scalar]:
        """Set the torques about the axes [N m]; return them with a value for every world."""
        ...

    def accelerate(self, acceleration: Acceleration) -> None:
        """Set the pivot's acceleration [m/s^2]."""
        ...

    def control(self, actuators: Sequence[int], setpoints: np.ndarray) -> None:
        """Set the controls of actuators that are no gimbal's and no flywheel's."""
        ...

    def command(self, u: Scalar, axis: int = 0) -> None:
        """Set the rate of an axis' gimbal servos, whose setpoints it moves, each module in its direction [rad/s]."""
        ...

    def advance(self, steps: int, /) -> None:
        """Take physics steps."""
        ...

    def stop_fallen(self, tilt: Scalar, limit: float) -> Sequence[tuple[int, float]]:
        """Stop the worlds whose tilt is beyond a limit, or no number; return each one's index and tilt [rad]."""
        ...


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
        end: Number of the physics steps.
        disturbances: What acts from outside.
        fall_angle: A world that tilts farther is stepped no more [rad].

    Where MuJoCo itself calls the controller, the decision falls in `advance`: its tick is there only afterwards.

    Attributes:
        takes_samples: Whether the loop takes the samples that are due; False if MuJoCo calls the controller.
        step: Number of the physics step at the present instant.
        endings: How worlds ended that are stepped no more, by their index.
    """

    takes_samples = True

    def __init__(
        self,
        physics: Physics,
        controller: ControllerLike,
        end: int,
        disturbances: Sequence[Disturbance],
        fall_angle: float,
    ) -> None:
        self.physics = physics
        self.controller = controller
        self.step = 0
        self.endings: dict[int, Ending] = {}
        self._end, self._disturbances = end, disturbances
        self._fall_angle = fall_angle
        self._steps = 0
        self._parts = list(enumerate(controller.axes))

    def ticks(self) -> Iterator[ControlTick]:
        """Go from control tick to control tick, until the instants or the running worlds are at their end."""
        physics, fall_angle = self.physics, self._fall_angle
        steps_per_sample, period = self.controller.steps_per_sample, self.controller.period
        state, tilt, stop_fallen = physics.state, physics.tilt, physics.stop_fallen
        sample = self.controller.sample
        still = Outside([0.0] * len(self._parts))
        held: Sequence[Scalar] | None = None
        torques: Sequence[Scalar] = ()
        edges = [edge for disturbance in self._disturbances for edge in disturbance.edges]
        for step, steps in instants(self._end, steps_per_sample, edges):
            self.step, self._steps = step, steps
            outside = still
            for disturb in self._disturbances:
                outside = disturb(step, steps, outside)
            if outside.acceleration is not None:
                physics.accelerate(outside.acceleration)
            if outside.setpoints is not None:
                physics.control(*outside.setpoints)
            if outside.torques is not held:
                held = outside.torques
                torques = physics.push(held)
            q, v = state()
            for world, angle in stop_fallen(tilt(q), fall_angle):
                self.endings[world] = Ending(step, angle)
            if not physics.any_running:
                return
            if step % steps_per_sample == 0:
                if self.takes_samples:
                    sample(step, physics.reading(v))
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
        if self.controller.setpoints is not None:
            physics.control(*self.controller.setpoints)

    def advance(self) -> None:
        """Take the physics to the next instant."""
        self.physics.advance(self._steps)

"""Advances physics and controller from one sampling instant to the next: the only loop of samples and decisions."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from operator import add
from typing import Any, NamedTuple, Protocol

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.axis import Tick
from cmg_mj.core.controller import Controller
from cmg_mj.core.errors import InputError
from cmg_mj.core.rig import Readings
from cmg_mj.core.types import Setpoints


class Outside(NamedTuple):
    """What acts on the plant until the next instant."""

    torques: Sequence[Scalar] | None = None
    """About each axis, one for all worlds or (n_worlds,); None: no torques [N m]."""
    acceleration: Sequence[Scalar] | None = None
    """The pivot's: x, y, z, likewise; None: it stays what it was, at first zero [m/s^2]."""
    setpoints: Setpoints | None = None
    """Controls of other actuators; None: they stay."""


class Disturbance(Protocol):
    """Something that acts from outside: a function of the physics step."""

    edges: Sequence[int] = ()
    """Physics steps that become instants."""
    actuators: Sequence[int] = ()
    """Actuators that it moves."""

    def placed(self, plants: Sequence[Any]) -> Sequence[Any]:
        """Return the plants that it acts on, one a world: what changes a model gives each world its own."""
        return plants

    def at(self, step: int, steps: int) -> Outside:
        """Return what acts from a physics step on, held or averaged for so many steps, until the next instant.

        Torques that stay are the same sequence.
        """
        ...


def acting(disturbances: Sequence[Disturbance], step: int, steps: int) -> Outside:
    """Put together what acts from a physics step on: see `Disturbance.at`.

    Args:
        disturbances: The disturbances.
        step: Number of the physics step.
        steps: Physics steps until the next instant.
    """
    if len(disturbances) == 1:
        return disturbances[0].at(step, steps)
    parts = [disturbance.at(step, steps) for disturbance in disturbances]
    torques, accelerations = (
        [value for part in parts if (value := getattr(part, name)) is not None] for name in ("torques", "acceleration")
    )
    setpoints = next((part.setpoints for part in parts if part.setpoints is not None), None)
    return Outside(_added(torques), _added(accelerations), setpoints)


def _added(vectors: Sequence[Sequence[Scalar]]) -> Sequence[Scalar] | None:
    """Add vectors; None for none. A single one stays the same sequence."""
    if len(vectors) < 2:
        return vectors[0] if vectors else None
    return [reduce(add, parts) for parts in zip(*vectors, strict=True)]


def next_instant(step: int, grid: int, edges: Sequence[int]) -> int:
    """Return the next physics step at which a sensor or the controller is due, or a disturbance has an edge.

    Args:
        step: Number of the physics step.
        grid: Physics steps between the instants at which a sensor or the controller may be due.
        edges: Steps that are instants beside, in order.
    """
    due = (step // grid + 1) * grid
    place = bisect_right(edges, step)
    return min(due, edges[place]) if place < len(edges) else due


Joints = Sequence[Scalar] | np.ndarray
"""Joint angles or rates: a list of floats, or an array (n, n_worlds)."""
State = tuple[Joints, Joints]
"""Joint angles, joint rates."""
Acceleration = Sequence[Scalar]
"""Acceleration of the pivot: x, y, z [m/s^2]."""


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

    def reading(self, v: Joints) -> Readings:
        """Compute what perfect sensors show at the present state, with the torques and the last commands in force."""
        ...

    def push(self, torques: Sequence[Scalar]) -> Sequence[Scalar]:
        """Set the torques about the axes [N m]; return them with a value for every world."""
        ...

    def accelerate(self, acceleration: Acceleration) -> None:
        """Set the pivot's acceleration [m/s^2]."""
        ...

    def control(self, actuators: Sequence[int], setpoints: Any) -> None:
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
        readings: Readings of perfect sensors there.
        endings: How worlds ended that are stepped no more, by their index.
    """

    takes_samples = True

    def __init__(
        self,
        physics: Physics,
        controller: Controller,
        end: int,
        disturbances: Sequence[Disturbance],
        fall_angle: float,
    ) -> None:
        moved = [actuator for one in disturbances for actuator in one.actuators]
        if both := set(controller.rig.actuators).intersection(moved):
            raise InputError(
                f"actuator {min(both)}: is moved by a stage between the axes and from outside; leave one out"
            )
        self.physics = physics
        self.controller = controller
        self.step = 0
        self.readings: Any = None
        self.endings: dict[int, Ending] = {}
        self._disturbances = disturbances
        self._edges = sorted({end, *(edge for one in disturbances for edge in one.edges if edge < end)})
        self._end = end
        self._fall_angle = fall_angle
        self._next = 0
        self._held: Sequence[Scalar] = [0.0] * len(controller.axes)
        self._torques = physics.push(self._held)

    def ticks(self) -> Iterator[ControlTick]:
        """Go from control tick to control tick, until the instants or the running worlds are at their end."""
        return iter(self.next_tick, None)

    def next_tick(self) -> ControlTick | None:
        """Go to the next control tick; None at the end."""
        physics, controller = self.physics, self.controller
        grid, period = controller.steps_per_sample, controller.period
        while self._next < self._end:
            self.step = step = self._next
            self._next = next_instant(step, grid, self._edges)
            steps = self._next - step
            self._act(step, steps)
            q, v = physics.state()
            for world, angle in physics.stop_fallen(physics.tilt(q), self._fall_angle):
                self.endings[world] = Ending(step, angle)
            if not physics.any_running:
                self._next = self._end
                return None
            if step % grid == 0:
                if self.takes_samples:
                    self.readings = physics.reading(v)
                if step % period == 0:
                    return _new(ControlTick, (step, steps, q, v, self._torques))
                if self.takes_samples:
                    controller.sample(step, self.readings)
            physics.advance(steps)
        return None

    def _act(self, step: int, steps: int) -> None:
        """Let the disturbances act until the next instant."""
        if not self._disturbances:
            return
        torques, acceleration, setpoints = acting(self._disturbances, step, steps)
        if acceleration is not None:
            self.physics.accelerate(acceleration)
        if setpoints is not None:
            self.physics.control(*setpoints)
        if torques is not None and torques is not self._held:
            self._held = torques
            self._torques = self.physics.push(torques)

    def decide(self) -> None:
        """Let the controller decide, and command the servos."""
        physics, controller = self.physics, self.controller
        controller.update(self.step, self.readings)
        if physics.stop_failed is not None:
            for tick in controller.ticks:
                for world, message in physics.stop_failed(tick):
                    self.endings[world] = Ending(self.step, message=message)
        for axis, rate in enumerate(controller.gimbal_rates):
            physics.command(rate, axis)
        if controller.moves_others:
            physics.control(*controller.setpoints)

    def advance(self) -> None:
        """Take the physics to the next instant."""
        self.physics.advance(self._next - self.step)

"""The controller of a run: it holds the state of a rig's control, whose functions it calls tick after tick."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.axis import AxisControl, Delivered, Sampled, Tick
from cmg_mj.core.noise import Normals
from cmg_mj.core.rig import AxesStage, Decision, Readings, RigControl, RigDeciding
from cmg_mj.core.straight_line import Tables, straight_line
from cmg_mj.core.types import Forces, Law, Observer, Setpoints

_new = tuple.__new__

PRINTED_AFTER = 32
"""Control ticks after which a run goes on as straight-line Python: a shorter one would not win back its printing."""
MAX_PHASES = 40
"""Instants of a common period beyond which nothing is printed: each has lines of its own."""


class ControllerState(NamedTuple):
    """All that a controller remembers: whoever saves it can go back to it."""

    step: int | None = None
    """The physics step of the last update."""
    readings: Any = None
    """The readings of perfect sensors there."""
    sampled: tuple[Sampled, ...] = ()
    deciding: RigDeciding | None = None
    decision: Decision | None = None
    """The last one."""


class Controller:
    """Runs the sensors, the observers and the laws of a rig's axes, tick after tick.

    It does not know MuJoCo. `update` takes the number of a physics step and the ideal readings there; `sample` does
    so where nothing is decided, or by something else.

    Args:
        axes: The controllers of the axes.
        between: The stages between them.
        seed: Seed of the sensors' noise.
        world_ids: The number of one world, on floats, or the numbers of many, on arrays.

    Attributes:
        rig: The control of the axes, a value.
        state: All that it remembers. It may be assigned.
        period: Physics steps between two control ticks.
        steps_per_sample: Physics steps between the instants at which anything may be due.
        moves_others: Whether it moves actuators beside the gimbals, by its `setpoints`.

    Raises:
        InputError: The control periods of the axes differ, or two stages move the same actuator.
    """

    def __init__(
        self,
        axes: Sequence[AxisControl],
        between: Sequence[AxesStage] = (),
        *,
        seed: int = 0,
        world_ids: int | Sequence[int] = 0,
    ) -> None:
        rig = RigControl(tuple(axes), tuple(between))
        self.rig = rig if isinstance(world_ids, int) else rig.for_worlds()
        self.seed = seed
        self.world_ids = world_ids
        self.axes = rig.axes
        self.period, self.steps_per_sample = rig.period, rig.steps_per_sample
        self.moves_others = bool(rig.actuators)
        self.state = ControllerState()
        self._forget()

    def _forget(self) -> None:
        """Make the tables anew, and print nothing yet."""
        noise = {n: Normals(self.seed, self.world_ids, n, width) for n, width in self.rig.draws.items()}
        self._tables: Tables = {**noise, **self.rig.tables}
        self._common_period = self.rig.common_period
        phases = self._common_period // self.steps_per_sample
        prints = phases <= MAX_PHASES and all(axis.is_trusted for axis in self.axes)
        settled = max(axis.settled for axis in self.axes)
        self._print_from = settled + PRINTED_AFTER * self.period if prints else math.inf
        self._printed: dict[tuple[str, int], Callable[..., Any]] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled and copied: printed functions are printed again."""
        return {**self.__dict__, "_printed": {}}

    @property
    def law(self) -> Law:
        """The law of the first axis."""
        return self.axes[0].law

    @property
    def observer(self) -> Observer:
        """The observer in the loop of the first axis."""
        return self.axes[0].observer

    @property
    def timestep(self) -> float:
        """Physics step [s]."""
        return self.axes[0].timestep

    @property
    def step(self) -> int | None:
        """The physics step of the last update."""
        return self.state.step

    @property
    def ticks(self) -> Sequence[Tick]:
        """The last tick of each axis; none before the first."""
        return () if self.state.decision is None else self.state.decision.ticks

    @property
    def tick(self) -> Tick | None:
        """The last tick of the first axis."""
        return self.ticks[0] if self.ticks else None

    @property
    def gimbal_rates(self) -> Sequence[Scalar]:
        """Rates at which each axis' gimbals are turned since the last tick, behind the servos' stages [rad/s]."""
        return () if self.state.decision is None else self.state.decision.rates

    @property
    def gimbal_rate(self) -> Scalar:
        """The rate of the first axis' gimbals; None before the first tick [rad/s]."""
        return self.gimbal_rates[0] if self.gimbal_rates else None

    @property
    def setpoints(self) -> Setpoints:
        """Actuators that are moved beside the gimbals, and their controls since the last tick."""
        decision = self.state.decision
        return list(self.rig.actuators), () if decision is None else decision.setpoints

    def reset(self) -> None:
        """Forget everything: the next update is the first tick of a run with the same seed."""
        self.state = ControllerState()

    def update(self, step: int, readings: Readings) -> bool:
        """Take the samples and the control decisions that are due at a physics step.

        Args:
            step: Number of the physics step, a multiple of `steps_per_sample`.
            readings: The ideal readings at that step.

        Returns:
            Whether a control tick was due; `ticks` then are its records.

        Raises:
            RunStopped: An observer or a law failed.
        """
        if step % self.period:
            self.sample(step, readings)
            return False
        state = self.state
        decided = self._decided(state.sampled, state.deciding, step, readings)
        self.state = _new(ControllerState, (step, readings, *decided))
        return True

    def sample(self, step: int, readings: Readings) -> None:
        """Take the samples that are due at a physics step: see `update`."""
        state = self.state
        arguments = state.sampled, step, readings, self._tables
        run = self._straight(self.rig.sample, step, arguments)
        try:
            sampled = run(*arguments)
        except (ArithmeticError, ValueError):
            sampled = self.rig.sample(*arguments)
        self.state = _new(ControllerState, (step, readings, sampled, *state[3:]))

    def decide(
        self,
        step: int,
        forces: Forces,
        encoders: Sequence[Scalar],
        fog: Scalar,
        rate: Scalar,
        gyro: Scalar = math.nan,
    ) -> Tick:
        """Take the control decision of a tick from samples that others have taken, with a rig of one axis.

        Args:
            step: Number of the physics step.
            forces: Specific force: inner x, inner z, outer x, outer z [m/s^2].
            encoders: Gimbal angles, one a gimbal [rad].
            fog: The gyro's rate [rad/s].
            rate: The true one, where that is fed back [rad/s].
            gyro: Reading of the cheap gyro, where an observer needs it [rad/s].

        Returns:
            The tick, which counts as the last one from now on.

        Raises:
            RunStopped: The observer or the law failed, or returned a number that is not finite.
        """
        (axis,) = self.rig.axes
        before = None if self.state.deciding is None else self.state.deciding.axes[0]
        deciding, tick = axis.decide(before, step, Delivered(forces, encoders, fog, gyro), rate)
        after, decision = self.rig.drive([deciding], (), step, [tick], self.state.readings, self._tables)
        self.state = self.state._replace(step=step, deciding=after, decision=decision)
        return tick

    def overrule(self, ticks: Sequence[Tick]) -> None:
        """Take ticks that have been decided elsewhere in the place of the last ones; observers hear their commands."""
        deciding, decision = self.state.deciding, self.state.decision
        assert deciding is not None
        assert decision is not None
        axes = [axis._replace(held=tick.u) for axis, tick in zip(deciding.axes, ticks, strict=True)]
        self.state = self.state._replace(
            deciding=deciding._replace(axes=tuple(axes)), decision=decision._replace(ticks=tuple(ticks))
        )

    def _decided(
        self, sampled: tuple[Sampled, ...], deciding: RigDeciding | None, step: int, readings: Readings
    ) -> tuple[tuple[Sampled, ...], RigDeciding, Decision]:
        """Take samples and decisions: see `RigControl.update`."""
        arguments = sampled, deciding, step, readings, self._tables
        run = self._straight(self.rig.update, step, arguments, _shown)
        try:
            return run(*arguments)
        except (ArithmeticError, ValueError):
            return self.rig.update(*arguments)

    def _straight(
        self,
        function: Callable[..., Any],
        step: int,
        arguments: tuple[Any, ...],
        finite: Callable[[Any], Sequence[Scalar]] | None = None,
    ) -> Callable[..., Any]:
        """Return a function of the rig, or its straight line, once it has run for a while.

        Where the straight line of one world fails or shows a number that is not finite, the function itself says why.
        """
        if step < self._print_from or self.state.deciding is None:
            return function
        phase = function.__name__, step % self._common_period
        run = self._printed.get(phase)
        if run is not None:
            return run
        try:
            *trees, tables = arguments
            if isinstance(self.world_ids, int):
                self._printed[phase] = straight_line(function, trees, tables, finite=finite)
            else:
                self._printed[phase] = straight_line(function, trees, tables, len(self.world_ids))
        except Exception:  # no formula of numbers alone, such as one with a branch on them: the function says why
            self._print_from = math.inf
            return function
        return self._printed[phase]


def _shown(result: tuple[Any, Any, Decision]) -> list[Scalar]:
    """Return the numbers of a decision that must be finite."""
    return [number for tick in result[2].ticks for number in (*tick.estimates[0], tick.u)]

"""A processor that takes the control decision in the controller's place, such as a board that runs all of it in C."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol, Unpack

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.axis import AxisControl
from cmg_mj.core.controller import Controller
from cmg_mj.core.errors import InputError, RunStopped
from cmg_mj.core.rig import Readings
from cmg_mj.core.types import Measurement, Observer, as_estimate, reads_gyro
from cmg_mj.results.result import Result
from cmg_mj.runs.experiment import Experiment
from cmg_mj.runs.simulate import SimulationOptions
from cmg_mj.stages.trim import trim_of


class Decision(NamedTuple):
    """A processor's decision."""

    u: float
    """Gimbal rate [rad/s]."""
    x_e: float
    """The integrator before it [rad s], which went into it unless it is being trimmed; NaN if the law has none."""
    estimate: Sequence[float]
    """The observer's: x1, x2, x3, its extra signals."""


class Processor(Protocol):
    """A processor that takes the control decision in the controller's place, in C or otherwise."""

    def start(self) -> None:
        """Make the next update the first one."""

    def update(self, accelerations: Sequence[float], encoders: Sequence[float]) -> Decision:
        """Run one control period on the readings of the sensors.

        Args:
            accelerations: Inner x, z, outer x, z [m/s^2].
            encoders: The gimbals' angles [rad].

        Returns:
            The decision.

        Raises:
            RunStopped: The processor gives no decision.
        """
        ...


def refuse_gyro(observer: Observer) -> None:
    """Refuse an observer that needs the cheap gyro, which no processor is given.

    Raises:
        InputError: The observer needs it.
    """
    if reads_gyro(observer):
        raise InputError(f"{type(observer).__name__}: a processor in the loop reads no gyro; take another observer")


class _RemoteObserver:
    """Stands for the observer that a processor runs: what it estimates has just been decided."""

    def __init__(self, observer: Observer) -> None:
        self.stands_for = observer
        self.extra_signals: Sequence[str] = getattr(observer, "extra_signals", ())
        self.estimate: Sequence[float] = ()

    def init(self, y: Measurement) -> None:
        return None

    def step(self, state: None, y: Measurement, u: Scalar) -> tuple[None, Any]:
        return None, self.estimate


class ProcessorController(Controller):
    """A controller whose decisions a processor takes, from what the sensors show (one world only).

    Args:
        processor: Takes the decisions.
        axis: The control with the observer and the law that it runs.
        seed: Seed of the sensors' noise.
        world: The world's number.
    """

    def __init__(self, processor: Processor, axis: AxisControl, seed: int = 0, world: int = 0) -> None:
        refuse_gyro(axis.observer)
        self.processor = processor
        self._remote = _RemoteObserver(axis.observer)
        remote = dataclasses.replace(axis, observers=(self._remote, *axis.observers[1:]))
        super().__init__([remote], seed=seed, world_ids=world)
        processor.start()

    def reset(self) -> None:
        """Forget everything, the processor too."""
        super().reset()
        self.processor.start()

    def _decided(self, sampled: Any, deciding: Any, step: int, readings: Readings) -> Any:
        """Let the processor decide on the samples that have been delivered."""
        (axis,) = self.rig.axes
        time = step * axis.timestep
        sampled = self.rig.sample(sampled, step, readings, self._tables)
        delivered = axis.delivered(sampled[0], step)
        try:
            decision = self.processor.update(tuple(delivered.forces), delivered.encoders)
        except RunStopped as error:
            raise RunStopped(f"{error}, at t = {time:g} s") from error
        self._remote.estimate = decision.estimate
        axes, (tick,) = self.rig.decide(sampled, deciding, step, readings)
        trim = trim_of(axis)
        trimmed = step < trim.until
        x_e = trim.gain * decision.estimate[trim.part] if trimmed else decision.x_e
        if deciding is None and not trimmed and tick.x_e:  # the processor's law has begun in this update
            x_e = tick.x_e
        if not math.isfinite(decision.u) or (math.isfinite(tick.x_e) and not math.isfinite(x_e)):
            raise RunStopped(f"the processor answered u = {decision.u:g}, x_e = {x_e:g} at t = {time:g} s")
        estimates = [as_estimate(decision.estimate), *tick.estimates[1:]]
        tick = tick._replace(u=decision.u, x_e=x_e, estimates=estimates)
        return sampled, *self.rig.drive(axes, (), step, (tick,), readings, self._tables)


def run_on(
    experiment: Experiment, processor: Processor, world: int = 0, **options: Unpack[SimulationOptions]
) -> Result:
    """Run one world whose control decisions a processor takes, such as a board.

    Args:
        experiment: The scenario, of one axis.
        processor: Takes the decisions.
        world: The world's number.
        **options: Those of `simulate`.
    """
    (axis,) = experiment.axis_controller().axes
    controller = ProcessorController(processor, axis, experiment.scenario.seed, int(world))
    return experiment.simulate(experiment.plant, controller, **options)


def run_on_a_board(experiment: Experiment, world: int = 0, **options: Unpack[SimulationOptions]) -> Result:
    """Run one world on an emulated board: `run --driver board`."""
    from cmg_mj.features.board import on_a_board

    with on_a_board(experiment.axis_controller("the board")) as board:
        return dataclasses.replace(run_on(experiment, board, world, **options), driver="board")

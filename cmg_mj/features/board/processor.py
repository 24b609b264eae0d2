"""A processor that takes the control decision in the controller's place, such as a board that runs all of it in C."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple, Protocol, Unpack

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.controller import Controller, KnownPlant, Tick
from cmg_mj.core.errors import InputError, RunStopped
from cmg_mj.core.runners import as_estimate
from cmg_mj.core.types import Forces, Law, Measurement, Observer, reads_gyro
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
        observer: The observer that the processor runs.
        law: The law that it runs.
        sensors: What stands between the ideal readings and the processor.
        plant: The controller's knowledge of the plant.
        **options: Those of `Controller`.
    """

    def __init__(
        self,
        processor: Processor,
        observer: Observer,
        law: Law,
        sensors: Any,
        plant: KnownPlant,
        **options: Any,
    ) -> None:
        refuse_gyro(observer)
        self.processor = processor
        self._remote = _RemoteObserver(observer)
        super().__init__(self._remote, law, sensors, plant, **options)
        self.observer = observer

    def reset(self) -> None:
        """Forget everything, the processor too."""
        super().reset()
        self.processor.start()

    def decide(
        self,
        step: int,
        forces: Forces,
        encoders: Sequence[Scalar],
        fog: Scalar,
        rate: Scalar,
        gyro: Scalar = math.nan,
    ) -> Tick:
        """Let the processor decide on the samples that have been delivered; see `Controller.decide`."""
        try:
            decision = self.processor.update(tuple(forces), encoders)
        except RunStopped as error:
            raise RunStopped(f"{error}, at t = {step * self.timestep:g} s") from error
        self._remote.estimate = decision.estimate
        is_first = self.tick is None
        tick = super().decide(step, forces, encoders, fog, rate, gyro)
        trim = trim_of(self)
        trimmed = step < trim.until
        x_e = trim.gain * decision.estimate[trim.part] if trimmed else decision.x_e
        if is_first and not trimmed and tick.x_e:  # the processor's law has begun in this update
            x_e = tick.x_e
        if not math.isfinite(decision.u) or (math.isfinite(tick.x_e) and not math.isfinite(x_e)):
            raise RunStopped(
                f"the processor answered u = {decision.u:g}, x_e = {x_e:g} at t = {step * self.timestep:g} s"
            )
        self.tick = tick._replace(
            u=decision.u, x_e=x_e, estimates=[as_estimate(decision.estimate), *tick.estimates[1:]]
        )
        return self.tick


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
    controller = experiment.axis_controller(int(world), make=partial(ProcessorController, processor))
    return experiment.simulate(experiment.plant, controller, **options)


def run_on_a_board(experiment: Experiment, world: int = 0, **options: Unpack[SimulationOptions]) -> Result:
    """Run one world on an emulated board: `run --driver board`."""
    from cmg_mj.features.board import on_a_board

    experiment.require_single_axis("the board")
    with on_a_board(experiment.axis_controller()) as board:
        return dataclasses.replace(run_on(experiment, board, world, **options), driver="board")

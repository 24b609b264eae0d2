"""Runs a controller on one plant or many, and judges the ticks."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import TypedDict, Unpack

import numpy as np

from cmg_mj.core.axes import ControllerLike
from cmg_mj.core.controller import Controller
from cmg_mj.core.errors import InputError, RunStopped
from cmg_mj.core.loop import ControlLoop, Ending
from cmg_mj.core.sensor import whole_steps
from cmg_mj.plant.mjcf import quiet
from cmg_mj.plant.physics import ManyWorlds, OneWorld
from cmg_mj.plant.plant import Plant
from cmg_mj.results.baselines import RATES, Baselines
from cmg_mj.results.floors import TiltFloor, acceleration_floor
from cmg_mj.results.metrics import Metrics
from cmg_mj.results.result import Outcome, Result
from cmg_mj.results.summary_keys import combine_axes
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.batch import unstack
from cmg_mj.runs.disturbances import Outsides, disturbances
from cmg_mj.runs.recorder import TickRecorder
from cmg_mj.scenario.schema import MetricsSettings

DIVERGED_TILT = 2.0 * math.pi
"""No plant that stood at one instant lies a whole turn farther at the next one: it has diverged [rad]."""
Since = Callable[[int], Trajectory]
"""Returns the ticks from one on, as far as the run has come."""


class SimulationOptions(TypedDict, total=False):
    """Options of a run that change no figure."""

    keep_trajectory: bool
    """True to keep every tick; if False, memory does not grow with the duration."""
    on_progress: Callable[[float], None] | None
    """Called after every tick with the simulated time [s]; a KeyboardInterrupt it raises ends the run."""
    on_start: Callable[[Since], None] | None
    """Called before the first tick with a function that shows the ticks meanwhile."""
    threads: int
    """Number of threads that step many worlds; 0: as many as there are processors."""


@quiet()
def simulate(
    plant: Plant | Sequence[Plant],
    controller: ControllerLike,
    duration_s: float,
    *,
    observers: Mapping[str, Sequence[str]],
    outside: Outsides,
    settings: MetricsSettings,
    driver: str = "native",
    loop: type[ControlLoop] = ControlLoop,
    **options: Unpack[SimulationOptions],
) -> Result:
    """Run one world, or as many as there are plants.

    Args:
        plant: The plant; or one a world, which may differ in numbers but not in structure.
        controller: A fresh controller, made for one world or for as many as there are plants.
        duration_s: Simulated time [s].
        observers: Axis -> names of its observer in the loop and open-loop observers.
        outside: What acts from outside.
        settings: What counts as settled and fallen.
        driver: Name of what calls the controller: `native`: the loop, `callback`: MuJoCo (one world only).
        loop: Advances physics and controller, if it is not these two.
        **options: See `SimulationOptions`.

    Returns:
        The outcomes, summaries and the trajectory. Whatever stops a run, what was recorded until then is there.

    Raises:
        InputError: A time or rate does not fit the physics step, or the callback was asked to drive many worlds.
    """
    single = isinstance(plant, Plant)
    plants = [plant] if single else list(plant)
    if driver != "native" and not single:
        raise InputError(f"driver = {driver!r}: drives one world, not a batch")
    names = plants[0].axis_names
    acting = disturbances(outside, plants, controller.seed, controller.worlds)
    if single and any(one.accelerates for one in acting):
        plants = [plants[0].with_own_model()]
    timestep = plants[0].timestep
    steps = whole_steps(duration_s, timestep, "duration_s", f"{duration_s:g} s")
    recorders = {
        name: _recorder(plants, name, part, observers[name], outside, settings, options)
        for name, part in zip(names, controller.parts, strict=True)
    }

    def since(tick: int) -> Trajectory:
        return Trajectory.joined({name: recorder.since(tick) for name, recorder in recorders.items()})

    if on_start := options.get("on_start"):
        on_start(since)
    physics = OneWorld(plants[0]) if single else ManyWorlds(plants, options.get("threads", 0))
    driving: AbstractContextManager = nullcontext()
    if driver == "callback":
        from cmg_mj.runs.callback import CallbackLoop, control_callback  # the loop needs no callback of MuJoCo's

        loop, driving = CallbackLoop, control_callback(plants[0], controller)
    ticks = loop(physics, controller, steps, acting, np.radians(settings.fall_angle_deg).item())
    rest = Outcome("done", duration_s)
    try:
        with driving:
            _record(ticks, controller, list(recorders.values()), timestep, options.get("on_progress"))
    except RunStopped as error:
        rest = Outcome("stopped", ticks.step * timestep, str(error), len(plants) > 1)
    except KeyboardInterrupt:
        rest = Outcome("interrupted", ticks.step * timestep)
    for recorder in recorders.values():
        recorder.flush()
    endings = ticks.endings
    outcomes = [_outcome(endings[world], timestep) if world in endings else rest for world in range(len(plants))]
    summaries = []
    for world, outcome in enumerate(outcomes):
        done = outcome.kind == "done"
        summaries.append(combine_axes({name: one.metrics.summary(world, done) for name, one in recorders.items()}))
    return Result(
        outcomes,
        summaries,
        since(0) if options.get("keep_trajectory", True) else None,
        tuple(observers[names[0]]),
        controller.seed,
        (controller.worlds,) if isinstance(controller.worlds, int) else tuple(controller.worlds),
        driver,
    )


def _recorder(
    rigs: Sequence[Plant],
    axis: str,
    controller: Controller,
    observers: Sequence[str],
    outside: Outsides,
    settings: MetricsSettings,
    options: SimulationOptions,
) -> TickRecorder:
    """Make what records and judges the ticks of one axis; that of the first axis has the joints."""
    plants = [rig.single_axis(axis) for rig in rigs]
    pairs = list(zip(plants, unstack(controller.sensors, len(plants)), strict=True))
    biases = [plant.apparent_bias(sensor.accelerometer) for plant, sensor in pairs]
    dt, limit, sensors = controller.law.dt, controller.law.rate_limit, controller.sensors
    noises = [plant.parameters.noise(sensor) for plant, sensor in pairs]
    y1_period = max(dt, 1.0 / sensors.accelerometer.rate_hz)
    unmodelled = any(part.unmodelled for parts in outside.values() for part in parts)
    acceleration_floors = []
    for noise, (plant, sensor) in zip(noises, pairs, strict=True):
        slides = plant.radial_tilt.height != plant.reduced.pivot_arm
        other = unmodelled or sensor.accelerometer.vibrates or plant.axis.misplaced or plant.bends or slides
        acceleration_floors.append(None if other else acceleration_floor(noise, y1_period))
    # A sample of y1 that the controller sees at n ticks counts n times, with sqrt(n) times the noise each time.
    tilt_sigmas = [noise.tilt * math.sqrt(y1_period / dt) for noise in noises]
    references = Baselines(sensors.mems_gyro, dt, controller.seed, controller.worlds, tilt_sigmas, controller.axis)
    pushes = outside.get("push", ())
    floors = TiltFloor(y1_period, len(plants)), acceleration_floors
    metrics = Metrics(observers, len(plants), dt, pushes, limit, settings, biases, RATES, *floors)
    keep, first = options.get("keep_trajectory", True), axis == rigs[0].axis_names[0]
    return TickRecorder(plants, observers, controller, metrics, references, keep=keep, joints=first)


def _record(
    loop: ControlLoop,
    controller: ControllerLike,
    recorders: Sequence[TickRecorder],
    timestep: float,
    on_progress: Callable[[float], None] | None,
) -> None:
    """Decide, advance and record at every control tick."""
    parts = list(zip(range(len(recorders)), controller.parts, recorders, strict=True))
    worlds, decide, advance = loop.physics, loop.decide, loop.advance
    for tick in loop.ticks():
        decide()
        advance()
        running = None if worlds.running is None else worlds.running.copy()
        for axis, part, recorder in parts:
            assert part.tick is not None
            recorder.add(tick.q, tick.v, part.tick, part.body_rate, tick.torques[axis], running)
        if on_progress:
            on_progress((tick.step + tick.steps) * timestep)


def _outcome(ending: Ending, timestep: float) -> Outcome:
    """Say how a world ended that the loop stopped."""
    time = ending.step * timestep
    if ending.message:
        return Outcome("stopped", time, f"{ending.message} at t = {time:g} s")
    if abs(ending.tilt) < DIVERGED_TILT:
        return Outcome("fell", time)
    return Outcome(
        "stopped",
        time,
        f"the plant diverged at t = {time:g} s: take a smaller plant.timestep_s, the integrator RK4 or a gentler push",
    )

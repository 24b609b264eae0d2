"""The loop that runs a scenario: one world or many."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np

from cmg_mj.controllers.controller import Controller, Tick
from cmg_mj.controllers.multi_axis import MultiAxisController
from cmg_mj.elementwise import Scalar
from cmg_mj.errors import InputError, RunStopped
from cmg_mj.observers.protocol import BIAS
from cmg_mj.plant.mujoco_state import quiet
from cmg_mj.plant.plant import Plant
from cmg_mj.results.baselines import RATES, References
from cmg_mj.results.error_bounds import Floors
from cmg_mj.results.metrics import Metrics
from cmg_mj.results.multi_axis_summary import combine_axes
from cmg_mj.results.result import Driver, Outcome, Result
from cmg_mj.scenario.disturbances import Push, Swing
from cmg_mj.scenario.schema import MetricsSettings
from cmg_mj.sensors.timing import whole_steps
from cmg_mj.simulation.callback import control_callback
from cmg_mj.simulation.physics import ManyWorlds, OneWorld
from cmg_mj.simulation.recorder import MultiAxisRecorder, TickRecorder
from cmg_mj.simulation.schedule import sampling_instants, with_swing_instants
from cmg_mj.simulation.stacked import split_values

DIVERGED_TILT = 2.0 * math.pi
"""No rig that stood at the last look lies a whole turn farther at the next one: its numbers have gone [rad]."""


@quiet()
def simulate(
    plant: Plant | Sequence[Plant],
    controller: Controller | MultiAxisController,
    duration_s: float,
    *,
    observers: Sequence[str] | Mapping[str, Sequence[str]],
    pushes: Sequence[Push] = (),
    swings: Sequence[Swing] = (),
    settings: MetricsSettings | None = None,
    driver: Driver = "native",
    keep_trajectory: bool = True,
    on_progress: Callable[[float], None] | None = None,
    on_start: Callable[[TickRecorder | MultiAxisRecorder], None] | None = None,
    threads: int = 0,
) -> Result:
    """Run one world, or as many as there are plants.

    Args:
        plant: The rig; or one a world, which may differ in numbers but not in structure.
        controller: A fresh controller, made for one world or for as many as there are plants.
        duration_s: Simulated time [s].
        observers: Names of the controller's observer and open-loop observers; or of each axis' if they differ.
        pushes: Torques from outside; of many worlds a torque may be an array (n_worlds,).
        swings: Others that swing.
        settings: What counts as settled and fallen.
        driver: `native`: the loop calls the controller. `callback`: MuJoCo does (one world only).
        keep_trajectory: Whether to keep every tick; without it memory does not grow with the duration.
        on_progress: Called after every tick with the simulated time [s]; a KeyboardInterrupt it raises ends the run.
        on_start: Called before the first tick with the rows, of which `since` shows what there is meanwhile.
        threads: On which many worlds are stepped; 0: as many as there are processors.

    Returns:
        The outcomes, summaries and the trajectory. Whatever stops a run, what was recorded until then is there.

    Raises:
        InputError: A time or rate does not fit the physics step, or the callback was asked to drive many worlds.
    """
    settings = settings or MetricsSettings()
    plants = [plant] if isinstance(plant, Plant) else list(plant)
    rig = plants[0]
    single = isinstance(plant, Plant)
    if driver == "callback" and not single:
        raise InputError("driver = 'callback': MuJoCo's control callback drives one world, not a batch")
    timestep = rig.model.opt.timestep
    steps = whole_steps(duration_s, timestep, "duration_s", f"{duration_s:g} s")
    worlds: Any = OneWorld(rig) if single else ManyWorlds(plants, threads)
    fall = np.radians(settings.fall_angle_deg).item()
    names = rig.axis_names
    observers_of_axis = observers if isinstance(observers, Mapping) else dict.fromkeys(names, observers)
    recorders_and_metrics = [
        _make_recorder_and_metrics(
            plants, name, part, observers_of_axis[name], pushes, settings, keep=keep_trajectory, joints=name == names[0]
        )
        for name, part in zip(names, controller.parts, strict=True)
    ]
    recorders = [own for own, _ in recorders_and_metrics]
    recorder = recorders[0] if len(recorders) == 1 else MultiAxisRecorder(dict(zip(names, recorders, strict=True)))
    if on_start is not None:
        on_start(recorder)
    outcome_of_world: list[Outcome | None] = [None] * len(plants)
    native = driver == "native"
    torques: Sequence[Scalar] | None = None
    pushed: Sequence[Scalar] = ()
    step = 0

    instants = sampling_instants(steps, controller.steps_per_sample, pushes, timestep, names)
    if swings:
        instants = with_swing_instants(instants, swings, timestep, names)
    # Of the only axis without a detour: they are asked for at every moment.
    one = len(names) == 1
    lean_of = rig.axis.line.lean if one else rig.largest_tilt
    ideal_of: Any = rig.axis.ideal if one else rig.ideal_readings
    parts_at_work = list(zip(range(len(names)), controller.parts, recorders, strict=True))
    beat, update, state, sense, advance = (
        controller.steps_per_sample,
        controller.update,
        worlds.state,
        worlds.sense,
        worlds.advance,
    )
    drive: AbstractContextManager = nullcontext() if native else control_callback(rig, controller)
    try:
        with drive:
            for step, count, held in instants:
                if held is not torques:
                    torques = held
                    worlds.push(*torques)
                    pushed = torques if single else [np.broadcast_to(torque, len(plants)) for torque in torques]
                q, v = state()
                lean = lean_of(q)
                if single:
                    if not abs(lean) <= fall:
                        outcome_of_world[0] = _end_of_world(lean, step * timestep)
                        break
                else:
                    down = ~(np.abs(lean) <= fall) & worlds.running
                    if down.any():
                        for i in np.flatnonzero(down):
                            outcome_of_world[i] = _end_of_world(float(lean[i]), step * timestep)
                        worlds.stop(down)
                    if not worlds.running.any():
                        break
                if native:
                    ticked = step % beat == 0 and update(step, ideal_of(sense(), v))
                    if ticked:
                        for axis, part, _ in parts_at_work:
                            if not single:
                                assert part.tick is not None
                                _stop_failed_worlds(worlds, part.tick, outcome_of_world, step * timestep)
                            worlds.command(part.gimbal_rate, axis)
                    advance(count)
                else:
                    ticked = step % controller.period == 0
                    advance(count)
                if ticked:
                    running = None if single else worlds.running.copy()
                    for axis, part, own in parts_at_work:
                        assert part.tick is not None
                        own.add(q, v, part.tick, pushed[axis], running)
                    if on_progress:
                        on_progress((step + count) * timestep)
    except RunStopped as error:
        shared = len(outcome_of_world) > 1
        outcome_of_world = [end or Outcome("stopped", step * timestep, str(error), shared) for end in outcome_of_world]
    except KeyboardInterrupt:
        outcome_of_world = [end or Outcome("interrupted", step * timestep) for end in outcome_of_world]
    for own in recorders:
        own.flush()
    outcomes = [end or Outcome("done", duration_s) for end in outcome_of_world]
    summaries = [
        combine_axes(
            {
                name: metrics.summary(i, outcome.kind == "done")
                for name, (_, metrics) in zip(names, recorders_and_metrics, strict=True)
            }
        )
        for i, outcome in enumerate(outcomes)
    ]
    numbers = (controller.worlds,) if isinstance(controller.worlds, int) else tuple(controller.worlds)
    longest = max(outcome.time_s for outcome in outcomes)
    loop = tuple(observers_of_axis[names[0]])
    return Result(outcomes, summaries, recorder.trajectory(), longest, loop, controller.seed, numbers, driver)


def _make_recorder_and_metrics(
    rigs: Sequence[Plant],
    axis: str,
    controller: Controller,
    observers: Sequence[str],
    pushes: Sequence[Push],
    settings: MetricsSettings,
    *,
    keep: bool,
    joints: bool,
) -> tuple[TickRecorder, Metrics]:
    """What collects and judges the ticks of one axis: see `simulate`."""
    plants = [plant.single_axis(axis) for plant in rigs]
    sensors = split_values(controller.sensors, len(plants))
    targets = {BIAS: [plant.apparent_bias(own.accelerometer) for plant, own in zip(plants, sensors, strict=True)]}
    dt, limit = controller.law.dt, controller.law.rate_limit
    noises = [plant.parameters.noise(own) for plant, own in zip(plants, sensors, strict=True)]
    floors = Floors(noises, max(dt, 1.0 / controller.sensors.accelerometer.rate_hz))
    metrics = Metrics(observers, len(plants), dt, pushes, limit, settings, targets, RATES, floors)
    beside = References(controller.sensors.mems_gyro, dt, controller.seed, controller.worlds, controller.axis)
    single = isinstance(controller.worlds, int)
    extras = controller.extra_signals
    rows = TickRecorder(plants, observers, extras, metrics, beside, dt, keep=keep, single=single, joints=joints)
    return rows, metrics


def _stop_failed_worlds(worlds: ManyWorlds, tick: Tick, outcome_of_world: list[Outcome | None], time: float) -> None:
    """Stop the worlds whose observer or law lost itself (in one world the controller raises)."""
    said = {"observer returned an estimate": sum(tick.estimates[0]), "law returned a command": tick.u}
    for what, numbers in said.items():
        blind = ~np.isfinite(numbers) & worlds.running
        if blind.any():
            for i in np.flatnonzero(blind):
                outcome_of_world[i] = Outcome("stopped", time, f"the {what} that is not finite at t = {time:g} s")
            worlds.stop(blind)


def _end_of_world(lean: float, time: float) -> Outcome:
    if abs(lean) < DIVERGED_TILT:
        return Outcome("fell", time)
    return Outcome(
        "stopped",
        time,
        f"the plant diverged at t = {time:g} s: take a smaller plant.timestep_s, the integrator RK4 or a gentler push",
    )

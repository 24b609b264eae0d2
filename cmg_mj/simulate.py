"""The loop that runs a scenario: one world or many."""

from __future__ import annotations

import itertools
import math
import statistics
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from cmg_mj.axes_controller import AxesController
from cmg_mj.callback import installed
from cmg_mj.controller import Controller, Tick
from cmg_mj.elementwise import Scalar, where
from cmg_mj.engine import quiet
from cmg_mj.errors import InputError, RunStopped, nearest
from cmg_mj.floors import Floors
from cmg_mj.metrics import Metrics, MetricsSettings
from cmg_mj.observers.protocol import BIAS
from cmg_mj.plant import Plant
from cmg_mj.push import Push
from cmg_mj.references import RATES, References
from cmg_mj.rows import Rows, RowsOfAxes
from cmg_mj.stacked import of_worlds
from cmg_mj.swing import Swing, swung
from cmg_mj.timing import whole_steps
from cmg_mj.trajectory import Trajectory
from cmg_mj.whole_rig import of_the_rig
from cmg_mj.worlds import ManyWorlds, OneWorld
from cmg_mj.worlds_table import as_table, riding_along, world_rows

if TYPE_CHECKING:
    import pyarrow as pa

A_TURN = 2.0 * math.pi
"""No rig that stood at the last look lies a whole turn farther at the next one: its numbers have gone [rad]."""

Driver = Literal["native", "callback", "board"]
"""Who calls the controller, or is it. `simulate` knows the first two: a board is the controller's processor."""


@dataclass
class Outcome:
    """How one world ended.

    Attributes:
        kind: `done`, `fell`, `stopped` (observer or plant failed) or `interrupted`.
        time_s: When [s].
        reason: In words, for `stopped`.
        with_others: Whether what stopped it stopped all worlds of its batch that still ran: it may be another's fault.
    """

    kind: Literal["done", "fell", "stopped", "interrupted"]
    time_s: float
    reason: str = ""
    with_others: bool = False

    @property
    def fell(self) -> bool:
        """Whether the rig fell."""
        return self.kind == "fell"


@dataclass
class Result:
    """What `simulate` returns.

    Attributes:
        outcomes: How each world ended, (n_worlds,).
        summaries: Each world's numbers, (n_worlds,).
        trajectory: All ticks, if they were kept.
        seconds: Simulated time of the longest world [s].
        observers: The observer in the loop, then the companions.
        seed: Seed of the sensors' noise.
        worlds: The worlds' numbers, (n_worlds,).
        driver: Who called the controller, or was it.
    """

    outcomes: list[Outcome]
    summaries: list[dict[str, Any]]
    trajectory: Trajectory | None = None
    seconds: float = 0.0
    observers: Sequence[str] = ("",)
    seed: int = 0
    worlds: Sequence[int] = ()
    driver: Driver = "native"

    @property
    def stood(self) -> np.ndarray:
        """Which worlds stood to the end, (n_worlds,)."""
        return np.array([outcome.kind == "done" for outcome in self.outcomes])

    @property
    def fell(self) -> np.ndarray:
        """Which worlds fell, (n_worlds,)."""
        return np.array([outcome.fell for outcome in self.outcomes])

    def values(self, key: str, companion: str | None = None) -> np.ndarray:
        """One number of every world's summary.

        Args:
            key: The summary's key, such as `velocity_rms_error_rad_s`.
            companion: Whose, of what rode along: a companion, `zero` or `mems_gyro`; None for the observer in the loop.

        Returns:
            (n_worlds,); NaN for a world that did not stand to the end, or has no such number.

        Raises:
            InputError: There is no such key or companion.
        """
        of = self.summaries
        if companion is not None:
            riding = riding_along(self.summaries[0])
            if companion not in riding:
                raise InputError(f"companion {companion!r}: did not ride along; {nearest(companion, riding)}")
            of = [riding_along(summary)[companion] for summary in of]
        if key not in of[0]:
            raise InputError(f"{key!r}: not in the summary; {nearest(key, of[0])}")
        numbers = np.array([math.nan if s[key] is None else s[key] for s in of], dtype=float)
        return np.where(self.stood, numbers, math.nan)

    def mean(self, key: str, companion: str | None = None) -> float | None:
        """Mean of `values` over the worlds that have one; None if no world has."""
        values = self.values(key, companion)
        known = values[np.isfinite(values)]
        return statistics.fmean(known) if len(known) else None

    def rows(self, who: str | None = None) -> list[dict[str, Any]]:
        """One observer's rows of `table`: that in the loop, or something that rode along."""
        loop = self.observers[0]
        worlds = self.worlds or range(len(self.outcomes))
        return world_rows(loop, who or loop, self.seed, worlds, self.outcomes, self.summaries)

    def table(self) -> pa.Table:
        """Every world kept: a row per observer and world, those that rode along after the one in the loop.

        Returns:
            Columns `observer`, `rides_along_in`, `world`, `seed`, `outcome`, `stood`, `end_time_s`, `reason`, then
            every figure of the summary, null where there is none. Where `stood` is false they are those until the end.
        """
        names = [self.observers[0], *riding_along(self.summaries[0])]
        return as_table(row for name in names for row in self.rows(name))

    def groups(self, count: int) -> list[Result]:
        """The worlds in so many groups of equal size, in their order, as `run_many` was given them."""
        worlds = len(self.outcomes)
        if count < 1 or worlds % count:
            raise InputError(f"groups({count}): {worlds} worlds cannot be parted so")
        if count == 1:
            return [self]
        size = worlds // count
        return [self.part(slice(i * size, (i + 1) * size)) for i in range(count)]

    def part(self, worlds: slice) -> Result:
        """Some of the worlds, that stand beside each other."""
        return replace(
            self,
            outcomes=self.outcomes[worlds],
            summaries=self.summaries[worlds],
            trajectory=None if self.trajectory is None else self.trajectory.of_worlds(worlds),
            seconds=max(outcome.time_s for outcome in self.outcomes[worlds]),
            worlds=self.worlds[worlds],
        )


def moments(
    steps: int,
    beat: int,
    pushes: Sequence[Push],
    timestep: float,
    axes: Sequence[str] = ("",),
) -> Iterator[tuple[int, int, list[Scalar]]]:
    """The moments at which the loop must look: (step, steps until the next, each axis' torque, one or a world's each).

    A push about an axis that the rig does not have, since it is locked, moves nothing.
    """
    changes: dict[int, list[Scalar]] = {0: [0.0] * len(axes), steps: [0.0] * len(axes)}
    for push in pushes:
        for time, torque in ((push.start_s, push.torque_n_m), (push.end_s, -push.torque_n_m)):
            step = whole_steps(time, timestep, "push", f"{time:g} s")
            change = changes.setdefault(step, [0.0] * len(axes))
            about = push.axis or axes[0]
            if about in axes:
                change[axes.index(about)] += torque
    edges = sorted(step for step in changes if step <= steps)
    torques: list[Scalar] = [0.0] * len(axes)
    for start, end in itertools.pairwise(edges):
        torques = [torque + change for torque, change in zip(torques, changes[start], strict=True)]
        held = [where(abs(torque) > 1e-12, torque, 0.0) for torque in torques]
        first = min(-(-start // beat) * beat, end)  # the first beat not before the push's edge
        if first > start:
            yield start, first - start, held
        last = max(end // beat * beat, first)
        for step in range(first, last, beat):
            yield step, beat, held
        if last < end:
            yield last, end - last, held


def swinging(
    looks: Iterable[tuple[int, int, list[Scalar]]], swings: Sequence[Swing], timestep: float, axes: Sequence[str]
) -> Iterator[tuple[int, int, list[Scalar]]]:
    """The moments with the swings' torques in their middle."""
    for step, count, held in looks:
        yield step, count, swung(held, swings, axes, (step + 0.5 * count) * timestep)


@quiet()
def simulate(
    plant: Plant | Sequence[Plant],
    controller: Controller | AxesController,
    duration_s: float,
    *,
    observers: Sequence[str] | Mapping[str, Sequence[str]],
    pushes: Sequence[Push] = (),
    swings: Sequence[Swing] = (),
    settings: MetricsSettings | None = None,
    driver: Driver = "native",
    keep_trajectory: bool = True,
    on_progress: Callable[[float], None] | None = None,
    on_start: Callable[[Rows | RowsOfAxes], None] | None = None,
    threads: int = 0,
) -> Result:
    """Run one world, or as many as there are plants.

    Args:
        plant: The rig; or one a world, which may differ in numbers but not in structure.
        controller: A fresh controller, made for one world or for as many as there are plants.
        duration_s: Simulated time [s].
        observers: Names of the controller's observer and companions; or of each axis' if they differ.
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
    parts = list(zip(names, controller.parts, strict=True))
    of_each = observers if isinstance(observers, Mapping) else dict.fromkeys(names, observers)
    judged = [
        _judged(plants, name, part, of_each[name], pushes, settings, keep=keep_trajectory, joints=name == names[0])
        for name, part in parts
    ]
    rows = [own for own, _ in judged]
    collected = rows[0] if len(rows) == 1 else RowsOfAxes(dict(zip(names, rows, strict=True)))
    if on_start is not None:
        on_start(collected)
    ends: list[Outcome | None] = [None] * len(plants)
    native = driver == "native"
    torques: Sequence[Scalar] | None = None
    pushed: Sequence[Scalar] = ()
    step = 0

    looks = moments(steps, controller.beat, pushes, timestep, names)
    if swings:
        looks = swinging(looks, swings, timestep, names)
    # Of the only axis without a detour: they are asked for at every moment.
    one = len(names) == 1
    lean_of = rig.axis.line.lean if one else rig.lean
    ideal_of: Any = rig.axis.ideal if one else rig.ideal
    at_work = list(zip(range(len(names)), controller.parts, rows, strict=True))
    drive: AbstractContextManager = nullcontext() if native else installed(rig, controller)
    try:
        with drive:
            for step, count, held in looks:
                if held is not torques:
                    torques = held
                    worlds.push(*torques)
                    pushed = torques if single else [np.broadcast_to(torque, len(plants)) for torque in torques]
                q, v = worlds.state()
                lean = lean_of(q)
                if single:
                    if not abs(lean) <= fall:
                        ends[0] = _fallen(lean, step * timestep)
                        break
                else:
                    down = ~(np.abs(lean) <= fall) & worlds.running
                    if down.any():
                        for i in np.flatnonzero(down):
                            ends[i] = _fallen(float(lean[i]), step * timestep)
                        worlds.stop(down)
                    if not worlds.running.any():
                        break
                if native:
                    due = step % controller.beat == 0
                    ticked = due and controller.update(step, ideal_of(worlds.sense(), v))
                    if ticked:
                        for axis, part, _ in at_work:
                            if not single:
                                assert part.tick is not None
                                _stop_blind(worlds, part.tick, ends, step * timestep)
                            worlds.command(part.turning, axis)
                    worlds.advance(count)
                else:
                    ticked = step % controller.period == 0
                    worlds.advance(count)
                if ticked:
                    running = None if single else worlds.running.copy()
                    for axis, part, own in at_work:
                        assert part.tick is not None
                        own.add(q, v, part.tick, pushed[axis], running)
                    if on_progress:
                        on_progress((step + count) * timestep)
    except RunStopped as error:
        shared = len(ends) > 1
        ends = [end or Outcome("stopped", step * timestep, str(error), shared) for end in ends]
    except KeyboardInterrupt:
        ends = [end or Outcome("interrupted", step * timestep) for end in ends]
    for own in rows:
        own.flush()
    outcomes = [end or Outcome("done", duration_s) for end in ends]
    summaries = [
        of_the_rig(
            {name: metrics.summary(i, outcome.kind == "done") for name, (_, metrics) in zip(names, judged, strict=True)}
        )
        for i, outcome in enumerate(outcomes)
    ]
    numbers = (controller.worlds,) if isinstance(controller.worlds, int) else tuple(controller.worlds)
    longest = max(outcome.time_s for outcome in outcomes)
    loop = tuple(of_each[names[0]])
    return Result(outcomes, summaries, collected.trajectory(), longest, loop, controller.seed, numbers, driver)


def _judged(
    rigs: Sequence[Plant],
    axis: str,
    controller: Controller,
    observers: Sequence[str],
    pushes: Sequence[Push],
    settings: MetricsSettings,
    *,
    keep: bool,
    joints: bool,
) -> tuple[Rows, Metrics]:
    """What collects and judges the ticks of one axis: see `simulate`."""
    plants = [plant.along(axis) for plant in rigs]
    sensors = of_worlds(controller.sensors, len(plants))
    targets = {BIAS: [plant.apparent_bias(own.accelerometer) for plant, own in zip(plants, sensors, strict=True)]}
    dt, limit = controller.law.dt, controller.law.rate_limit
    noises = [plant.facts.noise(own) for plant, own in zip(plants, sensors, strict=True)]
    floors = Floors(noises, max(dt, 1.0 / controller.sensors.accelerometer.rate_hz))
    metrics = Metrics(observers, len(plants), dt, pushes, limit, settings, targets, RATES, floors)
    beside = References(controller.sensors.mems_gyro, dt, controller.seed, controller.worlds, controller.axis)
    single = isinstance(controller.worlds, int)
    extras = controller.extra_signals
    rows = Rows(plants, observers, extras, metrics, beside, dt, keep=keep, single=single, joints=joints)
    return rows, metrics


def _stop_blind(worlds: ManyWorlds, tick: Tick, ends: list[Outcome | None], time: float) -> None:
    """Stop the worlds whose observer or law lost itself (in one world the controller raises)."""
    said = {"observer returned an estimate": sum(tick.estimates[0]), "law returned a command": tick.u}
    for what, numbers in said.items():
        blind = ~np.isfinite(numbers) & worlds.running
        if blind.any():
            for i in np.flatnonzero(blind):
                ends[i] = Outcome("stopped", time, f"the {what} that is not finite at t = {time:g} s")
            worlds.stop(blind)


def _fallen(lean: float, time: float) -> Outcome:
    if abs(lean) < A_TURN:
        return Outcome("fell", time)
    return Outcome(
        "stopped",
        time,
        f"the plant diverged at t = {time:g} s: take a smaller plant.timestep_s, the integrator RK4 or a gentler push",
    )

"""The only loop: one world or many."""

from __future__ import annotations

import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError

from cmg_mj.callback import installed
from cmg_mj.controller import Controller
from cmg_mj.elementwise import Scalar
from cmg_mj.errors import InputError, RunStopped
from cmg_mj.metrics import Metrics, MetricsSettings
from cmg_mj.plant import Plant
from cmg_mj.push import Push
from cmg_mj.timing import whole_steps
from cmg_mj.trajectory import Trajectory, column_names

Driver = Literal["native", "callback"]
ROWS_A_PIECE = 256  # ticks between two additions to the metrics


@dataclass
class Outcome:
    """How one world ended.

    Attributes:
        kind: `done`, `fell`, `stopped` (observer or plant failed) or `interrupted`.
        time_s: When [s].
        reason: In words, for `stopped`.
    """

    kind: Literal["done", "fell", "stopped", "interrupted"]
    time_s: float
    reason: str = ""

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
    """

    outcomes: list[Outcome]
    summaries: list[dict[str, Any]]
    trajectory: Trajectory | None = None
    seconds: float = 0.0
    metadata: dict[str, Any] = field(default_factory=dict)


class Worlds(Protocol):
    """Physics, one world or many."""

    def read(self) -> tuple[Sequence[Scalar], Sequence[Scalar], Sequence[Scalar]]:
        """Joint angles, joint rates and sensordata, each indexed by its address first."""
        ...

    def command(self, u: Scalar) -> None:
        """Set the gimbal rate until the next command."""
        ...

    def push(self, torque: float) -> None:
        """Set the torque on the frame until the next push."""
        ...

    def advance(self, steps: int) -> None:
        """Take physics steps."""
        ...


class OneWorld:
    """One world on floats."""

    def __init__(self, plant: Plant) -> None:
        self.model = plant.model
        self.data = plant.new_data()
        self._qpos, self._qvel, self._sensordata = self.data.qpos, self.data.qvel, self.data.sensordata
        self._ctrl, self._applied = self.data.ctrl, self.data.qfrc_applied
        self._servos = list(zip(plant.servos, plant.directions, strict=True))
        self._tilt = plant.tilt

    def read(self) -> tuple[Sequence[Scalar], Sequence[Scalar], Sequence[Scalar]]:
        """Joint angles, joint rates and sensordata as floats."""
        return self._qpos.tolist(), self._qvel.tolist(), self._sensordata.tolist()

    def command(self, u: Scalar) -> None:
        """Set the gimbal rate, each cube in its direction."""
        ctrl = self._ctrl
        for servo, direction in self._servos:
            ctrl[servo] = direction * u

    def push(self, torque: float) -> None:
        """Set the torque on the frame."""
        self._applied[self._tilt] = torque

    def advance(self, steps: int) -> None:
        """Take physics steps."""
        mujoco.mj_step(self.model, self.data, steps)


class ManyWorlds:
    """Many worlds on arrays, stepped by MuJoCo's own thread pool.

    Attributes:
        running: Which worlds are still stepped, (n_worlds,).
    """

    def __init__(self, plants: Sequence[Plant]) -> None:
        first = plants[0]
        self.batch = Batch(first.model, len(plants))
        if any(plant is not first for plant in plants):
            self.batch.set_models([plant.model for plant in plants])
        b = self.batch
        self._qpos, self._qvel, self._ctrl = b.bind("qpos"), b.bind("qvel"), b.bind("ctrl")
        self._applied, self._sensordata = b.bind("qfrc_applied"), b.bind("sensordata")
        act = b.bind("act")
        start = {id(plant): plant.new_data() for plant in plants}
        for i, plant in enumerate(plants):
            data = start[id(plant)]
            self._qpos[i], self._qvel[i], self._ctrl[i], act[i] = data.qpos, data.qvel, data.ctrl, data.act
        b.forward()
        self._servos = first.servos
        self._directions = np.array(first.directions)
        self._tilt = first.tilt
        self.running = np.ones(len(plants), dtype=bool)
        self._all_run = True

    def read(self) -> tuple[Sequence[Scalar], Sequence[Scalar], Sequence[Scalar]]:
        """Joint angles, joint rates and sensordata, each (n, n_worlds)."""
        return self._qpos.T.copy(), self._qvel.T.copy(), self._sensordata.T.copy()

    def command(self, u: Scalar) -> None:
        """Set the gimbal rates, each cube in its direction."""
        self._ctrl[:, self._servos] = np.multiply.outer(u, self._directions)

    def push(self, torque: float) -> None:
        """Set the torque on every frame."""
        self._applied[:, self._tilt] = torque

    def stop(self, worlds: np.ndarray) -> None:
        """Step these worlds no more."""
        self.running &= ~worlds
        self._all_run = False

    def advance(self, steps: int) -> None:
        """Take physics steps. A world in which MuJoCo raises keeps its state and is found not to move on."""
        try:
            self.batch.step(None if self._all_run else self.running, nstep=steps)
        except SimulationError as error:
            self._qpos[error.ids, self._tilt] = np.nan


def _stops(steps: int, beat: int, pushes: Sequence[Push], timestep: float) -> Iterator[tuple[int, int, float | None]]:
    """The moments at which the loop must look: (step, steps until the next moment, new push torque or None)."""
    changes: dict[int, float] = {}
    for push in pushes:
        for time, torque in ((push.start_s, push.torque_n_m), (push.end_s, -push.torque_n_m)):
            step = whole_steps(time, timestep, "push", f"{time:g} s")
            changes[step] = changes.get(step, 0.0) + torque
    edges = [step for step in sorted(changes) if step < steps] + [steps]
    torque, step, edge = 0.0, 0, 0
    while step < steps:
        new = None
        if step == edges[edge]:
            torque += changes[step]
            new = torque if abs(torque) > 1e-12 else 0.0
            edge += 1
        following = min(step - step % beat + beat, edges[edge])
        yield step, following - step, new
        step = following


def simulate(
    plant: Plant | Sequence[Plant],
    controller: Controller,
    duration_s: float,
    *,
    observers: Sequence[str],
    pushes: Sequence[Push] = (),
    settings: MetricsSettings | None = None,
    driver: Driver = "native",
    keep_trajectory: bool = True,
    on_progress: Callable[[float], None] | None = None,
) -> Result:
    """Run one world, or as many as there are plants.

    Args:
        plant: The rig; or one a world, which may differ in numbers but not in structure.
        controller: A fresh controller, made for one world or for as many as there are plants.
        duration_s: Simulated time [s].
        observers: Names of the controller's observer and companions.
        pushes: Torques from outside.
        settings: What counts as settled and fallen.
        driver: `native`: the loop calls the controller. `callback`: MuJoCo does (one world only).
        keep_trajectory: Whether to keep every tick; without it memory does not grow with the duration.
        on_progress: Called now and then with the simulated time [s].

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
    worlds: Any = OneWorld(rig) if single else ManyWorlds(plants)
    bias: Scalar = rig.bias if single else np.array([p.bias for p in plants])
    fall = np.radians(settings.fall_angle_deg).item()
    push_end = max((push.end_s for push in pushes), default=0.0)
    dt = controller.law.dt
    metrics = Metrics(observers, len(plants), dt, push_end, controller.law.rate_limit, settings)
    rows = _Rows(column_names(observers, rig.joint_names), len(observers), metrics, dt, single, keep_trajectory)
    ends: list[Outcome | None] = [None] * len(plants)
    running = len(plants)
    native = driver == "native"
    torque = 0.0
    step = 0

    drive: AbstractContextManager = nullcontext() if native else installed(rig, controller)
    try:
        with drive, np.errstate(all="ignore"):
            for step, count, new_torque in _stops(steps, controller.beat, pushes, timestep):
                if new_torque is not None:
                    torque = new_torque
                    worlds.push(torque)
                q, v, s = worlds.read()
                lean = q[rig.tilt] - rig.tilt_zero
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
                        running -= int(down.sum())
                        if not running:
                            break
                if native:
                    ticked = step % controller.beat == 0 and controller.update(step, rig.ideal(q, v, s))
                    if ticked:
                        worlds.command(controller.tick.u)  # type: ignore[union-attr]
                    worlds.advance(count)
                else:
                    ticked = step % controller.period == 0
                    worlds.advance(count)
                if ticked:
                    tick = controller.tick
                    assert tick is not None
                    row = [lean + bias, v[rig.tilt], rig.gimbal_angle(q), tick.y1, tick.y2, tick.fog, tick.u, tick.x_e, torque]
                    for estimate in tick.estimates:
                        row += estimate
                    rows.add(row, q, v, None if single else worlds.running)
                    if on_progress and len(rows) == 0:
                        on_progress((step + count) * timestep)
    except RunStopped as error:
        ends = [end or Outcome("stopped", step * timestep, str(error)) for end in ends]
    except KeyboardInterrupt:
        ends = [end or Outcome("interrupted", step * timestep) for end in ends]
    rows.flush()
    outcomes = [end or Outcome("done", duration_s) for end in ends]
    summaries = [metrics.summary(i, outcome.kind != "done") for i, outcome in enumerate(outcomes)]
    return Result(outcomes, summaries, rows.trajectory(), max(o.time_s for o in outcomes))


def _fallen(lean: float, time: float) -> Outcome:
    if np.isfinite(lean):
        return Outcome("fell", time)
    return Outcome("stopped", time, f"the plant diverged at t = {time:g} s: take a smaller plant.timestep_s or integrator RK4")


class _Rows:
    """Ticks on their way to the metrics and, if kept, to the trajectory."""

    def __init__(
        self, names: list[str], n_observers: int, metrics: Metrics, dt: float, single: bool, keep: bool
    ) -> None:
        self._names = names
        self._n_observers = n_observers
        self._metrics = metrics
        self._dt = dt
        self._single = single
        self._keep = keep
        self._floats = array.array("d")
        self._arrays: list[list[Scalar]] = []
        self._running: list[np.ndarray] = []
        self._waiting = 0
        self._pieces: list[np.ndarray] = []

    def __len__(self) -> int:
        return self._waiting

    def add(self, row: list[Scalar], q: Sequence[Scalar], v: Sequence[Scalar], running: np.ndarray | None) -> None:
        if running is None:
            self._floats.extend(row)
            self._floats.extend(q)
            self._floats.extend(v)
        else:
            self._arrays.append([*row, *q, *v] if self._keep else row)
            self._running.append(running.copy())
        self._waiting += 1
        if self._waiting >= ROWS_A_PIECE:
            self.flush()

    def flush(self) -> None:
        if not self._waiting:
            return
        if self._single:
            piece = np.array(self._floats).reshape(self._waiting, len(self._names), 1)
            self._floats = array.array("d")
        else:
            running = np.array(self._running)
            piece = np.full((self._waiting, len(self._arrays[0]), running.shape[1]), np.nan)
            for k, row in enumerate(self._arrays):
                for c, values in enumerate(row):
                    piece[k, c] = values
            piece[~np.broadcast_to(running[:, None, :], piece.shape)] = np.nan
            self._arrays, self._running = [], []
        self._waiting = 0
        columns = {name: piece[:, i] for i, name in enumerate(self._names[: piece.shape[1]])}
        rates = [piece[:, i] for i, name in enumerate(self._names[: piece.shape[1]]) if name.endswith("/x2_rad_s")]
        self._metrics.update(
            columns["x1_rad"], columns["x2_rad_s"], columns["x3_rad"], columns["u_rad_s"], columns["fog_rad_s"], rates
        )
        if self._keep:
            self._pieces.append(piece)

    def trajectory(self) -> Trajectory | None:
        if not self._keep:
            return None
        whole = np.concatenate(self._pieces) if self._pieces else np.zeros((0, len(self._names), 1))
        if self._single:
            whole = whole[:, :, 0]
        columns = {"time_s": np.arange(len(whole)) * self._dt}
        columns |= {name: np.ascontiguousarray(whole[:, i]) for i, name in enumerate(self._names)}
        return Trajectory(columns)

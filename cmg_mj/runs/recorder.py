"""Ticks on their way to the metrics and, if kept, to the trajectory."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import chain

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.controller import Controller
from cmg_mj.core.rig import ideals_of
from cmg_mj.plant.physics import Joints
from cmg_mj.plant.plant import Plant
from cmg_mj.results.baselines import RATES, Baselines
from cmg_mj.results.floors import TiltFloor, acceleration_floor
from cmg_mj.results.metrics import Metrics
from cmg_mj.results.trajectory import Layout, Trajectory
from cmg_mj.runs.batch import world_value
from cmg_mj.runs.disturbances import Outsides
from cmg_mj.scenario.schema import MetricsSettings

TICKS_A_PIECE = 256
"""Ticks that are made into columns together, which is much cheaper than one by one."""


class TickRecorder:
    """Collects the ticks of one or many worlds.

    Args:
        plants: The rigs, one a world.
        observers: Names of the observer in the loop, then of the open-loop observers.
        controller: The controller whose ticks they are: floats of one world, or arrays (n_worlds,).
        axis: The number of the axis; the first one keeps the joints too.
        outside: What acts from outside.
        settings: What counts as settled.
        keep: Whether to keep the pieces for a trajectory.
    """

    def __init__(
        self,
        plants: Sequence[Plant],
        observers: Sequence[str],
        controller: Controller,
        axis: int,
        outside: Outsides,
        settings: MetricsSettings,
        *,
        keep: bool,
    ) -> None:
        self._axis, self._controller, self._number = plants[0].axis, controller, axis
        control, joints = controller.axes[axis], axis == 0
        self._reads_gyro = control.reads_gyro
        self._bias = np.array([plant.bias for plant in plants])
        names, kinds = (tuple(plants[0].joint_names), plants[0].joint_kinds) if joints else ((), ())
        self._layout = Layout(
            tuple(observers), tuple(map(tuple, control.extra_signals)), names, kinds, control.reads_gyro
        )
        dt, sensors = control.law.dt, control.sensors
        self._keep, self._joints, self._dt = keep, joints, dt
        self._single = isinstance(controller.world_ids, int)
        self._waiting: list[tuple] = []
        self._kept = {name: [np.zeros((0, len(plants)))] for name in self._layout.columns()}
        pairs = [(plant, world_value(sensors, world)) for world, plant in enumerate(plants)]
        noises = [plant.parameters.noise(sensor) for plant, sensor in pairs]
        y1_period = max(dt, 1.0 / sensors.accelerometer.rate_hz)
        unmodelled = any(part.unmodelled for parts in outside.values() for part in parts)
        acceleration_floors = []
        for noise, (plant, sensor) in zip(noises, pairs, strict=True):
            slides = plant.pair_tilt.height != plant.reduced.pivot_arm
            other = unmodelled or sensor.accelerometer.vibrates or plant.axis.misplaced or plant.bends or slides
            acceleration_floors.append(None if other else acceleration_floor(noise, y1_period))
        rates = [name for name in RATES if name not in observers]  # an observer is its own baseline
        self.metrics = Metrics(
            observers,
            len(plants),
            dt,
            outside.get("push", ()),
            control.law.rate_limit,
            settings,
            [plant.apparent_bias(sensor.accelerometer) for plant, sensor in pairs],
            rates,
            TiltFloor(y1_period, len(plants)),
            acceleration_floors,
        )
        # A sample of y1 that the controller sees at n ticks counts n times, with sqrt(n) times the noise each time.
        sigmas = [noise.tilt * math.sqrt(y1_period / dt) for noise in noises]
        self._references = Baselines(sensors.mems_gyro, dt, controller.seed, controller.world_ids, sigmas, axis)

    def add(self, q: Joints, v: Joints, torque: Scalar, running: np.ndarray | None) -> None:
        """Take the controller's latest tick of the axis.

        Args:
            q: Joint angles at the tick [rad].
            v: Joint rates at the tick [rad/s].
            torque: The push, a float, or (n_worlds,) [N m].
            running: Which worlds have not ended, (n_worlds,); None for one world.
        """
        state = self._controller.state
        assert state.decision is not None
        body_rate = ideals_of(state.readings)[self._number].gyro
        if not self._single:  # a row of all sensors' readings, which would be held as long
            body_rate = body_rate.copy()
        self._waiting.append((q, v, state.decision.ticks[self._number], body_rate, torque, running))
        if len(self._waiting) >= TICKS_A_PIECE:
            self.flush()

    def flush(self) -> None:
        """Make the waiting ticks into columns: to the metrics, and to the trajectory if it is kept."""
        if not self._waiting:
            return
        columns, body_rate = self._piece()
        self._waiting = []
        rates = self._references.rates(body_rate, columns["y1_rad"])
        self.metrics.update(columns, {name: rates[name] for name in self.metrics.references})
        if self._keep:
            for name, column in columns.items():
                self._kept[name].append(column)

    def _piece(self) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Make the waiting ticks into columns by name, NaN after a world's end, and the frame's rate."""
        qs, vs, ticks, body_rates, torques, runnings = zip(*self._waiting, strict=True)
        q, v = self._columns(qs), self._columns(vs)
        *measured, estimates, gyro = zip(*ticks, strict=True)
        measured = self._columns(list(zip(*measured, strict=True)))
        shape = measured[0].shape
        push = np.broadcast_to(self._columns([(torque,) for torque in torques])[0], shape)
        estimated = chain.from_iterable(self._columns(estimate) for estimate in zip(*estimates, strict=True))
        line = self._axis.line
        true = line.lean(q) + self._bias, line.rate(v), self._axis.gimbal_angle(q)
        readings = [np.array(gyro).reshape(shape)] if self._reads_gyro else []
        signals = [*true, *measured, push, *readings, *estimated, *([*q, *v] if self._joints else [])]
        if not self._single:
            ended = ~np.array(runnings)
            signals = [np.where(ended, np.nan, signal) for signal in signals]
        return dict(zip(self._kept, signals, strict=True)), np.array(body_rates).reshape(shape)

    def _columns(self, ticks: Sequence) -> np.ndarray:
        """Turn (n_ticks, n_signals[, n_worlds]) into (n_signals, n_ticks, n_worlds)."""
        if self._single:  # fromiter: np.array takes five times as long over nested sequences of floats
            flat = np.fromiter(chain.from_iterable(ticks), dtype=float)
            return flat.reshape(len(ticks), -1).T[:, :, None]
        return np.swapaxes(np.array(ticks), 0, 1)

    def since(self, tick: int) -> Trajectory:
        """Return the ticks from one on that were kept, as far as the run has come.

        Those that wait go on waiting: whoever looks on changes no number.
        """
        waiting = self._piece()[0] if self._waiting else {}
        columns = {}
        for name, kept in self._kept.items():  # a column after the other: of a long run, all twice take much memory
            kept[:] = [np.concatenate(kept)]
            whole = np.concatenate([*kept, waiting[name]]) if waiting else kept[0]
            columns[name] = whole[tick:, 0] if self._single else whole[tick:]
        time = (tick + np.arange(len(columns["x1_rad"]))) * self._dt
        return Trajectory({"time_s": time, **columns}, layout=self._layout)

"""The closed loop as one linear system, sampled at the least time that holds whole periods of control and sensors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cmg_mj.core.errors import InputError, nearest, shortened
from cmg_mj.core.sensor import steps_until
from cmg_mj.core.types import STATE_SIGNALS, extra_signals, reads_gyro
from cmg_mj.linear.plant import LinearPlant, linear_reduced, linearise_alone
from cmg_mj.linear.slopes import Slopes, law_slopes, needed_states, observer_slopes
from cmg_mj.plant.plant import Plant
from cmg_mj.scenario.design import Design
from cmg_mj.stages.low_pass import INSIDE_HZ, coefficients
from cmg_mj.stages.notch import Notch

if TYPE_CHECKING:
    import control

INPUTS = (
    "push_n_m",
    "y1_noise_rad",
    "acceleration_noise_rad_s2",
    "y2_noise_rad",
    "fog_noise_rad_s",
    "gimbal_rate_noise_rad_s",
)
"""Inputs of the system: a torque on the rig, noise of four measurements, a gimbal rate that nobody commanded."""
OUTPUTS = (*STATE_SIGNALS, "u_rad_s")
"""Outputs before those of the observer: true tilt, tilt rate and gimbal angle, and the command."""
MODELS = ("rig", "reduced")
"""Plants of the system: the rig linearised as it is simulated, or the reduced model."""
FORCES = ("inner", "inner_z", "outer", "outer_z")
"""What the accelerometers show, across and along the radial line."""
TAKES = (
    *("adaptive", "finite_difference", "free_pivot", "gyro_free", "high_gain"),
    *("kalman", "linear", "linear_high_gain", "ltv", "luenberger", "mems_fused"),
)
"""The package's observers that have a slope at rest."""
NO_SLOPES = Slopes((), *np.zeros((4, 0, 0)))


class _Channel(NamedTuple):
    """A measurement on its way to the controller, in physics steps.

    Attributes:
        name: The sensor.
        period: Time between two readings.
        latency: Time until a reading is delivered.
        raw: Period of the samples that the part's low-pass takes; 0 without one.
        older: Steps by which these samples precede those of the pair's inner part.
    """

    name: str
    period: int
    latency: int
    raw: int = 0
    older: int = 0

    def taken(self, tick: int) -> int:
        """Return the step at which the newest reading at a tick was taken."""
        return (tick - self.latency) // self.period * self.period - self.older

    def is_filtered_at(self, step: int) -> bool:
        """Return whether the low-pass takes a sample at a step."""
        return bool(self.raw) and (step + self.older) % self.raw == 0


def linear_closed_loop(design: Design, plant: Plant, model: str = "rig") -> control.StateSpace:
    """Make the linear system of a scenario's closed loop: see `Experiment.linear_closed_loop`.

    Args:
        design: The law and the observers.
        plant: The plant.
        model: One of `MODELS`.

    Returns:
        The system.

    Raises:
        InputError: Something in the loop is not linear, or not covered.
    """
    import control  # 0.9 s of import: no run waits for it

    settings, dt = design.scenario.plant, design.law.dt
    if model not in MODELS:
        raise InputError(f"linear_closed_loop: plant = {shortened(repr(model))}: {nearest(str(model), MODELS)}")
    unmodelled = "bend: the reduced model is rigid" if plant.bends else ""
    if plant.reduced.pivot_arm:
        unmodelled = f"plant.model = {settings.model!r}: its pivot slides"
    if unmodelled and model == "reduced":
        raise InputError(f'{unmodelled}; take linear_closed_loop(plant="rig")')
    linear = linearise_alone(plant) if model == "rig" else linear_reduced(plant.reduced)
    if backlash := settings.gimbal_backlash_arcmin:
        raise InputError(
            f"plant.gimbal_backlash_arcmin = {backlash:g}: backlash is not linear; set plant.gimbal_backlash_arcmin=0"
        )
    for name in sensors_used(design):
        rate = getattr(design.scenario.sensors, name).rate_hz
        if abs(rate * dt - max(round(rate * dt), 1)) > 1e-9:
            raise InputError(
                f"sensors.{name}.rate_hz = {rate:g}: linear_closed_loop takes the control rate, {1.0 / dt:g} Hz, or a "
                "whole multiple of it"
            )
    loop = ClosedLoop(design, linear)
    *matrices, states, outputs = loop.matrices()
    names = {"inputs": loop.inputs, "outputs": outputs, "states": states, "name": "closed_loop"}
    return control.StateSpace(*matrices, dt, **names, remove_useless_states=False)


def sensors_used(design: Design) -> list[str]:
    """List the sensors in the loop, by their section."""
    return ["accelerometer", "encoder", *(["fog"] if design.scenario.controller.feedback == "fog" else [])]


class ClosedLoop:
    """The loop over a common period. Each signal is a row: its weights on all states, then on all inputs.

    Args:
        design: The law and the observers.
        plant: The plant, linearised.
        true_state: Whether the law gets the plant's state, as late as the sensors are, in place of an observer's.

    Attributes:
        ticks: The number of control periods in a common one.
        period: The common period [s].
        states: Name of each state.
        inputs: Name of each input.

    Raises:
        InputError: Observer or law have no slope.
    """

    def __init__(self, design: Design, plant: LinearPlant, *, true_state: bool = False) -> None:
        self._design, self._plant, self._true_state = design, plant, true_state
        law, controller, self._timestep = design.law, design.scenario.controller, design.rig.timestep
        self._estimating, extra, field = NO_SLOPES, (), f"controller.kind = {controller.kind!r}"
        try:
            if not true_state:
                observer, field = design.observer(), f"observer.kind = {design.scenario.observer.kind!r}"
                self._estimating, extra = observer_slopes(observer), extra_signals(observer)
                self._reads_gyro = reads_gyro(observer)
                field = f"controller.kind = {controller.kind!r}"
            self._deciding = law_slopes(design.fresh_law(), len(extra))
        except InputError as error:
            takes = f"linear_closed_loop takes state_feedback with {', '.join(TAKES)}, or one of your own"
            raise InputError(f"{field}: {error}; {takes}") from error
        self._estimates = [] if true_state else [f"estimated_{name}" for name in (*STATE_SIGNALS, *extra)]
        self._channels = _channels(design, true_state)
        control_steps = round(law.dt / self._timestep)  # whole, as the time grid has it
        self._steps = math.lcm(control_steps, *(channel.period for channel in self._channels))
        self._tick_steps = range(0, self._steps, control_steps)
        self.ticks, self.period = len(self._tick_steps), self._steps * self._timestep
        # The state of a reading on its way: sensor, step of a common period at which it is taken, periods ago.
        self._late: dict[tuple[str, int, int], str] = {}
        for channel in self._channels:
            late = [
                (channel.name, taken % self._steps, age)
                for taken in sorted({channel.taken(tick) for tick in self._tick_steps if channel.taken(tick) < 0})
                for age in range(1, -(taken // self._steps) + 1)
            ]
            self._late |= {reading: f"{channel.name}_{i}" for i, reading in enumerate(late, 1)}
        self._notch = Notch(controller.notch_hz, law.dt, math.inf) if controller.notch_hz else None
        self.states = [
            *plant.names,
            *(f"{channel.name}_filter_{i}" for channel in self._channels if channel.raw for i in (1, 2)),
            *self._late.values(),
            *_prefixed("observer", self._estimating),
            *_prefixed("law", self._deciding),
            *(["notch_1", "notch_2"] if self._notch else []),
            "u_before",
        ]
        self.inputs = [*INPUTS, *(f"{INPUTS[-1]}_{tick}" for tick in range(1, self.ticks))]
        rows = np.eye(len(self.states) + len(self.inputs))
        self._start = dict(zip((*self.states, *self.inputs), rows, strict=True))
        self._y1_slopes = _measured_slopes(design)
        bandwidth = design.scenario.sensors.accelerometer.bandwidth_hz
        self._low_pass = coefficients(bandwidth, INSIDE_HZ) if bandwidth else [[0.0] * 3] * 2

    def matrices(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, list[str], list[str]]:
        """Compute A, B, C, D of the states that reach an output, and the names of these states and of the outputs.

        With several ticks in a period their commands and gimbal rates are further signals.
        """
        start, plant = self._start, self._plant
        rows = self._rows = dict(start)
        x, turned, push = np.array([rows[name] for name in plant.names]), rows["u_before"], rows["push_n_m"]
        taken = {
            (channel.name, channel.taken(tick) % self._steps) for channel in self._channels for tick in self._tick_steps
        }
        instants = {*self._tick_steps, *(step for _, step in taken)}
        instants |= {step for channel in self._channels for step in range(self._steps) if channel.is_filtered_at(step)}
        hold = cache(lambda steps: plant.hold(steps * self._timestep))
        latched: dict[tuple[str, int], np.ndarray] = {}
        shown, commands = [], []
        rate_noises = self.inputs[len(INPUTS) - 1 :]  # one a tick
        for step, after in pairwise([*sorted(instants), self._steps]):
            motion = plant.C @ x + plant.D @ np.array([turned, push])
            ideal = self._ideal(motion)
            for channel in self._channels:
                value = ideal[channel.name]
                if channel.is_filtered_at(step):
                    value = self._second_order(f"{channel.name}_filter", self._low_pass, value)
                if (channel.name, step) in taken:
                    latched[channel.name, step] = value
            if step in self._tick_steps:
                readings = {}
                for channel in self._channels:
                    ago, at = divmod(channel.taken(step), self._steps)  # periods ago, at a step of theirs
                    reading = channel.name, at
                    readings[channel.name] = start[self._late[*reading, -ago]] if ago else latched[reading]
                u, estimate = self._decide(motion, readings)
                turned = u + rows[rate_noises[len(commands)]]
                commands.append(u)
                shown = shown or [*motion[:3], u, *estimate[: len(self._estimates)]]
            F, G = hold(after - step)
            x = F @ x + G @ np.array([turned, push])
        rows |= dict(zip(plant.names, x, strict=True))
        for (name, step, age), reading in self._late.items():
            rows[reading] = latched[name, step] if age == 1 else start[self._late[name, step, age - 1]]
        n = len(self.states)
        ahead, out = np.array([rows[name] for name in self.states]), np.array([*shown, *commands[1:]])
        outputs = [*OUTPUTS, *self._estimates, *(f"u_rad_s_{i}" for i in range(1, self.ticks))]
        A, B, C, D = ahead[:, :n], ahead[:, n:], out[:, :n], out[:, n:]
        kept = needed_states(A, C)
        return A[kept][:, kept], B[kept], C[:, kept], D, np.array(self.states)[kept].tolist(), outputs

    def _ideal(self, motion: np.ndarray) -> dict[str, np.ndarray]:
        """Return what perfect sensors show of the plant's outputs, to first order: tangential forces, y2, the gyro."""
        known, settings = self._design.rig, self._design.scenario.plant
        x1, x2, x3, y1, acceleration, gyro = motion
        true = replace(
            known.tilt,
            r_inner=known.tilt.r_inner + 1e-3 * settings.accelerometer_inner_misplaced_mm,
            r_outer=known.tilt.r_outer + 1e-3 * settings.accelerometer_outer_misplaced_mm,
        )
        forces = true.forces(-known.gravity * y1, 0.0 * y1, acceleration)
        return {"encoder": x3, "fog": gyro, "tilt": x1, "rate": x2, **dict(zip(FORCES, forces, strict=True))}

    def _second_order(self, name: str, coefficients: Sequence[Sequence[float]], value: np.ndarray) -> np.ndarray:
        """Advance a filter of second order, whose states are a name's 1 and 2."""
        ((b0, b1, b2), (_, a1, a2)), rows = coefficients, self._rows
        passed = b0 * value + rows[f"{name}_1"]
        rows[f"{name}_1"] = b1 * value - a1 * passed + rows[f"{name}_2"]
        rows[f"{name}_2"] = b2 * value - a2 * passed
        return passed

    def _decide(self, motion: np.ndarray, readings: dict[str, np.ndarray]) -> tuple[np.ndarray, Any]:
        """Return the command of a tick, and the estimate, as `Controller.decide` makes them."""
        rows, settings = self._rows, self._design.scenario.controller
        before, y2 = rows["u_before"], readings["encoder"] + rows["y2_noise_rad"]
        if self._true_state:
            measured = [readings["tilt"], y2, 0.0 * before, before]
            estimate = [readings["tilt"], readings["rate"], y2]
        else:
            y1, acceleration = self._y1_slopes @ np.array([readings[name] for name in _forces(self._design)])
            y1, acceleration = y1 + rows["y1_noise_rad"], acceleration + rows["acceleration_noise_rad_s2"]
            measured = [y1, y2, acceleration, before]
            shown = (
                [(1.0 + self._design.scenario.sensors.mems_gyro.scale_error) * motion[5]] if self._reads_gyro else []
            )
            estimate = self._advance("observer", self._estimating, [*measured, *shown])
        x1, x2, x3 = (measured[0], estimate[1], y2) if settings.angle_source == "measured" else estimate[:3]
        if settings.feedback != "observer":
            x2 = motion[1] if settings.feedback == "truth" else readings["fog"] + rows["fog_noise_rad_s"]
        (u,) = self._advance("law", self._deciding, [*measured, x1, x2, x3, *estimate[3:]])
        if self._notch is not None:
            u = self._second_order("notch", (self._notch.numerator, self._notch.denominator), u)
        rows["u_before"] = u
        return u, estimate

    def _advance(self, owner: str, slopes: Slopes, inputs: Sequence[Any]) -> np.ndarray:
        """Advance the observer or the law by a sample; return its outputs."""
        names, width = _prefixed(owner, slopes), len(self._rows["u_before"])
        state = np.array([self._rows[name] for name in names]).reshape(-1, width)
        self._rows |= dict(zip(names, slopes.A @ state + slopes.B @ np.array(inputs), strict=True))
        return slopes.C @ state + slopes.D @ np.array(inputs)


def _prefixed(owner: str, slopes: Slopes) -> list[str]:
    """Name the states of the observer or the law; one that is a single number has the owner's name."""
    return [f"{owner}_{name}" if name else owner for name in slopes.names]


def _channels(design: Design, true_state: bool) -> list[_Channel]:
    """Return the measurements in the loop, with the times of each."""
    timestep, sensors, channels = design.rig.timestep, design.scenario.sensors, []
    for name in sensors_used(design):
        sensor = getattr(sensors, name)
        times = round(1.0 / sensor.rate_hz / timestep), steps_until(sensor.latency_s, timestep)
        if name != "accelerometer":
            channels.append(_Channel(name, *times))
        elif true_state:
            channels += [_Channel(signal, *times) for signal in ("tilt", "rate")]
        else:
            raw = round(1.0 / INSIDE_HZ / timestep) if sensor.bandwidth_hz else 0
            skew = round(sensor.skew_s / timestep)
            channels += [_Channel(name, *times, raw, skew * name.startswith("outer")) for name in _forces(design)]
    return channels


def _forces(design: Design) -> tuple[str, ...]:
    """Name the forces of first order: along the ray, gravity is a cosine."""
    return FORCES[::2] if design.rig.tilt.is_radial else FORCES


def _measured_slopes(design: Design) -> np.ndarray:
    """Return y1 and the angular acceleration by `_forces`, (2, n).

    Differences of the code that runs, constant errors of the parts among it.
    """
    tilt, gravity = design.rig.tilt, design.rig.gravity
    erring = design.scenario.sensors.accelerometer.constant_errors()

    def measured(change: np.ndarray) -> np.ndarray:
        forces = erring((np.array(tilt.forces(0.0, gravity, 0.0)) + change).tolist())
        return np.array([tilt(*forces), tilt.acceleration(*forces)])

    h = 1e-5 * gravity
    changes = h * np.eye(4)[[FORCES.index(name) for name in _forces(design)]]
    return np.transpose([measured(change) - measured(-change) for change in changes]) / (2.0 * h)

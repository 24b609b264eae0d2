"""The closed loop over a common period of control and sensors as one function, and its slopes at rest as matrices."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from operator import sub
from typing import TYPE_CHECKING, Any

import numpy as np

from cmg_mj.core.arrays import Scalar, cos, sin
from cmg_mj.core.axis import AxisControl, Deciding, KnownPlant, Sampled
from cmg_mj.core.errors import InputError, nearest, shortened
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.rig import RigControl
from cmg_mj.core.sensor import Digital, Sensor
from cmg_mj.core.tilt import GimbalAngle, PairTilt
from cmg_mj.core.types import STATE_SIGNALS, Forces, IdealReading, Measurement
from cmg_mj.linear.plant import LinearPlant, linear_reduced, linearise_alone
from cmg_mj.linear.slopes import Slopes, law_slopes, needed_states, observer_slopes, slopes_at
from cmg_mj.observers.linear import FiniteDifference
from cmg_mj.plant.plant import Plant
from cmg_mj.scenario.design import Design

if TYPE_CHECKING:
    import control

MEASURED = ("y1_noise_rad", "acceleration_noise_rad_s2", "y2_noise_rad", "fog_noise_rad_s")
"""Noise of the measurements, in the order in which `ClosedLoop.sense` shows them."""
INPUTS = ("push_n_m", *MEASURED, "gimbal_rate_noise_rad_s")
"""Inputs of the system: a torque on the rig, noise of four measurements, a gimbal rate that nobody commanded."""
OUTPUTS = (*STATE_SIGNALS, "u_rad_s")
"""Outputs before those of the observer: true tilt, tilt rate and gimbal angle, and the command."""
MODELS = ("rig", "reduced")
"""Plants of the system: the rig linearised as it is simulated, or the reduced model."""
TAKES = (
    *("adaptive", "finite_difference", "free_pivot", "gyro_free", "high_gain"),
    *("kalman", "linear", "linear_high_gain", "ltv", "luenberger", "mems_fused"),
)
"""The package's observers that have a slope at rest."""
SENSORS = ("accelerometer", "encoder", "fog", "mems_gyro")
"""Sections of the sensors, in the order in which an axis has them."""
MOTION = 6
"""The number of the plant's outputs."""
LENGTH = 1e-5
"""Length of a difference of the sensors: shorter ones drown in the rounding of gravity."""


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
    """A linear plant and the control of its axis, without noise, rounding and play.

    Args:
        design: The law and the observers.
        plant: The plant, linearised.
        true_state: Whether the law gets the plant's state, as late as the sensors are, in place of an observer's.
        worlds: The number of worlds, on arrays (n_worlds,); None for one, on floats.

    Attributes:
        interval: Physics steps between the instants at which anything may be due.
        ticks: The number of control periods in a common one.
        period: The common period [s].
        inputs: Name of each input.
    """

    def __init__(
        self, design: Design, plant: LinearPlant, *, true_state: bool = False, worlds: int | None = None
    ) -> None:
        self._design = design
        self._plant = plant
        self._true_state = true_state
        axis = _control(design)
        self._axis = _fed_the_true_state(axis, design.rig.reduced) if true_state else axis
        rig = RigControl((self._axis,))
        self.interval = rig.steps_per_sample
        self._steps = range(0, rig.common_period, self.interval)
        self._silence = {stream: _silence(width, worlds) for stream, width in rig.draws.items()}
        self._is_array = worlds is not None
        self.ticks = rig.common_period // axis.period
        self.period = rig.common_period * axis.timestep
        self.inputs = [*INPUTS, *(f"{INPUTS[-1]}_{tick}" for tick in range(1, self.ticks))]
        self._hold = plant.hold(self.interval * axis.timestep)
        self._averaged = design.scenario.sensors.accelerometer.averaged and not true_state
        self._gravity = design.rig.gravity
        self._tilt = design.rig.tilt if true_state else _true_tilt(design)
        zero = 0.0 if worlds is None else np.zeros(worlds)
        self._rest = self.start(*[zero] * MOTION)
        self._still = self._shown(0, self._rest)

    def matrices(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, list[str], list[str]]:
        """Compute A, B, C, D of the states that reach an output, and the names of these states and of the outputs.

        They are the slopes of a common period at rest: each signal is a row, its slopes by all states and inputs.
        States that no input reaches, such as those of 1/f noise, are left out too. With several ticks in a period
        their commands and gimbal rates are further signals.

        Raises:
            InputError: Observer or law have no slope.
        """
        with np.errstate(all="ignore"):
            decided = self._decided()
            sensed = [
                slopes_at(self._rest, partial(self.sense, step), MOTION, LENGTH, together=True) for step in self._steps
            ]
        sizes = [len(part.A) for part in (self._plant, sensed[0], decided)]
        n = sum(sizes)
        x, sampled, deciding, inputs = np.split(np.eye(n + len(self.inputs)), np.cumsum(sizes))
        (push,), noise, beside = np.split(inputs, [1, 1 + len(MEASURED)])
        rates = iter(beside)
        turned = deciding[decided.paths.index(("held",))]
        outputs: list[np.ndarray] = []
        for part in sensed:
            motion = self.motion(x, turned, push)
            shown = part.C @ sampled + part.D @ motion
            sampled = part.A @ sampled + part.B @ motion
            if len(shown):
                shown[: len(noise)] += noise
                u, *estimate = decided.C @ deciding + decided.D @ shown
                deciding = decided.A @ deciding + decided.B @ shown
                turned = u + next(rates)
                outputs += [u] if outputs else [*motion[:3], u, *estimate[: len(self._estimates)]]
            x = self.moved(x, turned, push)
        J = np.array([*x, *sampled, *deciding, *outputs])
        A, B, C, D = J[:n, :n], J[:n, n:], J[n:, :n], J[n:, n:]
        kept = needed_states(A, C) & needed_states(A.T, B.T)
        sampling = ["_".join([SENSORS[int(number)], *path]) for number, *path in sensed[0].paths]
        controlling = ["_".join(path).replace("observers_0", "observer") for path in decided.paths]
        states = np.array([*self._plant.names, *sampling, *controlling], dtype=object)
        commands = [f"u_rad_s_{i}" for i in range(1, self.ticks)]
        names = [*OUTPUTS, *(f"estimated_{name}" for name in self._estimates), *commands]
        return A[kept][:, kept], B[kept], C[:, kept], D, states[kept].tolist(), names

    def start(self, *motion: Scalar) -> Sampled:
        """Start the sensors at the plant's outputs."""
        return self._axis.init(self._reading(*motion), self._silence)

    def sense(self, step: int, sampled: Sampled, *motion: Scalar) -> tuple[Sampled, list[Scalar]]:
        """Take the samples that are due.

        Args:
            step: Number of the physics step.
            sampled: The memory of the sensors.
            *motion: The plant's outputs.

        Returns:
            The next memory; and at a control tick y1, the acceleration, y2, the rates of both gyros and the true one:
            what rest shows counts as zero.
        """
        axis = self._axis
        ideal = self._reading(*motion)
        sampled = axis.sample(sampled, step, ideal, self._silence)
        if step % axis.period:
            return sampled, []
        return sampled, [*map(sub, self._shown(step, sampled), self._still), ideal.rate]

    def decide(
        self,
        step: int,
        deciding: Deciding | None,
        y1: Scalar,
        acceleration: Scalar,
        y2: Scalar,
        fog: Scalar,
        gyro: Scalar,
        rate: Scalar,
    ) -> tuple[Deciding, list[Scalar]]:
        """Decide on what `sense` shows, first without a memory; return the next one, the command and the estimate."""
        y = Measurement(y1, y2, acceleration, gyro if self._axis.reads_gyro else None)
        after, tick = self._axis.decide_on(deciding, step, y, fog, rate)
        return after, [tick.u, *tick.estimates[0]]

    def motion(self, x: np.ndarray, turned: Scalar, push: Scalar) -> np.ndarray:
        """Return the plant's outputs at a state, while the gimbals are turned and the rig is pushed."""
        return self._plant.C @ x + self._plant.D @ np.array([turned, push])

    def moved(self, x: np.ndarray, turned: Scalar, push: Scalar) -> np.ndarray:
        """Return the plant's state at the next instant."""
        F, G = self._hold
        return F @ x + G @ np.array([turned, push])

    def _decided(self) -> Slopes:
        """Find the slopes of `decide` at rest."""
        axis, scenario = self._axis, self._design.scenario
        field = f"observer.kind = {scenario.observer.kind!r}"
        try:
            observer = observer_slopes(axis.observer).rest
            field = f"controller.kind = {scenario.controller.kind!r}"
            law = law_slopes(axis.law, len(axis.extra_signals[0])).rest
        except InputError as error:
            takes = f"linear_closed_loop takes state_feedback with {', '.join(TAKES)}, or one of your own"
            raise InputError(f"{field}: {error}; {takes}") from error
        decide = partial(self.decide, axis.settled)
        shown = len(self._still) + 1
        begun, _ = decide(None, *[0.0] * shown)
        rest = begun._replace(observers=(observer,), law=law)
        return slopes_at(rest, decide, shown, together=axis.is_trusted)

    @property
    def _estimates(self) -> Sequence[str]:
        return () if self._true_state else (*STATE_SIGNALS, *self._axis.extra_signals[0])

    def _shown(self, step: int, sampled: Sampled) -> tuple[Scalar, ...]:
        """Return y1, the angular acceleration, y2 and what both gyros show; 0 for one that nobody reads."""
        delivered = self._axis.delivered(sampled, step)
        y = self._axis.measure(delivered)
        return y.y1, y.acceleration, y.y2, delivered.fog, y.gyro if self._axis.reads_gyro else 0.0 * y.y1

    def _reading(
        self, x1: Scalar, x2: Scalar, x3: Scalar, y1: Scalar, acceleration: Scalar, gyro: Scalar
    ) -> IdealReading:
        """Return what perfect sensors show of the plant's outputs."""
        forces: Forces = self._tilt.forces(-self._gravity * sin(y1), self._gravity * cos(y1), acceleration)
        if self._is_array:
            forces = np.array(forces)
        places = self._places(y1, gyro) if self._averaged else ()
        return IdealReading(forces, [x3], gyro, x2, (), places)

    def _places(self, tilt: Scalar, rate: Scalar) -> list[Scalar]:
        """Return `IdealReading.motion` about a pivot at rest, in a world of across, aside and up."""
        shown = []
        upright = np.exp(-1j * tilt)  # of a vector across + i up, turned with the tilt
        for (r, across), angle in zip(self._tilt.places, self._tilt.angles, strict=True):
            velocity = -1j * rate * (across + 1j * r) * upright
            own = np.exp(1j * angle) * upright
            shown += [part for vector in (velocity, own, 1j * own) for part in (vector.real, 0.0, vector.imag)]
        return [*shown, self._gravity]


def _control(design: Design) -> AxisControl:
    """Make the control of an axis whose readings are not rounded.

    A gyro that is not fed back is read at every tick: the common period does not depend on it.
    """
    rig, sensors = design.rig, design.scenario.sensors
    plant = KnownPlant(rig.tilt, GimbalAngle((1.0,), (0.0,)), rig.timestep)
    gyro = replace(sensors.mems_gyro, counts_per_deg_s=0.0)
    axis = design.axis_control(plant, open_loop_observers=[], sensors=replace(sensors, mems_gyro=gyro))
    pair, encoder, fog, *cheap = map(_unrounded, axis.at_work)
    if axis.feedback != "fog":
        fog = Sensor("gyro", (), axis.period)
    return replace(axis, at_work=(pair, encoder, fog, *cheap))


def _unrounded(sensor: Sensor) -> Sensor:
    stages = [replace(stage, resolution=0.0) if isinstance(stage, Digital) else stage for stage in sensor.stages]
    return replace(sensor, stages=tuple(stages))


def _fed_the_true_state(axis: AxisControl, model: ReducedModel) -> AxisControl:
    """Take perfect accelerometers, and for the observer's rate that of a perfect gyro with their times."""
    pair, encoder, fog, *_ = axis.at_work
    perfect = Sensor("accelerations", (), pair.period, pair.latency)
    feedback = axis.feedback
    if feedback == "observer":
        feedback = "fog"
        fog = replace(perfect, signal="gyro")
    unused = FiniteDifference(axis.law.dt, model)
    at_work = perfect, encoder, fog
    return replace(axis, observers=(unused,), at_work=at_work, memories=(), feedback=feedback, angle_source="measured")


def _true_tilt(design: Design) -> PairTilt:
    """Return where the accelerometers are, whatever the controller takes for their places."""
    settings, tilt = design.scenario.plant, design.rig.tilt
    inner = tilt.r_inner + 1e-3 * settings.accelerometer_inner_misplaced_mm
    outer = tilt.r_outer + 1e-3 * settings.accelerometer_outer_misplaced_mm
    return replace(tilt, r_inner=inner, r_outer=outer)


def _silence(width: int, worlds: int | None) -> Callable[[int], Any]:
    """Return a table of noise that is zero."""
    zeros = [0.0] * width if worlds is None else np.zeros((width, worlds))
    return lambda sample: zeros

"""The closed loop with its observer in it as one linear system, sampled at the control period."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cmg_mj.core.sensor import steps_until, whole_steps
from cmg_mj.core.types import extra_signals
from cmg_mj.errors import InputError, nearest, shortened
from cmg_mj.observers.zero_order_hold import hold_matrices
from cmg_mj.scenario.design import Design
from cmg_mj.scenario.linear_rig import LinearRig
from cmg_mj.scenario.rest_slopes import Slopes, law_slopes, needed_states, observer_slopes
from cmg_mj.sensors.sampled import Sensors
from cmg_mj.stages.low_pass import INSIDE_HZ
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
"""Inputs of the system: a torque on the rig, noise of the four measurements, a gimbal rate that nobody commanded."""
OUTPUTS = ("x1_rad", "x2_rad_s", "x3_rad", "u_rad_s")
"""Outputs before those of the observer: true tilt, tilt rate and gimbal angle, and the command."""
MODELS = ("rig", "reduced")
"""Plants of the system: the rig linearised as it is simulated, or the reduced model."""
WITH_A_SLOPE = (
    *("adaptive", "finite_difference", "free_pivot", "gyro_free", "high_gain", "kalman", "linear"),
    *("linear_high_gain", "ltv", "luenberger"),
)
"""Observers of the package that have a slope at rest."""


class _Channel(NamedTuple):
    """A measurement on its way to the controller, in physics steps.

    Attributes:
        name: The sensor.
        delay: Age of the newest reading at a tick.
        raw: Period of the samples that the part's low-pass takes; 0 without one.
        older: Steps by which these samples precede those of the pair's inner part.
    """

    name: str
    delay: int
    raw: int = 0
    older: int = 0

    def registers(self, period: int) -> int:
        """Count the numbers that the controller's side of the loop has to keep."""
        late, rest = divmod(self.delay, period)
        return late + (rest > 0)

    def latched_at(self, period: int) -> int:
        """Return the step after a tick at which the next reading to be delivered is taken."""
        return -self.delay % period

    def is_filtered_at(self, step: int) -> bool:
        """Return whether the low-pass takes a sample at a step after a tick."""
        return bool(self.raw) and (step + self.older) % self.raw == 0


def linear_closed_loop(design: Design, rig: LinearRig) -> control.StateSpace:
    """Make the linear system of a scenario's closed loop: see `Experiment.linear_closed_loop`.

    Args:
        design: The law and the observers.
        rig: The plant.

    Returns:
        The system.

    Raises:
        InputError: Something in the loop is not linear, or not covered.
    """
    import control

    _require_covered(design)
    kind, law_kind = design.scenario.observer.kind, design.scenario.controller.kind
    observer = design.observer()
    try:
        estimating = observer_slopes(observer)
    except InputError as error:
        raise InputError(
            f"observer.kind = {kind!r}: {error}; linear_closed_loop takes {', '.join(WITH_A_SLOPE)}, or one of your own"
        ) from error
    try:
        deciding = law_slopes(design.fresh_law(), observer)
    except InputError as error:
        raise InputError(f"controller.kind = {law_kind!r}: {error}; linear_closed_loop takes state_feedback") from error
    loop = _Loop(design, rig, estimating, deciding)
    outputs = [*OUTPUTS, *(f"estimated_{name}" for name in (*OUTPUTS[:3], *extra_signals(observer)))]
    A, B, C, D = loop.matrices(len(outputs))
    kept = needed_states(A, C)
    names = [name for name, is_kept in zip(loop.states, kept, strict=True) if is_kept]
    return control.StateSpace(
        *(A[kept][:, kept], B[kept], C[:, kept], D, design.law.dt),
        inputs=list(INPUTS),
        outputs=outputs,
        states=names,
        name="closed_loop",
        remove_useless_states=False,
    )


def require_rigid(design: Design) -> None:
    """Refuse a plant that the reduced model does not describe.

    Raises:
        InputError: The frame bends or the pivot slides.
    """
    plant, cure = design.scenario.plant, 'linear_closed_loop(plant="rig")'
    if plant.bends:
        raise InputError(
            f"plant.bend_frequency_hz = {plant.bend_frequency_hz:g}: the reduced model is rigid; take {cure}, or set "
            "plant.bend_frequency_hz=0"
        )
    if design.rig.reduced.pivot_arm:
        raise InputError(f"plant.model = {plant.model!r}: its pivot slides; take {cure}")


def require_model(plant: str) -> None:
    """Refuse a plant that is none of `MODELS`.

    Raises:
        InputError: It is none.
    """
    if plant not in MODELS:
        raise InputError(f"linear_closed_loop: plant = {shortened(repr(plant))}: {nearest(str(plant), MODELS)}")


def _require_covered(design: Design) -> None:
    """Refuse what a linear system of one period does not cover.

    Raises:
        InputError: There is such a thing.
    """
    plant, dt = design.scenario.plant, design.law.dt
    if plant.gimbal_backlash_arcmin:
        raise InputError(
            f"plant.gimbal_backlash_arcmin = {plant.gimbal_backlash_arcmin:g}: backlash is not linear; set "
            "plant.gimbal_backlash_arcmin=0"
        )
    for name, sensor in _sensors_used(design).items():
        ratio = sensor.rate_hz * dt
        if abs(ratio - round(ratio)) > 1e-9 or round(ratio) < 1:
            raise InputError(
                f"sensors.{name}.rate_hz = {sensor.rate_hz:g}: linear_closed_loop takes the control rate, "
                f"{1.0 / dt:g} Hz, or a whole multiple of it"
            )


def _sensors_used(design: Design) -> dict:
    """Return the sensors in the loop, by their section."""
    sensors: Sensors = design.scenario.sensors
    used = {"accelerometer": sensors.accelerometer, "encoder": sensors.encoder}
    return used | ({"fog": sensors.fog} if design.scenario.controller.feedback == "fog" else {})


class _Loop:
    """The loop over one control period. Each signal is a row: its weights on all states, then on all inputs.

    Args:
        design: The law and the observers.
        rig: The plant.
        estimating: Slopes of the observer.
        deciding: Slopes of the law.

    Attributes:
        states: Name of each state.
    """

    def __init__(self, design: Design, rig: LinearRig, estimating: Slopes, deciding: Slopes) -> None:
        self._design, self._rig, self._estimating, self._deciding = design, rig, estimating, deciding
        law, self._timestep = design.law, design.rig.timestep
        self._period = whole_steps(law.dt, self._timestep, "controller.rate_hz", f"{1.0 / law.dt:g} Hz")
        self._channels = _channels(design)
        filtered = [channel.name for channel in self._channels if channel.raw]
        notch_hz = design.scenario.controller.notch_hz
        self._notch = Notch(notch_hz, law.dt, math.inf) if notch_hz else None
        self.states = [
            *rig.names,
            *(f"{name}_filter_{i}" for name in filtered for i in (1, 2)),
            *(f"{c.name}_{i}" for c in self._channels for i in range(1, c.registers(self._period) + 1)),
            *_prefixed("observer", estimating),
            *_prefixed("law", deciding),
            *(["notch_1", "notch_2"] if self._notch else []),
            "u_before",
        ]
        self._rows = dict(zip((*self.states, *INPUTS), np.eye(len(self.states) + len(INPUTS)), strict=True))
        self._y1_slopes = _measured_slopes(design)
        self._next: dict[str, np.ndarray] = {}

    def matrices(self, outputs: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Compute A, B, C, D over one period.

        Args:
            outputs: How many outputs there are.
        """
        rows, rig = self._rows, self._rig
        x, push = np.array([rows[name] for name in rig.names]), rows["push_n_m"]
        channels, turned, shown = self._channels, rows["u_before"], []
        instants = {0, *(c.latched_at(self._period) for c in channels)}
        instants |= {step for c in channels for step in range(self._period) if c.is_filtered_at(step)}
        latched: dict[str, np.ndarray] = {}
        for step, after in zip(sorted(instants), [*sorted(instants)[1:], self._period], strict=True):
            motion = rig.C @ x + rig.D @ np.array([turned, push])
            ideal = self._ideal(motion)
            for channel in channels:
                value = ideal[channel.name]
                if channel.is_filtered_at(step):
                    value = self._filter(channel.name, value)
                if step == channel.latched_at(self._period):
                    latched[channel.name] = value
            if step == 0:
                readings = {c.name: self._read(c, latched) for c in channels}
                u, estimate = self._decide(motion, readings)
                shown = [*motion[:3], u, *estimate]
                turned = u + rows["gimbal_rate_noise_rad_s"]
            F, G, _ = hold_matrices(rig.A, rig.B, (after - step) * self._timestep)
            x = F @ x + G @ np.array([turned, push])
        self._next |= dict(zip(rig.names, x, strict=True))
        for channel in channels:
            self._shift(channel, latched[channel.name])
        n = len(self.states)
        ahead, shown = np.array([self._next[name] for name in self.states]), np.array(shown)
        assert len(shown) == outputs
        return ahead[:, :n], ahead[:, n:], shown[:, :n], shown[:, n:]

    def _ideal(self, motion: np.ndarray) -> dict[str, np.ndarray]:
        """Return what perfect sensors show of the rig's outputs, to first order: tangential forces, y2, the gyro."""
        known, settings = self._design.rig, self._design.scenario.plant
        _, _, x3, y1, acceleration, gyro = motion
        radii = {
            "inner": known.tilt.r_inner + 1e-3 * settings.accelerometer_inner_misplaced_mm,
            "outer": known.tilt.r_outer + 1e-3 * settings.accelerometer_outer_misplaced_mm,
        }
        forces = {name: radius * acceleration - known.gravity * y1 for name, radius in radii.items()}
        return forces | {"encoder": x3, "fog": gyro}

    def _filter(self, name: str, value: np.ndarray) -> np.ndarray:
        """Advance a part's low-pass by a sample."""
        from scipy.signal import butter

        bandwidth = self._design.scenario.sensors.accelerometer.bandwidth_hz
        (b0, b1, b2), (_, a1, a2) = np.array(butter(2, bandwidth, fs=INSIDE_HZ))
        one, two = (f"{name}_filter_{i}" for i in (1, 2))
        first, second = (self._next.get(state, self._rows[state]) for state in (one, two))
        passed = b0 * value + first
        self._next |= {one: b1 * value - a1 * passed + second, two: b2 * value - a2 * passed}
        return passed

    def _read(self, channel: _Channel, latched: dict[str, np.ndarray]) -> np.ndarray:
        """Return the reading that has been delivered by the tick."""
        registers = channel.registers(self._period)
        return self._rows[f"{channel.name}_{registers}"] if registers else latched[channel.name]

    def _shift(self, channel: _Channel, latched: np.ndarray) -> None:
        """Let the readings on their way move up by a period."""
        for i in range(channel.registers(self._period), 0, -1):
            self._next[f"{channel.name}_{i}"] = self._rows[f"{channel.name}_{i - 1}"] if i > 1 else latched

    def _decide(self, motion: np.ndarray, readings: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Return the command of the tick, and the estimate, as `Controller.decide` makes them."""
        rows, settings = self._rows, self._design.scenario.controller
        forces = np.array([readings["inner"], readings["outer"]])
        y1, acceleration = self._y1_slopes @ forces
        y1, acceleration = y1 + rows["y1_noise_rad"], acceleration + rows["acceleration_noise_rad_s2"]
        y2, before = readings["encoder"] + rows["y2_noise_rad"], rows["u_before"]
        measured = [y1, y2, acceleration, before]
        estimate = self._advance("observer", self._estimating, measured)
        x1, x2, x3 = (y1, estimate[1], y2) if settings.angle_source == "measured" else estimate[:3]
        if settings.feedback != "observer":
            x2 = motion[1] if settings.feedback == "truth" else readings["fog"] + rows["fog_noise_rad_s"]
        (u,) = self._advance("law", self._deciding, [*measured, x1, x2, x3, *estimate[3:]])
        if self._notch is not None:
            (b0, b1, b2), (_, a1, a2) = self._notch.numerator, self._notch.denominator
            passed = b0 * u + rows["notch_1"]
            self._next |= {"notch_1": b1 * u - a1 * passed + rows["notch_2"], "notch_2": b2 * u - a2 * passed}
            u = passed
        self._next["u_before"] = u
        return u, estimate

    def _advance(self, owner: str, slopes: Slopes, inputs: Sequence[np.ndarray]) -> np.ndarray:
        """Advance the observer or the law by a sample; return its outputs."""
        names, width = _prefixed(owner, slopes), len(self._rows["u_before"])
        state = np.array([self._rows[name] for name in names]).reshape(-1, width)
        self._next |= dict(zip(names, slopes.A @ state + slopes.B @ np.array(inputs), strict=True))
        return slopes.C @ state + slopes.D @ np.array(inputs)


def _prefixed(owner: str, slopes: Slopes) -> list[str]:
    """Name the states of the observer or the law; one that is a single number has the owner's name."""
    return [f"{owner}_{name}" if name else owner for name in slopes.names]


def _channels(design: Design) -> list[_Channel]:
    """Return the measurements in the loop, with the age of each at a tick."""
    timestep, sensors, channels = design.rig.timestep, design.scenario.sensors, []
    for name, sensor in _sensors_used(design).items():
        period = whole_steps(1.0 / sensor.rate_hz, timestep, f"sensors.{name}.rate_hz", f"{sensor.rate_hz:g} Hz")
        delay = -(-steps_until(sensor.latency_s, timestep) // period) * period
        if name != "accelerometer":
            channels.append(_Channel(name, delay))
            continue
        pair = sensors.accelerometer
        inside = f"{pair.bandwidth_hz:g} Hz, sampled at {INSIDE_HZ:g} Hz inside the part"
        where = "sensors.accelerometer"
        raw = whole_steps(1.0 / INSIDE_HZ, timestep, f"{where}.bandwidth_hz", inside) if pair.bandwidth_hz else 0
        skew = whole_steps(pair.skew_s, timestep, f"{where}.skew_s", f"{pair.skew_s:g} s")
        channels += [_Channel("inner", delay, raw), _Channel("outer", delay + skew, raw, skew)]
    return channels


def _measured_slopes(design: Design) -> np.ndarray:
    """Return y1 and the angular acceleration by the tangential forces of inner and outer part, (2, 2).

    Differences of the code that runs, constant errors of the parts among it.
    """
    tilt, gravity = design.rig.tilt, design.rig.gravity
    erring = design.scenario.sensors.accelerometer.constant_errors()

    def measured(inner: float, outer: float) -> np.ndarray:
        forces = erring((inner, gravity, outer, gravity))
        return np.array([tilt(*forces), tilt.acceleration(forces[0], forces[2])])

    h = 1e-5 * gravity
    inner, outer = measured(h, 0.0) - measured(-h, 0.0), measured(0.0, h) - measured(0.0, -h)
    return np.array([inner, outer]).T / (2.0 * h)

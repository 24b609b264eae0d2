"""Where accelerometers sit and what is wrong with them, with the gyro's errors and all delays, from one log."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.core.types import STANDARD_GRAVITY
from cmg_mj.features.identify.fit import BLOCKS, Parameter, Solution, solve
from cmg_mj.features.identify.signals import MAX_DELAY_S, PER_PERIOD, SETTLE, Signals
from cmg_mj.features.replay.log import UNITS

SCALE, OFFSET = 0.03, 0.6
"""Standard deviations of what is known before: datasheets' errors of scale, and offsets of accelerometers [m/s^2]."""
FAR = 5.0
"""A scale or an offset that is so many of these standard deviations off is a mistake."""
WIDE = {"m": 0.5, "rad": math.pi, "s": 0.05, "rad/s": 0.3, "rad/s^2": 1e-3}
"""Standard deviations of the rest, so wide that they only keep finite what a log cannot tell."""
PARTS = ("across", "up", "angle", "scale 1", "scale 2", "offset 1", "offset 2", "delay")
OF_PARTS = ("m", "m", "rad", "", "", "m/s^2", "m/s^2", "s")
"""Parameters of an accelerometer, and their units."""
ERRORS = {"tilt scale": 1.0, "gyro scale": 1.0, "gyro offset": 0.0, "gyro drift": 0.0, "gyro delay": 0.0}
"""Parameters of angle sensor and gyro -> the value without an error."""
NEAR = (0.7, 1.4)
"""Scales that are no mistake of a unit."""
ALIKE = 0.5
"""Least correlation of a gyro and the tilt's derivative, and least share of an accelerometer's readings that a fit
explains beyond their mean."""
RIGID = 2.0
"""Most rest of an accelerometer on a rigid body, by that of two axes that share neither place nor angle."""


def gravity(tilt: np.ndarray) -> np.ndarray:
    """Return gravity's specific force in the body's axes, i g exp(i y), (n,) [m/s^2]."""
    return 1j * STANDARD_GRAVITY * np.exp(1j * tilt)


class State(NamedTuple):
    """The body's motion behind the low-pass."""

    gravity: np.ndarray
    """Gravity's specific force, (n_times,) [m/s^2]."""
    K: np.ndarray
    """-i y'' - y'^2, (n_times,) [rad/s^2]."""
    rate: np.ndarray
    """y', (n_times,) [rad/s]."""


class Motion:
    """The body's motion, by an angle sensor, a gyro or both.

    The time is the angle sensor's, or without one the gyro's. A gyro shows scale * rate + offset, later by its delay,
    an angle sensor scale * tilt. Without an angle sensor the tilt is the integral of the rate, whose offset may drift,
    and has a mean of 0.
    """

    def __init__(self, signals: Signals) -> None:
        """Low-pass both.

        Args:
            signals: The log.
        """
        from scipy.integrate import cumulative_trapezoid

        values = signals.channels.values
        self.signals, self._has_angle, self._has_rate = signals, "tilt" in values, "rate" in values
        if self._has_angle:
            self._angle = values["tilt"]
        else:
            self._angle = cumulative_trapezoid(values["rate"], dx=signals.channels.dt, initial=0.0)
        angle = signals.curve(self._angle)
        self._raw = values["rate"] if self._has_rate else angle(signals.grid, 1)
        self._square = signals.curve(self._raw**2)
        self._shown = signals.curve(self._raw) if self._has_rate else lambda t, order=0: angle(t, order + 1)
        self.slope = angle(signals.time, 1) if self._has_angle and self._has_rate else None
        """The derivative of what the angle sensor shows beside a gyro, (n_times,) [rad/s]."""

    @property
    def parameters(self) -> list[Parameter]:
        """The errors of both."""
        found = [] if not self._has_angle else [Parameter("tilt scale", "", 1.0, SCALE, 1.0)]
        if not self._has_rate:
            return found
        slope = np.polyfit(self.signals.grid, self._angle, 1)[0] if self.slope is None else self.slope
        offset = float(np.mean(self._shown(self.signals.time) - slope)) if self._has_angle else float(slope)
        found.append(Parameter("gyro scale", "", 1.0, SCALE, 1.0))
        found.append(Parameter("gyro offset", "rad/s", offset, WIDE["rad/s"]))
        if not self._has_angle:
            return [*found, Parameter("gyro drift", "rad/s^2", 0.0, WIDE["rad/s^2"])]
        return [*found, Parameter("gyro delay", "s", 0.0, WIDE["s"])]

    def at(self, errors: Mapping[str, float]) -> State:
        """Return the motion at the signals' times by the errors that differ from `ERRORS`."""
        of_tilt, scale, offset, drift, delay = (ERRORS | dict(errors)).values()
        if not self._has_rate:
            scale = of_tilt
        t = self.signals.time + np.clip(delay, -MAX_DELAY_S, MAX_DELAY_S)
        off = offset + drift * t
        shown = self._shown(t)
        square = (self._square(t) - 2.0 * off * shown + off**2) / scale**2
        force = self._gravity(of_tilt) if self._has_angle else self._gravity(scale, offset, drift)
        return State(force, -1j * (self._shown(t, 1) - drift) / scale - square, (shown - off) / scale)

    def signs(self, errors: Mapping[str, float], width: float) -> np.ndarray:
        """Return tanh(rate / width), low-passed as the whole and not by parts, (n_times,)."""
        of_tilt, scale, offset, drift, delay = (ERRORS | dict(errors)).values()
        t = self.signals.grid
        shown = (self._raw - offset - drift * t) / (scale if self._has_rate else of_tilt)
        return self.signals.curve(np.tanh(shown / width))(self.signals.time + delay)

    @functools.lru_cache(maxsize=2)  # noqa: B019  (lives as long as a fit)
    def _gravity(self, scale: float, offset: float = 0.0, drift: float = 0.0) -> np.ndarray:
        t = self.signals.grid
        tilt = (self._angle - offset * t - drift * t**2 / 2.0) / scale
        return self.signals.curve(gravity(tilt if self._has_angle else tilt - tilt.mean()))(self.signals.time)


class Readings:
    """Readings of an accelerometer, and the line f = A i g exp(i y) + B K + b through it as a start.

    The second axis may point to either side of the first: the side that fits better is taken.
    """

    def __init__(self, signals: Signals, columns: tuple[str, str], unit: str, motion: State) -> None:
        """Find the start.

        Args:
            signals: The log.
            columns: Headings of both axes.
            unit: Their unit, for a message.
            motion: The motion without the sensors' errors.

        Raises:
            InputError: The readings do not have gravity's size.
        """
        shown = np.stack([signals.channels.values[name] for name in columns], axis=1)
        self.columns, self.unit = columns, unit
        self._curve, self._time = signals.curve(shown), signals.time
        _check_gravity(columns, np.median(np.hypot(*shown.T)), unit)
        x, z = self._curve(signals.time).T
        n = len(x)
        # An offset is small: without this, it and gravity are one where the tilt hardly changes.
        rows = np.vstack([np.stack([motion.gravity, motion.K, np.ones(n)], axis=1), [0.0, 0.0, 0.1 * math.sqrt(n)]])
        lines = []
        for side in (1.0, -1.0):
            seen = np.append(x + side * 1j * z, 0.0)
            line = np.linalg.lstsq(rows, seen, rcond=None)[0]
            lines.append((float(np.mean(np.abs(rows @ line - seen) ** 2)), side, line))
        _, side, (A, B, b) = min(lines, key=lambda one: one[0])
        place, self._angle, self._side = B / A, -float(np.angle(A)), side
        self._start = (place.real, place.imag, self._angle, 1.0, side, b.real, side * b.imag, 0.0)

    def parameters(self, name: str) -> list[Parameter]:
        """Its parameters."""
        before = [SCALE if unit == "" else OFFSET if unit == "m/s^2" else WIDE[unit] for unit in OF_PARTS]
        known = (0.0, 0.0, self._angle, 1.0, self._side, 0.0, 0.0, 0.0)
        rows = zip(PARTS, OF_PARTS, self._start, before, known, strict=True)
        return [Parameter(f"{name} {part}", unit, start, size, mean) for part, unit, start, size, mean in rows]

    def free_rest(self, motion: State) -> np.ndarray:
        """Return what two axes leave, each with a place and an angle of its own, (n_times, 2) [m/s^2].

        Raises:
            InputError: The readings do not follow the motion.
        """
        name, shown = f"--accelerometer {','.join(self.columns)}", self._curve(self._time)
        each = np.stack([*_parts(motion.gravity), *_parts(motion.K), np.ones(len(shown))], axis=1)
        free = shown - each @ np.linalg.lstsq(each, shown, rcond=None)[0]
        left = free.var(axis=0)
        apart = left >= ALIKE * shown.var(axis=0)  # an axis that hardly moves shows its noise, which the other has too
        if apart.all() or (left[apart].size and left[apart].max() > RIGID**2 * left.min()):
            raise InputError(f"{name}: does not follow the tilt: are these its columns?")
        return free

    def shown(self, delay: float) -> np.ndarray:
        """Return its readings, low-passed and advanced by its delay, (n_times, 2) [m/s^2]."""
        return self._curve(self._time + np.clip(delay, -MAX_DELAY_S, MAX_DELAY_S))

    def rest(self, values: Sequence[float], motion: State) -> np.ndarray:
        """Return what its parameters leave of its readings, (n_times, 2) [m/s^2]."""
        across, up, angle, s1, s2, o1, o2, delay = values
        f = (motion.gravity + motion.K * complex(across, up)) * np.exp(-1j * angle)
        return self.shown(delay) - np.stack([s1 * np.real(f) + o1, s2 * np.imag(f) + o2], axis=1)


def _size(rest: np.ndarray) -> np.ndarray:
    """Return the usual size of residuals, whatever the few large ones, (n_times, n) -> (n,)."""
    return np.median(np.abs(rest), axis=0)


def _parts(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.real(values), np.imag(values)


def _check_gravity(columns: tuple[str, str], size: float, unit: str) -> None:
    ratio, name = size / STANDARD_GRAVITY, f"--accelerometer {','.join(columns)}"
    if not NEAR[0] <= ratio <= NEAR[1]:
        factors = UNITS["acceleration"]
        now = factors.get(unit, 1.0)
        right = [other for other, factor in factors.items() if NEAR[0] <= ratio * factor / now <= NEAR[1]]
        cure = f"give the right unit, as in {name},{right[0]}" if right else "are these its columns?"
        raise InputError(f"{name}: shows {ratio:.3g} times gravity's 9.81 m/s^2, taken as {unit}: {cure}")


def _check_rate(motion: Motion, rate: np.ndarray) -> None:
    """Compare a gyro with the derivative of the tilt."""
    if motion.slope is None:
        return
    slope, rate = motion.slope - motion.slope.mean(), rate - rate.mean()
    power = math.sqrt((slope @ slope) * (rate @ rate))
    correlation = float(slope @ rate) / power if power else 0.0
    if abs(correlation) < ALIKE:
        raise InputError(
            f"--columns rate, tilt: the rate's correlation with the tilt's derivative is {correlation:.2f}: are these "
            "the columns?"
        )
    if correlation < 0.0:
        raise InputError("--columns rate: turns against the tilt: --scale rate=-1, or tilt=-1")
    ratio = math.sqrt((rate @ rate) / (slope @ slope)) * (1.0 if correlation > 0.9 else correlation)
    if not NEAR[0] <= ratio <= NEAR[1]:
        raise InputError(
            f"--columns rate: is {ratio:.3g} times the tilt's derivative: give the right unit, --units rate=... or "
            "tilt=... (57.3 deg are one rad)"
        )


@dataclass(frozen=True)
class Geometry:
    """Places and errors of a rig's sensors, by one log.

    Attributes:
        signals: The log.
        motion: The body's motion.
        readings: What each accelerometer shows.
        solution: The parameters: those of `motion`, then eight of each accelerometer.
    """

    signals: Signals
    motion: Motion
    readings: Sequence[Readings]
    solution: Solution

    @property
    def errors(self) -> dict[str, float]:
        """Errors of angle sensor and gyro by their names."""
        return {one.name: one.value for one in self.solution.numbers if one.name in ERRORS}

    @property
    def is_rate_judged(self) -> bool:
        """Whether the first residual is that of the gyro beside the angle sensor."""
        return self.motion.slope is not None

    def channels_of(self, accelerometer: int) -> slice:
        """Return the residuals of an accelerometer."""
        first = int(self.is_rate_judged) + 2 * accelerometer
        return slice(first, first + 2)

    def of(self, accelerometer: int) -> list[float]:
        """Return the parameters `PARTS` of an accelerometer."""
        first = len(self.motion.parameters) + len(PARTS) * accelerometer
        return self.solution.values[first : first + len(PARTS)].tolist()


def fit_geometry(signals: Signals) -> Geometry:
    """Fit places, angles, scales, offsets and delays.

    Args:
        signals: The log.

    Raises:
        InputError: A column, sign or unit is wrong.
    """
    if len(signals.time) < 3 * BLOCKS:
        name, hz = signals.channels.name, signals.below_hz
        least = 2.0 * (SETTLE / hz + MAX_DELAY_S) + 3 * BLOCKS / (PER_PERIOD * hz)
        raise InputError(
            f"{name}: lasts {signals.grid[-1]:.3g} s; below {hz:.3g} Hz, where noise does not hide the motion, it "
            f"takes {least:.3g} s: give a longer log, or --below-hz"
        )
    motion = Motion(signals)
    own = motion.parameters
    start = motion.at({p.name: p.start for p in own})
    _check_rate(motion, start.rate)
    readings = [Readings(signals, one.columns, one.unit, start) for one in signals.channels.options.rig.accelerometer]
    parameters = [*own]
    for number, one in enumerate(readings, 1):
        parameters += one.parameters(f"accelerometer {number}")
    names, n = [p.name for p in own], len(own)

    def residuals(values: np.ndarray) -> np.ndarray:
        errors = dict(zip(names, values[:n].tolist(), strict=True))
        state = motion.at(errors)
        rests = [
            one.rest(part, state)
            for one, part in zip(readings, values[n:].reshape(-1, len(PARTS)).tolist(), strict=True)
        ]
        if motion.slope is not None:
            # Not rate - slope / scale: a large scale would then hide the slope's noise.
            rests.insert(0, (motion.slope - errors["tilt scale"] * state.rate)[:, None])
        return np.hstack(rests)

    found = Geometry(signals, motion, readings, solve(parameters, residuals, share=2.0 / PER_PERIOD))
    state = motion.at(found.errors)
    free = [one.free_rest(state) for one in readings]
    for number, parameter in zip(found.solution.numbers, parameters, strict=True):
        off = number.value - parameter.known
        if parameter.before in (SCALE, OFFSET) and abs(off) > FAR * parameter.before:
            raise InputError(
                f"{number.name} = {' '.join([f'{number.value:.3g}', number.unit]).strip()}: no sensor is so far off "
                f"{parameter.known:g}: is a unit, a column or the angle sensor's --scale wrong?"
            )
    for i, one in enumerate(readings):
        ratio = float(np.max(_size(found.solution.residuals[:, found.channels_of(i)]) / _size(free[i])))
        if ratio > RIGID:
            raise InputError(
                f"--accelerometer {','.join(one.columns)}: its axes fit {ratio:.2g} times worse together than each by "
                "itself: are both columns of one accelerometer, with one scale?"
            )
    return found

"""The pendulum of a rig by one log: inertia, gravity, friction, and what its motor or its gimbals do."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.core.types import STANDARD_GRAVITY
from cmg_mj.features.identify.fit import Parameter, Solution, solve, within
from cmg_mj.features.identify.geometry import WIDE, Geometry, Motion
from cmg_mj.features.identify.signals import MAX_DELAY_S, PER_PERIOD, Signals

STICKS, SPINS = 0.02, 1.0
"""Dry friction turns round over so many rad/s of the body and of a wheel: it is C tanh(rate / STICKS)."""
MANY, TILTED = 1e3, 0.3
"""Standard deviations of what is known before: so many first estimates, and the equilibrium's tilt [rad]."""
GAINS = ("inertia J", "torque constant/J", "momentum/J")
"""Numbers that a torque which does nothing does not tell."""
UNITS = {"damping": ("N m s", "1/s"), "dry friction": ("N m", "1/s^2"), "J2": ("kg m^2", "")}
"""End of a number's name -> its unit, and that of its ratio to J."""


def has_pendulum(signals: Signals) -> bool:
    """Return whether a log shows what moves its body."""
    return bool(signals.channels.values.keys() & {"torque", "gimbal", "gimbal1"})


class Pendulum:
    """The equation of a log's motion.

        d/dt (J rate + J2 sin(x3)^2 rate - h sin(x3)) = G sin(tilt - e) - D rate - C sign(rate)
                                                        + k torque(t - delay) + D_w wheel + C_w sign(wheel)

    It is (2) of aranovskiy2020 with friction, G = m g l, and with a motor's torque or current instead of gimbals. The
    motor may drive a wheel, in whose bearing some of the torque is lost. If neither the flywheels' momentum h is known
    nor a torque in N m, only the ratios to J are: J is then 1.

    Attributes:
        acceleration: That of the log, (n_times,) [rad/s^2].
        has_motor: Whether a motor drives it, and not gimbals.
        is_known: Whether the numbers are no ratios.
    """

    def __init__(self, motion: Motion, errors: Mapping[str, float], momentum: float | None) -> None:
        """Low-pass what acts.

        Args:
            motion: The motion of a log.
            errors: What is wrong with its angle sensor and gyro, as in `ERRORS`.
            momentum: Spin momentum of the flywheels, if it is known [N m s].

        Raises:
            InputError: The momentum is that of no gimbals.
        """
        signals, state = motion.signals, motion.at(errors)
        values, self._time = signals.channels.values, signals.time
        self.acceleration, self._force = -np.imag(state.K), state.gravity / STANDARD_GRAVITY
        self._terms = {"damping": -state.rate, "dry friction": -motion.signs(errors, STICKS)}
        self.has_motor, self._gain = "torque" in values, 1.0 if momentum is None else momentum
        if self.has_motor and momentum is not None:
            raise InputError(f"--momentum {momentum:g}: goes with --columns gimbal=..., not with torque")
        if self.has_motor:
            self._torque = signals.curve(values["torque"])
            self.is_known = signals.channels.options.units["torque"].endswith("n_m")
        else:
            gimbal = values["gimbal"] if "gimbal" in values else (values["gimbal1"] - values["gimbal2"]) / 2.0
            sine = signals.curve(np.sin(gimbal))
            self._turned, shown = sine(self._time, 1), sine(self._time)
            self._terms["J2"] = -(shown**2) * self.acceleration - 2.0 * shown * self._turned * state.rate
            self.is_known = momentum is not None
        if "wheel" in values:
            self._terms["wheel's damping"] = signals.curve(values["wheel"])(self._time)
            self._terms["wheel's dry friction"] = signals.curve(np.tanh(values["wheel"] / SPINS))(self._time)

    def _driven(self, delay: float) -> np.ndarray:
        return self._torque(self._time - np.clip(delay, -MAX_DELAY_S, MAX_DELAY_S)) if self.has_motor else self._turned

    def foretell(self, values: np.ndarray) -> np.ndarray:
        """Return the angular acceleration by the numbers of `parameters`, (n_times,) [rad/s^2]."""
        G, e, last, *others = values
        delay = others.pop(0) if self.has_motor else 0.0
        inertia, gain = (last, self._gain) if self.is_known else (1.0, last)
        torque = gain * self._driven(delay) - G * np.real(self._force * np.exp(-1j * e))
        for other, term in zip(others, self._terms.values(), strict=True):
            torque = torque + other * term
        return torque / inertia

    @property
    def parameters(self) -> list[Parameter]:
        """The numbers, with linear least squares as a start.

        Raises:
            InputError: What drives the body does not change.
        """
        rows = [-np.real(self._force), -np.imag(self._force), self._driven(0.0), *self._terms.values()]
        G, aside, gain, *others = np.linalg.lstsq(np.column_stack(rows), self.acceleration, rcond=None)[0].tolist()
        role = "torque" if self.has_motor else "gimbal"
        if not self._driven(0.0).any():
            raise InputError(f"--columns {role}: does not change: is this its column?")
        inertia, per = (self._gain / gain, "") if self.is_known else (1.0, "/J")
        least = 1e-3 * abs(inertia * gain)

        def unknown(name: str, unit: str, start: float) -> Parameter:
            return Parameter(name, unit, start, MANY * max(abs(start), least))

        last = ("torque constant/J", "1/(A s^2)", gain) if self.has_motor else ("momentum/J", "1/s", gain)
        found = [
            unknown(f"m g l{per}", "1/s^2" if per else "N m", inertia * math.copysign(math.hypot(G, aside), G)),
            Parameter("equilibrium", "rad", math.atan(aside / G), TILTED),
            unknown("inertia J", "kg m^2", inertia) if self.is_known else unknown(*last),
        ]
        if self.has_motor:
            found.append(Parameter("torque delay", "s", 0.0, WIDE["s"]))
        for name, other in zip(self._terms, others, strict=True):
            unit = next(units for end, units in UNITS.items() if name.endswith(end))[bool(per)]
            found.append(unknown(f"{name}{per}", unit, inertia * other))
        return found


def fit_pendulum(geometry: Geometry, momentum: float | None) -> tuple[Pendulum, Solution]:
    """Fit the numbers of a pendulum to a log's angular acceleration.

    The errors of angle sensor and gyro, by which all scales are known, go into the intervals.

    Args:
        geometry: The log, and what is known of the sensors.
        momentum: Spin momentum of the flywheels, if it is known [N m s].

    Raises:
        InputError: The torque does not turn the body, or turns it against its sign.
    """
    names, sensors = list(geometry.errors), geometry.solution

    def fitted(by: int | None = None) -> tuple[Pendulum, Solution]:
        shift = 0.0 if by is None else math.sqrt(sensors.covariance[by, by])
        errors = {name: value + shift * (i == by) for i, (name, value) in enumerate(geometry.errors.items())}
        pendulum = Pendulum(geometry.motion, errors, momentum)
        return pendulum, solve(
            pendulum.parameters,
            lambda values: (pendulum.foretell(values) - pendulum.acceleration)[:, None],
            share=2.0 / PER_PERIOD,
        )

    pendulum, solution = fitted()
    gain = next(number for number in solution.numbers if number.name in GAINS)
    role = "torque" if pendulum.has_motor else "gimbal"
    if gain.error > abs(gain.value):
        raise InputError(
            f"--columns {role}: does not move the body beyond chance ({gain.name} = {gain.value:.3g} "
            f"±{gain.error:.3g}): is this its column?"
        )
    if gain.value < 0.0:
        raise InputError(f"--columns {role}: turns the body against its sign: --scale {role}=-1")
    n = len(names)
    sizes = np.sqrt(np.diag(sensors.covariance)[:n])
    slopes = np.stack([(fitted(i)[1].values - solution.values) / sizes[i] for i in range(n)], axis=1)
    more = within(np.sqrt(np.diag(slopes @ sensors.covariance[:n, :n] @ slopes.T)))
    numbers = [
        number._replace(error=math.hypot(number.error, extra))
        for number, extra in zip(solution.numbers, np.atleast_1d(more).tolist(), strict=True)
    ]
    return pendulum, solution._replace(numbers=numbers)

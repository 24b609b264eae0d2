"""The grid of physics steps on which every rate and time of a scenario lies."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

from cmg_mj.core.errors import InputError
from cmg_mj.core.sensor import whole_steps
from cmg_mj.inputs.types import Held, OnGrid, Start, marked_values
from cmg_mj.scenario.schema import Scenario

MIN_PERIOD_S = 1e-4
"""A scenario whose rates and times leave only a smaller step than this must name the step itself [s]."""
SWING_SHARE = 10.0
"""A swinging torque or pivot has at least so many samples a period."""
MAX_TICKS = 2_000_000
"""Most ticks of a run; a tick takes about 1.5 kB of memory until the recording is written."""
MAX_STEPS = 1_000_000_000
"""Most physics steps of a run; so many take hours."""
_MAX_DENOMINATOR = 10**9  # 1/3 s as a float is the fraction 1/3


class TimeGrid(NamedTuple):
    """The times that whole physics steps of a run must fill.

    Attributes:
        duration_s: The run's duration [s].
        timestep_s: The physics step that the scenario names [s]; None if the plant decides.
        period_s: The longest time that divides all periods and times [s]; the named step if there is one.
    """

    duration_s: float
    timestep_s: float | None
    period_s: float

    def physics_step(self, limit_s: float) -> float:
        """Fit the physics step of a run.

        Args:
            limit_s: The largest step that is accurate enough for the plant [s]: see `step_limit.py`.

        Returns:
            The named step, or the largest within the limit of which a whole number fills the period [s].

        Raises:
            InputError: The run would have too many steps to come to its end.
        """
        step = self.timestep_s or self.period_s / math.ceil(self.period_s / limit_s * (1.0 - 1e-9))
        steps = self.duration_s / step
        if steps > MAX_STEPS:
            raise InputError(
                f"duration_s = {self.duration_s:g}: {steps:.3g} physics steps of {step:g} s; at most "
                f"{MAX_STEPS:g} are taken, {MAX_STEPS * step:g} s"
            )
        return step


class _GridTime(NamedTuple):
    """A period or time of a scenario that whole physics steps must fill.

    Attributes:
        field: The field that gives it.
        text: Its value as the user wrote it.
        seconds: The time [s].
        exact: The time without what a float cannot hold of it [s].
        unit: `Hz` of a rate's period, `s` of a time; none of what a part does inside.
    """

    field: str
    text: str
    seconds: float
    exact: Fraction
    unit: str = ""


def time_grid(scenario: Scenario) -> TimeGrid:
    """Find the grid of a scenario: rates and times that fit each other, and a run that is not too long.

    Args:
        scenario: The scenario.

    Returns:
        The grid.

    Raises:
        InputError: A rate or time is on no grid, the nearest that would be is named; or a torque does not fit the run.
    """
    duration, timestep, control = scenario.duration_s, scenario.plant.timestep_s, scenario.controller.rate_hz
    if duration * control > MAX_TICKS:
        raise InputError(
            f"duration_s = {duration:g}: {duration * control:.3g} control ticks at controller.rate_hz = {control:g}; "
            f"at most {MAX_TICKS} are kept, {MAX_TICKS / control:g} s"
        )
    grid = TimeGrid(duration, timestep, common_period(scenario) if timestep is None else timestep)
    if timestep is not None:
        grid.physics_step(timestep)
        for time in _grid_times(scenario):
            try:
                whole_steps(time.seconds, timestep, time.field, time.text)
            except InputError as error:
                if not time.unit:
                    raise
                ratio = time.seconds / timestep
                steps = sorted({max(1, math.floor(ratio)), max(1, math.ceil(ratio))})
                times = [1.0 / (n * timestep) if time.unit == "Hz" else n * timestep for n in steps]
                raise InputError(f"{error} (nearest: {' or '.join(f'{t:g} {time.unit}' for t in times)})") from error
    for field, frequency, mark in marked_values(scenario, Held):
        if frequency and frequency > control / SWING_SHARE:
            raise InputError(
                f"{field} = {frequency:g}: the {mark.what} is held from sample to sample; at most "
                f"{control / SWING_SHARE:g} Hz at controller.rate_hz = {control:g}"
            )
    for field, start, _ in marked_values(scenario, Start):
        if start >= duration:
            raise InputError(f"{field} = {start:g}: must be less than duration_s = {duration:g}, where the run ends")
    return grid


def common_period(scenario: Scenario) -> float:
    """Return the longest time that divides every period and time of a scenario [s].

    Raises:
        InputError: It is shorter than `MIN_PERIOD_S`; the first field that makes it so is named.
    """
    common = Fraction(0)
    for time in _grid_times(scenario):
        a, b = common, time.exact
        divisor = math.gcd(a.numerator * b.denominator, b.numerator * a.denominator)
        common = Fraction(divisor, a.denominator * b.denominator)
        if common and common < _fraction(MIN_PERIOD_S):
            raise InputError(
                f"{time.field} = {time.text}: does not fit the other rates and times: no physics step of "
                f"{MIN_PERIOD_S:g} s or more divides them all; take rounder numbers, or set plant.timestep_s"
            )
    return float(common)


def _grid_times(scenario: Scenario) -> list[_GridTime]:
    """Return all periods and times of a scenario and of its axes: rates first, then times."""
    times = []
    parts = {"": scenario, **{f"axes.{name}.": part for name, part in scenario.axis_scenarios.items()}}
    for prefix, part in parts.items():
        for field, number, mark in marked_values(part, OnGrid):
            exact, text = _fraction(number), f"{number:g} {mark.unit}"
            seconds, exact = (1.0 / number, 1 / exact) if mark.unit == "Hz" else (number, exact)
            times.append(_GridTime(prefix + field, text, seconds, exact, mark.unit))
        pair = part.sensors.accelerometer
        if pair.bandwidth_hz:
            field, period = f"{prefix}sensors.accelerometer.bandwidth_hz", 1.0 / pair.raw_rate_hz
            times.append(_GridTime(field, pair.inside_text, period, _fraction(period)))
    return sorted(times, key=lambda time: time.unit == "s")


def _fraction(number: float) -> Fraction:
    return Fraction(number).limit_denominator(_MAX_DENOMINATOR)

"""The grid of physics steps on which every rate and time of a scenario lies."""

from __future__ import annotations

import math
from collections.abc import Sequence
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
    times, others = _marked(scenario)
    grid = TimeGrid(duration, timestep, _common_period(times) if timestep is None else timestep)
    if timestep is not None:
        for time in times:
            try:
                whole_steps(time.seconds, timestep, time.field, time.text)
            except InputError as error:
                if not time.unit:
                    raise
                ratio = time.seconds / timestep
                steps = sorted({max(1, math.floor(ratio)), max(1, math.ceil(ratio))})
                near = [1.0 / (n * timestep) if time.unit == "Hz" else n * timestep for n in steps]
                raise InputError(f"{error} (nearest: {' or '.join(f'{t:g} {time.unit}' for t in near)})") from error
    for field, number, mark in others:
        if isinstance(mark, Start) and number >= duration:
            raise InputError(f"{field} = {number:g}: must be less than duration_s = {duration:g}, where the run ends")
        if isinstance(mark, Held) and number and number > control / SWING_SHARE:
            raise InputError(
                f"{field} = {number:g}: the {mark.what} is held from sample to sample; at most "
                f"{control / SWING_SHARE:g} Hz at controller.rate_hz = {control:g}"
            )
    return grid


def common_period(scenario: Scenario) -> float:
    """Return the longest time that divides every period and time of a scenario [s].

    Raises:
        InputError: It is shorter than `MIN_PERIOD_S`; the first field that makes it so is named.
    """
    return _common_period(_marked(scenario)[0])


def _common_period(times: Sequence[_GridTime]) -> float:
    common = Fraction(0)
    for time in times:
        a, b = common, time.exact
        divisor = math.gcd(a.numerator * b.denominator, b.numerator * a.denominator)
        common = Fraction(divisor, a.denominator * b.denominator)
        if common and common < _fraction(MIN_PERIOD_S):
            raise InputError(
                f"{time.field} = {time.text}: does not fit the other rates and times: no physics step of "
                f"{MIN_PERIOD_S:g} s or more divides them all; take rounder numbers, or set plant.timestep_s"
            )
    return float(common)


def _marked(scenario: Scenario) -> tuple[list[_GridTime], list[tuple[str, float, Held | Start]]]:
    """Return all periods and times of a scenario and of its axes, rates first; and what else is marked of itself."""
    times, others = [], []
    parts = {"": scenario, **{f"axes.{name}.": part for name, part in scenario.axis_scenarios.items()}}
    for prefix, part in parts.items():
        for field, number, mark in marked_values(part, (OnGrid, Held, Start)):
            if isinstance(mark, OnGrid):
                exact, text = _fraction(number), f"{number:g} {mark.unit}"
                time = (1.0 / number, 1 / exact) if mark.unit == "Hz" else (number, exact)
                times.append(_GridTime(prefix + field, text, *time, mark.unit))
            elif not prefix:
                others.append((field, number, mark))
        pair = part.sensors.accelerometer
        if pair.bandwidth_hz:
            field, period = f"{prefix}sensors.accelerometer.bandwidth_hz", 1.0 / pair.raw_rate_hz
            times.append(_GridTime(field, pair.inside_text, period, _fraction(period)))
    return sorted(times, key=lambda time: time.unit == "s"), others


def _fraction(number: float) -> Fraction:
    return Fraction(number).limit_denominator(_MAX_DENOMINATOR)

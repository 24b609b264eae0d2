"""The physics step, and every rate and time of a scenario on the grid of its steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from fractions import Fraction

from cmg_mj.errors import InputError
from cmg_mj.scenario.loading import scenario_of_axis
from cmg_mj.scenario.plant_settings import PlantSettings
from cmg_mj.scenario.schema import Scenario
from cmg_mj.sensors.timing import whole_steps

SENSORS = ("accelerometer", "encoder", "fog")
FINEST_S = 1e-4
"""A scenario whose rates and times leave only a smaller step than this must name the step itself [s]."""
SWING_SHARE = 10.0
"""A swinging torque has at least so many samples a period."""
MOST_TICKS = 2_000_000
"""Of a run; one takes about 1.5 kB of memory until the recording is written."""
MOST_STEPS = 1_000_000_000
"""Of a run; so many take hours."""
_LARGEST_DENOMINATOR = 10**9  # 1/3 s as a float is the fraction 1/3


def check_times(scenario: Scenario) -> None:
    """Rates must divide the physics rate, times be multiples of the physics step, and pushes begin within the run.

    Raises:
        InputError: One does not; the nearest that would is named.
    """
    timestep = scenario.plant.timestep_s
    duration, control = scenario.duration_s, scenario.controller.rate_hz
    if duration * control > MOST_TICKS:
        raise InputError(
            f"duration_s = {duration:g}: {duration * control:.3g} control ticks at controller.rate_hz = {control:g}; "
            f"at most {MOST_TICKS} are kept, {MOST_TICKS / control:g} s"
        )
    if timestep is None:
        common_period(scenario)
    else:
        check_steps(scenario, timestep)
        for field, rate in _rates(scenario):
            _check_grid(1.0 / rate, timestep, field, f"{rate:g} Hz", lambda steps: f"{1.0 / (steps * timestep):g} Hz")
        for field, period, shown in _inside(scenario):
            whole_steps(period, timestep, field, shown)
        for field, time in _times(scenario):
            _check_grid(time, timestep, field, f"{time:g} s", lambda steps: f"{steps * timestep:g} s")
    torques = [(f"push.{i}", push.start_s) for i, push in enumerate(scenario.push)]
    torques += [(f"swing.{i}", swing.start_s) for i, swing in enumerate(scenario.swing)]
    for i, swing in enumerate(scenario.swing):
        if swing.frequency_hz > control / SWING_SHARE:
            raise InputError(
                f"swing.{i}.frequency_hz = {swing.frequency_hz:g}: the torque is held from sample to sample; at most "
                f"{control / SWING_SHARE:g} Hz at controller.rate_hz = {control:g}"
            )
    for name, start in torques:
        if start >= scenario.duration_s:
            raise InputError(
                f"{name}.start_s = {start:g}: must be less than duration_s = {scenario.duration_s:g}, "
                "where the run ends"
            )


def check_steps(scenario: Scenario, timestep: float) -> None:
    """A run must come to its end.

    Raises:
        InputError: It has too many physics steps.
    """
    steps = scenario.duration_s / timestep
    if steps > MOST_STEPS:
        raise InputError(
            f"duration_s = {scenario.duration_s:g}: {steps:.3g} physics steps of {timestep:g} s; at most "
            f"{MOST_STEPS:g} are taken, {MOST_STEPS * timestep:g} s"
        )


def common_period(scenario: Scenario) -> float:
    """The longest time that divides every period and time of a scenario [s].

    Raises:
        InputError: It is shorter than `FINEST_S`; the first field that makes it so is named.
    """
    periods, times = [], []
    for prefix, own in [
        ("", scenario),
        *((f"axes.{name}.", scenario_of_axis(scenario, name)) for name in scenario.axes),
    ]:
        periods += [(prefix + field, 1 / _fraction(rate), f"{rate:g} Hz") for field, rate in _rates(own)]
        periods += [(prefix + field, _fraction(period), shown) for field, period, shown in _inside(own)]
        times += [(prefix + field, _fraction(time), f"{time:g} s") for field, time in _times(own)]
    common = Fraction(0)
    for field, time, shown in periods + times:
        common = _common_divisor(common, time)
        if common and common < _fraction(FINEST_S):
            raise InputError(
                f"{field} = {shown}: does not fit the other rates and times: no physics step of {FINEST_S:g} s or more "
                "divides them all; take rounder numbers, or set plant.timestep_s"
            )
    return float(common)


def fitting_step(settings: PlantSettings, limit_s: float, period_s: float | None) -> float:
    """The physics step of a scenario: its own, or the largest that is within a limit and divides a period.

    Args:
        settings: The scenario's plant.
        limit_s: The largest step that is accurate enough [s]: see `step_limit.py`.
        period_s: The time that whole steps must fill [s]; None if any will do.

    Returns:
        The step [s].
    """
    if settings.timestep_s is not None:
        return settings.timestep_s
    if period_s is None:
        return limit_s
    return period_s / math.ceil(period_s / limit_s * (1.0 - 1e-9))


def physics_step(scenario: Scenario, limit_s: float) -> float:
    """The physics step that a scenario is run with.

    Args:
        scenario: The scenario.
        limit_s: The largest step that is accurate enough [s]: see `step_limit.py`.

    Returns:
        The step [s].
    """
    period = common_period(scenario) if scenario.plant.timestep_s is None else None
    return fitting_step(scenario.plant, limit_s, period)


def _rates(scenario: Scenario) -> Iterator[tuple[str, float]]:
    yield "controller.rate_hz", scenario.controller.rate_hz
    for kind in SENSORS:
        yield f"sensors.{kind}.rate_hz", getattr(scenario.sensors, kind).rate_hz


def _inside(scenario: Scenario) -> Iterator[tuple[str, float, str]]:
    """Sample periods inside a part, which no field gives [s]: the field that asks for them, and what to call it."""
    accelerometer = scenario.sensors.accelerometer
    if accelerometer.bandwidth_hz:
        rate = accelerometer.raw_rate_hz
        shown = f"{accelerometer.bandwidth_hz:g} Hz, sampled at {rate:g} Hz inside the part"
        yield "sensors.accelerometer.bandwidth_hz", 1.0 / rate, shown


def _times(scenario: Scenario) -> Iterator[tuple[str, float]]:
    yield "duration_s", scenario.duration_s
    yield "sensors.accelerometer.skew_s", scenario.sensors.accelerometer.skew_s
    for i, push in enumerate(scenario.push):
        yield f"push.{i}.start_s", push.start_s
        yield f"push.{i}.duration_s", push.duration_s


def _fraction(number: float) -> Fraction:
    return Fraction(number).limit_denominator(_LARGEST_DENOMINATOR)


def _common_divisor(a: Fraction, b: Fraction) -> Fraction:
    return Fraction(math.gcd(a.numerator * b.denominator, b.numerator * a.denominator), a.denominator * b.denominator)


def _check_grid(time: float, timestep: float, field: str, given: str, show: Callable[[int], str]) -> None:
    try:
        whole_steps(time, timestep, field, given)
    except InputError as error:
        around = {max(1, math.floor(time / timestep)), max(1, math.ceil(time / timestep))}
        raise InputError(f"{error} (nearest: {' or '.join(show(steps) for steps in sorted(around))})") from error

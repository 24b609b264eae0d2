"""Every rate and time of a scenario on the grid of its physics steps."""

from __future__ import annotations

import math
from collections.abc import Callable

from cmg_mj.errors import InputError
from cmg_mj.schema import Scenario
from cmg_mj.timing import whole_steps


def check_times(scenario: Scenario) -> None:
    """Rates must divide the physics rate, times be multiples of the physics step, and pushes begin within the run.

    Raises:
        InputError: One does not; the nearest that would is named.
    """
    timestep = scenario.plant.timestep_s
    sensors = {kind: getattr(scenario.sensors, kind) for kind in ("accelerometer", "encoder", "fog")}
    rates = {"controller.rate_hz": scenario.controller.rate_hz}
    rates |= {f"sensors.{kind}.rate_hz": sensor.rate_hz for kind, sensor in sensors.items()}
    times = {"duration_s": scenario.duration_s}
    times |= {f"sensors.{kind}.latency_s": sensor.latency_s for kind, sensor in sensors.items()}
    if scenario.controller.trim_s:
        times["controller.trim_s"] = scenario.controller.trim_s
    for i, push in enumerate(scenario.push):
        times |= {f"push.{i}.start_s": push.start_s, f"push.{i}.duration_s": push.duration_s}
    for field, rate in rates.items():
        _check_grid(1.0 / rate, timestep, field, f"{rate:g} Hz", lambda steps: f"{1.0 / (steps * timestep):g} Hz")
    for field, time in times.items():
        _check_grid(time, timestep, field, f"{time:g} s", lambda steps: f"{steps * timestep:g} s")
    for i, push in enumerate(scenario.push):
        if push.start_s >= scenario.duration_s:
            raise InputError(
                f"push.{i}.start_s = {push.start_s:g}: must be less than duration_s = {scenario.duration_s:g}, "
                "where the run ends"
            )


def _check_grid(time: float, timestep: float, field: str, given: str, show: Callable[[int], str]) -> None:
    try:
        whole_steps(time, timestep, field, given)
    except InputError as error:
        around = {max(1, math.floor(time / timestep)), max(1, math.ceil(time / timestep))}
        raise InputError(f"{error} (nearest: {' or '.join(show(steps) for steps in sorted(around))})") from error

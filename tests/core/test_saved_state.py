"""A controller's state is all that it remembers: whoever assigns a saved one goes back to it."""

from __future__ import annotations

import math

from cmg_mj.core.controller import PRINTED_AFTER, Controller
from cmg_mj.core.types import IdealReading
from tests.core.test_straight_line import LATE, TRIMMED, VIBRATION
from tests.recorded import push_recovery
from tests.sensors.test_accelerometer import ALL

PERIOD = 5
"""Physics steps in a control period."""


def reading(step: int) -> IdealReading:
    """A rig that swings, its wheels slightly off their speed."""
    tilt, gimbal = 0.05 * math.sin(0.003 * step), 0.1 * math.cos(0.002 * step)
    x, z = -9.81 * math.sin(tilt), 9.81 * math.cos(tilt)
    gimbals = [math.pi / 2.0 + gimbal, math.pi / 2.0 - gimbal]
    return IdealReading((x, z, x, z), gimbals, 0.15 * tilt, 0.15 * tilt, (314.0 + tilt, -314.0 + tilt))


def states(controller: Controller, first: int, ticks: int) -> list[str]:
    """Return the states that follow, as text: to the last bit, and NaN equals NaN."""
    after = []
    for step in range(first, first + ticks * PERIOD, controller.steps_per_sample):
        controller.update(step, reading(step))
        after.append(repr(controller.state))
    return after


def test_an_assigned_state_repeats_what_followed() -> None:
    """From before the straight line and from after it, in any order; every effect has a memory of its own."""
    stages = "plant.gimbal_backlash_arcmin=10", "controller.notch_hz=20"
    controller = push_recovery(*ALL, *VIBRATION, *LATE, *TRIMMED, *stages, "plant.timestep_s=0.001").controller()
    assert controller.period == PERIOD
    settled = controller.axes[0].settled // PERIOD + PRINTED_AFTER
    saved, followed = {}, {}
    for tick in (20, settled + 40):
        states(controller, (controller.step or 0) + 1, 0)

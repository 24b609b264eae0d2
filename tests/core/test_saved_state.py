"""A controller's state is all that it remembers: whoever assigns a saved one goes back to it."""

from __future__ import annotations

import math

from cmg_mj.core.controller import PRINTED_AFTER
from cmg_mj.core.types import IdealReading
from tests.core.test_straight_line import LATE, TRIMMED, VIBRATION
from tests.recorded import push_recovery
from tests.sensors.test_accelerometer import ALL


def reading(step: int) -> IdealReading:
    """A rig that swings, its wheels slightly off their speed."""
    tilt, gimbal = 0.05 * math.sin(0.003 * step), 0.1 * math.cos(0.002 * step)
    x, z = -9.81 * math.sin(tilt), 9.81 * math.cos(tilt)
    gimbals = [math.pi / 2.0 + gimbal, math.pi / 2.0 - gimbal]
    return IdealReading((x, z, x, z), gimbals, 0.15 * tilt, 0.15 * tilt, (314.0 + tilt, -314.0 + tilt))


def test_an_assigned_state_repeats_what_followed() -> None:
    """200 ticks bit for bit, from the straight line and from before it; every effect has a memory of its own."""
    stages = "plant.gimbal_backlash_arcmin=10", "controller.notch_hz=20"
    controller = push_recovery(*ALL, *VIBRATION, *LATE, *TRIMMED, *stages, "plant.timestep_s=0.001").controller()
    assert (controller.steps_per_sample, controller.period) == (1, 5)
    printed = controller.axes[0].settled + PRINTED_AFTER * controller.period
    saved, shown = [], []
    for step in range(printed + 1200):
        controller.update(step, reading(step))
        saved.append(controller.state)
        shown.append(repr(controller.state))  # to the last bit, and NaN equals NaN
    assert controller._printed
    for start in (printed + 103, 101):
        controller.state = saved[start]
        for step in range(start + 1, start + 1001):
            controller.update(step, reading(step))
            assert repr(controller.state) == shown[step]

"""Contacts in the model of the observers that have one: a leaning rig that is held while a gimbal turns."""

from __future__ import annotations

import numpy as np
import pytest

from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.core.types import Measurement
from cmg_mj.observers import make_observer
from cmg_mj.plant.plant import load_plant

DT, LEAN, RATE = 0.005, 0.05, 0.5
NOISE = MeasurementNoise(tilt=1e-3, acceleration=0.1, correlation=-0.9, gimbal=3e-4)


def found(kind: str, *, told: bool) -> float:
    """Return the mean rate that an observer finds in a second, in which the tilt is held."""
    model = load_plant().reduced
    observer = make_observer(kind, DT, model, NOISE)
    state, rates = observer.init(Measurement(LEAN, 0.0, 0.0)), []
    for k in range(1, 400):
        gimbal = RATE * DT * k
        y = Measurement(LEAN, gimbal, 0.0)
        if told:
            y.contact = -model.tilt_acceleration(LEAN, 0.0, gimbal, RATE)
        state, estimate = observer.step(state, y, RATE)
        rates.append(estimate[1])
    return float(np.abs(rates[-200:]).mean())


@pytest.mark.parametrize("kind", ["homogeneous", "ltv", "adaptive", "kalman", "high_gain", "homogeneous_adaptive"])
def test_a_contact_in_f2_leaves_no_rate(kind: str) -> None:
    assert found(kind, told=True) < 0.03 * found(kind, told=False)

"""`high_gain` against andrieu2009 (7), (8) on the reduced model."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.observers import Measurement
from cmg_mj.observers.high_gain import HighGain
from tests.observers.reference import DT, HEAVY, PAPER, Slope, integrate, observer, power, rough_signals, run

DEFAULTS = {"l1": 29.5, "l2": 12.4, "d_inf": 0.6, "b": 0.333, "phi1": 0.03, "phi2": 1.0, "phi3": 3.0}


def high_gain(dt: float = DT, model: ReducedModel = PAPER, **parameters: Any) -> HighGain:
    result = observer("high_gain", dt, model, **parameters)
    assert isinstance(result, HighGain)
    return result


def printed_slope(m: ReducedModel, **parameters: float) -> Slope:
    """(7), (8) for n = 2 with K of section 3; state x1, x2, L."""
    k = DEFAULTS | parameters
    d, b = k["d_inf"], k["b"]

    def q(s: float, a: float) -> float:
        return s + power(s, a) if d > 0.0 else s

    def slope(z: np.ndarray, y1: float, y2: float, u: float) -> np.ndarray:
        x1, x2, L = z
        D = m.J1 + m.J2 * math.sin(y2) ** 2
        damping = m.J2 * math.sin(2.0 * y2) / D
        f2 = (u * m.J_d * m.omega_d * math.cos(y2) + m.gravity_torque * math.sin(y1)) / D - u * damping * x2
        q1 = q(k["l1"] * (x1 - y1) / L**b, 1.0 / (1.0 - d))
        q2 = q(k["l2"] * q1, 1.0 + d)
        growth = k["phi1"] * (k["phi2"] - L) + k["phi3"] * abs(u * damping)
        return np.array([x2 - L ** (1.0 + b) * q1, f2 - L ** (2.0 + b) * q2, L * growth])

    return slope


@pytest.mark.parametrize("L", [1.0, 2.5, 7.0])
def test_correction_is_the_printed_one_at_any_gain(L: float) -> None:
    """(7) takes this from the copy of the model; b matters where L is not 1, which it hardly leaves on this rig."""
    slope, estimator = printed_slope(PAPER), high_gain()
    for e in (-0.2, -0.01, 0.003, 0.1):
        copy = slope(np.array([0.0, 0.0, L]), 0.0, 0.0, 0.0)[:2]
        expected = copy - slope(np.array([e, 0.0, L]), 0.0, 0.0, 0.0)[:2]
        assert estimator.correction(e, L) == pytest.approx(tuple(expected), rel=1e-12)


CASES = [
    pytest.param({}, PAPER, id="defaults"),
    pytest.param({"l1": 45.0}, PAPER, id="l1"),
    pytest.param({"l2": 25.0}, PAPER, id="l2"),
    pytest.param({"d_inf": 0.2}, PAPER, id="d_inf"),
    pytest.param({"d_inf": 0.0}, PAPER, id="linear"),
    pytest.param({"l1": 10.0, "l2": 4.0, "phi2": 3.0, "b": 0.6}, PAPER, id="phi2 and b"),
    pytest.param({}, HEAVY, id="a rig whose gain moves"),
    pytest.param({"phi1": 0.3}, HEAVY, id="phi1"),
    pytest.param({"phi3": 0.5}, HEAVY, id="phi3"),
]


@pytest.mark.daily_cases("defaults", "linear", "a rig whose gain moves")
@pytest.mark.parametrize(("parameters", "model"), CASES)
def test_follows_the_printed_observer_at_200_hz(parameters: dict, model: ReducedModel) -> None:
    y1, y2, u = rough_signals(150)
    phi2 = parameters.get("phi2", 1.0)
    expected = integrate(printed_slope(model, **parameters), [y1[0], 0.0, phi2], y1, y2, u)
    estimates, states = run(high_gain(model=model, **parameters), y1, y2, u)
    gains = np.array([state.L for state in states[1:]])
    error = np.sqrt(np.mean((estimates[:, 1] - expected[:, 1]) ** 2)) / np.std(expected[:, 1])
    assert error < 1e-2
    # Omega is held over a sample, in which the gimbal turns by up to 0.02 rad.
    assert gains - 1.0 == pytest.approx(expected[:, 2] - 1.0, rel=0.02, abs=1e-5)
    if model is HEAVY:
        assert gains.max() > 1.1


def test_defaults() -> None:
    defaults: Any = DEFAULTS
    assert high_gain() == high_gain(**defaults)


def test_largest_damping_is_the_largest() -> None:
    for model in (PAPER, HEAVY):
        over_angles = np.abs(model.terms(0.0, np.linspace(0.0, np.pi, 100_001))[2]).max()
        assert high_gain(model=model).largest_damping == pytest.approx(over_angles, rel=1e-6)


def test_the_fastest_gains_that_are_taken_are_stable() -> None:
    """Just inside the limit of the step, the linear observer still forgets; beyond it, it would not."""
    low, high = 30.0, 1000.0
    while high - low > 1e-3:
        middle = 0.5 * (low + high)
        try:
            high_gain(l1=middle, d_inf=0.0)
            low = middle
        except InputError:
            high = middle
    estimator = high_gain(l1=0.99 * low, d_inf=0.0)
    state = estimator.init(Measurement(0.0, 0.0))._replace(x1=1e-6)
    for _ in range(3000):
        state, _ = estimator.step(state, Measurement(0.0, 0.0), 0.0)
    assert abs(state.x1) < 1e-9

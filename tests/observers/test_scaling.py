"""Observers carried to another rig: with time, inertia and noise scaled they do the same in their own units."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.types import extra_signals
from cmg_mj.laws import scaled_gains
from cmg_mj.laws.state_feedback import TABLE_2_GAINS
from cmg_mj.observers import OBSERVER_CLASSES, OBSERVERS, Measurement, make_observer
from cmg_mj.observers.scaling import PURE, TORQUE, UNITS, Scales, Unit, scale_value, scaled_parameters, scales_of
from tests.observers.reference import DT, HEAVY, NOISE, rough_signals

EXTRA = {"bias_rad": PURE}
"""Units of estimates beyond x; the others are torques."""
_PIVOT_FREE = {"rate_start": Unit(-1), "bias_start": Unit(-2), "bias_walk": Unit(-2.5), "jerk": Unit(-2)}
_TIMES = dict.fromkeys(("pivot_s", "learn_s", "noise_s"), Unit(1))
STAY: dict[str, dict[str, Unit]] = {
    "homogeneous": {
        "alpha": PURE,
        "friction_n_m": TORQUE,
        "damping_n_m_s": Unit(-1, 1),
        "friction_width_rad_s": Unit(-1),
    },
    "gyro_free": _PIVOT_FREE,
    "free_pivot": {
        **_PIVOT_FREE,
        **_TIMES,
        **dict.fromkeys(("pivot_hz", "slow_hz"), Unit(-1)),
        "odds_s": Unit(1),
        **dict.fromkeys(("odds_alike", "innovation_weight", "slow_innovation_weight", "gate"), PURE),
        **dict.fromkeys(("pivot_start", "pivot_floor", "rise_factor", "covariance_boost", "inflation"), PURE),
    },
    "mems_fused": {"rate_start": Unit(-1), "walk_factor": PURE},
    "super_twisting": {"l0": PURE, "l1": PURE},
    "linear_high_gain": {"a1": PURE, "a2": PURE},
    "high_gain": dict.fromkeys(("l1", "l2", "d_inf", "b", "phi1", "phi3"), PURE),
    "adaptive": {"sinusoid_hz": Unit(-1), "known_bias_deg": PURE},
    "homogeneous_adaptive": {"alpha": PURE, "Gamma": PURE},
}
"""Units of the parameters that are not scaled: of the sensors, of the surroundings, and pure numbers."""
SLOW_AND_HEAVY = Scales(time=2.7, inertia=900.0)
OTHER: dict[str, dict[str, Any]] = {
    "homogeneous": {"friction_n_m": 0.02, "damping_n_m_s": 0.01},
    "luenberger": {"L": ((20.0, 0.3), (150.0, -2.0), (0.7, 20.0))},
    # The exponent b, beside which L counts as a unit of tilt too, has no effect but for that while L does not move.
    "high_gain": {"b": 1e-13, "phi3": 0.3},
    "adaptive": {"bias": False, "torque": True, "sinusoid_hz": 1.1, "known_bias_deg": 0.4},
}
"""Parameters that are not zero, so that their units matter."""


def other_rig(model: ReducedModel, s: Scales) -> ReducedModel:
    """The rig whose equation (4) is the same in its own units."""
    return replace(
        model,
        J1=model.J1 * s.inertia,
        J2=model.J2 * s.inertia,
        J_d=model.J_d * s.inertia,
        omega_d=model.omega_d / s.time,
        gravity_torque=model.gravity_torque * s.inertia / s.time**2,
    )


def of_all(kind: str, values: dict[str, Any], scales: Scales) -> dict[str, Any]:
    """Every parameter in the other rig's units, whatever it describes."""
    units = {**UNITS.get(kind, {}), **STAY.get(kind, {})}
    return {name: scale_value(value, units[name], scales) if name in units else value for name, value in values.items()}


def estimates(kind: str, scales: Scales, model: ReducedModel) -> np.ndarray:
    """Estimate the same trajectory by an observer on the other rig, in the papers' rig's units."""
    signature = OBSERVER_CLASSES.takes(kind)
    names = [name for name in signature if name not in OBSERVER_CLASSES.bench_parameters]
    values = {name: signature[name].default for name in names} | OTHER.get(kind, {})
    rate, acceleration = 1.0 / scales.time, 1.0 / scales.time**2
    noise = replace(
        NOISE,
        tilt=0.05 * NOISE.tilt,  # less than y1 has: free_pivot learns that
        acceleration=NOISE.acceleration * acceleration,
        gyro=NOISE.gyro * Unit(-0.5).factor(scales),
        gyro_walk=NOISE.gyro_walk * Unit(-1.5).factor(scales),
    )
    of_rig = (DT * scales.time, other_rig(model, scales), noise)
    observer = make_observer(kind, *of_rig, **of_all(kind, values, scales))
    y1, y2, u = rough_signals(150)
    a, g = np.random.default_rng(0).normal(0.0, 5.0, (2, 150)) * [[acceleration], [rate]]
    u = u / scales.time
    state, rows = observer.init(Measurement(y1[0], y2[0], a[0], g[0])), []
    for k in range(1, 150):
        state, estimate = observer.step(state, Measurement(y1[k], y2[k], a[k], g[k]), u[k - 1])
        rows.append(estimate)
    extra = [EXTRA.get(name, TORQUE).factor(scales) for name in extra_signals(observer)]
    return np.array(rows) / [1.0, rate, 1.0, *extra]


@pytest.mark.parametrize("kind", sorted(OBSERVERS))
def test_the_same_in_the_rigs_own_units(kind: str) -> None:
    expected, scaled = (estimates(kind, scales, HEAVY) for scales in (Scales(1.0), SLOW_AND_HEAVY))
    size = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(scaled / size, expected / size, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("kind", sorted(OBSERVERS))
def test_every_number_has_a_unit(kind: str) -> None:
    parameters = OBSERVER_CLASSES.takes(kind).values()
    numbers = {p.name for p in parameters if p.name not in OBSERVER_CLASSES.bench_parameters}
    scaled, stay = UNITS.get(kind, {}).keys(), STAY.get(kind, {}).keys()
    assert scaled | stay == numbers - {"bias", "torque"}
    assert not scaled & stay


def test_the_scale_of_time_is_that_of_the_law() -> None:
    model = ReducedModel(J1=40.0, J2=0.01, J_d=0.04, omega_d=300.0, gravity_torque=350.0, gimbals=2)
    np.testing.assert_allclose(scaled_gains(model)[2], TABLE_2_GAINS[2] / scales_of(model).time, rtol=1e-12)


def test_the_sensors_observers_and_a_users_own_stay_as_they_are() -> None:
    for kind in (
        "gyro_free",
        "free_pivot",
        "mems_fused",
        "finite_difference",
        "tests.features.tuning.user_observer:UserObserver",
    ):
        assert scaled_parameters(kind, HEAVY) == {}

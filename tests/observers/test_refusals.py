"""Parameters that the papers' conditions or the sample period rule out: messages name field and observer."""

from __future__ import annotations

import math
import re
from typing import Any

import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.observers import make_observer
from cmg_mj.observers.free_pivot import FreePivot
from cmg_mj.observers.gyro_free import GyroFree
from tests.observers.reference import DT, PAPER, observer

UNSTABLE = [((0.0, 0.0), (0.0, 0.0), (0.0, 0.0)), ((20.0, 0.0), (55.0, 0.0), (0.0, 20.0))]
UNSTABLE += [((20.0, 0.0), (150.0, 0.0), (0.0, 0.0)), ((-20.0, 0.0), (150.0, 0.0), (0.0, 20.0))]
"""Gains of the time-invariant observer: none, less than the unstable pole asks for, no third state, a sign."""
PERFECT = MeasurementNoise(0.0, 0.0, 0.9)
REFUSED: dict[str, list[tuple[str, dict[str, Any]]]] = {
    "adaptive": [
        ("bias, torque", {"torque": True}),
        ("bias, torque, sinusoid_hz", {"bias": False}),
        ("known_bias_deg", {"known_bias_deg": 1.0}),
        ("known_bias_deg = 90.0", {"bias": False, "known_bias_deg": 90.0}),
        *(("L", {"L": L}) for L in ((-1.0, 0.0), (1.0, -100.0), (-1.0, 100.0), (-35e9, -6e9))),
        ("Gamma", {"Gamma": (1.0, 0.0, 1.0)}),
        ("Sigma, Gamma", {"Sigma": 1e300}),
        ("Sigma, Gamma", {"bias": False, "sinusoid_hz": 1.0, "Sigma": 1e9}),
        ("sinusoid_hz = -1.0", {"sinusoid_hz": -1.0}),
        ("sinusoid_hz = 100", {"sinusoid_hz": 100.0}),
    ],
    "high_gain": [
        *(("d_inf", {"d_inf": d_inf}) for d_inf in (1.0, -0.1)),
        ("b = 0.7", {"b": 0.7}),
        ("b = 0.41", {"d_inf": 0.9, "b": 0.41}),
        ("l1, l2, phi2", {"l1": 1000.0}),
        ("l1, l2, phi2", {"phi2": 60.0}),
        ("phi3/phi1", {"phi3": 1e12}),
        ("phi3/phi1", {"phi1": 1e-9}),
    ],
    "homogeneous": [
        *(("alpha", {"alpha": alpha}) for alpha in (0.5, 0.2, 1.0001, -0.85, math.nan)),
        *(
            ("friction_n_m, damping_n_m_s", too_much)  # c h at most 2.5: up to 1.546 N m on one gimbal
            for too_much in ({"friction_n_m": 1.56}, {"damping_n_m_s": 31.5}, {"friction_n_m": 1e6})
        ),
    ],
    "homogeneous_adaptive": [("alpha", {"alpha": 0.5}), ("L", {"L": (1.0, -2.0)}), ("Gamma", {"Gamma": 0.0})],
    "luenberger": [("L", {"L": L}) for L in UNSTABLE],
    "ltv": [
        *(("Q", {"Q": Q}) for Q in ((0.0, 5e6, 1.0), (1.0, -5e6, 1.0), (1.0, 1.0), 3.0)),
        ("H0", {"H0": (1.0, 1.0, 0.0)}),
    ],
}


@pytest.mark.parametrize(
    ("kind", "field", "parameters"), [(kind, *case) for kind, cases in REFUSED.items() for case in cases]
)
def test_what_the_conditions_rule_out_is_refused(kind: str, field: str, parameters: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=rf"^observer\.{re.escape(field)}\b.* \(observer {kind}\)$"):
        observer(kind, **parameters)


@pytest.mark.parametrize(
    ("kind", "parameters"),
    [
        ("homogeneous", {"alpha": 0.501}),
        ("homogeneous", {"alpha": 1.0}),
        ("homogeneous", {"friction_n_m": 1.54}),
        ("luenberger", {"L": ((20.0, 0.0), (56.5, 0.0), (0.0, 20.0))}),  # m g l/(sqrt(2) J1) = 55.84
        *(("adaptive", {"dt": dt}) for dt in (0.02, 0.001)),
    ],
)
def test_what_is_just_inside_is_taken(kind: str, parameters: dict[str, Any]) -> None:
    observer(kind, **parameters)


@pytest.mark.parametrize("kind", ["gyro_free", "free_pivot"])
def test_without_a_measured_acceleration_a_filter_of_it_is_refused(kind: str) -> None:
    with pytest.raises(InputError, match="needs the noise of its sensors"):
        make_observer(kind, DT, PAPER)


@pytest.mark.parametrize("filter_class", [GyroFree, FreePivot])
def test_with_nothing_uncertain_a_filter_is_refused(filter_class: Any) -> None:
    """Its covariance would fade to zero over zero after some hundred samples."""
    filter_class(DT, PAPER, PERFECT, jerk=0.1, bias_walk=0.0)
    with pytest.raises(ValueError, match="one of them must be positive"):
        filter_class(DT, PAPER, PERFECT, jerk=0.0, bias_walk=0.0)

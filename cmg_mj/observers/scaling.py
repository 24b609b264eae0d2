"""The observers' parameters carried from the papers' rig to one that falls slower or faster, as the law's gains are.

In (4) of aranovskiy2020 a rig's own unit of time is sqrt(J1/(m g h)), and of torque what gravity has at a quarter turn.
With g = m g h/J1 of this rig and g0 of the papers', time runs tau = sqrt(g0/g) times as slowly, and torques are

    n J1/(n0 J1_0) / tau^2

times as large. Angles are pure numbers. A parameter is multiplied by each unit to the power that its own unit has.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.observers import OBSERVER_CLASSES

PAPERS_GRAVITY = 3.4531 / 0.061841
"""g0 = (m g l/sqrt(2))/J1 of the rig that the papers' parameters were chosen for (aranovskiy2020 Table 1) [1/s^2]."""
PAPERS_INERTIA = 2 * 0.061841
"""n0 J1_0, both gimbals' shares of it [kg m^2]."""

Number: TypeAlias = "float | tuple[Number, ...]"
"""Value of a parameter: a number, or some of them in tuples."""


class Scales(NamedTuple):
    """The units of a rig, in those of the papers' rig."""

    time: float
    """Tau: the rig falls this many times as slowly."""
    inertia: float = 1.0
    """Ratio of the inertias about the tilt axis."""


@dataclass(frozen=True)
class Unit:
    """The unit of a parameter, s^time (kg m^2)^inertia.

    A parameter `of_rig` describes the rig's motion and goes with the rig's units. Others describe errors of the
    sensors, which are the same on a slow rig, or the surroundings: the pivot's motion, a gait, friction.
    """

    time: float = 0.0
    inertia: float = 0.0
    of_rig: bool = True

    def factor(self, scales: Scales) -> float:
        """Return what a parameter of this unit is multiplied by."""
        return scales.time**self.time * scales.inertia**self.inertia


Units: TypeAlias = "Unit | tuple[Units, ...]"
"""Unit of a parameter, in tuples as the parameter's value is."""

PURE = Unit()
GAIN_1, GAIN_2 = Unit(-1), Unit(-2)
"""Gains on an angle's error in the equations of an angle and of a rate."""
TORQUE = Unit(-2, 1)
"""J x1''."""

_HOMOGENEOUS: dict[str, Units] = {
    "k1": GAIN_1,  # x1' = x2 - k1 [e]^alpha
    "k2": GAIN_2,  # x2' = f2 - k2 [e]^(2 alpha - 1)
    "alpha": PURE,
}
_ADAPTIVE: dict[str, Units] = {
    "L": (GAIN_1, GAIN_2),  # x' = A x + ... + L (C x - y)
    "Gamma": (PURE, Unit(-4, 2), Unit(-4, 2)),  # rad^2, (N m)^2, (N m)^2
    "Sigma": Unit(-1),  # Sigma Gamma T^2 is the rate at which e is learnt, T = g/l2 a pure number
}
_ACCELERATION: dict[str, Units] = {
    "rate_start": Unit(-1, of_rig=False),  # about what remains of it: the sensors' noise
    "bias_start": Unit(-2, of_rig=False),
    "bias_walk": Unit(-2.5, of_rig=False),
    "jerk": Unit(-2, of_rig=False),  # beside the acceleration's noise, which is as large or larger
}

UNITS: Mapping[str, Mapping[str, Units]] = {
    "linear": {"tau": Unit(1)},  # s/(tau s + 1)^2
    "ltv": {  # H' = H A'^T + A' H - H C^T C H + Q, where H C^T are gains: H11 [1/s], H12 [1/s^2], H22 [1/s^3]
        "Q": (Unit(-2), Unit(-4), Unit(-2)),
        "H0": (Unit(-1), Unit(-3), Unit(-1)),
    },
    "homogeneous": {
        **_HOMOGENEOUS,
        "friction_n_m": replace(TORQUE, of_rig=False),
        "damping_n_m_s": Unit(-1, 1, of_rig=False),
        "friction_width_rad_s": Unit(-1, of_rig=False),
    },
    "luenberger": {  # x' = A x + B u + L (y - C x)
        "L": ((GAIN_1, GAIN_1), (GAIN_2, GAIN_2), (GAIN_1, GAIN_1)),
    },
    "kalman": {  # x2' = f2 + (torque + white)/(n D), x3' = u + g, torque' = walk
        "torque_walk": Unit(-2.5, 1),  # after t it is torque_walk sqrt(t)
        "torque_white": Unit(-1.5, 1),  # its integral is torque_white sqrt(t)
        "gimbal_white": Unit(-0.5),
        "rate_start": Unit(-1),
        "torque_start": TORQUE,
    },
    "gyro_free": _ACCELERATION,
    "free_pivot": {
        **_ACCELERATION,
        **dict.fromkeys(("pivot_hz", "slow_hz"), Unit(-1, of_rig=False)),
        **dict.fromkeys(("odds_s", "pivot_s", "learn_s", "noise_s"), Unit(1, of_rig=False)),
        **dict.fromkeys(("odds_alike", "innovation_weight", "slow_innovation_weight", "gate"), PURE),
        **dict.fromkeys(("pivot_start", "pivot_floor", "rise_factor", "covariance_boost", "inflation"), PURE),
    },
    "finite_difference": {},
    "super_twisting": {"L": Unit(-2), "l0": PURE, "l1": PURE},  # L bounds x1''
    "linear_high_gain": {"epsilon": Unit(1), "a1": PURE, "a2": PURE},  # s^2 + (a1/epsilon) s + a2/epsilon^2
    "high_gain": {  # x1' = x2 - L^(1+b) q1(s), s = l1 e/L^b, runs L times as fast; q1(s) in units of L^b
        "phi2": Unit(-1),  # L' = L (phi1 (phi2 - L) + phi3 Omega), L and Omega [1/s]
        **dict.fromkeys(("l1", "l2", "d_inf", "b", "phi1", "phi3"), PURE),
    },
    "adaptive": {**_ADAPTIVE, "sinusoid_hz": Unit(-1, of_rig=False), "known_bias_deg": PURE},
    "homogeneous_adaptive": {**_HOMOGENEOUS, **_ADAPTIVE, "Gamma": PURE},
}
"""Observer -> parameter -> its unit. A user's own observer has none here."""


def scales_of(model: ReducedModel) -> Scales:
    """Return the units of a rig, in those of the papers' rig."""
    tau = math.sqrt(PAPERS_GRAVITY / (model.gravity_torque / model.J1))
    return Scales(tau, model.gimbals * model.J1 / PAPERS_INERTIA)


def scale_value(value: Number, unit: Units, scales: Scales) -> Number:
    """Multiply a parameter, or each number in it, by the power of the scales that its unit has."""
    if isinstance(value, tuple):
        assert isinstance(unit, tuple)
        return tuple(scale_value(part, its, scales) for part, its in zip(value, unit, strict=True))
    assert isinstance(unit, Unit)
    return value * unit.factor(scales)


def scaled_names(kind: str) -> tuple[str, ...]:
    """Return the parameters of an observer that go with the rig; none of a user's own observer."""
    units = UNITS.get(kind, {}).items()  # those in tuples are all of the rig
    return tuple(name for name, its in units if isinstance(its, tuple) or (its.of_rig and its != PURE))


def scaled_parameters(kind: str, model: ReducedModel) -> dict[str, Number]:
    """Carry an observer's default parameters to a rig, as `gains = "scaled"` carries Table 2's gains.

    Args:
        kind: The observer's name.
        model: The rig's reduced model.

    Returns:
        Those that are not what they are on the papers' rig: `scaled_names`.
    """
    scales, defaults = scales_of(model), OBSERVER_CLASSES.takes(kind)
    return {name: scale_value(defaults[name].default, UNITS[kind][name], scales) for name in scaled_names(kind)}

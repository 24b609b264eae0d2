"""The observers' parameters carried from the papers' rig to one that falls slower or faster, as the law's gains are.

Three units make the linearised loop of a rig that of the papers' rig (aranovskiy2020 (6) with scaled gains): of time,
of tilt and of inertia. With b = J_d omega_d/J1 and g = m g h/J1 of this rig, b0 and g0 of the papers',

    time tau = sqrt(g0/g),  tilt A = (b/b0) tau,  inertia n J1/(n0 J1_0),

since x1'' = g x1 + b u with t = tau t', u = u'/tau and x1 = A x1' is x1''' = g0 x1' + b0 u'. Gimbal angles stay what
they are. A parameter is multiplied by each unit to the power that its own unit has.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import NamedTuple, TypeAlias

from cmg_mj.observers.reduced_model import ReducedModel
from cmg_mj.observers.registry import OBSERVER_CLASSES

PAPERS_AUTHORITY = 0.3454 / 0.061841
"""b0 = J_d omega_d/J1 of the rig that the papers' parameters were chosen for (aranovskiy2020 Table 1) [1/s]."""
PAPERS_GRAVITY = 3.4531 / 0.061841
"""g0 = (m g l/sqrt(2))/J1 of that rig [1/s^2]."""
PAPERS_INERTIA = 2 * 0.061841
"""n0 J1_0, both gimbals' shares of it [kg m^2]."""

Number: TypeAlias = "float | tuple[Number, ...]"
"""Value of a parameter: a number, or some of them in tuples."""


class Owner(Enum):
    """What a parameter describes."""

    RIG = "rig"
    """The rig's motion: it goes with the rig's units."""
    SENSORS = "sensors"
    """Errors of the sensors, which are the same on a slow rig."""
    SURROUNDINGS = "surroundings"
    """The pivot's motion, a gait, friction: what the rig's own pace says nothing of."""


class Scales(NamedTuple):
    """The units of a rig, in those of the papers' rig."""

    time: float
    """Tau: the rig falls so many times as slowly."""
    tilt: float = 1.0
    """A: a turn of the gimbals tilts the rig by so many times as much."""
    inertia: float = 1.0
    """So many times as heavy about the tilt axis."""


@dataclass(frozen=True)
class Unit:
    """The unit of a parameter: s^time, times units of tilt^tilt and of (kg m^2)^inertia."""

    time: float = 0.0
    tilt: float = 0.0
    inertia: float = 0.0
    owner: Owner = Owner.RIG

    def factor(self, scales: Scales) -> float:
        """Return what a parameter of this unit is multiplied by."""
        return scales.time**self.time * scales.tilt**self.tilt * scales.inertia**self.inertia


Units: TypeAlias = "Unit | tuple[Units, ...]"
"""Unit of a parameter, in tuples as the parameter's value is."""

PURE = Unit()
GAIN_1, GAIN_2 = Unit(-1), Unit(-2)
"""Gains on a tilt's error in the equations of x1 and of x2."""
TORQUE = Unit(-2, 1, 1)
"""J x1''."""
SQUARED_TILT = Unit(0, 2)

_ADAPTIVE: dict[str, Units] = {
    "L": (GAIN_1, GAIN_2),  # x' = A x + ... + L (C x - y)
    "Gamma": (SQUARED_TILT, Unit(-4, 2, 2), Unit(-4, 2, 2)),  # rad^2, (N m)^2, (N m)^2
    "Sigma": Unit(-1, -2),  # Gamma Sigma T^2 is the rate at which e is learnt, T = g/l2 a pure number
}


def _homogeneous(alpha: float) -> dict[str, Units]:
    """Return the units of (11), whose gains act on powers of a tilt."""
    return {
        "k1": Unit(-1, 1.0 - alpha),  # x1' = x2 - k1 [e]^alpha
        "k2": Unit(-2, 2.0 - 2.0 * alpha),  # x2' = f2 - k2 [e]^(2 alpha - 1)
        "alpha": PURE,
    }


_ACCELERATION: dict[str, Units] = {
    "rate_start": Unit(-1, 1, owner=Owner.SENSORS),  # about what remains of it: the sensors' noise
    "bias_start": Unit(-2, 1, owner=Owner.SENSORS),
    "bias_walk": Unit(-2.5, 1, owner=Owner.SENSORS),
    "jerk": Unit(-2, 1, owner=Owner.SENSORS),
}


def units_of(kind: str, alpha: float = 0.85) -> Mapping[str, Units]:
    """Return the unit of every number that an observer takes.

    Args:
        kind: The observer's name; a user's own has no units here.
        alpha: The exponent of `homogeneous`, which its gains' units depend on.
    """
    units: dict[str, dict[str, Units]] = {
        "linear": {"tau": Unit(1)},  # s/(tau s + 1)^2
        "ltv": {  # H' = H A'^T + A' H - H C^T C H + Q, where H C^T are gains: H11 [1/s], H12 [1/s^2], H22 [1/s^3]
            "Q": (Unit(-2), Unit(-4), Unit(-2)),
            "H0": (Unit(-1), Unit(-3), Unit(-1)),
        },
        "homogeneous": {
            **_homogeneous(alpha),
            "friction_n_m": replace(TORQUE, owner=Owner.SURROUNDINGS),
            "damping_n_m_s": Unit(-1, 0, 1, Owner.SURROUNDINGS),
            "friction_width_rad_s": Unit(-1, 1, owner=Owner.SURROUNDINGS),
        },
        "luenberger": {  # x' = A x + B u + L (y - C x), y = (tilt, gimbal angle)
            "L": ((GAIN_1, Unit(-1, 1)), (GAIN_2, Unit(-2, 1)), (Unit(-1, -1), GAIN_1)),
        },
        "kalman": {  # x2' = f2 + (torque + white)/(n D), x3' = u + g, torque' = walk
            "torque_walk": Unit(-2.5, 1, 1),  # after t it is torque_walk sqrt(t)
            "torque_white": Unit(-1.5, 1, 1),  # its integral is torque_white sqrt(t)
            "gimbal_white": Unit(-0.5),
            "rate_start": Unit(-1, 1),
            "torque_start": TORQUE,
        },
        "gyro_free": _ACCELERATION,
        "free_pivot": {
            **_ACCELERATION,
            "pivot_hz": Unit(-1, owner=Owner.SURROUNDINGS),
            "pivot_start": Unit(0, 1, owner=Owner.SURROUNDINGS),
            "pivot_floor": Unit(0, 1, owner=Owner.SURROUNDINGS),
            "pivot_s": Unit(1, owner=Owner.SURROUNDINGS),
            "learn_s": Unit(1, owner=Owner.SURROUNDINGS),
            "surprise": PURE,
            "noise_s": Unit(1, owner=Owner.SENSORS),
        },
        "finite_difference": {},
        "super_twisting": {"L": Unit(-2, 1), "l0": PURE, "l1": PURE},  # L bounds x1''
        "linear_high_gain": {"epsilon": Unit(1), "a1": PURE, "a2": PURE},  # s^2 + (a1/epsilon) s + a2/epsilon^2
        "high_gain": {  # with L = phi2 L', e = phi2^b e': x1' = x2 - L^(1+b) q1(l1 e/L^b) runs phi2 times as fast
            "phi2": Unit(-1),  # L' = L (phi1 (phi2 - L) + phi3 Omega), L and Omega [1/s]
            **dict.fromkeys(("l1", "l2", "d_inf", "b", "phi1", "phi3"), PURE),
        },
        "adaptive": {
            **_ADAPTIVE,
            "sinusoid_hz": Unit(-1, owner=Owner.SURROUNDINGS),
            "known_bias_deg": Unit(0, 1, owner=Owner.SURROUNDINGS),
        },
        "homogeneous_adaptive": {**_homogeneous(alpha), **_ADAPTIVE, "Gamma": SQUARED_TILT},
    }
    return units.get(kind, {})


def scales_of(model: ReducedModel) -> Scales:
    """Return the units of a rig, in those of the papers' rig."""
    tau = math.sqrt(PAPERS_GRAVITY / (model.gravity_torque / model.J1))
    tilt = model.J_d * model.omega_d / model.J1 / PAPERS_AUTHORITY * tau
    return Scales(tau, tilt, model.gimbals * model.J1 / PAPERS_INERTIA)


def carried(value: Number, unit: Units, scales: Scales) -> Number:
    """Multiply a parameter, or each number in it, by the power of the scales that its unit has."""
    if isinstance(value, tuple):
        assert isinstance(unit, tuple)
        return tuple(carried(part, its, scales) for part, its in zip(value, unit, strict=True))
    assert isinstance(unit, Unit)
    return value * unit.factor(scales)


def scaled_parameters(kind: str, model: ReducedModel) -> dict[str, Number]:
    """Carry an observer's default parameters to a rig, as `gains = "scaled"` carries Table 2's gains.

    Args:
        kind: The observer's name.
        model: The rig's reduced model.

    Returns:
        Those that are not what they are on the papers' rig; none of an observer without such, or of a user's own.
    """
    scales, defaults = scales_of(model), OBSERVER_CLASSES.takes(kind)
    return {
        name: carried(defaults[name].default, unit, scales)
        for name, unit in units_of(kind).items()
        if any(part.owner is Owner.RIG and part != PURE for part in _flat(unit))
    }


def _flat(unit: Units) -> list[Unit]:
    if isinstance(unit, Unit):
        return [unit]
    return [part for its in unit for part in _flat(its)]

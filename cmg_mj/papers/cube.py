"""The gyroscope's module as aranovskiy2020 and sokolov2019 print it, and the reduced model that follows from it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from cmg_mj.core.reduced_model import ReducedModel

CUBE = {
    "m": 2.62,
    "J_b": 13e-3,
    "I_c": 10e-4,
    "J_c": 2.6e-4,
    "K_c": 9.9e-4,
    "I_d": 5.6e-4,
    "J_d": 11e-4,
    "omega_d": 314.0,
    "g": 9.81,
}
"""Both first tables [kg, kg m^2, rad/s], and the standard gravity that they do not give [m/s^2]."""


def inertias(table: Mapping[str, Any], gimbals: int) -> tuple[Any, Any]:
    """Return J1 and J2 of a gimbal's share by the printed closed forms; the mass m has the arm l [kg m^2]."""
    t = table
    J1 = t["I_d"] + t["J_b"] + t["K_c"] + t["m"] * t["l"] ** 2 / gimbals
    return J1, t["J_c"] - t["I_d"] + t["J_d"] - t["K_c"]


def reduced_model(table: Mapping[str, float], gimbals: int) -> ReducedModel:
    """Return the reduced model of a rig, from a table's numbers alone."""
    gravity_torque = table["m"] * table["g"] * table["l"] / math.sqrt(gimbals)
    return ReducedModel(*inertias(table, gimbals), table["J_d"], table["omega_d"], gravity_torque)

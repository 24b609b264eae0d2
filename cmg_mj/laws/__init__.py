"""Control laws by name, and a user's own by dotted path."""

from __future__ import annotations

from typing import Any

from cmg_mj.core.errors import InputError
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.core.types import FeedbackState, Law
from cmg_mj.inputs.user_classes import UserClassKind
from cmg_mj.laws.state_feedback import TABLE_2_GAINS, StateFeedback, lqr_gains, scaled_gains

__all__ = [
    "LAWS",
    "LAW_CLASSES",
    "TABLE_2_GAINS",
    "FeedbackState",
    "Law",
    "StateFeedback",
    "lqr_gains",
    "make_law",
    "scaled_gains",
]


LAWS = {
    "state_feedback": "cmg_mj.laws.state_feedback:StateFeedback",
    "lqg": "cmg_mj.laws.lqg:Lqg",
}
"""Name a user types -> dotted path of the class."""

LAW_CLASSES = UserClassKind(
    "law", "controller", LAWS, ("dt", "rate_limit"), ("model", "noise"), {"init": "y", "step": "state, y, x, u"}
)
"""Finds, checks and makes laws."""


def make_law(
    kind: str, dt: float, rate_limit: float, model: ReducedModel, noise: MeasurementNoise, /, **parameters: Any
) -> Law:
    """Construct a law.

    Args:
        kind: A name of `LAWS`, or `package.module:Class`.
        dt: Control period [s].
        rate_limit: Largest gimbal rate [rad/s].
        model: The reduced model read off the plant, for the laws that take it.
        noise: Of tilt and gimbal angle as the sensors' datasheet says, for the laws that take it.
        **parameters: The law's design parameters; those left out keep their defaults.

    Returns:
        The law.

    Raises:
        InputError: Unknown law or parameter, or a parameter that the law refuses.
    """
    law = LAW_CLASSES.make(kind, {"dt": dt, "rate_limit": rate_limit, "model": model, "noise": noise}, parameters)
    if (getattr(law, "dt", None), getattr(law, "rate_limit", None)) != (dt, rate_limit):
        raise InputError(f"law {kind}: must keep dt and rate_limit, which it is given, under these names")
    return law

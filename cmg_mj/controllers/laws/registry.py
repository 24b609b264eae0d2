"""Control laws by name, and a user's own by dotted path."""

from __future__ import annotations

from typing import Any

from cmg_mj.controllers.laws.protocol import Law
from cmg_mj.errors import InputError
from cmg_mj.inputs.user_classes import UserClassKind
from cmg_mj.observers.reduced_model import ReducedModel
from cmg_mj.sensors.tilt import TiltNoise

LAWS = {
    "state_feedback": "cmg_mj.controllers.laws.state_feedback:StateFeedback",
    "lqg": "cmg_mj.controllers.laws.lqg:Lqg",
}
"""Name a user types -> dotted path of the class."""

BENCH_PARAMETERS = ("dt", "model", "noise", "rate_limit")
"""Arguments that the bench gives: dt and the limit to every law, the others to laws that take them."""

OF_LAWS = UserClassKind("law", "controller", LAWS, BENCH_PARAMETERS, {"init": "y", "step": "state, y, x, u"})
"""The rules by which a law is found, checked and made."""


def law_class(kind: str) -> type:
    """Find a law's class.

    Args:
        kind: A name of `LAWS`, or `package.module:Class`.

    Returns:
        The class.

    Raises:
        InputError: There is no such law, or its module cannot be imported.
    """
    return OF_LAWS.find(kind)


def make_law(
    kind: str, dt: float, rate_limit: float, model: ReducedModel, noise: TiltNoise, /, **parameters: Any
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
    OF_LAWS.check_names(kind, parameters)
    signature = OF_LAWS.takes(kind)
    bench_arguments: dict[str, Any] = {"dt": dt, "rate_limit": rate_limit}
    bench_arguments |= {name: value for name, value in (("model", model), ("noise", noise)) if name in signature}
    law = OF_LAWS.make(kind, bench_arguments, parameters)
    if any(getattr(law, name, None) != bench_arguments[name] for name in ("dt", "rate_limit")):
        raise InputError(f"law {kind}: must keep dt and rate_limit, which it is given, under these names")
    return law

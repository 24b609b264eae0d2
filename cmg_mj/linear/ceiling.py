"""The ceiling: what no controller of a pair recovers from, by the linearised reduced model."""

from __future__ import annotations

import math
from typing import NamedTuple

from cmg_mj.core.reduced_model import ReducedModel


class RecoverableLimit(NamedTuple):
    """Upper bound for any controller, on the linearised reduced model (6) with the gimbals' geometry kept.

    With lambda^2 = m g h/J, the part z = x1 + x2/lambda of a state grows as z' = lambda z - (H/J) cos(x3) u/lambda.
    Nothing takes more off it than gimbals that turn at once as fast as they can, x3 = u t, up to their travel theta. It
    is recoverable if

        z < (H/J) S,   S = 1/lambda integral of e^(-lambda t) u cos(u t) dt from 0 to T = theta/u
                         = u/(lambda^2 + u^2) [1 + e^(-lambda T) ((u/lambda) sin theta - cos theta)]

    A push tau(t) that begins at t = 0 adds tau/(J lambda) to z', and an upright rig, whose gimbals turn from that
    moment on, recovers if

        integral of e^(-lambda t) tau(t)/(J lambda) dt < (H/J) S
    """

    tilt: float
    """The largest tilt from which a rig at rest recovers, (H/J) S [rad]."""
    impulse: float
    """The largest impulse about the line that an upright rig recovers from if it comes all at once, J lambda times the
    tilt [N m s]. Gimbals take off a part of a held push while it lasts: see `push_impulse`."""
    pole: float
    """lambda [1/s]."""

    def push_impulse(self, duration_s: float) -> float:
        """Compute the largest impulse about the line that an upright rig recovers from, brought by a constant torque.

        With x = lambda D, a torque tau for D adds tau/(J lambda^2) (1 - e^-x) to what is to be recovered from, so that
        tau D = blow x/(1 - e^-x).

        Args:
            duration_s: D, how long the push is held [s].

        Returns:
            The impulse [N m s].
        """
        x = self.pole * duration_s
        return self.impulse * (x / -math.expm1(-x) if x > 0.0 else 1.0)


def ceiling(model: ReducedModel, rate_limit: float, travel: float = math.pi / 2.0) -> RecoverableLimit:
    """Compute the limits for any controller on a rig.

    Args:
        model: Its reduced model.
        rate_limit: u, the gimbals' largest rate [rad/s].
        travel: theta, how far they turn from upright; beyond a quarter turn a gimbal pushes the other way [rad].

    Returns:
        The ceiling.
    """
    u = rate_limit
    pole = math.sqrt(model.gravity_torque / model.J1)
    momentum = model.J_d * model.omega_d
    left = math.exp(-pole * travel / u)
    S = u / (pole**2 + u**2) * (1.0 + left * (u / pole * math.sin(travel) - math.cos(travel)))
    tilt = momentum / model.J1 * S
    return RecoverableLimit(tilt, model.gimbals * model.J1 * pole * tilt, pole)


PUSH_S = 0.1
"""Duration of the push that the words name [s]."""


def plant_words(model: ReducedModel) -> str:
    """Say for one line what a plant is about its tilt line, all its gimbals together."""
    n = model.gimbals
    return (
        f"inertia {n * model.J1:.4g} kg m^2, gravity {n * model.gravity_torque:.4g} N m, momentum "
        f"{n * model.J_d * model.omega_d:.4g} N m s, falls with {math.sqrt(model.gravity_torque / model.J1):.3g} 1/s"
    )


def ceiling_words(limit: RecoverableLimit) -> str:
    """Say for one line what any controller recovers from."""
    return (
        f"any controller, from upright gimbals (linear model): recovers from at most {math.degrees(limit.tilt):.3g} "
        f"deg, or a push of {limit.push_impulse(PUSH_S) / PUSH_S:.3g} N m for {PUSH_S:g} s"
    )

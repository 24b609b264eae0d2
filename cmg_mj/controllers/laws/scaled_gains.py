"""Table 2's gains carried over to a rig of another size, by its time scale and its authority."""

from __future__ import annotations

import math

from cmg_mj.controllers.laws.state_feedback import TABLE_2_GAINS
from cmg_mj.observers.reduced_model import ReducedModel

PAPERS_AUTHORITY = 0.3454 / 0.061841
"""b0 = J_d omega_d/J1 of the rig that Table 2's gains were chosen for (aranovskiy2020 Table 1) [1/s]."""
PAPERS_GRAVITY = 3.4531 / 0.061841
"""g0 = (m g l/sqrt(2))/J1 of that rig [1/s^2]."""


def scaled_gains(model: ReducedModel) -> tuple[float, float, float, float]:
    """The gains that make a rig's linearised loop the papers' own, slowed down or sped up.

    With b = J_d omega_d/J1 and g = m g h/J1 of this rig, its time runs tau = sqrt(g0/g) times as slowly as that of the
    papers' rig, and a gimbal rate does 1/r as much, r = b0/b. Then [k1 r/tau^2, k2 r/tau, k3/tau, k4/tau^2] has the
    poles of [k1, k2, k3, k4] on the papers' rig, divided by tau.

    Args:
        model: The rig's reduced model.

    Returns:
        K_e on [x1, x2, x3, x_e].
    """
    k1, k2, k3, k4 = TABLE_2_GAINS
    r = PAPERS_AUTHORITY / (model.J_d * model.omega_d / model.J1)
    tau = math.sqrt(PAPERS_GRAVITY / (model.gravity_torque / model.J1))
    return k1 * r / tau**2, k2 * r / tau, k3 / tau, k4 / tau**2

"""A control law of your own: (8) about the tilt at which gravity bears the torque that `kalman` estimates.

The command line takes it too, from the folder of this file:
cmg-mj run push_recovery --observer kalman --set controller.kind=own_law:Leaning
"""

from __future__ import annotations

from dataclasses import dataclass

import cmg_mj


@dataclass(frozen=True)
class Leaning:
    """u = -K_e [x1 + torque/(n M), x2, x3, x_e]."""

    dt: float
    rate_limit: float
    model: cmg_mj.ReducedModel
    share: float = 1.0

    def init(self, y):
        """The state before the first sample: the integrator of (8)."""
        return cmg_mj.StateFeedback(self.dt).init(y)

    def step(self, state, y, x, u):
        """Sample k: what is measured, what is fed back with what the observer estimates beyond, u held since k-1."""
        leaning = self.share * x.extra[0] / (self.model.gimbals * self.model.gravity_torque)
        law = cmg_mj.StateFeedback(self.dt, rate_limit=self.rate_limit)
        return law.step(state, y, cmg_mj.FeedbackState(x.x1 + leaning, x.x2, x.x3), u)


if __name__ == "__main__":
    for kind in ("own_law:Leaning", "state_feedback"):
        settings = [f"controller.kind={kind}", "plant.equilibrium_bias_deg=2.25"]
        result = cmg_mj.prepare(cmg_mj.load_scenario("push_recovery", settings, "kalman")).run_many(5)
        print(f"{kind}: {result.stood.sum()} of 5 stood")

"""An observer of your own in the loop, and `homogeneous` beside it on the same noise.

The command line takes it too, from the folder of this file:
cmg-mj compare push_recovery --observers homogeneous,own_observer:HalfDifference
"""

from __future__ import annotations

from dataclasses import dataclass

import cmg_mj


@dataclass(frozen=True)
class HalfDifference:
    """The tilt's difference quotient, of which each sample takes a part."""

    needs = ()  # but y1: it replays on any log
    elementwise = True  # takes arrays (n_worlds,) as well as floats: many worlds run together

    dt: float
    model: cmg_mj.ReducedModel
    weight: float = 0.5

    def init(self, y):
        """The state at the first sample."""
        return y.y1, 0.0 * y.y1

    def step(self, state, y, u):
        """Sample k: y_k, and the gimbal rate held since k-1."""
        y1, rate = state
        rate = rate + self.weight * ((y.y1 - y1) / self.dt - rate)
        return (y.y1, rate), cmg_mj.Estimate(y.y1, rate, y.y2)


if __name__ == "__main__":
    for kind, settings in (("own_observer:HalfDifference", ["observer.weight=0.1"]), ("homogeneous", [])):
        experiment = cmg_mj.prepare(cmg_mj.load_scenario("push_recovery", ["duration_s=6.0", *settings], observer=kind))
        result = experiment.run_many(5, keep_trajectory=False)
        print(f"{kind}: {result.fell.sum()} of 5 fell, velocity RMS error {result.mean('velocity_rms_error_rad_s')}")

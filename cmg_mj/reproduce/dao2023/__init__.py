"""dao2023: the adaptive disturbance observer, on the pendulum robot and on the rig."""

from __future__ import annotations

from cmg_mj.reproduce.claim import Step
from cmg_mj.reproduce.dao2023 import equations, figures, on_the_rig

STEPS: list[Step] = [
    Step("pendulum robot", 14.0, figures.run),
    Step("equations", 7.0, equations.run),
    Step("on the rig", 13.0, on_the_rig.run),
]

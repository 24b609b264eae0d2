"""dao2023: the adaptive disturbance observer, on the pendulum robot and on the rig."""

from __future__ import annotations

from cmg_mj.papers.claim import Section
from cmg_mj.papers.dao2023 import equations, figures, on_the_rig

SECTIONS: list[Section] = [
    Section("pendulum robot", 14.0, figures.run),
    Section("equations", 7.0, equations.run),
    Section("on the rig", 13.0, on_the_rig.run),
]

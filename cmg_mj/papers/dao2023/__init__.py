"""dao2023: the adaptive disturbance observer, on the pendulum robot and on the rig."""

from __future__ import annotations

from cmg_mj.papers.claim import Section
from cmg_mj.papers.dao2023 import as_printed, figures, identities, on_the_rig

SECTIONS: list[Section] = [
    Section("pendulum robot", 14.0, figures.claims),
    Section("equations (7) to (9)", 5.0, identities.claims),
    Section("as printed", 2.0, as_printed.claims),
    Section("on the rig", 13.0, on_the_rig.claims),
]

"""dao2023: the adaptive disturbance observer, on the pendulum robot and on the rig."""

from __future__ import annotations

from cmg_mj.papers.claim import section
from cmg_mj.papers.dao2023 import figures, on_the_rig, theory

SECTIONS = [
    section("pendulum robot", 14.0, figures.figures_claims),
    section("equations (7) to (9)", 5.0, theory.separated_errors, theory.upsilon),
    section("as printed", 2.0, theory.sampling_claim, theory.misprint_claim),
    section("on the rig", 13.0, on_the_rig.bias, on_the_rig.velocity, on_the_rig.torques),
]

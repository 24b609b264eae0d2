"""andrieu2009: the theorem, the bioreactor, and the observer on the rig."""

from __future__ import annotations

from cmg_mj.reproduce.andrieu2009 import bi_limit_theory, bioreactor_bounds, bioreactor_figures, high_gain_rig
from cmg_mj.reproduce.claim import Step

STEPS: list[Step] = [
    Step("inequalities and theorems", 3.0, bi_limit_theory.claims),
    Step("the bioreactor's bounds", 1.0, bioreactor_bounds.claims),
    Step("Figs 1 and 2", 9.0, bioreactor_figures.claims),
    Step("on the rig", 13.0, high_gain_rig.run),
]

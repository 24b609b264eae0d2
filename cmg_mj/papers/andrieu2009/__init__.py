"""andrieu2009: the theorem, the bioreactor, and the observer on the rig."""

from __future__ import annotations

from cmg_mj.papers.andrieu2009 import bioreactor, figures, on_the_rig, theory
from cmg_mj.papers.claim import Section

SECTIONS: list[Section] = [
    Section("inequalities and theorems", 3.0, theory.theory_claims),
    Section("the bioreactor's bounds", 1.0, bioreactor.claims),
    Section("Figs 1 and 2", 9.0, figures.claims),
    Section("on the rig", 13.0, on_the_rig.claims),
]

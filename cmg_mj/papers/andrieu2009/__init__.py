"""andrieu2009: the theorem, the bioreactor, and the observer on the rig."""

from __future__ import annotations

from cmg_mj.papers.andrieu2009 import bioreactor, figures, on_the_rig, theorem_1, theory
from cmg_mj.papers.claim import section

SECTIONS = [
    section(
        "inequalities and theorems",
        3.0,
        theory.linear_increments,
        theory.increments,
        theory.exponent_of_6,
        theorem_1.no_observer_beyond_1,
        theory.scaling_conditions,
        theory.gain_tracking,
        theory.theorem_2,
        theory.equations_19_20,
        theorem_1.theorem_1,
        theorem_1.equations_11_12_claims,
    ),
    section(
        "the bioreactor's bounds",
        1.0,
        bioreactor.invariance,
        bioreactor.coordinates,
        bioreactor.increments,
        bioreactor.order_of_bounds,
        bioreactor.noise_level,
    ),
    section("Figs 1 and 2", 9.0, figures.claims),
    section("on the rig", 13.0, on_the_rig.claims),
]

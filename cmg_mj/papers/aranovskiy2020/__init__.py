"""aranovskiy2020: the scissored pair and its observers (9), (10) and (11)."""

from __future__ import annotations

from cmg_mj.papers.aranovskiy2020 import (
    gains,
    homogeneous,
    hypotheses,
    lag,
    model,
    riccati,
    section_5,
    servo,
    table_2,
    time_invariant,
    two_axes,
    update_cost,
)
from cmg_mj.papers.claim import Section

SECTIONS: list[Section] = [
    Section("two pairs at right angles", 2.0, two_axes.claims),
    Section("constants and reduced model", 0.2, model.claims),
    Section("linearisation", 0.1, model.linearisation_claims),
    Section("Hypotheses 1 to 3 kept and broken", 3.0, hypotheses.claims),
    Section("servos with a deadband", 5.0, servo.claims),
    Section("the law's gains", 0.5, gains.optimality_claims),
    Section("where the loop rests", 4.0, gains.rest_claims),
    Section("observability", 1.0, riccati.observability_claims),
    Section("(9), lag and noise", 0.3, lag.claims),
    Section("(11), the vicinity", 2.0, homogeneous.vicinity_claims),
    Section("(11), finite time", 1.5, homogeneous.finite_time_claims),
    Section("Remark 1, the cost of an update", 7.0, update_cost.claims),
    Section("Remark 1, the Riccati equation", 1.0, riccati.delicacy_claims),
    Section("the Riccati equation as printed", 1.0, riccati.misprint_claims),
    Section("Fig. 4", 3.0, section_5.figure_4_claims),
    Section("Figs 5 to 7", 8.0, section_5.claims),
    Section("the time-invariant observer", 9.0, time_invariant.claims),
    Section("Table 2 tuned again", 60.0, table_2.claims),
    Section("the appendix", 3.0, model.appendix_claims),
]

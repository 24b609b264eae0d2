"""aranovskiy2020: the scissored pair and its observers (9), (10) and (11)."""

from __future__ import annotations

from cmg_mj.papers import plvcc
from cmg_mj.papers.aranovskiy2020 import (
    differentiators,
    gains,
    hypotheses,
    model,
    riccati,
    section_5,
    table_2,
    two_axes,
)
from cmg_mj.papers.claim import Section, section

SECTIONS = [
    section("two pairs at right angles", 2.0, two_axes.one_axis_at_a_time),
    section("constants and reduced model", 0.2, model.claims),
    section("linearisation", 0.1, model.linearisation, model.law_equilibria),
    section("Hypotheses 1 to 3 kept and broken", 3.0, hypotheses.claims),
    section("servos with a deadband", 5.0, lambda: hypotheses.servo_claim(hypotheses.run_servos())),
    section("the law's gains", 0.5, gains.lqr_gains),
    section("where the loop rests", 4.0, gains.rest_claims),
    section("observability", 1.0, riccati.observability),
    section("(9), lag and noise", 0.3, differentiators.lag),
    section("(11), the vicinity", 2.0, differentiators.vicinity),
    section("(11), finite time", 1.5, differentiators.finite_time),
    section("Remark 1, the cost of an update", 7.0, riccati.cost),
    section("Remark 1, the Riccati equation", 1.0, riccati.delicacy),
    section("the Riccati equation as printed", 1.0, riccati.misprint),
    section("Fig. 4", 3.0, section_5.figure_4),
    section("Figs 5 to 7", 14.0, section_5.claims),
    section("the time-invariant observer", 9.0, section_5.remark),
    Section("Table 2 tuned again", 60.0, table_2.claims),
    section("the appendix", 3.0, lambda: plvcc.claim("aranovskiy2020")),
]

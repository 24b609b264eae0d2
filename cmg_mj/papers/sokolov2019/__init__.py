"""sokolov2019: one gimbal on a locked thrust bearing, and three velocity estimators."""

from __future__ import annotations

from cmg_mj.papers.claim import Section
from cmg_mj.papers.sokolov2019 import bearing, equations, figure_3, observer_bias, section_5, table_2

SECTIONS: list[Section] = [
    Section("the equations", 0.1, equations.claims),
    Section("the observers' bias", 1.2, observer_bias.claims),
    Section("Proposition 1", 1.3, equations.proposition_1_claims),
    Section("Fig. 3", 0.8, figure_3.claims),
    Section("Table II", 12.0, table_2.claims),
    Section("Figs 4 to 6, and the lag", 10.0, section_5.claims),
    Section("the thrust bearing", 3.0, bearing.claims),
]

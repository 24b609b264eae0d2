"""sokolov2019: one gimbal on a locked thrust bearing, and three velocity estimators."""

from __future__ import annotations

from cmg_mj.papers.claim import Section
from cmg_mj.papers.sokolov2019 import bearing, closed_loop, equations, figure_3, observer_bias, proposition_1

SECTIONS: list[Section] = [
    Section("the equations", 0.3, equations.claims),
    Section("the observers' bias", 3.0, observer_bias.claims),
    Section("Proposition 1", 3.0, proposition_1.claims),
    Section("Fig. 3", 2.0, figure_3.claims),
    Section("Figs 4 to 6, and the lag", 15.0, closed_loop.claims),
    Section("the thrust bearing", 5.0, bearing.claims),
]

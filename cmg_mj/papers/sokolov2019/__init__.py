"""sokolov2019: one gimbal on a locked thrust bearing, and three velocity estimators."""

from __future__ import annotations

from cmg_mj.papers import plvcc
from cmg_mj.papers.claim import Section, section
from cmg_mj.papers.sokolov2019 import bearing, equations, figure_3, section_5

SECTIONS = [
    section("the equations", 0.1, equations.table_i, equations.equations_of_motion, equations.law_equilibria),
    section("the observers' bias", 1.2, equations.biased_luenberger, equations.homogeneous_vicinity),
    section("Proposition 1", 1.3, lambda: plvcc.claim("sokolov2019")),
    section("Fig. 3", 0.8, figure_3.claims),
    Section("Table II", 12.0, figure_3.tuning_claims),
    section("Figs 4 to 6, and the lag", 12.0, section_5.claims),
    section("the thrust bearing", 3.0, lambda: bearing.claim(bearing.study())),
]

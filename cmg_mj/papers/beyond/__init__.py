"""A step beyond the papers: friction in the observer, the bias fed in, and all observers in one table.

Not part of `reproduce all`: a hundred seeds a cell take some minutes.
"""

from __future__ import annotations

from cmg_mj.papers.beyond import all_observers, fed_bias, friction
from cmg_mj.papers.claim import Section

SECTIONS: list[Section] = [
    Section("friction in the observer", 40.0, friction.claims),
    Section("the bias fed in", 120.0, fed_bias.claims),
    Section("all observers", 1500.0, all_observers.claims),
]

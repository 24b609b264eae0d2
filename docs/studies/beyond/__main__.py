"""Prints the studies that are in no paper.

cd docs/studies && python -m beyond (about ten minutes; docs/beyond.md shows a part of it)
"""

from __future__ import annotations

from beyond import all_observers, fed_bias, friction
from cmg_mj.papers.report import found

for study in (friction, fed_bias, all_observers):
    for claim in study.claims(lambda share: None):
        print(f"## {claim.place}: {claim.verdict}\n\n{claim.statement}\n\n{found(claim)}. {claim.reason}\n")
        if study is all_observers:
            print(all_observers.league_table(claim.figures["rows"]))

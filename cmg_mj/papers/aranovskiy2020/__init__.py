"""aranovskiy2020: the scissored pair and its observers (9), (10) and (11)."""

from __future__ import annotations

from cmg_mj.papers.aranovskiy2020 import (
    gains,
    hypotheses,
    lag,
    linearisation,
    observability,
    optimality,
    plvcc,
    rest,
    riccati,
    rig_loop,
    time_invariant,
    update_cost,
    vicinity,
)
from cmg_mj.papers.claim import Claim, OnShare, Section


def _appendix(on_share: OnShare) -> list[Claim]:
    return [plvcc.claim("aranovskiy2020")]


SECTIONS: list[Section] = [
    Section("constants and linearisation", 0.3, linearisation.run),
    Section("Hypotheses 1 to 3 kept and broken", 8.0, hypotheses.run),
    Section("the law's gains", 0.2, optimality.run),
    Section("where the loop rests", 13.0, rest.run),
    Section("observability", 1.0, observability.run),
    Section("(9), lag and noise", 0.3, lag.run),
    Section("(11), the vicinity", 2.0, vicinity.run),
    Section("Remark 1, the cost of an update", 1.0, update_cost.run),
    Section("Remark 1, the Riccati equation", 2.0, riccati.run),
    Section("Figs 4 to 7", 21.0, rig_loop.run),
    Section("the time-invariant observer", 10.0, time_invariant.run),
    Section("Table 2 tuned again", 31.0, gains.run),
    Section("the appendix", 3.0, _appendix),
]

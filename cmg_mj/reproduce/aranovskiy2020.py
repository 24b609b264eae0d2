"""aranovskiy2020: the scissored pair and its observers (9), (10) and (11)."""

from __future__ import annotations

from cmg_mj.reproduce import gains, hypotheses, linearisation, rest, riccati, rig_loop
from cmg_mj.reproduce.claim import Step

STEPS: list[Step] = [
    Step("constants, linearisation, gains of the law", 1.0, linearisation.run),
    Step("Hypotheses 1 to 3 kept and broken", 6.0, hypotheses.run),
    Step("where the loop rests", 12.0, rest.run),
    Step("observability, Remark 1", 4.0, riccati.run),
    Step("Figs 4 to 7", 19.0, rig_loop.run_figures),
    Step("the time-invariant observer", 8.0, rig_loop.time_invariant),
    Step("Table 2 tuned again", 30.0, gains.run),
]

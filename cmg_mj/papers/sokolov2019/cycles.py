"""Each loop's cycle behind the datasheet's gap, on MuJoCo and by the linear loop's describing function."""

from __future__ import annotations

from typing import NamedTuple

from cmg_mj.papers.sokolov2019.backlash import Cycle, find_cycles, make_release
from cmg_mj.papers.sokolov2019.figure_3 import L1, WITH_Y2, stiffness
from cmg_mj.papers.sokolov2019.gap_prediction import PredictedCycle, predict_cycle
from cmg_mj.papers.sokolov2019.paper import OBSERVERS
from cmg_mj.papers.sokolov2019.rig import experiment


class Cycles(NamedTuple):
    """Releases without noise."""

    ends: dict[str, Cycle]
    """Observer, and (9) with all terms in y2 -> what the loop ends in."""
    predicted: dict[str, PredictedCycle | None]
    """Linear observer -> the same by its describing function."""


def cycles() -> Cycles:
    """Find all cycles."""
    releases = {name: make_release(name) for name in OBSERVERS}
    # (9) but for J2, cos y2 and the sine: see `figure_3.nine_with_y2`.
    nine = {"k1": L1, "k2": stiffness(experiment().plant.reduced), "alpha": 1.0}
    releases[WITH_Y2] = make_release("homogeneous", **nine)
    ends = dict(zip(releases, find_cycles(list(releases.values())), strict=True))
    return Cycles(ends, {name: predict_cycle(name) for name in ("linear", "luenberger")})

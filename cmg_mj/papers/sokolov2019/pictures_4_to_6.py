"""The pictures of Figs 4 to 6."""

from __future__ import annotations

from cmg_mj.papers.recorded import loop_panels, trajectory_of
from cmg_mj.papers.sokolov2019.backlash import GAP_ARCMIN
from cmg_mj.papers.sokolov2019.loops import SHOWN_DEG, Loops
from cmg_mj.papers.sokolov2019.paper import OBSERVERS
from cmg_mj.view.plots.figure import Picture

NUMBERS = {"linear": 4, "luenberger": 5, "homogeneous": 6}


def picture(name: str, loops: Loops) -> Picture:
    """Draw world 0 without backlash and with it, side by side."""
    runs = {
        "without backlash": loops.by_bias[SHOWN_DEG][name],
        f"{GAP_ARCMIN:g} arcmin of backlash": loops.gap[name],
    }
    columns = [
        loop_panels(trajectory_of(result).world(0), name, OBSERVERS[name], title, 0.5) for title, result in runs.items()
    ]
    number = NUMBERS[name]
    title = f"sokolov2019, Fig. {number}: {OBSERVERS[name]} in the loop, a push at 1 s (e = {SHOWN_DEG} deg)"
    return Picture(
        f"sokolov2019-fig-{number}", title, [panel for row in zip(*columns, strict=True) for panel in row], columns=2
    )

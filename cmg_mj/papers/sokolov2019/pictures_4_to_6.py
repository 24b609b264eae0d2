"""The pictures of Figs 4 to 6."""

from __future__ import annotations

import numpy as np

from cmg_mj.papers.recorded import push_intervals, trajectory_of
from cmg_mj.papers.sokolov2019.backlash import GAP_ARCMIN
from cmg_mj.papers.sokolov2019.loops import SHOWN_DEG, Loops
from cmg_mj.papers.sokolov2019.paper import OBSERVERS
from cmg_mj.visualization.plots.figure_spec import Line, Panel, Picture

NUMBERS = {"linear": 4, "luenberger": 5, "homogeneous": 6}


def picture(name: str, loops: Loops) -> Picture:
    """Draw world 0 without backlash and with it, side by side."""
    runs = {
        "without backlash": loops.by_bias[SHOWN_DEG][name],
        f"{GAP_ARCMIN:g} arcmin of backlash": loops.gap[name],
    }
    rows: list[list[Panel]] = [[], [], []]
    for title, result in runs.items():
        example = trajectory_of(result).world(0)
        t, shaded = example["time_s"], push_intervals(example)
        tilt = [
            Line(t, np.degrees(example["y1_rad"]), "measured y1", color=7, width=0.5),
            Line(t, np.degrees(example["x1_rad"]), "true x1", color=0),
        ]
        rates = [
            Line(t, example[f"estimate/{name}/x2_rad_s"], f"estimate of {OBSERVERS[name]}", color=1, width=0.6),
            Line(t, example["x2_rad_s"], "true x2", color=0),
        ]
        rows[0].append(Panel("tilt [deg]", tilt, title, shaded=shaded))
        rows[1].append(Panel("tilt rate [rad/s]", rates, shaded=shaded))
        rows[2].append(
            Panel(
                "command u [rad/s]",
                [Line(t, example["u_rad_s"], "u", color=3, width=0.6)],
                shaded=shaded,
            )
        )
    number = NUMBERS[name]
    title = f"sokolov2019, Fig. {number}: {OBSERVERS[name]} in the loop, a push at 1 s (e = {SHOWN_DEG} deg)"
    return Picture(f"sokolov2019-fig-{number}", title, [panel for row in rows for panel in row], columns=2)

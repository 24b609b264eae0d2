"""Figs 5 to 7 of aranovskiy2020: the loop closed on each of its observers, the law on measured or estimated angles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cmg_mj.papers.aranovskiy2020 import comparison, second_place
from cmg_mj.papers.aranovskiy2020.comparison import AngleSource
from cmg_mj.papers.aranovskiy2020.paper import OBSERVERS
from cmg_mj.papers.aranovskiy2020.rig import DURATION_S, push_recovery
from cmg_mj.papers.assumed import PUSH_RECOVERY
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.recorded import loop_panels, trajectory_of
from cmg_mj.papers.scales import on_common_scales
from cmg_mj.results.intervals import known_interval
from cmg_mj.results.result import Result
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.side_by_side import run_of, run_side_by_side
from cmg_mj.view.plots.figure import Line, Panel, Picture

FIGURES = {"linear": "Fig. 5", "ltv": "Fig. 6", "homogeneous": "Fig. 7"}
ANGLES: tuple[AngleSource, AngleSource] = ("measured", "estimated")
"""The angles that the law is fed with."""
SEED = 72_001
WORLDS = 20


def close_loops(
    observers: Sequence[str], angles: AngleSource, worlds: int, seed: int, duration_s: float = DURATION_S
) -> dict[str, Result]:
    """Close the loop on each observer, a push at 2 s."""
    settings = [f'controller.angle_source="{angles}"']
    runs = [run_of(push_recovery(observer, seed, settings, duration_s), worlds) for observer in observers]
    return dict(zip(observers, run_side_by_side(runs), strict=True))


def figure(name: str, results: Mapping[AngleSource, Result]) -> Claim:
    """Judge one of Figs 5 to 7."""
    error = {angles: known_interval(result.values("velocity_rms_error_rad_s")) for angles, result in results.items()}
    tilt = {angles: known_interval(result.values("tilt_rms_deg")) for angles, result in results.items()}
    falls = {angles: float(result.fell.mean()) for angles, result in results.items()}
    settles = {angles: float(np.isfinite(result.values("settle_time_s")).mean()) for angles, result in results.items()}
    return Claim(
        place=FIGURES[name],
        statement=f"With the estimate of {OBSERVERS[name]} in the law the rig stands, and recovers from a push.",
        assumes=PUSH_RECOVERY,
        holds=max(falls.values()) == 0.0 and min(settles.values()) == 1.0,
        otherwise="It falls in some worlds, or does not settle.",
        figures={
            key: value
            for angles in results
            for key, value in (
                (f"velocity_rms_error_{angles}_angles_rad_s", error[angles]),
                (f"tilt_rms_{angles}_angles_deg", tilt[angles]),
                (f"fell_fraction_{angles}_angles", falls[angles]),
                (f"settled_fraction_{angles}_angles", settles[angles]),
            )
        },
        pictures=[_picture(name, {angles: trajectory_of(result).world(0) for angles, result in results.items()})],
    )


def _picture(name: str, examples: Mapping[AngleSource, Trajectory]) -> Picture:
    """Draw two columns: the law on measured angles, the law on estimated ones."""
    columns = []
    for angles, example in examples.items():
        column = loop_panels(example, name, OBSERVERS[name], f"{angles} angles", 0.6)
        gimbal = [Line(example["time_s"], np.degrees(example["x3_rad"]), "true x3", color=0)]
        column.insert(2, Panel("gimbal angle [deg]", gimbal, shaded=column[0].shaded))
        columns.append(column)
    number = FIGURES[name].removeprefix("Fig. ")
    return Picture(
        f"aranovskiy2020-fig-{number}",
        f"aranovskiy2020, Fig. {number}: the loop closed on {OBSERVERS[name]}, the law on measured and on estimated "
        "angles",
        [panel for row in zip(*columns, strict=True) for panel in row],
        columns=2,
    )


def claims(on_share: OnShare) -> list[Claim]:
    """Judge the three figures, and what Section V concludes from the same runs."""
    results: dict[AngleSource, dict[str, Result]] = {}
    for i, angles in enumerate(ANGLES):
        results[angles] = close_loops(list(OBSERVERS), angles, WORLDS, SEED)
        on_share((i + 1) / 3.0)
    exact = {
        second_place.TEN: results["measured"]["ltv"].values("velocity_rms_error_rad_s"),
        second_place.ELEVEN: results["measured"]["homogeneous"].values("velocity_rms_error_rad_s"),
    }
    errors = second_place.all_errors(exact, WORLDS, SEED)
    return [
        *on_common_scales([figure(name, {angles: results[angles][name] for angles in ANGLES}) for name in FIGURES]),
        *comparison.orders(comparison.read_measures(results)),
        second_place.cause(errors),
    ]

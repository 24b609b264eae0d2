"""Fig. 4 of aranovskiy2020: the three observers in open loop while the gyro closes the loop."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from cmg_mj.features.tuning.simulations import window_of
from cmg_mj.papers.aranovskiy2020.paper import OBSERVERS
from cmg_mj.papers.assumed import PUSH_RECOVERY
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.recorded import push_intervals, rms, trajectory_of
from cmg_mj.papers.words import join_with_and
from cmg_mj.results.intervals import Interval, mean_interval
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.view.plots.figure import Line, Panel, Picture

SEED = 72_000
WORLDS = 20
COMPARABLE = 1.5
"""Errors within this factor count as comparable."""


class OpenLoopRuns(NamedTuple):
    """The observers open loop, on one motion."""

    whole: dict[str, np.ndarray]
    """RMS of the estimated rate less the gyro's over the whole run, (n_worlds,) [rad/s]; `zero`: of zero."""
    after_push: dict[str, np.ndarray]
    """Errors from the push to one second after its end."""
    example: Trajectory
    """World 0."""


def run_open_loop(worlds: int, seed: int) -> OpenLoopRuns:
    """Run the tuning experiment with the three observers in open loop."""
    scenario = load_scenario(
        "observer_tuning", [f"seed={seed}", 'open_loop_observers=["ltv", "homogeneous"]'], "linear"
    )
    whole = trajectory_of(prepare(scenario).run_many(worlds))
    window = whole.between(*window_of(scenario))

    def errors(trajectory: Trajectory) -> dict[str, np.ndarray]:
        gyro = trajectory["fog_rad_s"]
        rms_errors = {name: rms(trajectory[f"estimate/{name}/x2_rad_s"] - gyro) for name in OBSERVERS}
        return rms_errors | {"zero": rms(gyro)}

    return OpenLoopRuns(errors(whole), errors(window), whole.world(0))


def largest_by_smallest(errors: Mapping[str, Interval]) -> float:
    """Return the largest of the three observers' errors by the smallest."""
    means = [errors[name].mean for name in OBSERVERS]
    return max(means) / min(means)


def figure_4(worlds: int = WORLDS, seed: int = SEED) -> list[Claim]:
    """Judge whether the three are comparable: from the push to a second after it, and over the whole run.

    Most of the whole run is stillness, where they are judged by their noise: there zero is closer than any.
    """
    runs = run_open_loop(worlds, seed)
    return [
        _comparable("from the push to a second after it", runs.after_push, "_after_push", [_picture(runs.example)]),
        _comparable("over all 10 s", runs.whole, "", []),
    ]


def _comparable(span: str, rms_errors: Mapping[str, np.ndarray], suffix: str, pictures: list[Picture]) -> Claim:
    """Judge one span of the run."""
    errors = {name: mean_interval(values) for name, values in rms_errors.items()}
    spread = largest_by_smallest(errors)
    return Claim(
        place=f"Fig. 4, {span}",
        statement="With the loop closed on the gyro and a push at 2 s, the three tuned observers are comparable open "
        "loop.",
        assumes={**PUSH_RECOVERY, "threshold": f"comparable is within a factor of {COMPARABLE:g}"},
        missing_data="The paper gives neither this recording, with its push, e and noise, nor a limit for comparable.",
        holds=spread < COMPARABLE,
        conditions=_zero_sentence(errors),
        otherwise=(
            "With ours they are not. (10) and (11) know the command but not the push, and take the command's effect "
            f"for a rate. {_zero_sentence(errors)}"
        ),
        figures={
            **{f"rms{suffix}_{name}_rad_s": interval for name, interval in errors.items()},
            f"largest_by_smallest{suffix}": spread,
        },
        pictures=pictures,
    )


def _find_beaten(errors: Mapping[str, Interval]) -> list[str]:
    """Return the equations that an estimate of zero is closer than."""
    return [equation for name, equation in OBSERVERS.items() if errors[name].mean > errors["zero"].mean]


def _describe_zero(errors: Mapping[str, Interval]) -> str:
    beaten = _find_beaten(errors)
    return f"an estimate of zero is closer than {join_with_and(beaten)}" if beaten else "all are closer than zero"


def _zero_sentence(errors: Mapping[str, Interval]) -> str:
    sentence = _describe_zero(errors)
    return f"{sentence[0].upper()}{sentence[1:]}."


def _picture(example: Trajectory) -> Picture:
    t, shaded = example["time_s"], push_intervals(example)
    panels = [
        Panel("tilt y1 [deg]", [Line(t, np.degrees(example["y1_rad"]), "measured", width=0.7)], "(a)", shaded=shaded),
        Panel("command u [rad/s]", [Line(t, example["u_rad_s"], "u", color=3, width=0.7)], shaded=shaded),
    ]
    for i, (name, equation) in enumerate(OBSERVERS.items()):
        lines = [
            Line(t, example[f"estimate/{name}/x2_rad_s"], f"{equation} {name}", color=name, width=0.7),
            Line(t, example["fog_rad_s"], "gyro", "k-", width=1.0),
        ]
        panels.append(Panel("tilt rate [rad/s]", lines, "(b)" if i == 0 else "", shaded=shaded, y_range=(-0.5, 0.45)))
    return Picture(
        "aranovskiy2020-fig-4", "aranovskiy2020, Fig. 4: tuning, the law fed by the gyro, a push at 2 s", panels
    )


def claims(on_share: OnShare) -> list[Claim]:
    """Judge Fig. 4."""
    return figure_4()

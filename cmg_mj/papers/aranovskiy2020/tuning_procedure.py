"""Section V's tuning: does a fit to the gyro make observers that follow it, and is it a fit for the loop?"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from cmg_mj.papers.aranovskiy2020.joint import JointExperiment, experiments, list_experiments
from cmg_mj.papers.aranovskiy2020.paper import OBSERVERS
from cmg_mj.papers.aranovskiy2020.retuned import CASES, DEFAULT_NOISE, PUSHES, SEED, STRONG, Studies, loop_ratios
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.words import join_with_and
from cmg_mj.results.intervals import Interval

LOOP_WORLDS = 10
LOOP_SHARE = 0.1
"""Share of the section's time that the closed loops take."""


class Trial(NamedTuple):
    """One experiment in which the three were tuned, and what the tuned do in the loop."""

    experiment: JointExperiment
    loop: Mapping[str, Interval]
    """Observer -> error in the closed loop, Table 2's by that of the tuned, under the same push and noise."""

    @property
    def worse_than_zero(self) -> list[str]:
        """The equations that an estimate of zero is closer than, tuned."""
        levels = self.experiment.levels.items()
        return [OBSERVERS[name] for name, level in levels if level.rms.mean() >= level.zero_rms]

    @property
    def worse_in_loop(self) -> list[str]:
        """The equations that the tuning makes worse in the loop, beyond chance; a world that fell counts."""
        return [OBSERVERS[name] for name, ratio in self.loop.items() if not ratio.high >= 1.0]


def run_trials(studies: Studies, joint: JointExperiment, on_share: OnShare) -> list[Trial]:
    """Close the loop on the tuned and on Table 2's: at the default noise and push, and in the joint experiment."""
    default = next(
        trial for trial in experiments(studies) if trial.push == STRONG.words and trial.noise_ug_rthz == DEFAULT_NOISE
    )
    trials, selection = [], [default] + [joint] * (joint.words != default.words)
    for i, trial in enumerate(selection):
        push = next(push for push in PUSHES if push.words == trial.push)
        loops = loop_ratios([(case, trial.levels[case.observer], push) for case in CASES], LOOP_WORLDS, SEED + 1)
        trials.append(Trial(trial, dict(zip((case.observer for case in CASES), loops, strict=True))))
        on_share((i + 1) / len(selection))
    return trials


def procedure_claim(studies: Studies, loops: list[Trial]) -> Claim:
    """Judge the procedure by its trials, the default experiment first."""
    ratios = [
        float(level.rms.mean()) / level.fit_rms
        for by_name in studies.values()
        for study in by_name.values()
        for level in study.levels
    ]
    candidates = list(experiments(studies))
    tunable = [experiment for experiment in candidates if experiment.beats_zero]
    return Claim(
        place="Section V, tuning",
        statement="Fitting an observer to the gyro's rate, recorded with the loop closed on the gyro and a push, tunes "
        "it.",
        assumes={
            "push": f"{join_with_and(list(studies))}",
            "noise": f"{min(e.noise_ug_rthz for e in candidates):g} to {max(e.noise_ug_rthz for e in candidates):g} "
            "ug/rtHz",
        },
        holds=bool(tunable),
        conditions=(
            f"In {len(tunable)} of the {len(candidates)} experiments tried: there all three, tuned, follow the gyro "
            f"better than an estimate of zero. These are {list_experiments(tunable) if tunable else 'none'}. "
            f"{_describe_zero(loops)}{_describe_losses(loops)}"
        ),
        otherwise="In none of the experiments tried do all three, tuned, follow the gyro better than zero does.",
        figures={
            "held_out_by_fitted_error_largest": max(ratios),
            **{
                trial.experiment.words: {
                    "fitted_error_rad_s": {n: level.fit_rms for n, level in trial.experiment.levels.items()},
                    "held_out_error_rad_s": {n: float(v.rms.mean()) for n, v in trial.experiment.levels.items()},
                    "table_2_error_rad_s": {n: float(v.given_rms.mean()) for n, v in trial.experiment.levels.items()},
                    "zero_estimate_error_rad_s": {n: level.zero_rms for n, level in trial.experiment.levels.items()},
                    "in_the_loop_table_2_by_tuned_error": dict(trial.loop),
                }
                for trial in loops
            },
        },
    )


def _describe_zero(loops: list[Trial]) -> str:
    """Name the experiments, of those whose loop was closed, in which an estimate of zero beats the tuned."""
    return "".join(
        f"At {trial.experiment.words} zero is closer than {join_with_and(trial.worse_than_zero)} at their best, which "
        "know the command, but not the push. "
        for trial in loops
        if trial.worse_than_zero
    )


def _describe_losses(loops: list[Trial]) -> str:
    """Name the experiments in which a fit to the gyro is none for the loop."""
    parts = [
        f"{join_with_and(trial.worse_in_loop)} at {trial.experiment.words}" for trial in loops if trial.worse_in_loop
    ]
    if not parts:
        return "In the loop no tuned observer is worse than Table 2's."
    return f"This fit does not suit the loop. There the tuned are worse than Table 2's for {'; '.join(parts)}."

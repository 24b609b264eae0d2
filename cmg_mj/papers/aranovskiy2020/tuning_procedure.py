"""Section V's tuning: does a fit to the gyro make observers that follow it, and is it a fit for the loop?"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from cmg_mj.papers.aranovskiy2020.joint import Together, experiments, listed
from cmg_mj.papers.aranovskiy2020.paper import OBSERVERS
from cmg_mj.papers.aranovskiy2020.retuned import CASES, DEFAULT_NOISE, PUSHES, SEED, STRONG, Studies, in_the_loop
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.words import listed_and
from cmg_mj.results.intervals import Interval

LOOP_WORLDS = 10
LOOP_SHARE = 0.1
"""Of the time that the section takes, the closed loops'."""


class Tried(NamedTuple):
    """One experiment in which the three were tuned, and what the tuned do in the loop."""

    together: Together
    loop: Mapping[str, Interval]
    """Observer -> error in the closed loop, Table 2's by that of the tuned, under the same push and noise."""

    @property
    def beaten(self) -> list[str]:
        """The equations that an estimate of zero is closer than, tuned."""
        levels = self.together.levels.items()
        return [OBSERVERS[name] for name, level in levels if level.rms.mean() >= level.zero_rms]

    @property
    def worse(self) -> list[str]:
        """The equations that the tuning makes worse in the loop, beyond chance; a world that fell counts."""
        return [OBSERVERS[name] for name, ratio in self.loop.items() if not ratio.high >= 1.0]


def loops_of(studies: Studies, together: Together, on_share: OnShare) -> list[Tried]:
    """Close the loop on the tuned and on Table 2's: at the default noise and push, and in the joint experiment."""
    default = next(
        tried for tried in experiments(studies) if tried.push == STRONG.words and tried.noise_ug_rthz == DEFAULT_NOISE
    )
    found, chosen = [], [default] + [together] * (together.words != default.words)
    for i, tried in enumerate(chosen):
        push = next(push for push in PUSHES if push.words == tried.push)
        loops = in_the_loop([(case, tried.levels[case.observer], push) for case in CASES], LOOP_WORLDS, SEED + 1)
        found.append(Tried(tried, dict(zip((case.observer for case in CASES), loops, strict=True))))
        on_share((i + 1) / len(chosen))
    return found


def procedure_claim(studies: Studies, loops: list[Tried]) -> Claim:
    """The procedure.

    Args:
        studies: Of all three, under every push.
        loops: The experiments that are judged, the default one first.

    Returns:
        The claim.
    """
    carried = [
        float(level.rms.mean()) / level.fit_rms
        for by_name in studies.values()
        for study in by_name.values()
        for level in study.levels
    ]
    tried = list(experiments(studies))
    good = [together for together in tried if together.worth_it]
    return Claim(
        place="Section V, tuning",
        says="Fitting an observer to the gyro's rate, recorded with the loop closed on the gyro and a push, tunes it.",
        found=(
            f"{' '.join(_in_words(each) for each in loops)} Over {len(carried)} fits the error on other seeds is "
            f"{min(carried):.3f} to {max(carried):.3f} times that on the fitted ones."
        ),
        holds=bool(good),
        conditions=(
            f"In {len(good)} of the {len(tried)} experiments tried: there all three, tuned, follow the gyro better "
            f"than an estimate of zero. These are {listed(good) if good else 'none'}. {_zero(loops)}{_worse(loops)}"
        ),
        otherwise="In none of the experiments tried do all three, tuned, follow the gyro better than zero does.",
        figures={
            "held_out_by_fitted_error_largest": max(carried),
            **{
                each.together.words: {
                    "fitted_error_rad_s": {n: level.fit_rms for n, level in each.together.levels.items()},
                    "held_out_error_rad_s": {n: float(v.rms.mean()) for n, v in each.together.levels.items()},
                    "table_2_error_rad_s": {n: float(v.given_rms.mean()) for n, v in each.together.levels.items()},
                    "zero_estimate_error_rad_s": {n: level.zero_rms for n, level in each.together.levels.items()},
                    "in_the_loop_table_2_by_tuned_error": dict(each.loop),
                }
                for each in loops
            },
        },
    )


def _in_words(tried: Tried) -> str:
    levels = tried.together.levels
    tuned = ", ".join(f"{OBSERVERS[name]} {level.rms.mean():.4f}" for name, level in levels.items())
    zero = next(iter(levels.values())).zero_rms
    loop = ", ".join(
        f"{OBSERVERS[name]} {ratio.mean:.3f} ({ratio.low:.3f} to {ratio.high:.3f})"
        for name, ratio in tried.loop.items()
    )
    return (
        f"At {tried.together.words} the tuned are off the gyro by {tuned} rad/s RMS, an estimate of zero by "
        f"{zero:.4f}. In the loop under the same push and noise Table 2's error by that of the tuned is {loop}."
    )


def _zero(loops: list[Tried]) -> str:
    """Where an estimate of zero does better than the tuned, of the experiments whose loop was closed."""
    return "".join(
        f"At {each.together.words} zero is closer than {listed_and(each.beaten)} at their best, which know the "
        "command, but not the push. "
        for each in loops
        if each.beaten
    )


def _worse(loops: list[Tried]) -> str:
    """What a fit to the gyro is not."""
    parts = [f"{listed_and(each.worse)} at {each.together.words}" for each in loops if each.worse]
    if not parts:
        return "In the loop no tuned observer is worse than Table 2's."
    return f"It is no fit for the loop: there the tuned are worse than Table 2's for {'; '.join(parts)}."

"""Table 2 of aranovskiy2020: the one experiment, of those tried, that all three lines could come from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from cmg_mj.features.tuning import NoiseLevelResult
from cmg_mj.papers.aranovskiy2020.paper import OBSERVERS
from cmg_mj.papers.aranovskiy2020.retuned import DEFAULT_NOISE, Studies, beats_zero, level_at
from cmg_mj.papers.claim import Assumption, Claim
from cmg_mj.papers.words import join_with_and
from cmg_mj.view.plots.figure import Line, Panel, Picture

ROUNDED = 1.05
"""The cost of printing a parameter to one digit: tau = 0.02 stands for 0.015 to 0.025."""


UNRECORDED = "The paper gives neither the recording that its observers were tuned on, nor its push, e and noise."


def is_best(level: NoiseLevelResult) -> bool:
    """Return true if the given parameters are the best ones: a tie with the tuned, or as near as rounding."""
    return level.verdict == "tie" or level.ratio.mean <= ROUNDED


class JointExperiment(NamedTuple):
    """The three observers in one experiment: one push on one rig, recorded at one noise."""

    push: str
    noise_ug_rthz: float
    levels: Mapping[str, NoiseLevelResult]
    """Observer -> what came out."""

    @property
    def words(self) -> str:
        """The experiment."""
        return f"{self.push}, {self.noise_ug_rthz:g} ug/rtHz"

    @property
    def largest_ratio(self) -> float:
        """Table 2's error by that of the tuned, of the observer of which it is largest."""
        return max(level.ratio.mean for level in self.levels.values())

    @property
    def beats_zero(self) -> bool:
        """True if all three, tuned, are closer to the gyro than zero: nobody tunes where the best is not to move."""
        return all(beats_zero(level) for level in self.levels.values())

    @property
    def best_observers(self) -> list[str]:
        """The observers whose given parameters are the best ones."""
        return [name for name, level in self.levels.items() if is_best(level)]


def assumed(experiment: JointExperiment) -> dict[Assumption, str]:
    """Name the push, with its e, and the noise of an experiment as assumptions."""
    return {
        "push": experiment.push,
        "noise": f"{experiment.noise_ug_rthz:g} ug/rtHz (the bench's own is {DEFAULT_NOISE:g})",
    }


def experiments(studies: Studies) -> Iterator[JointExperiment]:
    """Generate all experiments that were tried."""
    for push, by_name in studies.items():
        for level in by_name["linear"].levels:
            noise = level.noise_ug_rthz
            yield JointExperiment(push, noise, {name: level_at(study, noise) for name, study in by_name.items()})


def list_experiments(joint_experiments: Sequence[JointExperiment]) -> str:
    """List experiments push by push: `1 N m, e = 0.5 deg at 100, 200; 0.3 N m, e = 0 at 100 ug/rtHz`."""
    noises: dict[str, list[str]] = {}
    for experiment in joint_experiments:
        noises.setdefault(experiment.push, []).append(f"{experiment.noise_ug_rthz:g}")
    return "; ".join(f"{push} at {', '.join(densities)}" for push, densities in noises.items()) + " ug/rtHz"


def nearest_joint(studies: Studies) -> JointExperiment:
    """Return the experiment at which the worst of the three loses least, of those worth tuning in if there are any."""
    candidates = list(experiments(studies))
    return min([case for case in candidates if case.beats_zero] or candidates, key=lambda case: case.largest_ratio)


def joint_claim(studies: Studies) -> Claim:
    """Judge whether one experiment has all three lines of Table 2."""
    nearest, candidates = nearest_joint(studies), list(experiments(studies))
    tunable = [experiment for experiment in candidates if experiment.beats_zero]
    misfits = [OBSERVERS[name] for name in nearest.levels if name not in nearest.best_observers]
    return Claim(
        place="Table 2, the three together",
        statement="The three observers were tuned on the same collected data: Fig. 4's one experiment.",
        assumes=assumed(nearest),
        missing_data=UNRECORDED,
        holds=nearest.beats_zero and not misfits,
        otherwise=(
            f"No experiment tried has all three: where the worst loses least, {join_with_and(misfits)} is not the best."
            if misfits
            else "Where all three are the best, an estimate of zero is better still."
        ),
        figures={
            "experiment": nearest.words,
            "worst_table_2_by_tuned_error": {experiment.words: experiment.largest_ratio for experiment in candidates},
            "worth_tuning_in": [experiment.words for experiment in tunable],
        },
        pictures=[_picture(studies)],
    )


def _picture(studies: Studies) -> Picture:
    panels = []
    for push, by_name in studies.items():
        lines = []
        for color, (name, study) in enumerate(by_name.items(), 1):
            noise = [level.noise_ug_rthz for level in study.levels]
            means, spread = ([getattr(level.ratio, part) for level in study.levels] for part in ("mean", "half"))
            lines.append(Line(noise, means, "" if panels else OBSERVERS[name], "o-", color, spread=spread))
        x = "accelerometer noise density [ug/rtHz]"
        label = "error of Table 2's\nby that of the tuned"
        panels.append(Panel(label, lines, push, x, "log", y_range=(0.9, 3.0)))
    return Picture(
        "aranovskiy2020-table-2",
        "aranovskiy2020, Table 2: the observers tuned again, on held-out seeds; 1 where Table 2's are the best",
        panels,
    )

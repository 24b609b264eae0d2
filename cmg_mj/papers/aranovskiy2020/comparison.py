"""Section V of aranovskiy2020: which observer is best in the loop, by which measure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple

import numpy as np

from cmg_mj.papers.aranovskiy2020.paper import OBSERVERS
from cmg_mj.papers.assumed import PUSH_RECOVERY
from cmg_mj.papers.claim import Claim
from cmg_mj.papers.words import join_with_and
from cmg_mj.results.intervals import Interval, known_interval
from cmg_mj.results.result import Result
from cmg_mj.results.summary_keys import KEYS
from cmg_mj.view.plots.figure import Line, Panel, Picture

Numbers = Mapping[str, np.ndarray]
"""Observer -> a measure in the loop, (n_worlds,); NaN for a world that did not stand. Less is better."""

AngleSource = Literal["measured", "estimated"]
"""The angles that the law is fed with."""

Order = Literal["holds", "is inverted", "does not hold"]

PAIRS = (("ltv", "homogeneous"), ("linear", "ltv"))
"""The worse and the better of Section V's ranking."""
JUDGED = "velocity_rms_error_rad_s"
"""The measure of the paper's subject, velocity observers: the first."""
MEASURES = (JUDGED, "velocity_rms_error_push_rad_s", "tilt_rms_deg", "command_rms_rad_s")
"""Summary keys that an observer could be better by; the paper names none."""


def differences(numbers: Numbers) -> list[Interval | None]:
    """Subtract the better's numbers from the worse's, world by world, for each of `PAIRS`."""
    return [known_interval(numbers[worse] - numbers[better]) for worse, better in PAIRS]


def judge_order(numbers: Numbers) -> Order:
    """Judge the order homogeneous < ltv < linear: it holds beyond chance, is inverted, or neither."""
    steps = differences(numbers)
    if all(step is not None and step.low > 0.0 for step in steps):
        return "holds"
    if all(step is not None and step.high < 0.0 for step in steps):
        return "is inverted"
    return "does not hold"


class Measure(NamedTuple):
    """One measure, with the law on either kind of angles."""

    key: str
    numbers: Mapping[AngleSource, Numbers]
    """Angle source -> observer -> numbers."""

    @property
    def orders(self) -> dict[AngleSource, Order]:
        """Angle source -> the order."""
        return {angles: judge_order(numbers) for angles, numbers in self.numbers.items()}

    @property
    def best_observers(self) -> dict[AngleSource, str]:
        """Angle source -> the observer with the least mean over the worlds that stood."""
        return {
            angles: min(numbers, key=lambda name: float(np.nanmean(numbers[name])))
            for angles, numbers in self.numbers.items()
        }

    def has_order(self, order: Order) -> bool:
        """Return true if the order is this one on all angles."""
        return set(self.orders.values()) == {order}


def read_measures(results: Mapping[AngleSource, Mapping[str, Result]]) -> list[Measure]:
    """Read the measures off the runs: angle source -> observer -> runs."""
    return [
        Measure(
            key,
            {
                angles: {name: result.values(key) for name, result in by_name.items()}
                for angles, by_name in results.items()
            },
        )
        for key in MEASURES
    ]


def orders(measures: list[Measure]) -> list[Claim]:
    """Judge Section V's ranking by each measure, that of `JUDGED` first; the picture is the first one's."""
    return [_order(measure, [] if i else [_picture(measures)]) for i, measure in enumerate(measures)]


def _order(measure: Measure, pictures: list[Picture]) -> Claim:
    label = KEYS[measure.key].label
    turns = (
        "At low noise or large bias the order turns round, because (11) mistakes the bias for a rate most: the map "
        "over noise and bias is in docs/results.md."
    )
    return Claim(
        place=f"Section V, the comparison: {label}",
        statement="The homogeneous differentiator performs best, the time-varying observer second, the linear one "
        f"last; judged by the {label}.",
        assumes=PUSH_RECOVERY,
        holds={f"{angles} angles": order == "holds" for angles, order in measure.orders.items()},
        conditions=turns if measure.key == JUDGED else "",
        otherwise=_in_which_order(measure) + (f" {turns}" if measure.key == JUDGED else ""),
        figures={
            f"{worse}_less_{better}_{angles}_angles_{measure.key}": step
            for angles, numbers in measure.numbers.items()
            for (worse, better), step in zip(PAIRS, differences(numbers), strict=True)
        },
        pictures=pictures,
    )


def _in_which_order(measure: Measure) -> str:
    """Say how the order is not the ranking's."""
    if measure.has_order("is inverted"):
        return "It is inverted: (9), (10), (11)."
    best_equations = join_with_and(sorted({OBSERVERS[name] for name in measure.best_observers.values()}))
    return f"The best is {best_equations}."


def _picture(measures: list[Measure]) -> Picture:
    panels = []
    for i, measure in enumerate(measures):
        most = max(float(np.nanmax(values)) for numbers in measure.numbers.values() for values in numbers.values())
        for angles, numbers in measure.numbers.items():
            marks = [
                Line(np.arange(len(numbers[name])), numbers[name], "" if i else equation, "o", color=name)
                for name, equation in OBSERVERS.items()
            ]
            label = KEYS[measure.key].heading.replace(" RMS", "\nRMS")
            panels.append(Panel(label, marks, "" if i else f"{angles} angles", "world", y_range=(0.0, 1.05 * most)))
    return Picture(
        "aranovskiy2020-section-5",
        "aranovskiy2020, Section V: measures of the closed loop, world by world",
        panels,
        columns=len(next(iter(measures)).numbers),
    )

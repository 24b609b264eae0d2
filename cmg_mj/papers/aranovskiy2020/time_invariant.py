"""The time-invariant observer with which the rig of aranovskiy2020 could not be stabilised: which gain, which model."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from cmg_mj.papers.aranovskiy2020.paper import printed_model, settled_gains
from cmg_mj.papers.aranovskiy2020.rig import DURATION_S, push_recovery
from cmg_mj.papers.assumed import PUSH_RECOVERY
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.words import join_with_and
from cmg_mj.runs.side_by_side import BatchJob, run_side_by_side
from cmg_mj.view.plots.figure import Line, Panel, Picture

SEED = 72_002
WORLDS = 5
"""Seeds a bias."""
BIASES_DEG = (0.0, 0.25, 0.5, 1.0)
JUDGED_DEG = 0.5
"""The bias of Figs 5 to 7, where (10) itself must stand and the time-invariant observer fall."""


class Gain(NamedTuple):
    """Gain on e = x1 - y1: x1' has -l1 e, x2' has -l2 e, so the error's poles without gravity are s^2 + l1 s + l2."""

    l1: float
    l2: float

    @property
    def speed(self) -> float:
        """Distance of the error's poles from 0 [rad/s]."""
        return math.sqrt(self.l2)


def damped_gain(speed: float) -> Gain:
    """Return the gain whose poles lie 45 degrees off the real axis, as those of the frozen Riccati gain do [rad/s]."""
    return Gain(math.sqrt(2.0) * speed, speed**2)


PREDECESSOR, FROZEN = "predecessor's", "frozen"
GAINS: dict[str, Gain] = {
    "slow": damped_gain(10.0),
    PREDECESSOR: Gain(20.0, 150.0),
    "medium": damped_gain(20.0),
    "fast": damped_gain(30.0),
    FROZEN: Gain(*settled_gains()),
}
"""Gains, the slow first. The predecessor's is of its Table II; the Riccati equation settles at the frozen one."""
PRINTED = (PREDECESSOR, FROZEN)
"""The gains that the authors could have run: the verdict goes by them."""

LINEAR, MEASURED = "gravity at the estimate", "gravity at y1"
MODELS = (LINEAR, MEASURED)
"""The linearisation (6), as the predecessor's observer has it, and the model of (10) and (11)."""

WHOLE = "(10)"

Cell = tuple[str, str]
"""Gain and model."""


class Fate(NamedTuple):
    """The end of the worlds at one bias."""

    fell: float
    """Share that fell."""
    error: float | None
    """Mean velocity RMS error of those that stood [rad/s]; None if none did."""


def find_fates(
    observers: Sequence[tuple[str, Sequence[str]]],
    biases_deg: Sequence[float],
    worlds: int,
    seed: int,
    duration_s: float = DURATION_S,
) -> list[dict[float, Fate]]:
    """Close the loop on observers with their settings at several biases, with the push of Figs 5 to 7.

    Args:
        observers: Names and settings.
        biases_deg: The biases e [deg].
        worlds: Worlds a bias, the same ones at each and for every observer.
        seed: Seed of the noise.
        duration_s: Simulated time [s].

    Returns:
        For each of them what became of the worlds at each bias.
    """
    biases = {"equilibrium_bias_deg": [e for e in biases_deg for _ in range(worlds)]}
    numbers = [*range(worlds)] * len(biases_deg)
    experiments = [push_recovery(observer, seed, settings, duration_s) for observer, settings in observers]
    results = run_side_by_side(
        [BatchJob(experiment.with_varied(biases), numbers) for experiment in experiments], keep_trajectory=False
    )
    return [
        {
            e: Fate(float(group.fell.mean()), group.mean("velocity_rms_error_rad_s"))
            for e, group in zip(biases_deg, result.split(len(biases_deg)), strict=True)
        }
        for result in results
    ]


def choose_observer(cell: Cell) -> tuple[str, list[str]]:
    """Return the observer with that gain and model, and its settings.

    With alpha = 1, (11) is the first two states of (10) with a constant gain.
    """
    (l1, l2), model = GAINS[cell[0]], cell[1]
    if model == LINEAR:
        return "luenberger", [f"observer.L=[[{l1}, 0.0], [{l2}, 0.0], [0.0, 20.0]]"]
    return "homogeneous", [f"observer.k1={l1}", f"observer.k2={l2}", "observer.alpha=1"]


def rate_bias(cell: Cell) -> float:
    """Return the bias of the rate estimated at rest, per radian of e, in closed form [1/s]."""
    (l1, l2), model = GAINS[cell[0]], printed_model()
    lever = model.gravity_torque / model.J1
    return l1 * lever / (l2 - lever if cell[1] == LINEAR else l2)


class Factorial(NamedTuple):
    """The fates by gain, model and bias, and those of (10)."""

    cells: Mapping[Cell, Mapping[float, Fate]]
    whole: Mapping[float, Fate]

    def falls_at(self, cell: Cell) -> list[float]:
        """Return the biases at which every world of a cell falls [deg]."""
        return [e for e, fate in self.cells[cell].items() if fate.fell == 1.0]

    def stands_everywhere(self, cell: Cell) -> bool:
        """Return true if no world of a cell falls at any bias."""
        return all(fate.fell == 0.0 for fate in self.cells[cell].values())

    @property
    def failing(self) -> list[Cell]:
        """The printed gains' cells that fall, at the bias of Figs 5 to 7, where (10) stands."""
        if self.whole[JUDGED_DEG].fell > 0.0:
            return []
        return [c for c in self.cells if c[0] in PRINTED and self.cells[c][JUDGED_DEG].fell == 1.0]


def remark(experiment: Factorial) -> Claim:
    """Judge the remark, over gain, model and bias."""
    safe_gains = [gain for gain in GAINS if all(experiment.stands_everywhere((gain, model)) for model in MODELS)]
    return Claim(
        place="Section V, the time-invariant observer",
        statement="A linear time-invariant observer, which is a particular case of (10), could not stabilise the rig.",
        assumes={
            "push": PUSH_RECOVERY["push"],
            "e": f"{min(experiment.whole):g} to {max(experiment.whole):g} deg",
            "noise": PUSH_RECOVERY["noise"],
            "gains": ", ".join(GAINS),
        },
        missing_data="The paper gives neither the gain nor the model of its time-invariant observer.",
        holds=bool(experiment.failing),
        conditions=_conditions(experiment, safe_gains),
        otherwise=(
            f"At e = {JUDGED_DEG:g} deg neither the predecessor's gain nor the frozen one of (10) falls in every "
            "world, with either model, where (10) stands."
        ),
        figures={
            "bias_deg": list(experiment.whole),
            **{
                f"{gain}, {model}": {
                    "l1_1_s": GAINS[gain].l1,
                    "l2_1_s2": GAINS[gain].l2,
                    "rate_bias_rad_s_per_rad": rate_bias((gain, model)),
                    "fell_fraction": [fate.fell for fate in fates.values()],
                    "velocity_rms_error_rad_s": [fate.error for fate in fates.values()],
                }
                for (gain, model), fates in experiment.cells.items()
            },
            "fell_fraction (10)": [fate.fell for fate in experiment.whole.values()],
            "velocity_rms_error (10)_rad_s": [fate.error for fate in experiment.whole.values()],
        },
        pictures=[_picture(experiment)],
    )


def _conditions(experiment: Factorial, safe_gains: Sequence[str]) -> str:
    """Name the cells that fall, and say that the constancy of the gain is not the cause."""
    cells = [f"the {gain} gain and {model}" for gain, model in experiment.failing]
    sentences = [f"At e = {JUDGED_DEG:g} deg, with {join_with_and(cells)}." if cells else "Nowhere."]
    if FROZEN in safe_gains:
        sentences.append(
            "A constant gain is not the cause: frozen at the value at which the Riccati equation settles, it stands "
            "with either model at every bias tried."
        )
    sensitive_models = [model for model in MODELS if experiment.falls_at((PREDECESSOR, model))]
    if len(sensitive_models) == 2:
        first = {model: min(experiment.falls_at((PREDECESSOR, model))) for model in MODELS}
        sentences.append(
            f"The cause is a small gain, and then the model: the predecessor's falls from {first[LINEAR]:g} deg "
            f"with {LINEAR}, from {first[MEASURED]:g} deg with {MEASURED}."
        )
    return " ".join(sentences)


def _picture(experiment: Factorial) -> Picture:
    shares, errors = [], []
    for model in MODELS:
        falls, velocities = [], []
        for color, gain in enumerate(GAINS):
            fates = experiment.cells[gain, model]
            known_errors = {e: fate.error for e, fate in fates.items() if fate.error is not None}
            falls.append(Line(list(fates), [100.0 * fate.fell for fate in fates.values()], gain, "o-", color))
            velocities.append(Line(list(known_errors), list(known_errors.values()), style="o-", color=color))
        whole_errors = {e: fate.error for e, fate in experiment.whole.items() if fate.error is not None}
        velocities.append(Line(list(whole_errors), list(whole_errors.values()), WHOLE, "k--"))
        shares.append(Panel("share of falls [%]", falls, y_range=(-5.0, 105.0)))
        label = "velocity\nRMS error [rad/s]"
        errors.append(Panel(label, velocities, "of those that stood", "equilibrium bias e [deg]", y_range=(0.0, 0.2)))
    return Picture(
        "aranovskiy2020-time-invariant",
        "aranovskiy2020, Section V: time-invariant observers, gravity at the estimate (left) and at y1",
        [*shares, *errors],
        columns=2,
    )


def factorial(worlds: int, seed: int, duration_s: float = DURATION_S) -> Factorial:
    """Run every cell, and (10)."""
    cells = [(gain, model) for gain in GAINS for model in MODELS]
    observers = [*(choose_observer(cell) for cell in cells), ("ltv", [])]
    *fates, whole = find_fates(observers, BIASES_DEG, worlds, seed, duration_s)
    return Factorial(dict(zip(cells, fates, strict=True)), whole)


def claims(on_share: OnShare) -> list[Claim]:
    """Judge the remark."""
    return [remark(factorial(WORLDS, SEED))]

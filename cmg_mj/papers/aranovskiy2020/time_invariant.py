"""The time-invariant observer with which the rig could not be stabilised: which gain, which model."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from cmg_mj.papers.aranovskiy2020.paper import printed_model, settled_gains
from cmg_mj.papers.aranovskiy2020.rig import DURATION_S, PUSH_RECOVERY, push_recovery
from cmg_mj.papers.claim import Claim
from cmg_mj.runs.side_by_side import BatchJob, run_jobs
from cmg_mj.view.plots.figure import Line, Panel, Picture

SEED, WORLDS = 72_002, 5
"""Seed, and number of worlds a bias."""
BIASES_DEG = (0.0, 0.25, 0.5, 1.0)
JUDGED_DEG = 0.5
"""The bias of Figs 5 to 7, where (10) itself must stand and the time-invariant observer fall."""


class Gain(NamedTuple):
    """Gain on e = x1 - y1: x1' has -l1 e, x2' has -l2 e, so the error's poles without gravity are s^2 + l1 s + l2."""

    l1: float
    l2: float


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

Cell = tuple[str, str]
"""Gain and model."""


class Fate(NamedTuple):
    """The end of the worlds at one bias."""

    fell: float
    """Share that fell."""
    error: float | None
    """Mean velocity RMS error of those that stood [rad/s]; None if none did."""


Fates = Mapping[float, Fate]
"""Bias e [deg] -> what became of the worlds."""


def find_fates(
    observers: Sequence[tuple[str, Sequence[str]]],
    biases_deg: Sequence[float],
    worlds: int,
    seed: int,
    duration_s: float = DURATION_S,
) -> list[Fates]:
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
    results = run_jobs(
        [BatchJob(experiment.with_varied(biases), numbers) for experiment in experiments], keep_trajectory=False
    )
    return [
        {
            e: Fate(group.fell.mean(), group.mean("velocity_rms_error_rad_s"))
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


def remark() -> Claim:
    """Judge the remark, over gain, model and bias."""
    cells = [(gain, model) for gain in GAINS for model in MODELS]
    observers = [*(choose_observer(cell) for cell in cells), ("ltv", [])]
    *fates, whole = find_fates(observers, BIASES_DEG, WORLDS, SEED)
    return remark_claim(dict(zip(cells, fates, strict=True)), whole)


def remark_claim(cells: Mapping[Cell, Fates], whole: Fates) -> Claim:
    """Judge it by the fates of every cell, and of (10)."""
    falls = any(cells[gain, model][JUDGED_DEG].fell == 1.0 for gain in PRINTED for model in MODELS)
    return Claim(
        place="Section V, the time-invariant observer",
        statement="A linear time-invariant observer, which is a particular case of (10), could not stabilise the rig.",
        assumes={
            "push": PUSH_RECOVERY["push"],
            "e": f"{min(whole):g} to {max(whole):g} deg",
            "noise": PUSH_RECOVERY["noise"],
            "gains": ", ".join(GAINS),
        },
        missing_data="The paper gives neither the gain nor the model of its time-invariant observer.",
        holds=falls and whole[JUDGED_DEG].fell == 0.0,
        conditions="At e = 0.5 deg, with the predecessor's gain and gravity at the estimate. A constant gain is not "
        "the cause: frozen at the value at which the Riccati equation settles, it stands with either model at every "
        "bias tried. The cause is a small gain, and then the model: the predecessor's falls from 0.5 deg with gravity "
        "at the estimate, from 1 deg with gravity at y1.",
        otherwise="At e = 0.5 deg neither the predecessor's gain nor the frozen one of (10) falls in every world, with "
        "either model, where (10) stands.",
        figures={
            "bias_deg": list(whole),
            **{
                f"{gain}, {model}": {
                    "l1_1_s": GAINS[gain].l1,
                    "l2_1_s2": GAINS[gain].l2,
                    "rate_bias_rad_s_per_rad": rate_bias((gain, model)),
                    "fell_fraction": [fate.fell for fate in fates.values()],
                    "velocity_rms_error_rad_s": [fate.error for fate in fates.values()],
                }
                for (gain, model), fates in cells.items()
            },
            "fell_fraction (10)": [fate.fell for fate in whole.values()],
            "velocity_rms_error (10)_rad_s": [fate.error for fate in whole.values()],
        },
        pictures=[_picture(cells, whole)],
    )


def _picture(cells: Mapping[Cell, Fates], whole: Fates) -> Picture:
    def error_line(fates: Fates, label: str = "", style: str = "o-", color: int | None = None) -> Line:
        known = {e: fate.error for e, fate in fates.items() if fate.error is not None}
        return Line(list(known), list(known.values()), label, style, color)

    shares, errors = [], []
    for model in MODELS:
        falls, velocities = [], []
        for color, gain in enumerate(GAINS):
            fates = cells[gain, model]
            falls.append(Line(list(fates), [100.0 * fate.fell for fate in fates.values()], gain, "o-", color))
            velocities.append(error_line(fates, color=color))
        velocities.append(error_line(whole, "(10)", "k--"))
        shares.append(Panel("share of falls [%]", falls, y_range=(-5.0, 105.0)))
        label = "velocity\nRMS error [rad/s]"
        errors.append(Panel(label, velocities, "of those that stood", "equilibrium bias e [deg]", y_range=(0.0, 0.2)))
    return Picture(
        "aranovskiy2020-time-invariant",
        "aranovskiy2020, Section V: time-invariant observers, gravity at the estimate (left) and at y1",
        [*shares, *errors],
        columns=2,
    )

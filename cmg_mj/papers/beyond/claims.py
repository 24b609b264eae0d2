"""A step beyond the papers: the bias fed in, friction in the observer, and all observers in one table.

Not part of `reproduce all`: a hundred seeds a cell take about half an hour.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from cmg_mj.experiment import prepare
from cmg_mj.intervals import Interval, mean_interval
from cmg_mj.papers.beyond.league import league, markdown
from cmg_mj.papers.claim import Claim, OnShare, Section, verdict
from cmg_mj.picture import Line, Panel, Picture
from cmg_mj.scenario import load_scenario

SEED, WORLDS = 90_000, 100
FRICTION_N_M = 0.05
FED_BIASES_DEG = (0.25, 0.5, 1.0, 1.5)
ERROR = "velocity_rms_error_rad_s"


def errors(worlds: int, *settings: str) -> np.ndarray:
    """Velocity RMS error of every world in `push_recovery`, NaN where it fell, (worlds,) [rad/s]."""
    result = prepare(load_scenario("push_recovery", settings)).run_many(worlds, keep_trajectory=False)
    return np.array(
        [s[ERROR] if o.kind == "done" else np.nan for s, o in zip(result.summaries, result.outcomes, strict=True)]
    )


def gain(before: np.ndarray, after: np.ndarray) -> Interval | None:
    """By how much an error shrank, world by world, in those that stood both times; None if there are fewer than two."""
    differences = (before - after)[np.isfinite(before - after)]
    return mean_interval(differences) if len(differences) > 1 else None


def friction(worlds: int, seed: int) -> dict[str, Any]:
    """Dry friction in the plant and in the observer, each with and without the other.

    Returns:
        Mean errors by plant and observer; the gain of the observer's friction model on both plants, and how much of
        the gain on the rig that rubs is not had on the one that does not.
    """
    found = {
        (rubs, knows): errors(
            worlds,
            f"seed={seed}",
            "observer.kind=homogeneous",
            f"plant.tilt_friction_n_m={FRICTION_N_M if rubs else 0.0}",
            f"observer.friction_n_m={FRICTION_N_M if knows else 0.0}",
        )
        for rubs in (False, True)
        for knows in (False, True)
    }
    names = {False: "without", True: "with"}
    figures: dict[str, Any] = {
        f"{names[rubs]}_friction_in_the_plant_{names[knows]}_in_the_observer_rad_s": float(np.nanmean(values))
        for (rubs, knows), values in found.items()
    }
    gains = {rubs: gain(found[rubs, False], found[rubs, True]) for rubs in (False, True)}
    both = (found[True, False] - found[True, True]) - (found[False, False] - found[False, True])
    own = mean_interval(both[np.isfinite(both)])
    for rubs, value in gains.items():
        figures[f"gain_{names[rubs]}_friction_rad_s"] = None if value is None else list(value)
    return figures | {"gain_due_to_friction_rad_s": list(own), "worlds": worlds, "seed": seed}


def friction_claim(on_share: OnShare, worlds: int = WORLDS, seed: int = SEED + 1) -> Claim:
    """What a friction model in the observer brings."""
    f = friction(worlds, seed)
    due, rubbing = f["gain_due_to_friction_rad_s"], f["gain_with_friction_rad_s"]
    smooth = f["gain_without_friction_rad_s"]
    return Claim(
        place="Future work of both papers: friction in the observer",
        says="a friction model in the velocity estimator would reduce its modelling errors",
        found=(
            f"On a rig with {FRICTION_N_M:g} N m of dry friction on the tilt axis the same friction in (11) takes "
            f"{_milli(rubbing)} off the velocity RMS error "
            f"({f['with_friction_in_the_plant_without_in_the_observer_rad_s']:.4f} to "
            f"{f['with_friction_in_the_plant_with_in_the_observer_rad_s']:.4f} rad/s). But on a rig without it, it "
            f"takes {_milli(smooth)} off as well: it also damps the estimate of a rate whose true value is small. What "
            f"is due to knowing the friction is the difference, {_milli(due)}."
        ),
        verdict=verdict(due[1] > 0.0, "conditions"),
        why="most of the gain is damping that would help without any friction; push_recovery, e = 0.5 deg, 400 ug/rtHz",
        figures=f,
    )


def fed_bias(worlds: int, seed: int, on_share: OnShare) -> list[dict[str, Any]]:
    """(11) alone, `adaptive` alone, and (11) told the bias by `adaptive`, at several biases."""
    kinds = ("homogeneous", "adaptive", "homogeneous_adaptive")
    rows = []
    for i, bias in enumerate(FED_BIASES_DEG):
        found = {
            kind: errors(worlds, f"seed={seed}", f"observer.kind={kind}", f"plant.equilibrium_bias_deg={bias}")
            for kind in kinds
        }
        row: dict[str, Any] = {"bias_deg": bias, "worlds": worlds, "seed": seed}
        for kind, values in found.items():
            stood = values[np.isfinite(values)]
            row[f"{kind}_rad_s"] = list(mean_interval(stood)) if len(stood) > 1 else None
            row[f"{kind}_fell_fraction"] = 1.0 - len(stood) / worlds
        better = gain(found["homogeneous"], found["homogeneous_adaptive"])
        row["gain_rad_s"] = None if better is None else list(better)
        rows.append(row)
        on_share((i + 1) / len(FED_BIASES_DEG))
    return rows


def fed_bias_claim(on_share: OnShare, worlds: int = WORLDS, seed: int = SEED + 2) -> Claim:
    """What feeding the estimated bias into (11) brings."""
    rows = fed_bias(worlds, seed, on_share)

    def cell(value: list[float] | None, fell: float) -> str:
        shown = "-" if value is None else f"{1e3 * value[0]:.1f} ± {1e3 * (value[2] - value[0]):.1f}"
        return shown + (f" [{fell:.0%} fell]" if fell else "")

    kinds = ("homogeneous", "adaptive", "homogeneous_adaptive")
    lines = ["| e [deg] | " + " | ".join(f"`{kind}` [1e-3 rad/s]" for kind in kinds) + " |", "|---|---:|---:|---:|"]
    for row in rows:
        cells = (cell(row[f"{kind}_rad_s"], row[f"{kind}_fell_fraction"]) for kind in kinds)
        lines.append(f"| {row['bias_deg']:g} | " + " | ".join(cells) + " |")
    helped = [
        row["bias_deg"]
        for row in rows
        if (row["gain_rad_s"] is not None and row["gain_rad_s"][1] > 0.0)
        or (row["homogeneous_adaptive_fell_fraction"] < row["homogeneous_fell_fraction"])
    ]
    means = [
        Line(
            [row["bias_deg"] for row in rows if row[f"{kind}_rad_s"]],
            [row[f"{kind}_rad_s"][0] for row in rows if row[f"{kind}_rad_s"]],
            kind,
            "o-",
            spread=[row[f"{kind}_rad_s"][2] - row[f"{kind}_rad_s"][0] for row in rows if row[f"{kind}_rad_s"]],
        )
        for kind in kinds
    ]
    everywhere = len(helped) == len(rows)
    return Claim(
        place="homogeneous with the bias fed in from adaptive",
        ours=True,
        says="the rate error of (11) that e causes goes when e is estimated beside it",
        found="Velocity RMS error in `push_recovery`, 95 % intervals:\n\n" + "\n".join(lines),
        verdict=verdict(bool(helped), "" if everywhere else "conditions"),
        why="" if everywhere else f"it helps at e = {', '.join(f'{e:g}' for e in helped) or 'no'} deg of those tried",
        figures={"rows": rows},
        pictures=[
            Picture(
                "beyond-fed-bias",
                "The bias fed into (11): velocity RMS error with 95 % intervals",
                [Panel("velocity RMS error [rad/s]", means, x_label="equilibrium bias e [deg]")],
            )
        ],
    )


def league_claim(on_share: OnShare, worlds: int = WORLDS, seed: int = SEED) -> Claim:
    """All observers in one table, and where the papers' order holds in it."""
    rows = league(worlds, seed, on_share)
    cells = dict.fromkeys((row["noise_ug_rthz"], row["bias_deg"]) for row in rows)
    found = {(row["observer"], row["noise_ug_rthz"], row["bias_deg"]): row[ERROR] for row in rows}
    papers = ("homogeneous", "ltv", "linear")

    def ordered(cell: tuple[float, float]) -> bool:
        values = [found[(kind, *cell)] for kind in papers]
        return None not in values and all(a < b for a, b in pairwise(values))

    holds = [cell for cell in cells if ordered(cell)]
    best = {cell: min(_in_cell(rows, cell), key=lambda row: row[ERROR] or np.inf)["observer"] for cell in cells}
    where = ", ".join(f"{noise:g} ug/rtHz and {bias:g} deg" for noise, bias in holds)
    winners = ", ".join(f"`{kind}` {list(best.values()).count(kind)}" for kind in dict.fromkeys(best.values()))
    everywhere = len(holds) == len(cells)
    return Claim(
        place="All observers, three noises, three biases",
        says="aranovskiy2020 section V: homogeneous before ltv before linear; here over a grid, with every observer",
        found=(
            f"{worlds} seeds a cell. The smallest velocity error: {winners} of {len(cells)} cells. The paper's order "
            f"holds at {where or 'none of them'}. The floor is the error of the filter that knows the model, e, the "
            f"push, the gimbals' motion and the noise exactly: none of the observers knows e or the push.\n\n"
            f"{markdown(rows)}"
        ),
        verdict=verdict(bool(holds), "" if everywhere else "conditions"),
        why="" if everywhere else "the order turns round where noise is low or the bias large",
        figures={"rows": rows},
        pictures=[_trade_off(rows)],
    )


def _in_cell(rows: Sequence[dict[str, Any]], cell: tuple[float, float]) -> list[dict[str, Any]]:
    return [row for row in rows if (row["noise_ug_rthz"], row["bias_deg"]) == cell]


def _trade_off(rows: Sequence[dict[str, Any]]) -> Picture:
    """Lag against noise gain, a mark an observer."""
    shown = [row for row in _in_cell(rows, (400.0, 0.5)) if row["push_lag_s"] is not None]
    marks = [Line([1e3 * row["push_lag_s"]], [row["noise_gain_per_s"]], row["observer"], "o") for row in shown]
    panel = Panel("noise gain [1/s]", marks, x_label="lag in a sudden push [ms]", x_scale="log", y_scale="log")
    return Picture("beyond-trade-off", "Every observer trades lag for noise (400 ug/rtHz)", [panel])


def _milli(interval: Sequence[float] | None) -> str:
    if interval is None:
        return "an unknown amount"
    mean, low, high = (1e3 * value for value in interval)
    return f"{mean:.2f}e-3 rad/s (95 %: {low:.2f} to {high:.2f})"


SECTIONS = [
    Section("friction in the observer", 60.0, lambda on_share: [friction_claim(on_share)]),
    Section("the bias fed in", 180.0, lambda on_share: [fed_bias_claim(on_share)]),
    Section("all observers", 1500.0, lambda on_share: [league_claim(on_share)]),
]

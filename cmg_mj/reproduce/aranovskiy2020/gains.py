"""Table 2 of aranovskiy2020 found again: the three observers tuned as Section V does, scored on other seeds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from cmg_mj.intervals import Interval, ratio_interval
from cmg_mj.picture import Line, Panel, Picture
from cmg_mj.reproduce.aranovskiy2020.rig_loop import errors
from cmg_mj.reproduce.claim import Claim, OnShare, verdict
from cmg_mj.scenario import load_scenario, prepare
from cmg_mj.schema import Scenario
from cmg_mj.tuning import Level, Recorded, Study, best_noise, record, tune

SEED = 74_000
WORLDS = 20
DEFAULT_NOISE = 400.0
WARM_UP_S = 0.5
"""Replayed before the window [s]: many times the time constants of the three."""
NEAR = 1.02
"""An error within 2 % of the best one's counts as the best: the table gives one or two digits."""
GENTLE = ["push.0.torque_n_m=0.3", "plant.equilibrium_bias_deg=0.0"]
"""A push of which (11) has less to learn, on a rig without bias."""


@dataclass(frozen=True)
class Tuned:
    """What is tuned of an observer, and at which sensor noises.

    Attributes:
        observer: Its name.
        equation: Its number in the paper.
        parameters: What is tuned of it.
        noise_ug_rthz: Noise densities [ug/sqrt(Hz)].
        printed: Table 2's line.
    """

    observer: str
    equation: str
    parameters: Sequence[str]
    noise_ug_rthz: Sequence[float]
    printed: str


CASES = (
    Tuned("linear", "(9)", ["tau"], (100.0, 200.0, 400.0), "tau = 0.02"),
    Tuned("ltv", "(10)", ["Q[1]"], (200.0, 400.0, 800.0), "Q = diag(1, 5e6, 1)"),
    Tuned("homogeneous", "(11)", ["k1", "k2", "alpha"], (400.0, 1600.0), "[k1, k2, alpha] = [20, 150, 0.85]"),
)


def recorder() -> Callable[..., Recorded]:
    """Recordings of the tuning experiment that are made once and serve every observer."""
    kept: dict[tuple, Recorded] = {}

    def recorded(scenario: Scenario, worlds: range, *, noise_ug_rthz: float, warm_up_s: float) -> Recorded:
        key = (worlds, noise_ug_rthz, scenario.seed, scenario.plant, tuple(scenario.push))
        if key not in kept:
            kept[key] = record(scenario, worlds, noise_ug_rthz=noise_ug_rthz, warm_up_s=warm_up_s)
        return kept[key]

    return recorded


def study_of(
    case: Tuned,
    seed: int,
    worlds: int,
    noise_ug_rthz: Sequence[float] | None = None,
    settings: Sequence[str] = (),
    recorded: Callable[..., Recorded] | None = None,
    on_share: OnShare | None = None,
) -> Study:
    """Tune one observer."""
    return tune(
        load_scenario("observer_tuning", [f"seed={seed}", *settings], case.observer),
        worlds=worlds,
        parameters=case.parameters,
        noise_ug_rthz=case.noise_ug_rthz if noise_ug_rthz is None else noise_ug_rthz,
        warm_up_s=WARM_UP_S,
        starts=1,
        recorded=recorded or recorder(),
        on_share=on_share,
    )


def _sizes(level: Level) -> str:
    return ", ".join(f"{name} = {size:.4g}" for name, size in level.sizes.items())


def _ratio(ratio: Interval) -> str:
    return f"{ratio.mean:.3f} ({ratio.low:.3f} to {ratio.high:.3f})"


def in_the_loop(case: Tuned, level: Level, worlds: int, seed: int) -> Interval:
    """Velocity RMS error in the closed loop, Table 2's by the tuned, world by world, after the push of Figs 5 to 7."""
    settings = [f"seed={seed}", "duration_s=10"]
    given, tuned = (
        prepare(load_scenario("push_recovery", [*settings, *changed], case.observer)).run_many(
            worlds, keep_trajectory=False
        )
        for changed in ([], [f"observer.{name}={size}" for name, size in level.sizes.items()])
    )
    return ratio_interval(*(errors(result) for result in (given, tuned)))


def _claim(case: Tuned, study: Study, gentle: Study | None) -> Claim:
    """Table 2's line of one observer."""
    at_default = next(level for level in study.levels if level.noise_ug_rthz == DEFAULT_NOISE)
    best = best_noise(study)
    found = [
        f"At {DEFAULT_NOISE:g} ug/rtHz, fitted on {study.worlds} seeds, {_sizes(at_default)}; on "
        f"{len(at_default.rms)} other seeds Table 2 has {_ratio(at_default.ratio)} times its error, with the 95 % "
        f"interval; verdict on the tuned: {at_default.verdict}."
    ]
    found.append(
        "By noise [ug/rtHz]: "
        + "; ".join(f"{lv.noise_ug_rthz:g}: {_sizes(lv)}, {_ratio(lv.ratio)}, {lv.verdict}" for lv in study.levels)
        + "."
    )
    if best is not None:
        about = "about " if len(study.numbers) == 1 else "the level "
        found.append(f"Table 2's own gains are the best ones at {about}{best:.0f} ug/rtHz.")
    else:
        found.append("At none of these noises are Table 2's own gains the best ones.")
    gentle_near = False
    loop: Interval | None = None
    if gentle is not None:
        loop = in_the_loop(case, at_default, 10, SEED + 1)
        found.append(
            f"In the closed loop Table 2's gains have {_ratio(loop)} times the error of those tuned at "
            f"{DEFAULT_NOISE:g}: what is best in the second after the push, open loop, need not be best in the loop."
        )
        (level,) = gentle.levels
        gentle_near = level.ratio.mean < NEAR
        found.append(
            f"With a push of 0.3 N m and e = 0 at {level.noise_ug_rthz:g} ug/rtHz: {_sizes(level)}, Table 2 "
            f"{_ratio(level.ratio)} times, {level.verdict}."
        )
    if at_default.ratio.mean < NEAR:
        holds, why = True, ""
    elif best is not None:
        holds, why = True, f"At an accelerometer noise of about {best:.0f} ug/rtHz; the paper does not give its own."
    elif gentle_near:
        holds = True
        why = (
            f"To {NEAR - 1.0:.0%} for a push three times as gentle on a rig without bias; under ours Table 2's gains "
            "are too slow at every noise, and the best exponent is 1, a linear observer."
        )
    else:
        holds, why = False, "No noise tried makes them the best ones."
    return Claim(
        place=f"Table 2, {case.equation}",
        says=f"{case.printed}, tuned to fit the gyro best.",
        found=" ".join(found),
        verdict=verdict(holds, why),
        why=why,
        figures={
            "noise_density_ug_rthz": [lv.noise_ug_rthz for lv in study.levels],
            "tuned": [dict(lv.sizes) for lv in study.levels],
            "table_2_by_tuned_error": [list(lv.ratio) for lv in study.levels],
            "table_2_less_tuned_error_rad_s": [list(lv.gain) for lv in study.levels],
            "tuned_is": [lv.verdict for lv in study.levels],
            "table_2_best_at_noise_density_ug_rthz": best,
            **({"in_the_loop_table_2_by_tuned_error": list(loop)} if loop is not None else {}),
            **({"gentle_table_2_by_tuned_error": list(gentle.levels[0].ratio)} if gentle is not None else {}),
        },
    )


def _picture(studies: dict[str, Study]) -> Picture:
    ratios, values = [], []
    for i, case in enumerate(CASES):
        study = studies[case.observer]
        noise = [level.noise_ug_rthz for level in study.levels]
        spread = [level.ratio.half for level in study.levels]
        means = [level.ratio.mean for level in study.levels]
        ratios.append(Line(noise, means, f"{case.equation} {case.observer}", "o-", color=i + 1, spread=spread))
        for number in study.numbers:
            relative = [level.sizes[number.name] / abs(number.given) for level in study.levels]
            style = {"k2": "s--", "alpha": "^:"}.get(number.name, "o-")
            values.append(Line(noise, relative, f"{case.equation} {number.name}", style, color=i + 1))
    x = "accelerometer noise density [ug/rtHz]"
    values.append(Line([100.0, 1600.0], [1.0, 1.0], style=":", color=7))
    return Picture(
        "aranovskiy2020-table-2",
        "aranovskiy2020, Table 2: the observers tuned again at several sensor noises, a push of 1 N m",
        [
            Panel("error of Table 2's gains\nby that of the tuned", ratios, "on held-out seeds", x, "log"),
            Panel("tuned by Table 2's", values, "1 where Table 2's are the best", x, "log", "log"),
        ],
    )


def _held_out(studies: dict[str, Study]) -> Claim:
    """Issue of the whole table: tuned against printed."""
    levels = [(case.equation, level) for case in CASES for level in studies[case.observer].levels]
    verdicts = [level.verdict for _, level in levels]
    worse = [f"{equation} at {level.noise_ug_rthz:g}" for equation, level in levels if level.verdict == "worse"]
    zero = math.fsum(level.zero_rms for _, level in levels) / len(levels)
    listed = "; ".join(
        f"{case.equation} {level.rms.mean():.4f} against {level.given_rms.mean():.4f}"
        for case in CASES
        for level in studies[case.observer].levels
        if level.noise_ug_rthz == DEFAULT_NOISE
    )
    return Claim(
        place="Section V, tuning",
        says="The gains are fitted to the gyro's rate in a recorded experiment.",
        found=(
            f"Of {len(levels)} fits (three observers, several noises) the tuned parameters are better than Table 2's "
            f"on held-out seeds in {verdicts.count('better')}, tie in {verdicts.count('tie')}, are worse in "
            f"{len(worse)}. RMS error in the window at {DEFAULT_NOISE:g} ug/rtHz [rad/s]: {listed}; an estimate of "
            f"zero has {zero:.4f}."
        ),
        verdict=verdict(not worse),
        why="" if not worse else f"Worse on held-out seeds: {', '.join(worse)}.",
        figures={"better": verdicts.count("better"), "tie": verdicts.count("tie"), "worse": len(worse)},
        pictures=[_picture(studies)],
    )


def run(on_share: OnShare) -> list[Claim]:
    """All claims of this module."""
    recorded = recorder()
    seconds = {"linear": 3.0, "ltv": 10.0, "homogeneous": 10.0, "gentle": 4.0}
    total, before = sum(seconds.values()), 0.0

    def share_of(name: str, before: float) -> OnShare:
        return lambda done: on_share((before + done * seconds[name]) / total)

    studies = {}
    for case in CASES:
        studies[case.observer] = study_of(
            case, SEED, WORLDS, recorded=recorded, on_share=share_of(case.observer, before)
        )
        before += seconds[case.observer]
    gentle = study_of(CASES[2], SEED, WORLDS, [DEFAULT_NOISE], GENTLE, on_share=share_of("gentle", before))
    return [
        _held_out(studies),
        *(_claim(case, studies[case.observer], gentle if case.observer == "homogeneous" else None) for case in CASES),
    ]

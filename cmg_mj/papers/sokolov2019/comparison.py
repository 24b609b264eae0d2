"""Sections V and VI: which of (8), (9) and (10) is best, and whether a model helps."""

from __future__ import annotations

from collections.abc import Mapping

from cmg_mj.papers.claim import Claim
from cmg_mj.papers.sokolov2019.loops import Loops, format_interval, is_better, is_smaller, numbers
from cmg_mj.papers.sokolov2019.paper import OBSERVERS
from cmg_mj.results import markdown
from cmg_mj.results.intervals import known_interval
from cmg_mj.results.result import Result

KEYS = {"velocity_rms_error_rad_s": "velocity RMS error [rad/s]", "tilt_rms_deg": "tilt RMS [deg]"}


def _cell(result: Result, key: str) -> str:
    falls_note = f" ({result.fell.mean():.0%} fell)" if result.fell.any() else ""
    return format_interval(known_interval(result.values(key))) + falls_note


def _table(loops: Loops) -> str:
    rows = [
        (setting, words, *(_cell(by_name[name], key) for name in OBSERVERS))
        for key, words in KEYS.items()
        for setting, by_name in loops.all_settings.items()
    ]
    return markdown.table(("where", "what", *OBSERVERS.values()), rows, text_columns=2)


def best_claim(loops: Loops) -> Claim:
    """Judge section V: (10) against the other two."""
    wins = {
        setting: all(is_better(by_name["homogeneous"], by_name[name]) for name in ("linear", "luenberger"))
        for setting, by_name in loops.all_settings.items()
    }
    tilt_of_8 = [
        setting
        for setting, by_name in loops.all_settings.items()
        if is_smaller(by_name["linear"], by_name["homogeneous"], "tilt_rms_deg")
    ]
    return Claim(
        place="Section V, the comparison",
        statement="The nonlinear differentiator (10) offers the best behaviour of the three.",
        result=(
            f"{loops.worlds} seeds, world by world, 95 % intervals. (10) has the smallest error of the rate, or stands "
            f"where another falls, in {sum(wins.values())} of {len(wins)} settings."
        ),
        table=_table(loops),
        holds=all(wins.values()),
        conditions=(
            "It is the best by the error of the estimated rate; by the tilt's RMS (8) is the better one at "
            f"{'; '.join(tilt_of_8)}."
            if tilt_of_8
            else ""
        ),
        otherwise="Its velocity error is not the smallest everywhere.",
        figures={
            setting: {name: numbers(by_name[name]) for name in OBSERVERS} | {"10_is_best": wins[setting]}
            for setting, by_name in loops.all_settings.items()
        },
    )


def is_ranked(by_name: Mapping[str, Result]) -> bool:
    """Return true if (9) is better than (8), (10) better than (9), and neither of the two with a model falls."""
    with_model = is_better(by_name["luenberger"], by_name["linear"])
    nonlinear = is_better(by_name["homogeneous"], by_name["luenberger"])
    return with_model and nonlinear and not any(by_name[name].fell.any() for name in ("luenberger", "homogeneous"))


def model_based(loops: Loops) -> Claim:
    """Judge section VI: with a model better than without, and the nonlinear one better than the linear one."""
    holds_at = [setting for setting, by_name in loops.all_settings.items() if is_ranked(by_name)]
    not_at = [setting for setting in loops.all_settings if setting not in holds_at]
    return Claim(
        place="Section VI",
        statement="The designs with a model outperform the one without; of them the nonlinear one has the smaller "
        "error.",
        result=(
            f"By velocity RMS error, {loops.worlds} seeds, world by world beyond chance, (10) is better than (9) and "
            f"(9) than (8), with no fall, at {'; '.join(holds_at) or 'none'}."
        ),
        holds=bool(holds_at),
        conditions=(
            f"Not at {'; '.join(not_at)}: a bias makes (9) believe in a rate, until it is no better than (8), or falls."
            if not_at
            else ""
        ),
        otherwise="(9) is nowhere better than (8), or (10) nowhere better than (9).",
        figures={"holds_at": holds_at, "does_not_hold_at": not_at},
    )

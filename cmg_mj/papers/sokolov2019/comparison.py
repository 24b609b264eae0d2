"""Sections V and VI: which of (8), (9) and (10) is best, and whether a model helps."""

from __future__ import annotations

from collections.abc import Mapping

from cmg_mj.papers.claim import Assumption, Claim
from cmg_mj.papers.sokolov2019.backlash import GAP_ARCMIN
from cmg_mj.papers.sokolov2019.loops import BIASES_DEG, Loops, is_better, numbers
from cmg_mj.papers.sokolov2019.paper import OBSERVERS
from cmg_mj.papers.sokolov2019.rig import PUSH_AND_NOISE
from cmg_mj.results.result import Result

KEYS = {"velocity_rms_error_rad_s": "velocity RMS error [rad/s]", "tilt_rms_deg": "tilt RMS [deg]"}
"""Measures that the estimators could be compared by; the paper names none."""
ASSUMED: Mapping[Assumption, str] = {
    **PUSH_AND_NOISE,
    "e": f"up to {max(BIASES_DEG):g} deg",
    "backlash": f"0 and {GAP_ARCMIN:g} arcmin",
}


def _label(key: str) -> str:
    return KEYS[key].partition(" [")[0]


def best_claims(loops: Loops) -> list[Claim]:
    """Judge section V by each measure: (10) against the other two."""
    return [_best(loops, key) for key in KEYS]


def _best(loops: Loops, key: str) -> Claim:
    wins = {
        setting: all(is_better(by_name["homogeneous"], by_name[name], key) for name in ("linear", "luenberger"))
        for setting, by_name in loops.all_settings.items()
    }
    better_settings = {
        name: [s for s, by_name in loops.all_settings.items() if is_better(by_name[name], by_name["homogeneous"], key)]
        for name in ("linear", "luenberger")
    }
    others = [
        f"{OBSERVERS[name]} is better at {'; '.join(places)}" for name, places in better_settings.items() if places
    ]
    return Claim(
        place=f"Section V, the comparison: {_label(key)}",
        statement="The nonlinear differentiator (10) offers the best behaviour of the three; judged by the "
        f"{_label(key)}.",
        assumes=ASSUMED,
        holds=wins,
        otherwise=f"{'. '.join(others) or 'It is not the best beyond chance everywhere'}.",
        figures={
            setting: {name: numbers(by_name[name]) for name in OBSERVERS} | {"10_is_best": wins[setting]}
            for setting, by_name in loops.all_settings.items()
        },
    )


def is_ranked(by_name: Mapping[str, Result], key: str = "velocity_rms_error_rad_s") -> bool:
    """Return true if (9) is better than (8), (10) better than (9), and neither of the two with a model falls."""
    with_model = is_better(by_name["luenberger"], by_name["linear"], key)
    nonlinear = is_better(by_name["homogeneous"], by_name["luenberger"], key)
    return with_model and nonlinear and not any(by_name[name].fell.any() for name in ("luenberger", "homogeneous"))


def model_based_claims(loops: Loops) -> list[Claim]:
    """Judge section VI by each measure: with a model better than without, the nonlinear better than the linear one."""
    return [_model_based(loops, key) for key in KEYS]


def _model_based(loops: Loops, key: str) -> Claim:
    holds_at = [setting for setting, by_name in loops.all_settings.items() if is_ranked(by_name, key)]
    not_at = [setting for setting in loops.all_settings if setting not in holds_at]
    return Claim(
        place=f"Section VI: {_label(key)}",
        statement="The designs with a model outperform the one without; of them the nonlinear one has the smaller "
        f"error; judged by the {_label(key)}.",
        assumes=ASSUMED,
        holds=bool(holds_at),
        conditions=(
            f"Not at {'; '.join(not_at)}: a bias makes (9) believe in a rate, until it is no better than (8), or falls."
            if not_at
            else ""
        ),
        otherwise="(9) is nowhere better than (8), or (10) nowhere better than (9).",
        figures={"holds_at": holds_at, "does_not_hold_at": not_at},
    )

"""Sections V and VI: which of (8), (9) and (10) is best, and whether a model helps."""

from __future__ import annotations

from collections.abc import Mapping

from cmg_mj.intervals import known_interval
from cmg_mj.papers.claim import Claim
from cmg_mj.papers.sokolov2019.loops import Loops, numbers, shown, smaller
from cmg_mj.papers.sokolov2019.paper import OBSERVERS
from cmg_mj.simulate import Result


def _listed(by_name: Mapping[str, Result], key: str) -> str:
    return ", ".join(
        f"{equation} {shown(known_interval(by_name[name].values(key)))}"
        + (f" ({by_name[name].fell.mean():.0%} fell)" if by_name[name].fell.any() else "")
        for name, equation in OBSERVERS.items()
    )


def best(found: Loops) -> Claim:
    """Section V: (10) against the other two."""
    error = {
        where: all(smaller(by_name["homogeneous"], by_name[name]) is not False for name in ("linear", "luenberger"))
        for where, by_name in found.everywhere.items()
    }
    tilt_of_8 = [
        where
        for where, by_name in found.everywhere.items()
        if smaller(by_name["linear"], by_name["homogeneous"], "tilt_rms_deg")
    ]
    errors, tilts = (
        "; ".join(f"{where}: {_listed(by_name, key)}" for where, by_name in found.everywhere.items())
        for key in ("velocity_rms_error_rad_s", "tilt_rms_deg")
    )
    return Claim(
        place="Section V, the comparison",
        says="The nonlinear differentiator (10) offers the best behaviour of the three.",
        found=(
            f"{found.worlds} seeds with 95 % intervals. Velocity RMS error [rad/s]: {errors}. Tilt RMS [deg]: {tilts}."
        ),
        holds=all(error.values()),
        conditions=(
            "It is the best by the error of the estimated rate; by the tilt's RMS (8) is the better one at "
            f"{'; '.join(tilt_of_8)}."
            if tilt_of_8
            else ""
        ),
        otherwise="Its velocity error is not the smallest everywhere.",
        figures={
            where: {name: numbers(by_name[name]) for name in OBSERVERS} | {"error_of_10_is_smallest": error[where]}
            for where, by_name in found.everywhere.items()
        },
    )


def model_based(found: Loops) -> Claim:
    """Section VI: with a model better than without, and the nonlinear one better than the linear one."""
    holds_at: list[str] = []
    not_at: list[str] = []
    for where, by_name in found.everywhere.items():
        with_model = smaller(by_name["luenberger"], by_name["linear"])
        nonlinear = smaller(by_name["homogeneous"], by_name["luenberger"])
        stands = not any(by_name[name].fell.any() for name in ("luenberger", "homogeneous"))
        (holds_at if with_model and nonlinear and stands else not_at).append(where)
    return Claim(
        place="Section VI",
        says="The designs with a model outperform the one without; of them the nonlinear one has the smaller error.",
        found=(
            f"Velocity RMS error, {found.worlds} seeds, world by world beyond chance: (10) < (9) < (8) with no fall at "
            f"{'; '.join(holds_at) or 'none'}. Not so at {'; '.join(not_at) or 'none'}: a bias makes (9) believe in a "
            "rate, until it is no better than (8), or falls."
        ),
        holds=bool(holds_at),
        conditions=f"It is so at {'; '.join(holds_at)}; not at {'; '.join(not_at)}." if not_at else "",
        otherwise="(9) is nowhere better than (8).",
        figures={"holds_at": holds_at, "does_not_hold_at": not_at},
    )

"""Remark 1 of aranovskiy2020: what an update of the observer (10) costs beside those of (9) and (11)."""

from __future__ import annotations

import statistics
from typing import Any

import numpy as np

from cmg_mj.bench import time_of_update
from cmg_mj.observers import make_observer
from cmg_mj.papers.aranovskiy2020.forms_of_10 import Plain, euler, rk4
from cmg_mj.papers.aranovskiy2020.paper import OBSERVERS, printed_model
from cmg_mj.papers.aranovskiy2020.rig import DT
from cmg_mj.papers.claim import Claim, OnShare


def update_times(worlds: int | None, turns: int, updates: int) -> dict[str, float]:
    """Median time of an update [us], the observers taking turns.

    Args:
        worlds: So many at once, on arrays; None for one, on floats, and then the plain forms of (10) too.
        turns: How many.
        updates: Updates in a row.

    Returns:
        Time by observer.
    """
    cases: dict[str, Any] = {name: make_observer(name, DT, printed_model()) for name in OBSERVERS}
    if worlds is None:
        cases |= {"ltv, plain Euler": Plain(euler), "ltv, plain Runge-Kutta 4": Plain(rk4)}
    value: Any = 0.01 if worlds is None else np.full(worlds, 0.01)
    y1, y2, acceleration, u = ([factor * value] * updates for factor in (1.0, 2.0, 0.0, 3.0))
    signals = y1, y2, acceleration, u
    times = [{name: time_of_update(observer, *signals) for name, observer in cases.items()} for _ in range(turns)]
    return {name: statistics.median(turn[name] for turn in times) for name in cases}


def cost() -> Claim:
    """Time of an update of (10) relative to (9) and (11)."""
    one = update_times(None, turns=3, updates=200)
    worlds = 4096
    many = update_times(worlds, turns=1, updates=4)
    ratios = {name: one[name] / one["linear"] for name in one}
    arithmetic = {name: many[name] / many["linear"] for name in many}
    return Claim(
        place="Remark 1, cost",
        says="The observer (10) is computationally heavy: its gain takes differential equations solved online.",
        found=(
            f"An update takes, by that of (9): (11) {ratios['homogeneous']:.1f}, (10) {ratios['ltv']:.1f} with the "
            "exact step on the 2x2 block that is left of H. Written out with 3x3 matrices it takes "
            f"{ratios['ltv, plain Euler']:.0f} with Euler and {ratios['ltv, plain Runge-Kutta 4']:.0f} with "
            f"Runge-Kutta 4 (one world, in Python). The arithmetic alone, on {worlds} worlds at once: (11) "
            f"{arithmetic['homogeneous']:.1f}, (10) {arithmetic['ltv']:.1f}. (10) takes {one['ltv']:.0f} us of the "
            "5000 us of a control period here."
        ),
        holds=one["ltv"] > one["homogeneous"] > one["linear"] and arithmetic["ltv"] > 1.0,
        otherwise="It is not the dearest of the three.",
        figures={
            "update_us": one,
            "update_by_linear": ratios,
            "update_by_linear_4096_worlds": arithmetic,
        },
    )


def claims(on_share: OnShare) -> list[Claim]:
    """The cost."""
    return [cost()]

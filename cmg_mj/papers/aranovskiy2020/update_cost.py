"""Remark 1: what an update of the observer (10) costs beside those of (9) and (11)."""

from __future__ import annotations

import json
import statistics
from pathlib import Path
from typing import Any

import numpy as np

from cmg_mj.observers import make_observer
from cmg_mj.papers.aranovskiy2020.forms_of_10 import Plain, euler, rk4
from cmg_mj.papers.aranovskiy2020.paper import OBSERVERS, printed_model
from cmg_mj.papers.aranovskiy2020.rig import DT
from cmg_mj.papers.claim import Claim
from cmg_mj.runs.benchmark import time_of_update

CLOCK_MHZ = 216.0
"""Clock of the rig's processor, an STM32F746 [MHz]."""

RECORDED = Path(__file__).with_name("on_the_board.json")
"""Instructions of an update of the observer alone, by observer, as far as an emulator of that processor can say;
`python benchmarks/board.py --paper` writes it."""

PLAIN = {"ltv, plain Euler": euler, "ltv, plain Runge-Kutta 4": rk4}
"""(10) written out with 3x3 matrices, by the method for H."""


def update_times(worlds: int | None, turns: int, updates: int) -> dict[str, float]:
    """Measure the median time of an update [us], the observers taking turns.

    With worlds, arrays of so many; without (None) floats, and then the plain forms of (10) too.
    """
    cases: dict[str, Any] = {name: make_observer(name, DT, printed_model()) for name in OBSERVERS}
    if worlds is None:
        cases |= {name: Plain(method) for name, method in PLAIN.items()}
    value: Any = 0.01 if worlds is None else np.full(worlds, 0.01)
    y1, y2, acceleration, u = ([factor * value] * updates for factor in (1.0, 2.0, 0.0, 3.0))
    times = [
        {name: time_of_update(observer, y1, y2, acceleration, u) for name, observer in cases.items()}
        for _ in range(turns)
    ]
    return {name: statistics.median(turn[name] for turn in times) for name in cases}


def cost(recorded: Path = RECORDED) -> Claim:
    """Instructions of an update of (10) beside those of (9) and (11) on the rig's processor; times on this one."""
    board = json.loads(recorded.read_text(encoding="utf-8"))
    single_times, batch_times = update_times(None, turns=3, updates=200), update_times(4096, turns=1, updates=4)
    dearest = max(board[name] for name in ("ltv", *PLAIN))
    return Claim(
        place="Remark 1, cost",
        statement="The observer (10) is computationally heavy in embedded systems: its gain takes differential "
        "equations solved online.",
        holds=dearest > board["homogeneous"] > board["linear"],
        otherwise="On this processor it turns round: the powers in (11) cost more than a step of the equations of H, "
        "whichever way that is taken.",
        figures={
            "instructions": board,
            "share_of_period": dearest / CLOCK_MHZ / (1e6 * DT),
            "update_us": single_times,
            "update_by_linear": {name: time / single_times["linear"] for name, time in single_times.items()},
            "update_by_linear_4096_worlds": {name: time / batch_times["linear"] for name, time in batch_times.items()},
        },
    )

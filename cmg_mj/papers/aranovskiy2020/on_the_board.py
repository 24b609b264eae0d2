"""The cost of aranovskiy2020's observers on its rig's processor, an STM32F746, as far as an emulator can say.

`on_the_board.json` stands in where the cross-compiler, the emulator or CasADi is missing; `python -m
cmg_mj.papers.aranovskiy2020.record_on_the_board` writes it anew.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

from cmg_mj.codegen.board.cost import cost_of
from cmg_mj.codegen.board.tools import available
from cmg_mj.papers.aranovskiy2020.forms_of_10 import Plain, euler, rk4
from cmg_mj.papers.aranovskiy2020.paper import OBSERVERS
from cmg_mj.scenario.loading import parse_scenario
from cmg_mj.simulation.experiment import prepare

RECORDED = Path(__file__).with_suffix(".json")

PLAIN = {"ltv, plain Euler": euler, "ltv, plain Runge-Kutta 4": rk4}
"""(10) written out with 3x3 matrices, by the method for H."""


class Instructions(NamedTuple):
    """Instructions of an update of the observer alone, the median along a run.

    Attributes:
        by_observer: By observer, those of the package and (10) written out.
        counted_here: Whether they were counted now, or read from the file.
    """

    by_observer: dict[str, float]
    counted_here: bool


def count() -> dict[str, float]:
    """Count them, along half a second in which the rig comes back from one degree."""
    runs = {
        name: prepare(
            parse_scenario({"duration_s": 0.5, "plant": {"initial_tilt_deg": 1.0}, "observer": {"kind": name}})
        )
        for name in OBSERVERS
    }
    counts = {name: cost_of(run, run.axis_controller())["step_instructions"] for name, run in runs.items()}
    of_10 = runs["ltv"]
    for name, method in PLAIN.items():
        counts[name] = cost_of(of_10, of_10.axis_controller(observer=Plain(method)))["step_instructions"]
    return counts


def instructions() -> Instructions:
    """Count the instructions where that can be done; elsewhere read the recorded ones."""
    if available():
        return Instructions(count(), True)
    return Instructions(json.loads(RECORDED.read_text(encoding="utf-8")), False)

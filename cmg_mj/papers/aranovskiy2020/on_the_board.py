"""The cost of aranovskiy2020's observers on its rig's processor, an STM32F746, as far as an emulator can say."""

from __future__ import annotations

import json
from pathlib import Path

from cmg_mj.papers.aranovskiy2020.forms_of_10 import euler, rk4

RECORDED = Path(__file__).with_suffix(".json")
"""Instructions of an update of the observer alone, by observer; `python benchmarks/board.py --paper` writes it."""

PLAIN = {"ltv, plain Euler": euler, "ltv, plain Runge-Kutta 4": rk4}
"""(10) written out with 3x3 matrices, by the method for H."""


def instructions() -> dict[str, float]:
    """Read the recorded instructions by observer, those of the package and (10) written out."""
    return json.loads(RECORDED.read_text(encoding="utf-8"))

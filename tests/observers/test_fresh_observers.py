"""A user's observer that remembers more than its state: every run has a fresh one."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmg_mj import Estimate, Measurement, ReducedModel
from tests.command import cmg_mj

SHORT = ("--set", "duration_s=0.5", "--set", "push=[]")


@dataclass
class Remembers:
    """Its memory is in fields, which look like parameters."""

    dt: float
    model: ReducedModel
    last: float = 0.0
    rate: float = 0.0

    def init(self, y: Measurement) -> None:
        return None

    def step(self, state: None, y: Measurement, u: Any) -> tuple[None, Estimate]:
        self.rate = self.rate + 0.5 * ((y.y1 - self.last) / self.dt - self.rate)
        self.last = y.y1
        return None, Estimate(y.y1, self.rate, y.y2)


class Allocates:
    """Its memory has the shape of the first measurement it sees."""

    def __init__(self, dt: float, model: ReducedModel) -> None:
        self.dt, self.buffer = dt, None

    def init(self, y: Measurement) -> None:
        return None

    def step(self, state: None, y: Measurement, u: Any) -> tuple[None, Estimate]:
        if self.buffer is None:
            self.buffer = np.zeros((1, *np.shape(y.y1)))
        rate = 0.0 * y.y1 + (y.y1 - self.buffer[0]) / self.dt
        self.buffer[0] = y.y1
        return None, Estimate(y.y1, rate, y.y2)


class RaisesLate:
    """In the middle of a run."""

    def __init__(self, dt: float, model: ReducedModel) -> None:
        self.dt = dt

    def init(self, y: Measurement) -> tuple[int, Any]:
        return 0, y.y1

    def step(self, state: tuple[int, Any], y: Measurement, u: Any) -> tuple[tuple[int, Any], Estimate]:
        k, y1 = state
        if k > 10:
            raise RuntimeError("late")
        return (k + 1, y.y1), Estimate(y.y1, 0.3 * (y.y1 - y1) / self.dt, y.y2)


@pytest.mark.usefixtures("elsewhere")
def test_the_resolved_scenario_has_the_defaults_and_reruns_to_the_same_numbers() -> None:
    kind = f"{__name__}:Remembers"
    first = cmg_mj("run", "push_recovery", "--observer", kind, *SHORT, "--out", "first", "--json")
    fields = tomllib.loads(Path("first/scenario.toml").read_text())["observer"]
    assert (fields["last"], fields["rate"]) == (0.0, 0.0)
    assert cmg_mj("run", "first/scenario.toml", "--out", "again", "--json").out == first.out


@pytest.mark.usefixtures("elsewhere")
def test_floats_and_arrays_are_not_mixed() -> None:
    outcome = cmg_mj(
        "compare", "push_recovery", "--observers", f"{__name__}:Allocates", "--worlds", 2, *SHORT, "--out", "it"
    )
    assert outcome.status == 0, outcome.err

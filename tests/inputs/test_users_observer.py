"""Users' observers that cannot work, fail in a run, or fail in some worlds."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmg_mj import Estimate, Measurement, load_scenario, prepare
from tests.command import cmg_mj
from tests.inputs.complaints import assert_in_order, table
from tests.run_folders import assert_whole


class Mine:
    """A user's observer that works: what the others get wrong, they get wrong from it."""

    def __init__(self, dt: float, model: object) -> None:
        self.dt = dt

    def init(self, y: Measurement) -> Any:
        return (y.y1, 0)

    def step(self, state: Any, y: Measurement, u: Any) -> Any:
        y1, k = state
        return (y.y1, k + 1), self.estimate(k + 1, y, 0.3 * (y.y1 - y1) / self.dt)

    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return Estimate(y.y1, rate, y.y2)


class FailsWhenMade(Mine):
    def __init__(self, dt: float, model: object) -> None:
        raise RuntimeError("no licence\nfor this")


class TakesNoPeriod(Mine):
    def __init__(self) -> None:
        pass


class FailsAtFirst(Mine):
    def init(self, y: Measurement) -> Any:
        raise KeyError("gain")


class ForgetsArguments(Mine):
    def step(self, y: Measurement) -> Any:  # type: ignore[override]
        return None


class ReturnsNothing(Mine):
    def step(self, state: Any, y: Measurement, u: Any) -> Any:
        return None


class ReturnsNoEstimate(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return None


class ReturnsTwo(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return y.y1, rate


class ReturnsText(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return y.y1, rate, "0.0"


class ReturnsLists(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return [y.y1], [rate], [y.y2]


class ForOneWorld(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return y.y1, math.copysign(1.0, rate), y.y2


class ForgetsWorlds(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return y.y1, 0.0, y.y2


class FailsLater(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return 1 / 0 if k == 30 else Estimate(y.y1, rate, y.y2)


class GivesNan(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return Estimate(y.y1, rate * (math.nan if k >= 30 else 1.0), y.y2)


class GivesInfinity(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return Estimate(y.y1, rate * 0.0 + (math.inf if k >= 30 else 0.0), y.y2)


class ChangesInPlace(Mine):
    """Keeps its rate in one object, which on arrays it changes in place: on floats `+=` makes a new one."""

    def init(self, y: Measurement) -> Any:
        return y.y1, 0.0 * y.y1

    def step(self, state: Any, y: Measurement, u: Any) -> Any:
        y1, rate = state
        rate += 0.05 * ((y.y1 - y1) / self.dt - rate)
        return (y.y1, rate), Estimate(y.y1, rate, y.y2)


class NamesNoSignals(Mine):
    extra_signals = "bias_rad"


class OwesASignal(Mine):
    extra_signals = ("bias_rad",)


RETURN = "step(state, y, u) must return"


@pytest.mark.daily_cases(
    "in the loop-*",
    "compared-made",
    "compared-None",
    "compared-signals",
    "open loop-init",
    "open loop-no estimate",
    "open loop-signature",
)
@table(
    (
        "made",
        FailsWhenMade,
        "observer tests.inputs.test_users_observer:FailsWhenMade: RuntimeError: no licence for this",
    ),
    ("made without dt", TakesNoPeriod, "TakesNoPeriod: TypeError: ", "unexpected keyword argument 'dt'"),
    (
        "init",
        FailsAtFirst,
        "'tests.inputs.test_users_observer:FailsAtFirst': init(y) raised KeyError: 'gain' (",
        "py, line ",
    ),
    ("signature", ForgetsArguments, "step(state, y, u) raised TypeError: ", "positional arguments"),
    ("None", ReturnsNothing, f"{RETURN} (state, (x1, x2, x3)), not None"),
    ("no estimate", ReturnsNoEstimate, f"{RETURN} (state, (x1, x2, x3)), not (state, None)"),
    ("two numbers", ReturnsTwo, f"{RETURN} (state, (x1, x2, x3)), not (state, [0.011, "),
    ("text", ReturnsText, f"{RETURN} a number for x3, not '0.0'"),
    ("lists", ReturnsLists, f"{RETURN} a number for x1, not [0.011]"),
    ("signals", NamesNoSignals, "extra_signals must be a tuple of names like ('bias_rad',), each once, not 'bias_rad'"),
    ("a signal too few", OwesASignal, f"{RETURN} (state, (x1, x2, x3, bias_rad)), not (state, "),
)
@pytest.mark.parametrize("place", ["in the loop", "open loop", "compared"])
def test_an_observer_that_cannot_work(wrong_input: type, fragments: list[str], place: str) -> None:
    """It is found before the run, so that not even a folder is made."""
    kind = f"{__name__}:{wrong_input.__name__}"
    if place == "compared":
        outcome = cmg_mj("compare", "push_recovery", "--observers", f"linear,{kind}", "--worlds", 1)
    elif place == "in the loop":
        outcome = cmg_mj("run", "push_recovery", "--observer", kind)
    else:
        outcome = cmg_mj("run", "push_recovery", "--set", f"open_loop_observers=['{kind}']")
        assert (
            "FailsWhenMade" in kind
            or "TakesNo" in kind
            or "NamesNo" in kind
            or "open_loop_observers: 'tests.inputs.test_users_observer:" in outcome.complaint
        )
    assert_in_order(["push_recovery", *fragments], outcome.complaint)
    assert list(Path().iterdir()) == []


@pytest.mark.daily_cases("a function for floats")
@table(
    ("a function for floats", ForOneWorld, "step(state, y, u) raised TypeError: only", "use operators and cmg_mj.elem"),
    ("a number for all", ForgetsWorlds, f"{RETURN} an array of 2 numbers for x2, not 0.0; many worlds come at once"),
)
def test_an_observer_for_one_world_among_many(quick: str, wrong_input: type, fragments: list[str]) -> None:
    kind = f"{__name__}:{wrong_input.__name__}"
    assert cmg_mj("run", quick, "--observer", kind).status == 0
    outcome = cmg_mj("compare", quick, "--observers", kind, "--out", "compared")
    assert_in_order([f"observer.kind = '{kind}': ", *fragments], outcome.complaint)
    assert not Path("compared").exists()


@pytest.mark.daily_cases("native-raises", "native-NaN", "callback-infinity")
@table(
    (
        "raises",
        FailsLater,
        "observer FailsLater raised ZeroDivisionError: division by zero at t = 0.15 s (test_users_observer.py, line ",
        "); ",
    ),
    ("NaN", GivesNan, "observer GivesNan returned ", "nan", " at t = 0.15 s; "),
    ("infinity", GivesInfinity, "observer GivesInfinity returned ", "inf", " at t = 0.15 s; "),
)
@pytest.mark.parametrize("driver", ["native", "callback"])
def test_an_observer_that_fails_in_a_run(wrong_input: type, fragments: list[str], driver: str) -> None:
    """The recording until then is kept."""
    kind = f"{__name__}:{wrong_input.__name__}"
    outcome = cmg_mj("run", "push_recovery", "--observer", kind, "--driver", driver, "--out", "it")
    assert outcome.status == 2
    assert "stopped at 0.15 s" in outcome.out
    note, complaint = outcome.err.splitlines()
    assert note.startswith("Written to it. ")
    assert_in_order(["cmg-mj: ", *fragments, "what was recorded until then is in it"], complaint)
    assert len(assert_whole("it")) == 30


def test_an_observer_that_fails_among_others(quick: str) -> None:
    """The others are run, all is written, and the exit status tells."""
    kind = f"{__name__}:GivesNan"
    outcome = cmg_mj("compare", quick, "--observers", f"{kind},linear", "--worlds", 2)
    assert outcome.status == 2
    assert re.search(r"linear .* 0%\s+0%", outcome.out)
    assert re.search(r"GivesNan .* 0%\s+100%", outcome.out)
    complaint = outcome.err.splitlines()[1]
    assert complaint.startswith(f"cmg-mj: {kind}: 2 of 2 worlds stopped: ")
    assert Path("runs/quick-compare-0/trajectory-linear.parquet").exists()


def test_an_open_loop_observer_that_gives_nan_harms_nobody(quick: str) -> None:
    kind = f"{__name__}:GivesNan"
    outcome = cmg_mj("run", quick, "--set", f"open_loop_observers=['{kind}']")
    assert outcome.status == 0
    assert re.search(rf"{kind}\s+-\s+-", outcome.out)


def test_an_observer_that_changes_its_own_arrays_is_judged_as_in_one_world(quick: str) -> None:
    """A change of its arrays does not reach the estimates of earlier ticks."""
    experiment = prepare(load_scenario(quick, [], f"{__name__}:ChangesInPlace"))
    one, many = experiment.run(), experiment.run_many(2)
    assert one.trajectory is not None
    assert many.trajectory is not None
    name = f"estimate/{__name__}:ChangesInPlace/x2_rad_s"
    np.testing.assert_array_equal(many.trajectory[name][:, 0], one.trajectory[name])
    key = "velocity_rms_error_rad_s"
    assert many.summaries[0][key] == pytest.approx(one.summaries[0][key], rel=1e-12)

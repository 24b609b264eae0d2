"""Users' control laws that cannot work, fail in a run, or fail in some worlds."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from pydantic.dataclasses import dataclass

from cmg_mj import FeedbackState, InputError, Measurement, load_scenario, prepare
from cmg_mj.inputs.types import STRICT, Positive
from tests.command import cmg_mj
from tests.inputs.complaints import assert_in_order, table
from tests.run_folders import assert_whole


class Mine:
    """A user's law that works: what the others get wrong, they get wrong from it."""

    def __init__(self, dt: float, rate_limit: float) -> None:
        self.dt, self.rate_limit = dt, rate_limit

    def init(self, y: Measurement) -> Any:
        return 0

    def step(self, state: Any, y: Measurement, x: FeedbackState, u: Any) -> Any:
        return state + 1, self.command(state, -35.0 * x.x1 - 4.0 * x.x2 + x.x3)

    def command(self, k: int, demand: Any) -> Any:
        return demand


@dataclass(frozen=True, config=STRICT)
class Typed:
    """One whose parameters pydantic checks."""

    dt: Positive
    rate_limit: Positive
    stiffness: Positive = 35.0
    gains: tuple[float, float, float, float] | None = None

    def init(self, y: Measurement) -> None:
        return None

    def step(self, state: None, y: Measurement, x: FeedbackState, u: Any) -> tuple[None, Any]:
        return None, -self.stiffness * x.x1 - 4.0 * x.x2 + x.x3


class FailsWhenMade(Mine):
    def __init__(self, dt: float, rate_limit: float) -> None:
        raise RuntimeError("no licence\nfor this")


class TakesNoPeriod(Mine):
    def __init__(self) -> None:
        pass


class KeepsNothing(Mine):
    def __init__(self, dt: float, rate_limit: float) -> None:
        pass


class FailsAtFirst(Mine):
    def init(self, y: Measurement) -> Any:
        raise KeyError("gain")


class ForgetsArguments(Mine):
    def step(self, state: Any, y: Measurement) -> Any:  # type: ignore[override]
        return None


class HasNoStep:
    def init(self, y: Measurement) -> Any:
        return None


class ReturnsNothing(Mine):
    def step(self, state: Any, y: Measurement, x: FeedbackState, u: Any) -> Any:
        return None


class ReturnsACommand(Mine):
    def step(self, state: Any, y: Measurement, x: FeedbackState, u: Any) -> Any:
        return 0.5


class ReturnsText(Mine):
    def command(self, k: int, demand: Any) -> Any:
        return "0.0"


class ReturnsAList(Mine):
    def command(self, k: int, demand: Any) -> Any:
        return [demand]


class GivesNanAtOnce(Mine):
    def command(self, k: int, demand: Any) -> Any:
        return math.nan


class NeedsWhatThereIsNot(Mine):
    needs = ("estimates",)


class IntegratesText(Mine):
    def init(self, y: Measurement) -> Any:
        return Text()


class Text(int):
    x_e = "0.0"


class TrimsNothing(Mine):
    trim_gain = 100.0


class ForOneWorld(Mine):
    def command(self, k: int, demand: Any) -> Any:
        return math.copysign(1.0, demand)


class ForgetsWorlds(Mine):
    def command(self, k: int, demand: Any) -> Any:
        return 0.0


class FailsLater(Mine):
    def command(self, k: int, demand: Any) -> Any:
        return 1 / 0 if k == 30 else demand


class GivesNan(Mine):
    def command(self, k: int, demand: Any) -> Any:
        return demand * (math.nan if k >= 30 else 1.0)


class GivesInfinity(Mine):
    def command(self, k: int, demand: Any) -> Any:
        return demand * 0.0 + (math.inf if k >= 30 else 0.0)


class ReturnsTextLater(Mine):
    def command(self, k: int, demand: Any) -> Any:
        return "0.0" if k == 30 else demand


class ChangesWhatItIsGiven(Mine):
    def step(self, state: Any, y: Measurement, x: FeedbackState, u: Any) -> Any:
        rate = x.x2
        rate *= 2.0
        return state + 1, -35.0 * x.x1 - 4.0 * rate


class AsksForMuch(Mine):
    """Far beyond the limit, with NumPy's numbers."""

    commands: ClassVar[list] = []

    def step(self, state: Any, y: Measurement, x: FeedbackState, u: Any) -> Any:
        self.commands.append(u)
        return state + 1, np.float64(1000.0)


RETURN = "step(state, y, x, u) must return"


def law_path(law: type) -> str:
    return f"{__name__}:{law.__name__}"


def law_option(law: type) -> list[str]:
    return ["--set", f"controller.kind={law_path(law)}"]


@pytest.mark.daily_cases(
    "run-*", "compare-made", "compare-text", "compare-trimmed", "check-init", "check-None", "check-needs"
)
@table(
    ("made", FailsWhenMade, f"law {__name__}:FailsWhenMade: RuntimeError: no licence for this"),
    ("made without dt", TakesNoPeriod, "TakesNoPeriod: TypeError: ", "unexpected keyword argument 'dt'"),
    ("keeps nothing", KeepsNothing, "KeepsNothing: must keep dt and rate_limit, which it is given, under these names"),
    ("no step", HasNoStep, "must be a class with the methods init(y) and step(state, y, x, u)"),
    ("init", FailsAtFirst, f"controller.kind = '{__name__}:FailsAtFirst': init(y) raised KeyError: 'gain'"),
    ("signature", ForgetsArguments, "step(state, y, x, u) raised TypeError: ", "positional arguments"),
    ("None", ReturnsNothing, f"{RETURN} (state, u), not None"),
    ("no state", ReturnsACommand, f"{RETURN} (state, u), not 0.5"),
    ("text", ReturnsText, f"{RETURN} a number for u, not '0.0'"),
    ("a list", ReturnsAList, f"{RETURN} a number for u, not [-"),
    ("NaN", GivesNanAtOnce, "step(state, y, x, u) returned nan for u at a tilt of 0.01 rad"),
    ("needs", NeedsWhatThereIsNot, "needs = ('estimates',): there is no 'estimates'; did you mean 'estimate'?"),
    ("an integrator of text", IntegratesText, "x_e in its state must be a number, not '0.0'"),
    ("trimmed", TrimsNothing, "has a trim_gain, so its state must be a NamedTuple with x_e, not "),
)
@pytest.mark.parametrize("command", ["run", "compare", "check"])
def test_a_law_that_cannot_work(wrong_input: type, fragments: list[str], command: str) -> None:
    """It is found before the run, so that not even a folder is made."""
    if command == "check":
        Path("mine.toml").write_text(f"[controller]\nkind = '{law_path(wrong_input)}'")
        outcome = cmg_mj("check", "mine.toml")
        Path("mine.toml").unlink()
    else:
        outcome = cmg_mj(command, "push_recovery", *law_option(wrong_input))
    assert_in_order(fragments, outcome.complaint)
    assert list(Path().iterdir()) == []


@table(
    (
        "a typo of a name",
        ["kind=lgq"],
        "controller.kind = 'lgq': no such law; did you mean 'lqg'? allowed: lqg, state_",
    ),
    (
        "no module",
        ["kind=nowhere:Law"],
        "'nowhere:Law': cannot be imported: ModuleNotFoundError: No module named 'nowh",
    ),
    ("no class", [f"kind={__name__}:Nobody"], "Nobody': cannot be imported: AttributeError: "),
    ("no name", ["kind=3"], "controller.kind = 3: "),
    (
        "a typo of a field",
        ["kind=lqg", "torque_wlk=1.0"],
        "controller.torque_wlk: no such field of lqg; did you mean 'torque_wal",
    ),
    (
        "another's field",
        ["torque_walk=1.0"],
        "controller.torque_walk: no such field",
    ),
    (
        "of the wrong type",
        ["kind=lqg", "torque_walk='1'"],
        "controller.torque_walk = '1': ",
    ),
    (
        "refused",
        ["kind=lqg", "torque_walk=-1"],
        "controller.torque_walk = -1: must be greater than 0 (law lqg)",
    ),
    ("too few", ["kind=lqg", "state_cost=[1, 1]"], "controller.state_cost = [1, 1]: "),
    ("weights without an optimum", ["kind=lqg", "state_cost=[1, 1, 1, 0]"], "state_cost: no stabilising gain"),
    (
        "the bench's",
        [f"kind={__name__}:Typed", "dt=0.1"],
        "controller.dt: set by the bench, which gives it to every law",
    ),
    ("a typo of one's own", [f"kind={__name__}:Typed", "stifness=1.0"], "controller.stifness: no such", "'stiffness'"),
    (
        "one's own of the wrong type",
        [f"kind={__name__}:Typed", "stiffness='a'"],
        "controller.stiffness = 'a': must be a",
    ),
    ("gains", ["kind=lqg", "gains=[1,2,3,4]"], "controller.gains: lqg takes no gains; leave it out"),
    ("weights", ["kind=lqg", "lqr.state_cost=[1,1,1,1]"], "controller.lqr: lqg takes no gains; leave it out"),
    (
        "the gyro",
        ["kind=lqg", "feedback=fog"],
        "controller.feedback = 'fog': lqg takes nothing of the observer and has no",
    ),
    ("angle_source", ["kind=lqg", "angle_source=estimated"], "leave it out, or set controller.angle_source=measured"),
    (
        "trim",
        ["kind=lqg", "bias_trim_s=1.0"],
        "controller.bias_trim_s = 1: Lqg has no integrator to be trimmed; leave it out",
    ),
)
def test_fields_that_do_not_fit_the_law(wrong_input: list[str], fragments: list[str]) -> None:
    outcome = cmg_mj(
        "run", "push_recovery", *(part for setting in wrong_input for part in ("--set", f"controller.{setting}"))
    )
    assert_in_order(["push_recovery with ", *fragments], outcome.complaint)
    assert list(Path().iterdir()) == []


def test_gains_reach_a_law_of_ones_own_that_takes_them() -> None:
    settings = [f"controller.kind={__name__}:Typed", "controller.gains=[1,2,3,4]", "controller.stiffness=30"]
    law = prepare(load_scenario("push_recovery", settings)).law
    assert law == Typed(0.005, 4.7, 30.0, (1.0, 2.0, 3.0, 4.0))


@pytest.mark.daily_cases("a function for floats", "in place")
@table(
    (
        "a function for floats",
        ForOneWorld,
        "step(state, y, x, u) raised TypeError: only",
        "use operators and cmg_mj.el",
    ),
    ("a number for all", ForgetsWorlds, f"{RETURN} an array of 2 numbers for u, not 0.0; many worlds come at once"),
    (
        "in place",
        ChangesWhatItIsGiven,
        "step(state, y, x, u) raised ValueError: output array is read-only (",
        "); many worlds",
    ),
)
def test_a_law_for_one_world_among_many(quick: str, wrong_input: type, fragments: list[str]) -> None:
    assert cmg_mj("run", quick, *law_option(wrong_input)).status == 0
    outcome = cmg_mj("compare", quick, *law_option(wrong_input), "--out", "compared")
    assert_in_order([f"controller.kind = '{law_path(wrong_input)}': ", *fragments], outcome.complaint)
    assert not Path("compared").exists()


def test_a_law_that_changes_what_it_is_given_changes_no_record() -> None:
    """A batch that had no dry run on arrays stops, rather than go on with an estimate that nobody made."""
    settings = ["push=[]", "duration_s=0.1", f"controller.kind={law_path(ChangesWhatItIsGiven)}"]
    result = prepare(load_scenario("push_recovery", settings)).run_many(2)
    assert [outcome.kind for outcome in result.outcomes] == ["stopped"] * 2
    assert "raised ValueError: output array is read-only" in result.outcomes[0].reason


@pytest.mark.daily_cases("native-raises", "native-NaN", "callback-raises", "callback-text")
@table(
    (
        "raises",
        FailsLater,
        "law FailsLater raised ZeroDivisionError: division by zero at t = 0.15 s (test_users_law.py, line ",
        "); ",
    ),
    ("NaN", GivesNan, "law GivesNan returned nan for u at t = 0.15 s; "),
    ("infinity", GivesInfinity, "law GivesInfinity returned inf for u at t = 0.15 s; "),
    ("text", ReturnsTextLater, "law ReturnsTextLater raised TypeError: the law returned <U3 of shape (), not a real "),
)
@pytest.mark.parametrize("driver", ["native", "callback"])
def test_a_law_that_fails_in_a_run(wrong_input: type, fragments: list[str], driver: str) -> None:
    """The recording until then is kept."""
    outcome = cmg_mj("run", "push_recovery", *law_option(wrong_input), "--driver", driver, "--out", "it")
    assert outcome.status == 2
    assert "stopped at 0.15 s" in outcome.out
    note, complaint = outcome.err.splitlines()
    assert note.startswith("Written to it. ")
    assert_in_order(["cmg-mj: ", *fragments, "what was recorded until then is in it"], complaint)
    assert len(assert_whole("it")) == 30


def test_a_law_that_fails_in_one_world_of_many() -> None:
    """Only that world stops."""
    experiment = prepare(
        load_scenario("push_recovery", ["push=[]", "duration_s=0.3", f"controller.kind={__name__}:FailsInWorld1"])
    )
    result = experiment.run_many(3)
    assert [outcome.kind for outcome in result.outcomes] == ["done", "stopped", "done"]
    assert result.outcomes[1].reason == "the law returned a command that is not finite at t = 0.15 s"


class FailsInWorld1(Mine):
    def command(self, k: int, demand: Any) -> Any:
        error = np.zeros(np.shape(demand))
        if k >= 30:
            error[1] = math.nan
        return demand + error


def test_no_law_gets_beyond_the_limit() -> None:
    """Its next sample tells it what was commanded, as a float."""
    AsksForMuch.commands.clear()
    experiment = prepare(
        load_scenario("push_recovery", ["push=[]", "duration_s=0.05", f"controller.kind={law_path(AsksForMuch)}"])
    )
    AsksForMuch.commands.clear()
    trajectory = experiment.run().trajectory
    assert trajectory is not None
    np.testing.assert_array_equal(trajectory["u_rad_s"], 4.7)
    assert AsksForMuch.commands == [0.0] + [4.7] * (len(trajectory) - 1)
    assert all(type(u) is float for u in AsksForMuch.commands)
    many = experiment.run_many(2).trajectory
    assert many is not None
    np.testing.assert_array_equal(many["u_rad_s"], 4.7)


def test_a_law_that_remembers_in_itself_is_fresh_in_every_run() -> None:
    experiment = prepare(
        load_scenario("push_recovery", ["push=[]", "duration_s=0.1", f"controller.kind={__name__}:Remembers"])
    )
    one, rerun = experiment.run().trajectory, experiment.run().trajectory
    assert one is not None
    assert rerun is not None
    np.testing.assert_array_equal(one["u_rad_s"], rerun["u_rad_s"])
    assert one["u_rad_s"][-1] == pytest.approx(0.01 * len(one))
    with pytest.raises(InputError, match="differs"):
        prepare(load_scenario("push_recovery")).run_many(2, vary={"controller.kind": ["lqg", "state_feedback"]})


class Remembers(Mine):
    count = 0

    def step(self, state: Any, y: Measurement, x: FeedbackState, u: Any) -> Any:
        self.count += 1
        return state, 0.01 * self.count + 0.0 * y.y1

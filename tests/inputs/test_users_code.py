"""Users' observers and laws: what the bench takes, and how one that fails ends its run."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import numpy as np
import pytest
from pydantic.dataclasses import dataclass

from cmg_mj import Estimate, Experiment, FeedbackState, InputError, Measurement
from cmg_mj.core.one_by_one import for_worlds
from cmg_mj.inputs.types import STRICT, Positive
from cmg_mj.runs.comparison import compare
from cmg_mj.runs.open_loop import replay
from cmg_mj.runs.side_by_side import run_jobs, run_of
from tests.command import cmg_mj
from tests.recorded import assert_same_bits, push_recovery, recorded
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


class FailsAtFirst(Mine):
    def init(self, y: Measurement) -> Any:
        raise KeyError("gain")


class ReturnsNothing(Mine):
    def step(self, state: Any, y: Measurement, u: Any) -> Any:
        return None


def estimating(name: str, estimate: Callable[[int, Measurement, Any], Any]) -> type:
    """An observer that returns what a function makes of the sample's number, the sample and the rate."""
    return type(name, (Mine,), {"estimate": staticmethod(estimate)})


ReturnsTwo = estimating("ReturnsTwo", lambda k, y, rate: (y.y1, rate))
ReturnsText = estimating("ReturnsText", lambda k, y, rate: (y.y1, rate, "0.0"))
ForgetsWorlds = estimating("ForgetsWorlds", lambda k, y, rate: (y.y1, 0.0, y.y2))
FailsLater = estimating("FailsLater", lambda k, y, rate: 1 / 0 if k == 30 else (y.y1, rate, y.y2))
GivesNan = estimating("GivesNan", lambda k, y, rate: (y.y1, rate * (math.nan if k >= 30 else 1.0), y.y2))
IsMasked = estimating("IsMasked", lambda k, y, rate: (y.y1, np.ma.masked, y.y2))
WidensLater = estimating("WidensLater", lambda k, y, rate: (y.y1, np.array([rate]) if k >= 30 else rate, y.y2))
IsNoneLater = estimating("IsNoneLater", lambda k, y, rate: (y.y1, None if k >= 30 else rate, y.y2))
IsComplexLater = estimating("IsComplexLater", lambda k, y, rate: (y.y1, rate * (1j if k >= 30 else 1.0), y.y2))
IsMaskedLater = estimating("IsMaskedLater", lambda k, y, rate: (y.y1, np.ma.masked if k >= 30 else rate, y.y2))


class OwesASignal(Mine):
    extra_signals = ("bias_rad",)


class NamesXTwice(Mine):
    extra_signals = ("x1_rad",)


class MyLaw:
    """A user's law that works."""

    def __init__(self, dt: float, rate_limit: float) -> None:
        self.dt, self.rate_limit = dt, rate_limit

    def init(self, y: Measurement) -> Any:
        return 0

    def step(self, state: Any, y: Measurement, x: FeedbackState, u: Any) -> Any:
        return state + 1, self.command(state, -35.0 * x.x1 - 4.0 * x.x2 + x.x3)

    def command(self, k: int, demand: Any) -> Any:
        return demand


def commanding(name: str, command: Callable[[int, Any], Any]) -> type:
    """A law that returns what a function makes of the sample's number and the demand."""
    return type(name, (MyLaw,), {"command": staticmethod(command)})


LawReturnsAList = commanding("LawReturnsAList", lambda k, demand: [demand])
LawForgetsWorlds = commanding("LawForgetsWorlds", lambda k, demand: 0.0)
LawFailsLater = commanding("LawFailsLater", lambda k, demand: 1 / 0 if k == 30 else demand)
LawWidensLater = commanding("LawWidensLater", lambda k, demand: [demand] if k >= 30 else demand)
LawGivesInfinity = commanding("LawGivesInfinity", lambda k, demand: demand * 0.0 + (math.inf if k >= 30 else 0.0))


class LawReturnsNothing(MyLaw):
    def step(self, state: Any, y: Measurement, x: FeedbackState, u: Any) -> Any:
        return None


class AsksForMuch(MyLaw):
    """Far beyond the limit."""

    commands: ClassVar[list] = []

    def command(self, k: int, demand: Any) -> Any:
        return 0.0 * demand + 1000.0

    def step(self, state: Any, y: Measurement, x: FeedbackState, u: Any) -> Any:
        self.commands.append(u)
        return super().step(state, y, x, u)


class Remembers(MyLaw):
    count = 0

    def step(self, state: Any, y: Measurement, x: FeedbackState, u: Any) -> Any:
        self.count += 1
        return state, 0.01 * self.count + 0.0 * y.y1


@dataclass(frozen=True, config=STRICT)
class Typed:
    """A law whose parameters pydantic checks."""

    dt: Positive
    rate_limit: Positive
    stiffness: Positive = 35.0
    gains: tuple[float, float, float, float] | None = None

    def init(self, y: Measurement) -> None:
        return None

    def step(self, state: None, y: Measurement, x: FeedbackState, u: Any) -> tuple[None, Any]:
        return None, -self.stiffness * x.x1 - 4.0 * x.x2 + x.x3


def field_of(part: type) -> str:
    return "controller.kind" if "Law" in part.__name__ or part in (AsksForMuch, Remembers) else "observer.kind"


def with_part(part: type, *settings: str, field: str = "") -> Experiment:
    """A short run with an observer or a law of one's own."""
    path = f"{__name__}:{part.__name__}"
    setting = f"open_loop_observers=['{path}']" if field == "open loop" else f"{field or field_of(part)}={path}"
    return push_recovery("push=[]", "duration_s=0.3", setting, *settings)


@pytest.mark.parametrize(
    ("part", "worlds", "fragments"),
    [
        (FailsAtFirst, 1, ["observer FailsAtFirst", "in init", "KeyError: 'gain'"]),
        (FailsAtFirst, 2, ["observer FailsAtFirst", "KeyError: 'gain'"]),
        (ReturnsNothing, 1, ["observer ReturnsNothing", "TypeError"]),
        (ReturnsTwo, 1, ["observer ReturnsTwo", "2", "x1, x2, x3"]),
        (ReturnsText, 2, ["observer ReturnsText", "x3", "<U"]),
        (IsMasked, 1, ["observer IsMasked", "x2 is masked"]),
        (OwesASignal, 2, ["observer OwesASignal", "3", "bias_rad"]),
        (LawReturnsNothing, 1, ["law LawReturnsNothing", "TypeError"]),
        (LawReturnsAList, 1, ["law LawReturnsAList", "u", "(1,)", "()"]),
    ],
)
def test_what_has_a_wrong_shape_ends_the_run_at_its_first_tick(part: type, worlds: int, fragments: list[str]) -> None:
    """In the loop, and an observer in open loop too."""
    for field in ["", "open loop"] if field_of(part) == "observer.kind" else [""]:
        experiment = with_part(part, field=field)
        result = experiment.run_many(worlds) if worlds > 1 else experiment.run()
        assert {outcome.kind for outcome in result.outcomes} == {"stopped"}
        reason = result.outcomes[0].reason
        assert all(fragment in reason for fragment in fragments)
        assert result.seconds <= 0.005


@pytest.mark.parametrize(
    ("part", "shown"),
    [
        (FailsLater, "ZeroDivisionError: division by zero"),
        (GivesNan, "observer GivesNan returned nan for x2"),
        (IsMaskedLater, "TypeError: x2 is masked"),
        (WidensLater, "TypeError: x2 has shape (1,) of float64, not ()"),
        (IsNoneLater, "TypeError: x2 has shape () of object, not ()"),
        (IsComplexLater, "TypeError: x2 has shape () of complex128, not ()"),
        (LawWidensLater, "TypeError: u has shape (1,) of float64, not ()"),
        (LawFailsLater, "ZeroDivisionError: division by zero"),
        (LawGivesInfinity, "law LawGivesInfinity returned inf for u"),
    ],
)
@pytest.mark.parametrize("driver", ["native", "callback"])
def test_what_fails_in_a_run_is_shown_once_and_the_record_kept(part: type, shown: str, driver: str) -> None:
    path = f"{__name__}:{part.__name__}"
    outcome = cmg_mj(
        "run", "push_recovery", "--set", f"{field_of(part)}={path}", "--driver", driver, "--out", "it", "--json"
    )
    assert outcome.status == 2
    assert outcome.err.count(shown) == 1
    assert "t = 0.15 s" in outcome.err
    assert "cmg_mj/core" not in outcome.err
    assert ("test_users_code.py" in outcome.err) == ("Zero" in shown)
    assert len(assert_whole("it")) == 30


@pytest.mark.parametrize(("part", "outcome", "ticks"), [(FailsLater, "stopped", 30), (GivesNan, "done", 60)])
def test_an_open_loop_observer_that_raises_ends_the_run_and_nan_harms_nobody(
    part: type, outcome: str, ticks: int
) -> None:
    result = with_part(part, field="open loop").run()
    assert (result.outcomes[0].kind, len(recorded(result))) == (outcome, ticks)


class Gated(Mine):
    """An extended Kalman filter of arrays of one world, with a gate that is an `if`."""

    def init(self, y: Measurement) -> Any:
        return np.array([y.y1, 0.0]), np.eye(2)

    def step(self, state: Any, y: Measurement, u: Any) -> Any:
        x, P = state
        F = np.array([[1.0, self.dt], [19.0 * self.dt * math.cos(x[0]), 1.0]])
        P = F @ P @ F.T + np.diag([0.0, 0.01])
        K = np.linalg.solve([[P[0, 0] + 1e-4]], P[:1])[0]
        e = y.y1 - x[0] - self.dt * x[1]
        x = np.array([x[0] + self.dt * x[1], x[1]]) + K * (e if abs(e) < 0.02 else math.copysign(0.02, e))
        return (x, P - np.outer(K, P[0])), Estimate(x[0], x[1], y.y2)


class NormsAll(Mine):
    """Takes the norm of arrays over all worlds: right in shape, and wrong."""

    def step(self, state: Any, y: Measurement, u: Any) -> Any:
        state, (x1, x2, x3) = super().step(state, y, u)
        return state, Estimate(x1, x2 / (1.0 + 0.1 * np.linalg.norm(x2)), x3)


class InItself(Mine):
    """Its memory is a list of its own."""

    def __init__(self, dt: float) -> None:
        self.dt, self.memory = dt, [0.0, 0.0]

    def init(self, y: Measurement) -> Any:
        self.memory[0] = y.y1

    def step(self, state: Any, y: Measurement, u: Any) -> Any:
        rate = 0.3 * (y.y1 - self.memory[0]) / self.dt
        self.memory[:] = y.y1, max(-1.0, min(1.0, rate))
        return None, Estimate(y.y1, self.memory[1], y.y2)


class LawWithAnIf(MyLaw):
    """With an integrator, and what the observer in the loop estimates beyond x."""

    trim_gain = 1.0

    class Memory(NamedTuple):
        x_e: float

    def init(self, y: Measurement) -> Any:
        return self.Memory(0.0)

    def step(self, state: Any, y: Measurement, x: FeedbackState, u: Any) -> Any:
        u = -35.0 * x.x1 - 4.0 * x.x2 + x.x3 + 0.1 * sum(x.extra)
        return self.Memory(state.x_e + 0.001 * x.x1), u if abs(u) < 3.0 else math.copysign(3.0, u)


@pytest.mark.parametrize(
    ("part", "settings"),
    [
        (Gated, []),
        (NormsAll, []),
        (InItself, []),
        (ForgetsWorlds, []),
        (LawForgetsWorlds, []),
        (LawWithAnIf, ["observer.kind=adaptive", "controller.bias_trim_s=0.1"]),
    ],
)
def test_worlds_of_a_part_that_takes_floats_alone_are_its_single_runs(part: type, settings: list[str]) -> None:
    """Side by side with another observer and in a replay of many worlds too."""
    experiment = with_part(part, *settings)
    other = push_recovery("push=[]", "duration_s=0.3")
    alone, *_ = run_jobs([run_of(experiment, 3), run_of(other, 2)])
    for many in (alone, experiment.run_many(3)):
        assert {outcome.kind for outcome in many.outcomes} == {"done"}
        for world in (0, 2):
            assert_same_bits(recorded(many).world(world), recorded(experiment.run(world=world)))
    if field_of(part) == "observer.kind":
        rate = replay(experiment.design.observer(), recorded(many)).x2
        np.testing.assert_array_equal(rate, recorded(many)[f"estimate/{experiment.observer_title}/x2_rad_s"])


def test_a_class_that_says_so_is_stepped_with_arrays() -> None:
    for part in (Mine(0.005, None), MyLaw(0.005, 4.7)):
        assert for_worlds(part) is not part
        part.elementwise = True  # type: ignore[union-attr]
        assert for_worlds(part) is part


class FailsWhereItIsFar(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return (y.y1, rate, y.y2) if y.y1 < math.radians(3.0) else 1 / 0


def test_a_world_in_which_a_part_fails_takes_no_other_out_of_a_comparison() -> None:
    experiment = with_part(FailsWhereItIsFar, "sensors.accelerometer.noise_density_ug_rthz=1000")
    alone = [experiment.run(world=world) for world in range(8)]
    assert 0 < sum(result.stood[0] for result in alone) < 8
    result = compare([experiment], 8)[0].result
    assert result.outcomes == [one.outcomes[0] for one in alone]
    assert result.summaries == [one.summaries[0] for one in alone]


def test_no_law_gets_beyond_the_limit() -> None:
    """Its next sample tells the law what was commanded."""
    experiment = with_part(AsksForMuch)
    AsksForMuch.commands.clear()
    commands = recorded(experiment.run())["u_rad_s"]
    np.testing.assert_array_equal(commands, 4.7)
    assert AsksForMuch.commands == [0.0] + [4.7] * (len(commands) - 1)
    np.testing.assert_array_equal(recorded(experiment.run_many(2))["u_rad_s"], 4.7)


def test_a_law_that_remembers_in_itself_is_fresh_in_every_run() -> None:
    experiment = with_part(Remembers)
    one, rerun = (recorded(experiment.run()) for _ in range(2))
    assert_same_bits(one, rerun)
    assert one["u_rad_s"][-1] == pytest.approx(0.01 * len(one))


def test_extra_signals_are_none_of_x() -> None:
    with pytest.raises(InputError, match=r"NamesXTwice.*extra_signals"):
        with_part(NamesXTwice)


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        (["kind=lgq"], "did you mean 'lqg'"),
        (["kind=nowhere:Law"], "nowhere"),
        ([f"kind={__name__}:Nobody"], "Nobody"),
        (["kind=3"], "controller.kind"),
        (["kind=lqg", "torque_wlk=1.0"], "torque_walk"),
        (["torque_walk=1.0"], "controller.torque_walk"),
        (["kind=lqg", "torque_walk=-1"], "controller.torque_walk"),
        (["kind=lqg", "state_cost=[1, 1]"], "controller.state_cost"),
        (["kind=lqg", "state_cost=[1, 1, 1, 0]"], "state_cost"),
        ([f"kind={__name__}:Typed", "dt=0.1"], "controller.dt"),
        ([f"kind={__name__}:Typed", "stifness=1.0"], "'stiffness'"),
        ([f"kind={__name__}:Typed", "stiffness='a'"], "controller.stiffness"),
        (["kind=lqg", "gains=[1,2,3,4]"], "controller.gains"),
        (["kind=lqg", "lqr.state_cost=[1,1,1,1]"], "controller.lqr"),
        (["kind=lqg", "feedback=fog"], "controller.feedback"),
        (["kind=lqg", "bias_trim_s=1.0"], "controller.bias_trim_s"),
    ],
)
def test_fields_that_do_not_fit_the_law(settings: list[str], field: str) -> None:
    with pytest.raises(InputError) as error:
        push_recovery(*(f"controller.{setting}" for setting in settings))
    assert field in str(error.value)


def test_gains_reach_a_law_of_ones_own_that_takes_them() -> None:
    settings = [f"controller.kind={__name__}:Typed", "controller.gains=[1,2,3,4]", "controller.stiffness=30"]
    assert push_recovery(*settings).law == Typed(0.005, 4.7, 30.0, (1.0, 2.0, 3.0, 4.0))

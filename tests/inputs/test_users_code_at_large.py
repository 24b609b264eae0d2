"""A user's code can hurt only itself: it changes what it is given, exits, prints, returns what is no number."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmg_mj import Estimate, Measurement
from cmg_mj.errors import RunStopped, raised
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.simulation.experiment import prepare
from tests.command import cmg_mj
from tests.inputs.test_users_observer import Mine


class ChangesTheTilt(Mine):
    """After the rehearsal, in place."""

    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        if k > 5:
            d = y.y1
            d -= 0.02
        return Estimate(y.y1, rate, y.y2)


class ChangesTheCommand(Mine):
    def step(self, state: Any, y: Measurement, u: Any) -> Any:
        if state[1] > 5:
            u[:] = 0.0
        return super().step(state, y, u)


class ExitsWhenMade(Mine):
    def __init__(self, dt: float, model: object) -> None:
        sys.exit(0)


class ExitsAtFirst(Mine):
    def init(self, y: Measurement) -> Any:
        sys.exit("bye")


class ExitsAtTheFirstStep(Mine):
    def step(self, state: Any, y: Measurement, u: Any) -> Any:
        sys.exit()


class Unspeakable(Exception):
    def __str__(self) -> str:
        raise RuntimeError("no words")


class RaisesUnspeakably(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        if k > 5:
            raise Unspeakable
        return Estimate(y.y1, rate, y.y2)


class Generates(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return (part for part in (y.y1, rate, y.y2))


class TurnsComplex(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return Estimate(y.y1, rate + (0j if k > 5 else 0.0), y.y2)


class TurnsNumpyComplex(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return Estimate(y.y1, np.complex128(rate) if k > 5 else rate, y.y2)


class Prints(Mine):
    def __init__(self, dt: float, model: object) -> None:
        super().__init__(dt, model)
        print("made")

    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        print("step")
        return Estimate(y.y1, rate, y.y2)


def kind(cls: type) -> str:
    return f"{__name__}:{cls.__name__}"


@pytest.mark.parametrize("open_loop_observer", [ChangesTheTilt, ChangesTheCommand])
def test_an_open_loop_observer_cannot_change_what_others_see(open_loop_observer: type) -> None:
    """The observer in the loop and all that is recorded are as without it; it itself is lost."""
    settings = ["duration_s=0.4", "push=[]"]
    expected = prepare(load_scenario("push_recovery", [*settings, "open_loop_observers=[]"])).run_many(3).trajectory
    result = prepare(
        load_scenario("push_recovery", [*settings, f"open_loop_observers=['{kind(open_loop_observer)}']"])
    ).run_many(3)
    assert expected is not None
    assert result.trajectory is not None
    for name, values in expected.columns.items():
        np.testing.assert_array_equal(result.trajectory[name], values)
    assert np.isnan(result.trajectory[f"estimate/{kind(open_loop_observer)}/x2_rad_s"][-1]).all()


def test_in_the_loop_the_comparison_fails(quick: str) -> None:
    outcome = cmg_mj("compare", quick, "--observers", kind(ChangesTheTilt), "--worlds", 2)
    assert outcome.status == 2
    assert "read-only" in outcome.err


@pytest.mark.parametrize("cls", [ExitsWhenMade, ExitsAtFirst, ExitsAtTheFirstStep])
@pytest.mark.parametrize("command", ["run", "check"])
def test_leaving_is_no_success(quick: str, cls: type, command: str) -> None:
    Path(quick).write_text(f"duration_s = 0.3\n[observer]\nkind = '{kind(cls)}'")
    outcome = cmg_mj(command, quick)
    assert "SystemExit" in outcome.complaint


def test_leaving_while_imported_is_no_success(quick: str) -> None:
    Path("leaves.py").write_text("import sys\nsys.exit(0)\n")
    assert "cannot be imported: SystemExit: 0" in cmg_mj("run", quick, "--observer", "leaves:Class").complaint


def test_an_exception_without_words(quick: str) -> None:
    outcome = cmg_mj("run", quick, "--observer", kind(RaisesUnspeakably))
    assert outcome.status == 2
    assert "raised Unspeakable: its message cannot be shown at t = " in outcome.err
    assert raised(ValueError()) == "ValueError"


def test_a_generator_is_no_estimate(quick: str) -> None:
    complaint = cmg_mj("run", quick, "--observer", kind(Generates)).complaint
    assert "step(state, y, u) must return (state, (x1, x2, x3))" in complaint


@pytest.mark.parametrize("cls", [TurnsComplex, TurnsNumpyComplex])
def test_complex_numbers_stop_a_run_and_what_was_recorded_is_kept(quick: str, cls: type) -> None:
    outcome = cmg_mj("run", quick, "--observer", kind(cls))
    assert outcome.status == 2
    assert "complex128, not real numbers" in outcome.err
    assert json.loads(Path(f"runs/quick-{cls.__name__}-0/summary.json").read_text())["outcome"] == "stopped"


def test_complex_numbers_in_many_worlds() -> None:
    experiment = prepare(
        load_scenario("push_recovery", ["duration_s=0.3", "push=[]", f"observer.kind='{kind(TurnsComplex)}'"])
    )
    result = experiment.run_many(2)
    assert {outcome.kind for outcome in result.outcomes} == {"stopped"}
    assert "not real numbers" in result.outcomes[0].reason
    assert issubclass(RunStopped, Exception)


def test_what_it_prints_is_no_output_of_the_command(quick: str) -> None:
    outcome = cmg_mj("run", quick, "--observer", kind(Prints), "--json")
    assert json.loads(outcome.out)["observer"] == kind(Prints)
    assert {"made", "step"} <= set(outcome.err.split())
    Path("mine.toml").write_text(f"duration_s = 0.3\n[observer]\nkind = '{kind(Prints)}'")
    check_outcome = cmg_mj("check", "mine.toml")
    assert "made" not in check_outcome.out
    assert "your own code, which was imported and tried on two samples" in check_outcome.out

"""Run folders: whole and repeatable; comparisons equal to their single runs."""

from __future__ import annotations

import dataclasses
import json
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from cmg_mj import Estimate, Measurement, load_scenario, parse_scenario, prepare
from cmg_mj.inputs.files import folder
from cmg_mj.results.baselines import BASELINES
from cmg_mj.results.result import Outcome
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs import comparison
from cmg_mj.runs import save as runs
from tests.command import cmg_mj
from tests.recorded import assert_same_bits, recorded
from tests.run_folders import assert_whole, names, write

pytestmark = pytest.mark.usefixtures("elsewhere")


# --- the same again ------------------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Mine:
    """A user's observer."""

    dt: float
    model: object
    gain: float = 0.3
    nothing: float | None = None

    def init(self, y: Measurement) -> Any:
        return y.y1, 0.0 * y.y1

    def step(self, state: Any, y: Measurement, u: Any) -> tuple[Any, Estimate]:
        y1, rate = state
        rate = rate + self.gain * ((y.y1 - y1) / self.dt - rate)
        return (y.y1, rate), Estimate(y.y1, rate, y.y2)


def own_model() -> list[str]:
    """A model of the user's, named relative to the scenario, that differs from the bundled one."""
    for name in ("scissored_pair.xml", "cube.xml"):
        write((folder("models") / name).read_text().replace('mass="0.35"', 'mass="0.45"'), f"rigs/{name}")
    return [write("duration_s = 0.4\n[plant]\nmodel = '../rigs/scissored_pair.xml'", "scenarios/my.toml")]


PUSHED = ("--set", "duration_s=0.5", "--set", "push.0.start_s=0.3")
KINDS: dict[str, Callable[[], list[str]]] = {
    "a bundled scenario": lambda: ["push_recovery", "--seed", "3", *PUSHED, "--observer", "ltv"],
    "a user's model": own_model,
    "a user's observer": lambda: [write(f"duration_s = 0.4\n[observer]\nkind = '{__name__}:Mine'\ngain = 0.4")],
    "lqr": lambda: [write("duration_s = 0.4\n[controller]\nlqr.state_cost = [30, 1, 0.5, 0.1]\nlqr.input_cost = 0.3")],
    "every observer": lambda: [write("duration_s = 0.4\nopen_loop_observers = 'all'\n[controller]\nfeedback = 'fog'")],
    "another grid": lambda: [
        write("duration_s = 0.4\n[plant]\ntimestep_s = 0.0005\nmodel = 'single_gimbal'\nlock_thrust_bearing = true")
    ],
}


@pytest.mark.daily_cases("every observer", "a user's observer", "a user's model")
@pytest.mark.parametrize("kind", KINDS)
def test_a_written_scenario_reruns_to_the_same_bits(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """From another folder, where other files may lie about; twice is the same run, too."""
    arguments = KINDS[kind]()
    first = cmg_mj("run", *arguments, "--out", "first", "--json")
    assert first.status == 0, first.err
    repetition = cmg_mj("run", *arguments, "--out", "again", "--json")
    write("<mujoco/>", "elsewhere/scissored_pair.xml")
    monkeypatch.chdir("elsewhere")
    rerun = cmg_mj("run", "../first/scenario.toml", "--out", "../rerun", "--json")
    assert rerun.status == 0, rerun.err
    assert first.out == repetition.out == rerun.out
    monkeypatch.chdir("..")
    trajectories = [Path(f"{place}/trajectory.parquet").read_bytes() for place in ("first", "again", "rerun")]
    assert trajectories[0] == trajectories[1] == trajectories[2]
    scenarios = [Path(f"{place}/scenario.toml").read_text() for place in ("first", "again", "rerun")]
    assert scenarios[0] == scenarios[1] == scenarios[2]


# --- what is written -----------------------------------------------------------------------------------------


def test_a_run_folder() -> None:
    outcome = cmg_mj(
        "run", write("title = 'Mine'\nduration_s = 0.5\nopen_loop_observers = ['ltv']"), "--out", "deep/er", "--json"
    )
    trajectory = assert_whole("deep/er")
    assert Path("deep/er/summary.json").read_text() == outcome.out
    assert len(trajectory) == 100
    assert trajectory.observers == ("homogeneous", "ltv")
    assert trajectory.metadata["outcome"] == {"kind": "done", "time_s": 0.5, "reason": ""}
    assert trajectory.metadata["scenario"] == tomllib.loads(Path("deep/er/scenario.toml").read_text())


def test_another_run_takes_the_next_number_or_overwrites() -> None:
    for seed, options in ((1, ()), (2, ()), (2, ()), (3, ("--overwrite",))):
        cmg_mj("run", write("duration_s = 0.1"), "--out", "it", "--seed", seed, *options)
    for place, seed in (("it", 3), ("it-2", 2)):
        assert tomllib.loads(Path(place, "scenario.toml").read_text())["seed"] == seed
        assert_whole(place)


def test_a_fall_is_a_result() -> None:
    outcome = cmg_mj("run", write("duration_s = 3.0\n[plant]\nequilibrium_bias_deg = 20.0"), "--out", "it", "--json")
    summary = json.loads(outcome.out)
    assert (outcome.status, outcome.err) == (0, "")
    assert (summary["fell"], summary["outcome"], summary["settle_time_s"]) == (True, "fell", None)
    assert len(assert_whole("it")) == pytest.approx(summary["end_time_s"] * 200, abs=1)


@pytest.mark.parametrize(("tilt_deg", "outcome"), [(29.9, "done"), (30.1, "fell"), (-30.1, "fell")])
def test_a_fall_is_beyond_30_degrees(tilt_deg: float, outcome: str) -> None:
    plant = {"equilibrium_bias_deg": 0.0, "initial_tilt_deg": tilt_deg}
    assert prepare(parse_scenario({"duration_s": 0.001, "plant": plant})).run().outcomes[0].kind == outcome


def test_a_run_without_a_tick_can_be_written() -> None:
    """An interrupt may come before the first."""
    experiment = prepare(load_scenario(write("duration_s = 0.1")))
    result = experiment.run()
    whole = recorded(result)
    none = replace(whole, columns={name: column[:0] for name, column in whole.columns.items()})
    empty = dataclasses.replace(result, trajectory=none, outcomes=[Outcome("interrupted", 0.0)])
    runs.save_run(Path("it"), runs.report_run(experiment, empty), plot=True)
    assert len(Trajectory.load(Path("it/trajectory.parquet"))) == 0
    assert Path("it/plot.png").read_bytes().startswith(b"\x89PNG")


# --- comparisons ---------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_comparison_of_one_world_equals_single_runs() -> None:
    file = write("duration_s = 0.5\n[[push]]\nstart_s = 0.2\n[observer]\nkind = 'homogeneous'\nk1 = 30.0")
    user_observer = f"{__name__}:Mine"
    outcome = cmg_mj(
        "compare", file, "--worlds", 1, "--observers", f"ltv,homogeneous,{user_observer}", "--json", "--out", "it"
    )
    assert (outcome.status, outcome.err) == (0, "")
    rows = json.loads(outcome.out)
    assert json.loads(Path("it/summary.json").read_text()) == rows
    assert [entry["observer"] for entry in rows] == ["ltv", "homogeneous", user_observer, *BASELINES]
    for entry, name in zip(rows, ("ltv", "homogeneous", "Mine"), strict=False):
        single = json.loads(cmg_mj("run", file, "--observer", entry["observer"], "--json", "--out", name).out)
        shared = {key: entry[key] for key in single.keys() & entry.keys()}
        assert shared == {key: single[key] for key in shared}
        assert len(shared) == 15
        compared, alone = (
            Trajectory.load(Path(place)) for place in (f"it/trajectory-{name}.parquet", f"{name}/trajectory.parquet")
        )
        assert_same_bits(compared, alone)
    assert {"recording.rrd", "trajectory-Mine.parquet", "worlds.parquet"} <= set(names("it"))


def test_a_comparison_reports_progress_from_nothing_to_all() -> None:
    experiment = prepare(load_scenario(write("duration_s = 3.0\n[controller]\nfeedback = 'truth'")))
    shares: list[float] = []
    comparison.compare([experiment, experiment], 1, shares.append)
    assert shares == sorted(shares)
    assert 0.0 < shares[0] < 0.5 < shares[-1] <= 1.0


def test_a_comparison_trims_where_there_is_a_bias_estimate() -> None:
    """Observers without one run untrimmed; alone, they are refused (tests/inputs/)."""
    scenario = load_scenario("bias_estimation", ["duration_s=0.5"])
    experiments = comparison.prepare_comparison(scenario, ["linear", "adaptive", "homogeneous_adaptive"])
    assert [experiment.scenario.controller.bias_trim_s for experiment in experiments] == [0.0, 1.0, 1.0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "observers", "same"),
    [
        ("push_recovery", "linear,ltv", ["linear", "ltv"]),  # without the scenario's own observer
        ("bias_estimation", f"linear,{__name__}:Mine,adaptive", ["linear", f"{__name__}:Mine", "adaptive"]),  # trimmed
        (
            "bias_estimation --set observer.kind=linear --set observer.tau=0.03",
            "linear,adaptive",
            ["linear", "adaptive"],
        ),
    ],
)
def test_a_comparisons_scenario_runs_to_the_same_comparison(scenario: str, observers: str, same: list[str]) -> None:
    scenario, *settings = scenario.split()
    settings += ["--set", "duration_s=0.4", "--set", "push=[]", "--set", "plant.equilibrium_bias_deg=0.3"]
    first = cmg_mj("compare", scenario, "--observers", observers, "--worlds", 2, "--out", "a", "--json", *settings)
    assert first.status == 0, first.err
    rerun = cmg_mj("compare", "a/scenario.toml", "--out", "b", "--json")
    assert (rerun.status, rerun.err) == (0, "")
    assert rerun.out == first.out
    assert [row["observer"] for row in json.loads(rerun.out)][: -len(BASELINES)] == same
    assert pq.read_table("a/worlds.parquet").equals(pq.read_table("b/worlds.parquet"))
    fields = tomllib.loads(Path("a/scenario.toml").read_text(encoding="utf-8"))
    assert fields == tomllib.loads(Path("b/scenario.toml").read_text(encoding="utf-8"))
    assert fields["compare"] == {"observers": same, "worlds": 2}


def test_run_says_that_it_does_not_compare() -> None:
    outcome = cmg_mj("run", write("duration_s = 0.2\n[compare]\nworlds = 3"), "--json")
    assert (outcome.status, outcome.err) == (0, "cmg-mj: [compare] is for cmg-mj compare; this is one run\n")
    assert json.loads(outcome.out)["observer"] == "homogeneous"

"""Run folders: whole, repeatable, and kept when a run is interrupted; comparisons equal to their single runs."""

from __future__ import annotations

import dataclasses
import json
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rerun.chunk import RrdReader

from cmg_mj import Estimate, Measurement, load_scenario, parse_scenario, prepare, runs
from cmg_mj.resources import folder
from cmg_mj.simulate import Outcome
from cmg_mj.trajectory import Trajectory
from tests.command import COMMAND, cmg_mj, cmg_mj_process, environment

FILES = ["recording.rrd", "scenario.toml", "summary.json", "trajectory.parquet"]


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))  # to which the command adds


def write(text: str, path: str = "my.toml") -> str:
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text(text)
    return path


def names(place: str) -> list[str]:
    return sorted(path.name for path in Path(place).iterdir())


def assert_whole(place: str) -> Trajectory:
    """Every file of a run folder can be read to its end, and there is no other."""
    assert names(place) == FILES
    json.loads((Path(place) / "summary.json").read_text())
    tomllib.loads((Path(place) / "scenario.toml").read_text())
    assert list(RrdReader(Path(place) / "recording.rrd").stream().to_chunks())
    return Trajectory.load(Path(place) / "trajectory.parquet")


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


KINDS: dict[str, Callable[[], list[str]]] = {
    "a bundled scenario": lambda: ["push_recovery", "--seed", "3", "--set", "duration_s=2.05", "--observer", "ltv"],
    "a user's model": own_model,
    "a user's observer": lambda: [write(f"duration_s = 0.4\n[observer]\nkind = '{__name__}:Mine'\ngain = 0.4")],
    "lqr": lambda: [write("duration_s = 0.4\n[controller]\nlqr.state_cost = [30, 1, 0.5, 0.1]\nlqr.input_cost = 0.3")],
    "every observer": lambda: [write("duration_s = 0.4\ncompanions = 'all'\n[controller]\nfeedback = 'fog'")],
    "another grid": lambda: [
        write("duration_s = 0.4\n[plant]\ntimestep_s = 0.0005\nmodel = 'single_gimbal'\nlock_thrust_bearing = true")
    ],
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_written_scenario_reruns_to_the_same_bits(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """From another folder, where other files may lie about; twice is the same run, too."""
    arguments = KINDS[kind]()
    first = cmg_mj("run", *arguments, "--out", "first", "--json")
    assert first.status == 0, first.err
    again = cmg_mj("run", *arguments, "--out", "again", "--json")
    write("<mujoco/>", "elsewhere/scissored_pair.xml")
    monkeypatch.chdir("elsewhere")
    rerun = cmg_mj("run", "../first/scenario.toml", "--out", "../rerun", "--json")
    assert rerun.status == 0, rerun.err
    assert first.out == again.out == rerun.out
    monkeypatch.chdir("..")
    trajectories = [Path(f"{place}/trajectory.parquet").read_bytes() for place in ("first", "again", "rerun")]
    assert trajectories[0] == trajectories[1] == trajectories[2]
    written = [Path(f"{place}/scenario.toml").read_text() for place in ("first", "again", "rerun")]
    assert written[0] == written[1] == written[2]


def test_another_seed_is_another_run() -> None:
    file = write("duration_s = 0.3")
    assert cmg_mj("run", file, "--json").out != cmg_mj("run", file, "--json", "--seed", 1).out


def test_the_callback_writes_the_same() -> None:
    file = write("duration_s = 0.5\n[[push]]\nstart_s = 0.1")
    native = cmg_mj("run", file, "--out", "native", "--json")
    callback = cmg_mj("run", file, "--out", "callback", "--json", "--driver", "callback")
    assert native.out == callback.out
    assert Path("native/trajectory.parquet").read_bytes() == Path("callback/trajectory.parquet").read_bytes()


# --- what is written -----------------------------------------------------------------------------------------


def test_a_run_folder() -> None:
    said = cmg_mj("run", write("title = 'Mine'\nduration_s = 0.5\ncompanions = ['ltv']"), "--out", "deep/er", "--json")
    trajectory = assert_whole("deep/er")
    assert Path("deep/er/summary.json").read_text() == said.out
    assert len(trajectory) == 100
    assert trajectory.observers == ["homogeneous", "ltv"]
    assert trajectory.metadata["outcome"] == {"kind": "done", "time_s": 0.5, "reason": ""}
    assert trajectory.metadata["scenario"] == tomllib.loads(Path("deep/er/scenario.toml").read_text())


def test_a_folder_is_written_over() -> None:
    for seed in (1, 2):
        cmg_mj("run", write("duration_s = 0.1"), "--out", "it", "--seed", seed)
    assert tomllib.loads(Path("it/scenario.toml").read_text())["seed"] == 2
    assert_whole("it")


def test_looking_whether_a_folder_can_be_written_leaves_nothing() -> None:
    write("mine", "it/.writable")
    runs.output_folder(Path("it"))
    assert names("it") == [".writable"]


def test_a_fall_is_a_result() -> None:
    said = cmg_mj("run", write("duration_s = 3.0\n[plant]\nequilibrium_bias_deg = 20.0"), "--out", "it", "--json")
    summary = json.loads(said.out)
    assert (said.status, said.err) == (0, "")
    assert (summary["fell"], summary["outcome"], summary["settle_time_s"]) == (True, "fell", None)
    assert len(assert_whole("it")) == pytest.approx(summary["end_time_s"] * 200, abs=1)


def test_a_run_shorter_than_a_tick_has_one() -> None:
    assert cmg_mj("run", write("duration_s = 0.001"), "--out", "it").status == 0
    assert len(Trajectory.load(Path("it/trajectory.parquet"))) == 1


def test_a_run_without_a_tick_can_be_written() -> None:
    """An interrupt may come before the first."""
    experiment = prepare(load_scenario(write("duration_s = 0.1")))
    result = experiment.run()
    assert result.trajectory is not None
    none = Trajectory({name: column[:0] for name, column in result.trajectory.columns.items()})
    empty = dataclasses.replace(result, trajectory=none, outcomes=[Outcome("interrupted", 0.0)])
    runs.save_run(runs.output_folder(Path("it")), experiment, empty, plot=True)
    assert len(Trajectory.load(Path("it/trajectory.parquet"))) == 0
    assert Path("it/plot.png").read_bytes().startswith(b"\x89PNG")


def test_numbers_json_does_not_know() -> None:
    experiment = prepare(load_scenario(write("duration_s = 0.1")))
    result = experiment.run()
    result.summaries[0]["gimbal_peak_deg"] = float("nan")
    assert runs.summary_of(experiment, result)["gimbal_peak_deg"] is None


# --- comparisons ---------------------------------------------------------------------------------------------


def test_a_comparison_of_one_world_equals_single_runs() -> None:
    file = write("duration_s = 0.5\n[[push]]\nstart_s = 0.2\n[observer]\nkind = 'homogeneous'\nk1 = 30.0")
    mine = f"{__name__}:Mine"
    said = cmg_mj("compare", file, "--worlds", 1, "--observers", f"ltv,homogeneous,{mine}", "--json", "--out", "it")
    assert (said.status, said.err) == (0, "")
    compared = json.loads(said.out)
    assert json.loads(Path("it/summary.json").read_text()) == compared
    assert [entry["observer"] for entry in compared] == ["ltv", "homogeneous", mine]
    for entry, name in zip(compared, ("ltv", "homogeneous", "Mine"), strict=True):
        single = json.loads(cmg_mj("run", file, "--observer", entry["observer"], "--json", "--out", name).out)
        shared = {key: entry[key] for key in single.keys() & entry.keys()}
        assert shared == {key: single[key] for key in shared}
        assert len(shared) == 10
        columns = Trajectory.load(Path(f"it/trajectory-{name}.parquet")).columns
        assert all(
            (columns[key] == values).all()
            for key, values in Trajectory.load(Path(f"{name}/trajectory.parquet")).columns.items()
        )
    assert names("it") == [
        "recording.rrd",
        "scenario.toml",
        "summary.json",
        "trajectory-Mine.parquet",
        "trajectory-homogeneous.parquet",
        "trajectory-ltv.parquet",
    ]


def test_a_comparison_of_many_worlds() -> None:
    """Means over the worlds that stood, and how they spread."""
    experiment = prepare(load_scenario(write("duration_s = 0.5")))
    (entry,) = runs.compare([experiment], 3)
    singles = [experiment.run(world=world).summaries[0] for world in range(3)]
    for key in ("velocity_rms_error_rad_s", "tilt_rms_deg", "settle_time_s"):
        assert entry.summary[key] == pytest.approx(sum(single[key] for single in singles) / 3, rel=1e-12)
    assert entry.summary["velocity_rms_error_std_rad_s"] > 0.0
    assert (entry.summary["worlds"], entry.summary["fell_fraction"], entry.summary["settled_fraction"]) == (3, 0.0, 1.0)


def test_a_comparison_reports_progress_from_nothing_to_all() -> None:
    experiment = prepare(load_scenario(write("duration_s = 3.0\n[controller]\nfeedback = 'truth'")))
    shares: list[float] = []
    runs.compare([experiment, experiment], 1, shares.append)
    assert shares == sorted(shares)
    assert 0.0 < shares[0] < 0.5 < shares[-1] <= 1.0


def test_observers_of_one_name_from_two_places_do_not_overwrite_each_other() -> None:
    assert runs.file_names(["ltv", "a.b:Mine", "c:Mine", "c:Yours"]) == ["ltv", "a.b.Mine", "c.Mine", "Yours"]


# --- Ctrl-C --------------------------------------------------------------------------------------------------

SOURCE = """
import os, signal
from cmg_mj import Estimate

class Interrupts:
    '''Presses Ctrl-C at the 600th sample, once or more often.'''
    def __init__(self, dt, model, times=1):
        self.times = times
    def init(self, y):
        return 0
    def step(self, k, y, u):
        if k == 598:
            for _ in range(self.times):
                os.kill(os.getpid(), signal.SIGINT)
        return k + 1, Estimate(y.y1, 0.0 * y.y1, y.y2)
"""
LONG = "duration_s = 600.0\n[controller]\nfeedback = 'truth'\n[observer]\nkind = 'pressing:Interrupts'"


@pytest.mark.parametrize("driver", ["native", "callback"])
def test_ctrl_c_ends_a_run_at_the_next_clean_point(driver: str) -> None:
    """The class is found in the current folder."""
    write(SOURCE, "pressing.py")
    said = cmg_mj_process("run", write(LONG), "--out", "it", "--json", "--driver", driver, cwd=Path())
    assert said.status == 130, said
    assert said.err == "cmg-mj: interrupted at 3.835 s; what was recorded until then is in it\n"
    assert len(assert_whole("it")) == 768  # three pieces of 256 ticks
    assert json.loads(said.out)["outcome"] == "interrupted"


def test_ctrl_c_twice_ends_a_run_at_once() -> None:
    write(SOURCE, "pressing.py")
    said = cmg_mj_process("run", write(LONG), "--out", "it", "--set", "observer.times=2", cwd=Path())
    assert said.status == 130, said
    assert said.err.splitlines()[-1] == "cmg-mj: interrupted at 2.995 s; what was recorded until then is in it"
    assert len(assert_whole("it")) == 599


WRITING = """
import os, signal
from cmg_mj import cli, runs
def pressed(record, times=({times})):
    def press(*arguments):
        for _ in range(times):
            os.kill(os.getpid(), signal.SIGINT)
        record(*arguments)
    return press
runs.write_json_before, runs._write_json = runs._write_json, pressed(runs._write_json)
cli.main(["run", "my.toml", "--out", "it"])
"""


def run_python(program: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", program], env=environment(), capture_output=True, text=True, timeout=60, check=False
    )


def test_ctrl_c_while_files_are_written_lets_them_be_finished() -> None:
    write("duration_s = 0.2")
    done = run_python(WRITING.format(times=1))
    assert done.returncode == 130, done
    assert done.stderr.splitlines()[-1] == "cmg-mj: interrupted when all was done; it is in it"
    assert_whole("it")


def test_ctrl_c_twice_while_files_are_written_leaves_no_broken_one() -> None:
    write("duration_s = 0.2")
    done = run_python(WRITING.format(times=2))
    assert done.returncode == 130, done
    assert done.stderr == "cmg-mj: interrupted\n"
    assert names("it") == ["trajectory.parquet"]
    assert len(Trajectory.load(Path("it/trajectory.parquet"))) == 40


def test_ctrl_c_ends_a_comparison_with_the_observers_that_are_done() -> None:
    write(SOURCE, "pressing.py")
    file = write("duration_s = 3.0\n[controller]\nfeedback = 'truth'")
    said = cmg_mj_process(
        "compare", file, "--observers", "linear,pressing:Interrupts,ltv", "--worlds", 1, "--out", "it", cwd=Path()
    )
    assert said.status == 130, said
    assert said.err.splitlines()[-1] == "cmg-mj: interrupted; 1 of 3 observers are in it"
    assert names("it") == ["recording.rrd", "scenario.toml", "summary.json", "trajectory-linear.parquet"]
    (entry,) = json.loads(Path("it/summary.json").read_text())
    assert entry["observer"] == "linear"


def test_ctrl_c_before_the_first_observer_is_done_leaves_no_files() -> None:
    write(SOURCE, "pressing.py")
    said = cmg_mj_process(
        "compare", write(LONG), "--observers", "pressing:Interrupts", "--worlds", 1, "--out", "it", cwd=Path()
    )
    assert (said.status, said.out) == (130, "")
    assert said.err == "cmg-mj: interrupted before the first observer was done; nothing was written\n"
    assert names("it") == []


def test_ctrl_c_from_outside() -> None:
    """A real one, to a run that would take half a minute."""
    running = subprocess.Popen(
        [*COMMAND, "run", write("duration_s = 600.0"), "--out", "it"],
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    until = time.monotonic() + 30.0
    while not Path("it").exists() and time.monotonic() < until:
        time.sleep(0.01)
    time.sleep(0.5)
    running.send_signal(signal.SIGINT)
    _, err = running.communicate(timeout=30)
    assert running.returncode == 130, err
    assert err.splitlines()[-1].startswith("cmg-mj: interrupted at ")
    trajectory = assert_whole("it")
    assert 0 < len(trajectory) < 600 * 200
    verified = subprocess.run([sys.executable, "-m", "rerun", "rrd", "verify", "it/recording.rrd"], capture_output=True)
    assert verified.returncode == 0, verified


def test_another_run_does_not_take_the_folder_of_one_that_is_there() -> None:
    first = prepare(parse_scenario({"duration_s": 0.05}))
    other = prepare(parse_scenario({"duration_s": 0.05, "plant": {"equilibrium_bias_deg": 0.2}}))
    folder = runs.output_folder(runs.unused_folder(Path("runs"), "mine", first))
    runs.save_run(folder, first, first.run())
    assert runs.unused_folder(Path("runs"), "mine", first) == folder
    assert runs.unused_folder(Path("runs"), "mine", other) == Path("runs/mine-2")


def test_a_comparison_trims_where_there_is_a_bias_estimate() -> None:
    """Those without one run untrimmed; alone, they are refused (tests/test_bad_input.py)."""
    scenario = load_scenario("bias_estimation", ["duration_s=0.5"])
    experiments = runs.prepare_comparison(scenario, ["linear", "adaptive", "homogeneous_adaptive"])
    assert [experiment.scenario.controller.trim_s for experiment in experiments] == [0.0, 1.0, 1.0]

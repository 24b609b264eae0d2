"""Failures during a run, or when its files are written."""

from __future__ import annotations

import shutil
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from cmg_mj import Estimate, Measurement
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.studies import save as runs
from cmg_mj.visualization import recording
from tests.command import cmg_mj
from tests.inputs.complaints import assert_in_order, table
from tests.inputs.test_users_observer import Mine
from tests.run_folders import FILES, assert_whole, names


@table(
    ("a huge push", "[[push]]\nstart_s = 0.1\ntorque_n_m = 1e9", "the plant diverged at t = 0.105 s", "smaller"),
)
@pytest.mark.parametrize("command", ["run", "compare"])
def test_a_plant_that_diverges(command: str, wrong_input: str, fragments: list[str]) -> None:
    Path("my.toml").write_text(f"duration_s = 0.5\n{wrong_input}")
    options = ["--observers", "linear", "--worlds", "2"] if command == "compare" else ["--json"]
    outcome = cmg_mj(command, "my.toml", "--out", "it", *options)
    assert outcome.status == 2
    assert_in_order(["cmg-mj: ", *fragments], outcome.err.splitlines()[-1])
    assert (Path("it") / "recording.rrd").exists()


class PutsInTheWay(Mine):
    """Makes a folder where a file is to be."""

    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        if k == 10:
            Path("it/plot.png/mine").mkdir(parents=True)
        return Estimate(y.y1, rate, y.y2)


def test_what_comes_in_the_way_of_a_file(quick: str) -> None:
    outcome = cmg_mj("run", quick, "--out", "it", "--json", "--plot", "--observer", f"{__name__}:PutsInTheWay")
    assert outcome.status == 0
    assert outcome.err.startswith("Written to it-2; what was in it stays as it was. Open")
    assert outcome.out.startswith("{")  # the summary is not lost
    assert names("it") == ["plot.png"]
    assert names("it/plot.png") == ["mine"]
    assert names("it-2") == sorted([*FILES, "plot.png"])


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_cannot_be_written_keeps_no_other_from_being(
    quick: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(path: Path, *arguments: object) -> None:
        path.write_text("begun")
        raise IsADirectoryError(21, "Is a directory")

    write_text = runs.write_text

    def fails_on_toml(path: Path, text: str) -> None:
        (write_text if text.startswith("{") else fail)(path, text)

    owner, writer = {
        "scenario.toml": (runs, "write_text"),
        "trajectory.parquet": (Trajectory, "save"),
        "summary.json": (runs, "_write_json"),
        "recording.rrd": (recording, "write_recording"),
    }[name]
    method = fails_on_toml if name == "scenario.toml" else fail
    monkeypatch.setattr(owner, writer, method if isinstance(owner, ModuleType) else lambda _, path, *more: fail(path))
    outcome = cmg_mj("run", quick, "--out", "it", "--json")
    assert outcome.status == 2
    assert outcome.err == f"cmg-mj: it/{name}: cannot be written: Is a directory\n"
    assert outcome.out.startswith("{")  # the summary is not lost
    assert names("it") == [file for file in FILES if file != name]


class Removes(Mine):
    """Removes the folder that the run is to be written to."""

    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        if k == 10:
            shutil.rmtree("it", ignore_errors=True)
        return Estimate(y.y1, rate, y.y2)


def test_a_folder_that_disappears_is_made_again(quick: str) -> None:
    outcome = cmg_mj("run", quick, "--out", "it", "--observer", f"{__name__}:Removes")
    assert outcome.status == 0
    assert_whole("it")

"""What goes wrong while a run goes on, or when it is written."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from cmg_mj import Estimate, Measurement
from tests.bad_input.complaints import assert_in_order, table
from tests.bad_input.test_users_observer import Mine
from tests.command import cmg_mj


@table(
    ("a huge push", "[[push]]\nstart_s = 0.1\ntorque_n_m = 1e9", "the plant diverged at t = 0.105 s", "smaller"),
)
@pytest.mark.parametrize("command", ["run", "compare"])
def test_a_plant_that_diverges(command: str, given: str, fragments: list[str]) -> None:
    Path("my.toml").write_text(f"duration_s = 0.5\n{given}")
    options = ["--observers", "linear", "--worlds", "2"] if command == "compare" else ["--json"]
    said = cmg_mj(command, "my.toml", "--out", "it", *options)
    assert said.status == 2
    assert_in_order(["cmg-mj: ", *fragments], said.err.splitlines()[-1])
    assert (Path("it") / "recording.rrd").exists()


@pytest.mark.parametrize("name", ["scenario.toml", "summary.json", "trajectory.parquet", "recording.rrd", "plot.png"])
def test_a_file_that_cannot_be_written_keeps_no_other_from_being(quick: str, name: str) -> None:
    (Path("it") / name / "in the way").mkdir(parents=True)
    plot = ["--plot"] if name == "plot.png" else []
    said = cmg_mj("run", quick, "--out", "it", "--json", *plot)
    assert said.status == 2
    assert said.err == f"cmg-mj: it/{name}: cannot be written: Is a directory\n"
    assert said.out.startswith("{")  # the summary is not lost
    files = {path.name for path in Path("it").iterdir() if path.is_file()}
    assert files == {"scenario.toml", "summary.json", "trajectory.parquet", "recording.rrd"} - {name}


class Removes(Mine):
    """Removes the folder that the run is to be written to."""

    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        if k == 10:
            shutil.rmtree("it", ignore_errors=True)
        return Estimate(y.y1, rate, y.y2)


def test_a_folder_that_disappears(quick: str) -> None:
    said = cmg_mj("run", quick, "--out", "it", "--observer", f"{__name__}:Removes")
    assert said.status == 2
    (line,) = said.err.splitlines()
    assert line.startswith("cmg-mj: it/trajectory.parquet: cannot be written: ")

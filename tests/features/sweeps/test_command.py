"""`cmg-mj sweep`: its files, their reruns, and the same from Python."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import cmg_mj as package
from cmg_mj.core.errors import InputError
from cmg_mj.features.sweeps import chunks
from cmg_mj.features.sweeps.chunks import FIGURES
from cmg_mj.inputs.files import folder
from tests.command import cmg_mj
from tests.features.sweeps.synthetic_trials import BIAS, VELOCITY

SMALL = ["sweep", "push_recovery", "--vary", f"{BIAS}=0,1", "--observers", "linear,gyro_free", "--worlds", "3"]
SHORT = ["--set", "duration_s=0.5", "--set", "push=[]"]
WEIGHTS = "controller.lqr.state_cost"
LAW = ["--set", f"{WEIGHTS}=[286, 3, 0, 0.08]"]


@pytest.mark.slow
def test_the_files_of_a_sweep(tmp_path: Path) -> None:
    out, again = tmp_path / "out", tmp_path / "again"
    outcome = cmg_mj(*SMALL, *SHORT, "--out", out, "--json")
    assert outcome.status == 0
    cells = json.loads(outcome.out)["cells"]
    places = [(cell[BIAS], cell["observer"]) for cell in cells]
    assert places == [(0, "linear"), (0, "gyro_free"), (1, "linear"), (1, "gyro_free")]
    assert {"trials.parquet", "report.md", "curves.png", "study.toml"} <= {path.name for path in out.iterdir()}
    assert pq.read_table(out / "cells.parquet").to_pylist() == cells
    trials = pq.read_table(out / "trials.parquet")
    errors = [row[VELOCITY] for row in trials.to_pylist() if row["observer"] == "linear" and row[BIAS] == 1]
    assert cells[2][VELOCITY] == pytest.approx(np.mean(errors))
    assert cells[2][f"{VELOCITY}_behind_best_low"] > 0.0
    assert cells[2][f"{VELOCITY}_best"] == "gyro_free"
    assert cmg_mj("sweep", out / "study.toml", "--out", again).status == 0
    assert pq.read_table(again / "trials.parquet").equals(trials)
    assert "resuming: 12 of 12 trials are done" in cmg_mj(*SMALL, *SHORT, "--out", out).err


@pytest.mark.parametrize(
    "axes",
    [
        pytest.param([*LAW, "--vary", "plant.flywheel_speed_rad_s=200,314"], marks=pytest.mark.slow),
        ["--vary", f"{WEIGHTS}=[286,3,0,0.08],[500,3,0,0.08]"],
        pytest.param([*LAW, "--vary", "controller.lqr.input_cost=1,3"], marks=pytest.mark.slow),
    ],
)
def test_gains_that_are_solved_for_rerun_from_their_weights(tmp_path: Path, axes: list[str]) -> None:
    out, rerun = tmp_path / "out", tmp_path / "again"
    settings = ["--set", "duration_s=0.5", "--set", "push.0.start_s=0.2", "--worlds", 2]
    assert cmg_mj("sweep", "push_recovery", *axes, *settings, "--out", out).status == 0
    assert cmg_mj("sweep", out / "study.toml", "--out", rerun).status == 0
    first = pq.read_table(out / "trials.parquet")
    assert first.equals(pq.read_table(rerun / "trials.parquet"))
    commands = first["command_rms_rad_s"].to_pylist()
    assert commands[0] != commands[2]


@pytest.mark.slow
def test_a_row_reruns_alone(tmp_path: Path) -> None:
    """Worlds 0, 1 and 2, fields that go together, a push: `cmg-mj run` with the row's values has its figures."""
    rates, torque = ("controller.rate_hz", "sensors.accelerometer.rate_hz"), "push.0.torque_n_m"
    axes = ["--vary", f"{'+'.join(rates)}=100,200", "--vary", f"{torque}=0.3:0.5"]
    settings = ["--set", "duration_s=0.5", "--set", "push.0.start_s=0.2"]
    design = ["--sample", "2", "--worlds", "3", "--seed", "7", "--observers", "linear,gyro_free"]
    assert cmg_mj("sweep", "push_recovery", *axes, *settings, *design, "--out", tmp_path / "out").status == 0
    rows = pq.read_table(tmp_path / "out" / "trials.parquet").to_pylist()
    for row, world in ((rows[0], 0), (rows[4], 1), (rows[8], 2)):
        row_settings = [part for field in (*rates, torque) for part in ("--set", f"{field}={row[field]}")]
        options = ["--observer", row["observer"], "--seed", row["seed"], "--world", world, "--json"]
        outcome = cmg_mj("run", "push_recovery", *settings, *row_settings, *options, "--out", tmp_path / "alone")
        assert outcome.status == 0, outcome
        alone = json.loads(outcome.out)
        figures = {key for key in FIGURES if row[key] is not None}
        assert len(figures) > 8
        assert {key: alone[key] for key in figures} == {key: row[key] for key in figures}
    assert {row["observer"] for row in (rows[0], rows[8])} == {"linear", "gyro_free"}
    assert len({row[VELOCITY] for row in rows[:3]}) == 3  # worlds differ


def test_a_study_file_with_settings_and_its_own_model(tmp_path: Path) -> None:
    """The model is beside the file, `--set` changes the file's scenario, options its design."""
    for name in ("scissored_pair.xml", "cube.xml"):
        text = (folder("models") / name).read_text(encoding="utf-8")
        (tmp_path / name.replace("scissored_pair", "mine")).write_text(text, encoding="utf-8")
    (tmp_path / "s.toml").write_text(
        f'[scenario]\nduration_s = 0.2\nplant.model = "mine.xml"\n[sweep]\nworlds = 2\n[vary]\n"{BIAS}" = [0, 0.5]\n',
        encoding="utf-8",
    )
    out = tmp_path / "out"
    outcome = cmg_mj("sweep", tmp_path / "s.toml", "--set", "controller.feedback=truth", "--worlds", 3, "--out", out)
    assert outcome.status == 0
    fields = tomllib.loads((out / "study.toml").read_text(encoding="utf-8"))
    assert (fields["scenario"]["controller"]["feedback"], fields["sweep"]["worlds"]) == ("truth", 3)
    wrong = cmg_mj("sweep", tmp_path / "s.toml", "--set", "controller.feedbak=truth", "--dry-run")
    assert (wrong.status, "controller.feedbak: no such field" in wrong.complaint) == (2, True)


def test_ctrl_c_in_a_dry_run_after_it_has_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(study: object, observer: str, trials: object, tick: Callable[[float], None]) -> None:
        tick(0.1)
        tick(0.2)
        raise KeyboardInterrupt

    monkeypatch.setattr(chunks, "compute", interrupt)
    assert cmg_mj("sweep", "push_recovery", "--vary", f"{BIAS}=0,1", "--dry-run").status == 130


def test_the_tables_of_a_sweep_as_frames() -> None:
    pytest.importorskip("pandas")
    scenario = package.load_scenario("push_recovery", ["duration_s=0.4", "push=[]"])
    swept = package.sweep(scenario, {BIAS: [0.0, 0.5]}, ["linear", "gyro_free"], worlds=2)
    assert list(swept) == ["trials", "cells"]
    assert len(swept.to_pandas("trials")) == 2 * 2 * 2
    assert swept.to_pandas()["observer"].tolist() == swept.cells["observer"].to_pylist()
    with pytest.raises(InputError, match="to_pandas: 'order'"):
        swept.to_pandas("order")

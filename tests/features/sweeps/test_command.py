"""`cmg-mj sweep`: its files, going on, and what it refuses."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from cmg_mj.features.sweeps.chunks import FIGURES
from cmg_mj.inputs.files import folder
from tests.command import cmg_mj

BIAS = "plant.equilibrium_bias_deg"
SMALL = ["sweep", "push_recovery", "--vary", f"{BIAS}=0,1", "--observers", "linear,gyro_free", "--worlds", "3"]
SHORT = ["--set", "duration_s=0.5", "--set", "push=[]"]
NOISES = ["--vary", "sensors.accelerometer.noise_density_ug_rthz=100:400:10"]


@pytest.mark.slow
def test_the_files_of_a_sweep(tmp_path: Path) -> None:
    outcome = cmg_mj(*SMALL, *SHORT, "--out", str(tmp_path / "out"), "--json")
    assert outcome.status == 0
    cells = json.loads(outcome.out)["cells"]
    assert [(cell[BIAS], cell["observer"]) for cell in cells] == [
        (0, "linear"),
        (0, "gyro_free"),
        (1, "linear"),
        (1, "gyro_free"),
    ]
    assert {"trials.parquet", "cells.parquet", "report.md", "study.toml"} <= {
        p.name for p in (tmp_path / "out").iterdir()
    }
    assert pq.read_table(tmp_path / "out" / "cells.parquet").to_pylist() == cells
    trials = pq.read_table(tmp_path / "out" / "trials.parquet").to_pylist()
    errors = [row["velocity_rms_error_rad_s"] for row in trials if row["observer"] == "linear" and row[BIAS] == 1]
    assert cells[2]["velocity_rms_error_rad_s"] == pytest.approx(np.mean(errors))
    assert cells[2]["velocity_rms_error_rad_s_behind_best_low"] > 0.0
    assert cells[2]["velocity_rms_error_rad_s_best"] == "gyro_free"
    rerun = cmg_mj("sweep", str(tmp_path / "out" / "study.toml"), "--out", str(tmp_path / "again"))
    assert rerun.status == 0
    rerun_trials = pq.read_table(tmp_path / "again" / "trials.parquet")
    assert rerun_trials.equals(pq.read_table(tmp_path / "out" / "trials.parquet"))
    second_outcome = cmg_mj(*SMALL, *SHORT, "--out", str(tmp_path / "out"))
    assert "resuming: 12 of 12 trials are done" in second_outcome.err


WEIGHTS = "controller.lqr.state_cost"


@pytest.mark.parametrize(
    "axes",
    [
        pytest.param(
            ["--set", f"{WEIGHTS}=[286, 3, 0, 0.08]", "--vary", "plant.flywheel_speed_rad_s=200,314"],
            marks=pytest.mark.slow,
        ),
        ["--vary", f"{WEIGHTS}=[286,3,0,0.08],[500,3,0,0.08]"],
        pytest.param(
            ["--set", f"{WEIGHTS}=[286, 3, 0, 0.08]", "--vary", "controller.lqr.input_cost=1,3"],
            marks=pytest.mark.slow,
        ),
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
    for row in (rows[0], rows[4], rows[8]):
        row_settings = [part for field in (*rates, torque) for part in ("--set", f"{field}={row[field]}")]
        run_options = ["--observer", row["observer"], "--seed", row["seed"], "--world", row["world"]]
        outcome = cmg_mj(
            "run", "push_recovery", *settings, *row_settings, *run_options, "--json", "--out", tmp_path / "alone"
        )
        assert outcome.status == 0, outcome
        alone = json.loads(outcome.out)
        figures = {key for key in FIGURES if row[key] is not None}
        assert len(figures) > 8
        assert {key: alone[key] for key in figures} == {key: row[key] for key in figures}
    assert [row["world"] for row in (rows[0], rows[4], rows[8])] == [0, 1, 2]
    assert {row["observer"] for row in (rows[0], rows[8])} == {"linear", "gyro_free"}
    errors = [row["velocity_rms_error_rad_s"] for row in rows[:3]]
    assert len(set(errors)) == 3  # worlds differ


@pytest.mark.slow
def test_the_report_of_a_map(tmp_path: Path) -> None:
    out = tmp_path / "out"
    rates = ["--vary", "sensors.accelerometer.noise_density_ug_rthz=100,400"]
    assert cmg_mj(*SMALL, *rates, *SHORT, "--out", str(out)).status == 0
    report = (out / "report.md").read_text(encoding="utf-8")
    assert "![Push recovery: velocity RMS error [rad/s], 3 worlds a cell](map_velocity_error.png)" in report
    assert (out / "map_velocity_error.png").read_bytes().startswith(b"\x89PNG")
    assert "No world fell." in report


@pytest.mark.slow
def test_a_design_for_indices(tmp_path: Path) -> None:
    out = tmp_path / "out"
    axes = ["--vary", f"{BIAS}=-1:1", "--vary", "sensors.accelerometer.noise_density_ug_rthz=log:100:800"]
    arguments = ["sweep", "push_recovery", *axes, "--sobol", "16", "--worlds", "2", *SHORT, "--out", str(out)]
    outcome = cmg_mj(*arguments, "--observers", "linear")
    assert outcome.status == 0
    rows = pq.read_table(out / "indices.parquet").to_pylist()
    row_of = {row["field"]: row for row in rows if row["figure"] == "velocity_rms_error_rad_s"}
    noise = row_of["sensors.accelerometer.noise_density_ug_rthz"]
    assert noise["total_low"] < noise["total"] < noise["total_high"]
    assert not any("push" in row["figure"] for row in rows)
    interval_text = f"{noise['total']:.3f} [{noise['total_low']:.3f}, {noise['total_high']:.3f}]"
    assert "| total index, velocity RMS error |" in " ".join(outcome.out.split())
    assert interval_text in outcome.out
    report = (out / "report.md").read_text(encoding="utf-8")
    assert f"| linear     | {BIAS} " in report
    assert f"{noise['total']:.3f} [{noise['total_low']:.3f}, {noise['total_high']:.3f}]" in report
    assert not list(out.glob("*.png"))


def test_a_study_file_with_settings_and_its_own_model(tmp_path: Path) -> None:
    """The model is beside the file, `--set` changes the file's scenario, options its design."""
    for name in ("scissored_pair.xml", "cube.xml"):
        (tmp_path / name.replace("scissored_pair", "mine")).write_text(
            (folder("models") / name).read_text(encoding="utf-8"), encoding="utf-8"
        )
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


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--vary", "plant.equilibrium_bias=0,1"], "plant.equilibrium_bias: no such field; did you mean"),
        (["--vary", f"{BIAS}=0,90"], f"{BIAS} = 90: must be"),
        (["--vary", f"{BIAS}"], "no values"),
        ([], "nothing is varied"),
        (["--vary", f"{BIAS}=0:1"], "a range without a count is for --sample and --sobol"),
        (["--vary", f"{BIAS}=0:1", "--sobol", "200"], "--sobol 200: must be a power of two, such as 256"),
        (["--vary", "observer.k1=10,20", "--observers", "homogeneous,linear"], "observer.k1"),
        (["--vary", "observer.k1=10,-20"], "observer.k1"),
        (
            ["--vary", f"{BIAS}=0:1:11", *NOISES, "--worlds", "10000"],
            "1100000 trials; for more than 1000000 give --yes",
        ),
        (["--vary", f"{BIAS}=0:1", "--sobol", "2", "--sample", "3"], "--sample and --sobol: one of them"),
        (["--vary", f"{BIAS}=0,1", "--observers", "linar"], "no such observer; did you mean 'linear'"),
    ],
)
def test_what_is_refused(tmp_path: Path, arguments: list[str], complaint: str) -> None:
    outcome = cmg_mj("sweep", "push_recovery", *arguments, "--out", str(tmp_path / "out"))
    assert complaint in outcome.complaint
    assert not (tmp_path / "out").exists()

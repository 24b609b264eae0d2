"""Scripts of docs/studies whose tables the documentation and the changelog name; its study files."""

from __future__ import annotations

import importlib
import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

from cmg_mj.results.error_bounds import acceleration_floor
from cmg_mj.sensors.tilt import TiltNoise
from cmg_mj.studies.sweeps.study import SweepStudy
from cmg_mj.studies.sweeps.study_file import axes_of, design_of, scenario_of, study_file
from tests.command import cmg_mj

STUDIES = Path(__file__).resolve().parents[2] / "docs/studies"
REAL_RIGS = ("real_bend", "real_pivot", "real_rigs", "real_vibration")
"""Study files of many observers, which `--dry-run` would try for minutes."""
STEPS = STUDIES / "steps.py"


@pytest.mark.slow
def test_the_table_of_steps() -> None:
    arguments = "--worlds 2 --observers linear --integrators RK4 --steps-ms 2.5,5 --set duration_s=0.5 --set push=[]"
    process = subprocess.run([sys.executable, STEPS, *arguments.split()], capture_output=True, text=True, check=True)
    rows = [line for line in process.stdout.splitlines() if line.startswith("| RK4")]
    assert len(rows) == 2
    assert "0.00 %" in rows[0]


@pytest.mark.slow
def test_the_tables_of_the_accelerometers_errors() -> None:
    arguments = "alone --only outer --worlds 2 --observers linear --jobs 1 --set duration_s=0.2 --set push=[]"
    command = [sys.executable, STUDIES / "sensor_errors.py", *arguments.split()]
    process = subprocess.run(command, capture_output=True, text=True, check=True)
    rows = [line.split("|")[1:-1] for line in process.stdout.splitlines() if line.startswith("| offset 5 mg, outer")]
    assert [len(row) for row in rows] == [10, 5]
    assert float(rows[0][1]) == 0.14  # atan(0.5 * 5e-3)
    assert "- to the MEMS gyro: in " in process.stdout


@pytest.mark.slow
def test_the_table_of_gyro_free_against_the_others() -> None:
    """Two cells whose sign does not depend on the worlds; the rows of the page are those of the study."""
    arguments = "--worlds 2 --jobs 1 --only"
    command = [sys.executable, STUDIES / "gyro_free_against.py", *arguments.split(), "mast of 10 Hz"]
    process = subprocess.run(command, capture_output=True, text=True, check=True)
    assert re.search(r"\| mast of 10 Hz +\| +- \(2 fell\) \| +- \(2 fell\) \| +\d\d \|", process.stdout)
    assert "100%" in process.stderr
    study = STUDIES / "gyro_free_against.py"
    spec = importlib.util.spec_from_file_location("gyro_free_against", study)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    page = (STUDIES.parent / "which_observer_evidence.md").read_text(encoding="utf-8")
    cases = [*module.sensor_errors(), *module.pivots(), *module.bends()]
    rows = re.findall(r"(?m)^\| ([^|]+) \|", page)[1:]
    assert rows == [case.name for case in cases]


@pytest.mark.slow
def test_the_table_for_a_builder() -> None:
    """Its rows, and the heads that docs/which_observer.md has too."""
    command = [sys.executable, STUDIES / "for_a_builder.py", "--worlds", "2", "--observers", "linear,gyro_free"]
    process = subprocess.run(command, capture_output=True, text=True, check=True)
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in process.stdout.splitlines()[2:]]
    page = (STUDIES.parent / "which_observer.md").read_text(encoding="utf-8")
    assert "| " + " | ".join(rows[0]) + " |" in page
    assert [row[0] for row in rows[2:]][:3] == ["`linear`", "`gyro_free`", "`zero`"]
    assert rows[2][4] == "-3.00 to 2.00"
    assert "100%" in process.stderr


@pytest.mark.slow
def test_the_tables_of_the_baselines() -> None:
    command = [sys.executable, STUDIES / "baselines.py", "--worlds", "2"]
    process = subprocess.run(command, capture_output=True, text=True, check=True)
    assert re.search(r"\| fused, told nothing, offset 20 deg/s +\| +0\.\d+ \| +0\.00\d+ \| +0\.001", process.stdout)
    assert re.search(r"\| 0\.1, 0\.15 +\| +0\.83 \| +1\.11 \| +0\.0366 \|", process.stdout)


@pytest.mark.slow
def test_the_table_of_the_numbers_of_free_pivot() -> None:
    study = STEPS.with_name("free_pivot_tuning.py")
    arguments = "--worlds 2 --falls 2 --jobs 1"
    process = subprocess.run([sys.executable, study, *arguments.split()], capture_output=True, text=True, check=True)
    assert re.search(r"\| as it is +(\| +\d\.\d\d ){6}\| +\d \|", process.stdout)
    assert process.stdout.count("\n") == 12


@pytest.mark.slow
def test_the_tables_of_gyro_free() -> None:
    study = STEPS.with_name("gyro_free.py")
    arguments = "--worlds 2 --noise 400 --e 0.5 --parts model,taps"
    process = subprocess.run([sys.executable, study, *arguments.split()], capture_output=True, text=True, check=True)
    assert "| 400       |      0.01406 |     0.01268 |  9.8 % |" in process.stdout
    assert process.stdout.count("as in the tables") == 3


@pytest.mark.slow
def test_the_tables_of_the_laws() -> None:
    arguments = "--worlds 2 --e 0.5 --figures-only"
    command = [sys.executable, STUDIES / "laws.py", *arguments.split()]
    process = subprocess.run(command, capture_output=True, text=True, check=True)
    assert process.stdout.count("| `lqg`  ") == 1
    assert process.stdout.count("| (8), `kalman`") == 2


@pytest.mark.slow
def test_the_table_of_turning_rigs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(STUDIES)
    table = importlib.import_module("two_axes_loop").fastest_turn([3.0])
    assert re.findall(r"stands|fell at [\d.]+ s", table) == ["stands", "fell at 2.0 s", "fell at 0.9 s"]


@pytest.mark.slow
def test_the_tables_of_two_axes() -> None:
    command = [sys.executable, STUDIES / "two_axes.py", "--worlds", "1"]
    process = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "c = [+0, +1], [-1, +0]" in process.stdout
    assert re.search(r"w c sin.* \| +\+0.000 \| +\+0.000 \|\n", process.stdout)
    assert re.search(r"wheel 10 % slow +\| +0.0345 \|", process.stdout)
    assert len(re.findall(r"\| (?:held|free)  \| 1/1 ", process.stdout)) == 4


@pytest.mark.slow
@pytest.mark.parametrize(
    "study", sorted({path.name for path in STUDIES.glob("*.toml")} - {f"{name}.toml" for name in REAL_RIGS})
)
def test_a_study_file_can_be_run(study: str) -> None:
    outcome = cmg_mj("sweep", STUDIES / study, "--dry-run")
    assert outcome.status == 0, outcome.err
    assert " trials in " in outcome.out


@pytest.mark.parametrize("study", REAL_RIGS)
def test_a_study_of_real_rigs_has_the_baselines(study: str) -> None:
    name = str(STUDIES / f"{study}.toml")
    fields = study_file(name)
    assert fields is not None
    settings = fields.get("sweep", {})
    design = design_of(name, settings)
    scenario, axes = scenario_of(name, fields), tuple(axes_of(name, fields))
    parsed = SweepStudy(scenario, axes, tuple(settings.get("observers", [])), settings.get("worlds", 0), *design)
    assert {"zero", "mems_as_bought", "mems_fused"} <= set(parsed.references)
    assert {"gyro_free", "free_pivot"} <= set(parsed.observers)


@pytest.mark.slow
@pytest.mark.parametrize("study", REAL_RIGS)
def test_a_study_of_real_rigs_runs(study: str, tmp_path: Path) -> None:
    size = "--sample 2 --worlds 1 --observers free_pivot,gyro_free,zero --set duration_s=0.1 --set push.0.start_s=0"
    outcome = cmg_mj("sweep", STUDIES / f"{study}.toml", *size.split(), "--out", tmp_path)
    assert outcome.status == 0, outcome.err
    report = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "| zero (baseline)" in report
    assert "## Refused and stopped" not in report


@pytest.mark.slow
def test_the_table_of_gymnasium() -> None:
    pytest.importorskip("imageio", reason='imageio is not installed: python -m pip install "gymnasium[mujoco]"')
    command = [sys.executable, STUDIES / "gymnasium_plugin.py", "cart held"]
    process = subprocess.run(command, capture_output=True, text=True, check=True)
    row = r"\| InvertedPendulum-v5, cart held \| +0.001 \| +10 of 10 \| +10 of 10 \| +0 of 10 \(\d+ to \d+ steps\) \|"
    assert re.search(row, process.stdout)
    assert re.search(row, (STUDIES.parent / "plugin_evidence.md").read_text(encoding="utf-8"))


@pytest.mark.slow
def test_a_cell_of_the_bending_frames_table(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(STUDIES)
    study = importlib.import_module("bending_frame")
    settings = [*study.bend(10.0, "mast"), *study.RATES["gyro_free"]]
    assert study.cell((settings, 2)) == "2 fall"
    assert float(study.cell(([*settings, "controller.notch_hz=10"], 2))) < 0.6


@pytest.mark.slow
def test_the_grid_of_free_pivot(tmp_path: Path) -> None:
    """Two worlds of two cells; the second call computes nothing."""
    arguments = ["--worlds", "2", "--jobs", "1", "--only", "0.5 m/s2 to 5 Hz", "--keep", tmp_path]
    command = [sys.executable, STUDIES / "free_pivot_grid.py", *map(str, arguments)]
    tables = [subprocess.run(command, capture_output=True, text=True, check=True).stdout for _ in range(2)]
    assert tables[0] == tables[1]
    assert len(list(tmp_path.iterdir())) == 2
    assert tables[0].count("| pivot 0.5 m/s2 to 5 Hz") == 3


@pytest.mark.slow
def test_the_bound_of_a_pivot_at_rest_is_that_of_the_acceleration(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(STUDIES)
    bound = importlib.import_module("free_pivot_grid").matched_bound
    noise, start = TiltNoise(0.0063, 0.41, 0.89), {"offset": 0.35, "rate": 0.02}
    at_rest, weak, strong, sine = (
        bound(noise, 0.005, motion, 9.81, **start)
        for motion in (None, ("noise", 0.05, 5.0), ("noise", 0.5, 5.0), ("sine", 0.5, 5.0))
    )
    assert at_rest.error == pytest.approx(acceleration_floor(noise, 0.005), rel=1e-9)
    assert at_rest.error == sine.error < weak.error < strong.error
    assert at_rest.early < weak.early < strong.early


@pytest.mark.slow
def test_the_tables_of_the_light_cart() -> None:
    """The cart of 1 kg: unstable about the pivot, stable about the mass centre."""
    command = [sys.executable, STUDIES / "light_cart.py", "--carts", "1", "--worlds", "1"]
    process = subprocess.run(command, capture_output=True, text=True, check=True)
    assert re.search(r"5.51 x1 \+ 0.12 u \| +274 \| +-0.279 \|", process.stdout)
    for about, stands in (("about the pivot", 0), ("about the mass centre", 1)):
        assert re.search(rf"\n\| gyro_free, {about} +\| +{stands} \|", process.stdout)

"""Scripts and study files of docs/studies run, with few worlds."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from tests.command import HANGS_AFTER_S, cmg_mj

STUDIES = Path(__file__).resolve().parents[2] / "docs/studies"
REAL_RIGS = ("real_bend", "real_pivot", "real_rigs", "real_vibration")
"""Study files of many observers, which `--dry-run` would try for minutes."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "line",
    [
        "baselines.py --worlds 2",
        "claims_not_reproduced.py --claim andrieu2009-bounds",
        "for_a_builder.py --worlds 2 --observers linear,gyro_free",
        "gimbal_gyro.py --worlds 2 --parts loop",
        "free_pivot_tuning.py --worlds 2 --falls 2 --jobs 1",
        "gyro_free.py --worlds 2 --noise 400 --e 0.5 --parts model,taps",
        "gyro_free_against.py --worlds 2 --jobs 1 --only 'mast of 10 Hz'",
        "laws.py --worlds 2 --e 0.5 --figures-only",
        "sensor_errors.py alone --only outer --worlds 2 --observers linear --jobs 1 --set duration_s=0.2 --set push=[]",
        "steps.py --worlds 2 --observers linear --integrators RK4 --steps-ms 2.5,5 --set duration_s=0.5 --set push=[]",
        "two_axes.py --worlds 1",
    ],
)
def test_a_script_prints_a_table(line: str) -> None:
    name, *arguments = shlex.split(line)
    process = subprocess.run(
        [sys.executable, STUDIES / name, *arguments], capture_output=True, text=True, timeout=HANGS_AFTER_S, check=True
    )
    assert "\n| " in process.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    "study", sorted({path.name for path in STUDIES.glob("*.toml")} - {f"{name}.toml" for name in REAL_RIGS})
)
def test_a_study_file_can_be_run(study: str) -> None:
    outcome = cmg_mj("sweep", STUDIES / study, "--dry-run")
    assert outcome.status == 0, outcome.err

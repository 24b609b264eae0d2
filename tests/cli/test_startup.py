"""Which libraries a command may not import: start-up time is mostly import time."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

DATA = Path(__file__).parents[2] / "examples/data/stepper_encoder_gyro.csv"
LIST, CHECK, RUN = "list", "check push_recovery", "run push_recovery --out run"
REPLAY = f"replay {DATA} --columns time=time_s,tilt=encoder_rad,rate=gyr_y_rad_s --out replay"

NEVER = ["control", "gymnasium", "sympy"]
FITTING = ["scipy.signal", "scipy.stats", "scipy.optimize", "scipy.interpolate", "matplotlib"]
FILES = ["pyarrow", "rerun", "tabulate"]
FORBIDDEN = {
    "--help": [*NEVER, *FITTING, *FILES, "numpy", "scipy", "pydantic", "mujoco", "rich"],
    LIST: [*NEVER, *FITTING, *FILES, "scipy", "mujoco"],
    CHECK: [*NEVER, *FITTING, *FILES],
    RUN: [*NEVER, *FITTING],
    REPLAY: NEVER,
}

# Runs a command and prints the modules it has imported, whatever its exit status is.
PROGRAM = """
import json, sys
from cmg_mj.cli import main
try:
    main(sys.argv[1:])
finally:
    print(json.dumps(sorted(sys.modules)), file=sys.stderr)
"""


def imported_modules(command: str, folder: Path, before: str = "") -> set[str]:
    """Run a command in a fresh interpreter: the modules that it has imported."""
    line = [sys.executable, "-c", before + PROGRAM, *command.split()]
    process = subprocess.run(line, cwd=folder, capture_output=True, text=True, check=True)
    return set(json.loads(process.stderr.splitlines()[-1]))


def forbidden_modules(command: str, modules: set[str]) -> list[str]:
    """The modules that the command may not import."""
    return [name for name in FORBIDDEN[command] if name in modules]


@pytest.mark.parametrize(
    "command",
    [
        "--help",
        LIST,
        pytest.param(CHECK, marks=pytest.mark.slow),
        pytest.param(RUN, marks=pytest.mark.slow),
        pytest.param(REPLAY, marks=pytest.mark.slow),
    ],
)
def test_imports_no_library_that_it_does_not_need(command: str, tmp_path: Path) -> None:
    assert forbidden_modules(command, imported_modules(command, tmp_path)) == []

"""Pairs on robots, with contacts, held joints and the solver's warm start: the runner's numbers, bit for bit."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

import cmg_mj
from tests.codegen.engine_plugin.made import ALL_IMPERFECTIONS, check_against_runner, make, needs_compiler, run

pytestmark = [needs_compiler, pytest.mark.slow]

ROOT = Path(cmg_mj.__file__).parents[1]
GYMNASIUM = find_spec("gymnasium")
ROBOTS: dict[str, tuple[str, dict[str, Any]]] = {
    "torso": ("examples/robots/torso.xml", {"body": "torso", "axis": "x", "scale": 1.21}),
    "bicycle": ("examples/robots/bicycle.xml", {"body": "frame", "axis": "x", "position": (0.0, 0.0, 0.3)}),
    "held pendulum": ("inverted_pendulum.xml", {"body": "pole", "axis": "hinge"}),
    "pendulum on a free cart": ("inverted_pendulum.xml", {"body": "pole", "axis": "hinge", "release": ["slider"]}),
    "hopper": ("hopper.xml", {"body": "torso", "axis": "x", "base": "free"}),
    "humanoid": ("humanoid.xml", {"body": "torso", "axis": "y", "scale": 2.2}),
}
SCENARIO = """\
duration_s = 6.0
push = [{ start_s = 3.0, duration_s = 0.1, torque_n_m = 2.0 }]
[plant]
model = "robot.xml"
initial_tilt_deg = 0.5
[controller]
gains = "scaled"
"""


@pytest.mark.parametrize("imperfections", [False, True], ids=["default", "all imperfections"])
@pytest.mark.parametrize("robot", ROBOTS)
def test_a_mounted_robot(robot: str, imperfections: bool, tmp_path: Path) -> None:
    file, options = ROBOTS[robot]
    if "/" not in file and (GYMNASIUM is None or GYMNASIUM.origin is None):
        pytest.skip("gymnasium is not installed")
    folder = ROOT if "/" in file else Path(str(GYMNASIUM and GYMNASIUM.origin)).parent / "envs" / "mujoco" / "assets"
    cmg_mj.mount(folder / file, **options).save(tmp_path / "robot.xml")
    (tmp_path / "robot.toml").write_text(SCENARIO, encoding="utf-8")
    made = make("gyro_free", *(ALL_IMPERFECTIONS if imperfections else ()), scenario=str(tmp_path / "robot.toml"))
    trajectory = made.experiment.run().trajectory
    assert trajectory is not None
    check_against_runner(made, run(made, made.start(), len(trajectory)), trajectory, "gyro_free")

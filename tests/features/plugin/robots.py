"""Pairs on robots, with contacts, held joints and the solver's warm start, as the tests and the table run them."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cmg_mj

ROOT = Path(cmg_mj.__file__).parents[1]
GYMNASIUM = find_spec("gymnasium")
ROBOTS: dict[str, tuple[str, dict[str, Any]]] = {
    "torso": ("examples/robots/torso.xml", {"body": "torso", "axis": "x", "scale": 1.21}),
    "bicycle": ("examples/robots/bicycle.xml", {"body": "frame", "axis": "x", "position": (0.0, 0.0, 0.3)}),
    "held pendulum": ("inverted_pendulum.xml", {"body": "pole", "axis": "hinge"}),
    "pendulum on a free cart": ("inverted_pendulum.xml", {"body": "pole", "axis": "hinge", "release": ["slider"]}),
    "hopper": ("hopper.xml", {"body": "torso", "axis": "x", "base": "free", "scale": 2.0}),
    "humanoid": ("humanoid.xml", {"body": "torso", "axis": "y", "scale": 2.2}),
}
SCENARIO = """\
push = [{ start_s = 3.0, duration_s = 0.1, torque_n_m = 2.0 }]
[plant]
model = "robot.xml"
equilibrium_bias_deg = 0.0
initial_tilt_deg = 0.5
[controller]
gains = "scaled"
"""


def is_missing(robot: str) -> bool:
    """Return whether the robot is Gymnasium's, and that is not installed."""
    return "/" not in ROBOTS[robot][0] and (GYMNASIUM is None or GYMNASIUM.origin is None)


def write_robot(robot: str, folder: Path, duration: float) -> str:
    """Write a robot with its pair and a scenario of so many seconds; returns the scenario's path."""
    file, options = ROBOTS[robot]
    place = ROOT if "/" in file else Path(str(GYMNASIUM and GYMNASIUM.origin)).parent / "envs" / "mujoco" / "assets"
    cmg_mj.mount(place / file, **options).save(folder / "robot.xml")
    (folder / "robot.toml").write_text(f"duration_s = {duration}\n{SCENARIO}", encoding="utf-8")
    return str(folder / "robot.toml")

"""Axes of whatever name: the runner's numbers, in files and symbols of their own."""

from __future__ import annotations

import json
import re
from html import escape
from pathlib import Path

import pytest

import cmg_mj
from cmg_mj import load_scenario, prepare
from cmg_mj.runs.experiment import Experiment
from tests.features.plugin.made import assert_same_run, needs_compiler

pytestmark = [needs_compiler, pytest.mark.slow]

MODELS = Path(cmg_mj.__file__).parents[1] / "models"
SCENARIO = """\
duration_s = 1.0
push = [{{ axis = {0}, start_s = 0.5, torque_n_m = 1.0 }}, {{ axis = {1}, start_s = 0.5, torque_n_m = -1.0 }}]
[plant]
model = "two_axes.xml"
turn_rate_rad_s = 1.0
[axes.{1}.plant]
equilibrium_bias_deg = -0.3
[controller]
gains = "scaled"
"""


def two_axes(roll: str, pitch: str, folder: Path) -> Experiment:
    """The bundled plant, its axes named otherwise."""
    for file in MODELS.glob("*.xml"):
        text = file.read_text(encoding="utf-8")
        for axis in ("roll", "pitch"):
            text = re.sub(rf'\b{axis}/|(?<=prefix="){axis}', lambda match: f"@{match[0]}", text)
        for axis, name in (("roll", roll), ("pitch", pitch)):
            text = text.replace(f"@{axis}", escape(name))
        (folder / file.name).write_text(text, encoding="utf-8")
    names = [json.dumps(name, ensure_ascii=False) for name in (roll, pitch)]
    (folder / "scenario.toml").write_text(SCENARIO.format(*names), encoding="utf-8")
    return prepare(load_scenario(str(folder / "scenario.toml"), [], "gyro_free"))


@pytest.mark.parametrize(
    ("roll", "pitch"),
    [
        ("l", "l/x"),
        ("a/b", "a_b"),
        ("größe", "controller"),
        ('"*/?\\', "<&'??/\U0001f600"),
    ],
)
def test_two_axes_of_some_names(roll: str, pitch: str, tmp_path: Path) -> None:
    experiment = two_axes(roll, pitch, tmp_path)
    assert_same_run(experiment.run(), experiment.run("plugin"))

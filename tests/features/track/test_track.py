"""Actuators that a file moves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario
from tests.recorded import recorded

STANDS = ["gait.steps=0", "duration_s=2.0"]


def nod(folder: Path, text: str, *settings: str) -> list[str]:
    (folder / "nod.csv").write_text(text, encoding="utf-8")
    return [*STANDS, f'track=[{{file="{folder / "nod.csv"}"}}]', *settings]


def test_the_joints_follow_in_one_world_and_in_many(tmp_path: Path) -> None:
    """Both hips pitch by 0.02 rad together, so that the torso leans; without the track it does not."""
    text = "time_s,left/hip_pitch,right/hip_pitch\n0,0,0\n0.5,0,0\n0.9,0.02,0.02\n"
    prepared = prepare(load_scenario("walk", nod(tmp_path, text)))
    alone = recorded(prepared.run(world=1))
    many = recorded(prepared.run_many([0, 1]))
    hip = alone["angle/left/hip_pitch_rad"]
    at = alone["time_s"] >= 1.2
    np.testing.assert_allclose(hip[at], 0.02, atol=2e-3)
    np.testing.assert_allclose(hip[alone["time_s"] < 0.5], 0.0, atol=2e-3)
    np.testing.assert_array_equal(hip, many["angle/left/hip_pitch_rad"][:, 1])


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (
            "time_s,left/hip_pich\n0,0\n",
            r"track\.0\.file: .*'left/hip_pich': no such actuator to move; .*left/hip_pitch",
        ),
        ("time_s,roll/cube1/gimbal_servo\n0,0\n", "no such actuator to move"),
        ("time_s,left/hip_pitch\n0,0.1\n", "begins at 0.1, and the keyframe has it at 0"),
        ("time_s,left/hip_pitch\n0,0\n0,1\n", "row 2: must hold finite numbers, and times that grow"),
        ("time_s,left/hip_pitch\n0,zero\n", "must hold numbers alone"),
        ("time_s\n0\n", "must have a heading"),
        ("time_ms,left/hip_pitch\n0,0\n", "must have a heading, time_s,ACTUATOR"),
        ("time_s,left/hip_pitch\n0,0\n1,1e300\n", "goes from 0 to 1e\\+300, and the actuator takes -1e\\+06"),
        ("time_s,left/hip_pitch\n9,0\n", "begins at 9 s, when the run has ended"),
        ("time_s,left/hip_pitch\n0,9007199254740993\n", "begins at|goes from"),
    ],
)
def test_what_does_not_fit_is_named(tmp_path: Path, text: str, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        prepare(load_scenario("walk", nod(tmp_path, text)))


def test_two_tracks_of_one_actuator_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "nod.csv"
    path.write_text("time_s,left/hip_pitch\n0,0\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"track\.1\.file: .* track\.0 moves it already"):
        prepare(load_scenario("walk", [*STANDS, f'track=[{{file="{path}"}},{{file="{path}"}}]']))

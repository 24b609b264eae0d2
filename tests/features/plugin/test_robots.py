"""Pairs on robots, with contacts, held joints and the solver's warm start: the runner's numbers, bit for bit."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.features.plugin.made import ALL_IMPERFECTIONS, check_against_runner, make, needs_compiler
from tests.features.plugin.robots import ROBOTS, is_missing, write_robot

pytestmark = [needs_compiler, pytest.mark.slow]


@pytest.mark.parametrize("imperfections", [False, True], ids=["default", "all imperfections"])
@pytest.mark.parametrize("robot", ROBOTS)
def test_a_mounted_robot(robot: str, imperfections: bool, tmp_path: Path) -> None:
    if is_missing(robot):
        pytest.skip("gymnasium is not installed")
    scenario = write_robot(robot, tmp_path, 15.0)
    check_against_runner(make("gyro_free", *(ALL_IMPERFECTIONS if imperfections else ()), scenario=scenario))

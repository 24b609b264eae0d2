"""Trajectories and results as mappings and as pandas frames."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

import cmg_mj
from cmg_mj.core.errors import InputError
from tests.recorded import recorded

SHORT = ["duration_s=0.4", "push=[]"]
BIASES = [0.5, 40.0]  # one stands, one falls


@cache
def experiment() -> cmg_mj.Experiment:
    return cmg_mj.prepare(cmg_mj.load_scenario("push_recovery", SHORT))


@cache
def many() -> cmg_mj.Result:
    return experiment().run_many(2, settings={"equilibrium_bias_deg": BIASES})


@cache
def one() -> cmg_mj.Result:
    return experiment().run()


EVERY: dict[str, Callable[[], Any]] = {
    "trajectory": lambda: recorded(one()),
    "trajectory of many worlds": lambda: recorded(many()),
    "result": many,
}
every = pytest.mark.parametrize("make", [pytest.param(make, id=name) for name, make in EVERY.items()])


@every
def test_keys_iteration_and_look_up_agree(make: Callable[[], Any]) -> None:
    table = make()
    assert list(table) == list(table.keys())
    assert list(dict(table)) == list(table)
    assert all(name in table for name in table)
    assert "no such column" not in table
    with pytest.raises(KeyError, match="no such column"):
        table["no such column"]


def test_a_trajectory_as_a_frame() -> None:
    pandas = pytest.importorskip("pandas")
    one_world = recorded(one())
    frame = one_world.to_pandas()
    assert list(frame.columns) == one_world.keys()
    np.testing.assert_array_equal(frame["x1_rad"], one_world["x1_rad"])
    pandas.testing.assert_frame_equal(frame, pandas.DataFrame(dict(one_world)))


def test_many_worlds_as_a_frame_have_a_row_a_world_and_tick() -> None:
    pytest.importorskip("pandas")
    worlds = recorded(many())
    frame = worlds.to_pandas()
    assert list(frame.columns) == ["world", *worlds.keys()]
    for world in (0, 1):
        alone, rows = worlds.world(world), frame[frame["world"] == world]
        assert len(rows) == len(alone)
        for name in alone:
            np.testing.assert_array_equal(rows[name], alone[name], name)
    assert len(worlds.world(1)) < len(worlds.world(0))  # it fell


def test_results_as_frames() -> None:
    pytest.importorskip("pandas")
    frame: Any = many().to_pandas()
    assert len(frame) == len(many())
    assert frame["velocity_rms_error_rad_s"].tolist()[0] == many().summaries[0]["velocity_rms_error_rad_s"]
    assert math.isnan(frame[frame["observer"] == "zero"]["settle_time_s"].tolist()[0])


@every
def test_without_pandas_the_message_names_the_cure(make: Callable[[], Any], monkeypatch: pytest.MonkeyPatch) -> None:
    table = make()
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(InputError, match=r"pandas is not installed. Install it with `python -m pip install pandas`"):
        table.to_pandas()
    assert dict(table)

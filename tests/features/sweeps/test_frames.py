"""The tables of a sweep as pandas frames."""

from __future__ import annotations

import pytest

import cmg_mj
from cmg_mj.core.errors import InputError


def test_the_tables_of_a_sweep_as_frames() -> None:
    pytest.importorskip("pandas")
    scenario = cmg_mj.load_scenario("push_recovery", ["duration_s=0.4", "push=[]"])
    swept = cmg_mj.sweep(scenario, {"plant.equilibrium_bias_deg": [0.0, 0.5]}, ["linear", "gyro_free"], worlds=2)
    assert swept.keys() == ["trials", "cells"]
    assert len(swept.to_pandas("trials")) == 2 * 2 * 2
    assert swept.to_pandas()["observer"].tolist() == swept.cells["observer"].to_pylist()
    with pytest.raises(InputError, match="to_pandas: 'order'"):
        swept.to_pandas("order")

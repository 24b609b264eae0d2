"""Numbers of many worlds taken together, and settings that vary over them."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.plant.plant import load_plant
from cmg_mj.results.baselines import BASELINES
from cmg_mj.results.result import Result
from cmg_mj.results.summary_keys import open_loop_figures
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario
from tests.recorded import recorded

ROWS = 2 + len(BASELINES)  # of a world: two observers, and what they are judged beside
BIASES = [0.5, 0.5, 40.0, 40.0]  # two worlds that stand, two that fall


@cache
def experiment() -> Experiment:
    settings = ["duration_s=1.0", "push=[]", 'open_loop_observers=["linear"]']
    return prepare(load_scenario("push_recovery", settings, "homogeneous"))


@cache
def result() -> Result:
    return experiment().run_many(4, settings={"equilibrium_bias_deg": BIASES})


ERROR = "velocity_rms_error_rad_s"


def test_worlds_vary_and_those_that_fell_do_not_count() -> None:
    actual = result()
    assert actual.stood.tolist() == [True, True, False, False]
    assert actual.fell.tolist() == [False, False, True, True]
    values = actual.values(ERROR)
    assert np.isnan(values).tolist() == [False, False, True, True]
    assert values[0] == actual.summaries[0][ERROR]
    assert actual.mean(ERROR) == pytest.approx((values[0] + values[1]) / 2.0)
    open_loop_observer = actual.values(ERROR, "linear")
    assert open_loop_observer[1] == open_loop_figures(actual.summaries[1])["linear"][ERROR]


def test_the_table_has_a_row_per_observer_and_world() -> None:
    table = result().table()
    assert table["observer"].to_pylist() == [name for name in ("homogeneous", "linear", *BASELINES) for _ in BIASES]
    assert table["in_loop_of"].to_pylist() == [None] * 4 + ["homogeneous"] * 4 * (1 + len(BASELINES))
    assert table["world"].to_pylist() == [0, 1, 2, 3] * ROWS
    assert table["stood"].to_pylist() == [True, True, False, False] * ROWS
    assert table["outcome"].to_pylist() == ["done", "done", "fell", "fell"] * ROWS
    assert table["end_time_s"].to_pylist() == [outcome.time_s for outcome in result().outcomes] * ROWS
    assert table[ERROR].to_pylist()[4:8] == [open_loop_figures(s)["linear"][ERROR] for s in result().summaries]
    assert set(table["tilt_rms_deg"].to_pylist()[4:]) == {None}  # the loop's alone


def test_references_have_values_too() -> None:
    zero = result().values(ERROR, "zero")
    assert zero[0] == result().summaries[0]["velocity_rms_rad_s"]
    assert np.isnan(zero).tolist() == [False, False, True, True]
    assert (result().values("velocity_fit", "mems_gyro")[:2] > 0.9).all()


def test_groups_are_the_worlds_in_their_order() -> None:
    survivors, fallen_worlds = result().split(2)
    assert survivors.stood.all()
    assert fallen_worlds.fell.all()
    assert fallen_worlds.mean(ERROR) is None
    np.testing.assert_array_equal(recorded(survivors)["x2_rad_s"], recorded(result())["x2_rad_s"][:, :2])
    assert survivors.seconds == 1.0 > fallen_worlds.seconds


def test_varied_rigs_are_those_of_their_own_scenarios() -> None:
    """World i at a varied setting is world i of the scenario with that setting, bit for bit."""
    alone = prepare(load_scenario("push_recovery", ["duration_s=1.0", "push=[]", "plant.equilibrium_bias_deg=1.0"]))
    batch = experiment().run_many([5, 6], settings={"equilibrium_bias_deg": np.array([0.0, 1.0])})
    np.testing.assert_array_equal(recorded(batch)["x2_rad_s"][:, 1], recorded(alone.run(world=6))["x2_rad_s"])


def test_equal_settings_share_one_rig() -> None:
    rigs = [setup.plant for setup in experiment().with_varied({"equilibrium_bias_deg": BIASES})]
    assert rigs[0] is rigs[1]
    assert rigs[2] is rigs[3] is not rigs[0]


@pytest.mark.parametrize(
    ("vary", "field"),
    [
        ({"equilibrium_bias_dg": [0.0, 1.0]}, "equilibrium_bias_dg"),
        ({"push.3.torque_n_m": [0.0, 0.005]}, "push.3"),
        ({"sensors.encoder.latency_s": [0.0, 0.005]}, "sensors.encoder.latency_s"),
        ({"observer.k1": [20.0, 21.0]}, "observer.k1"),
        ({"equilibrium_bias_deg": 1.0}, "lists of values"),
        ({"equilibrium_bias_deg": [0.0, 1.0], "initial_tilt_deg": [1.0]}, "as many values"),
        ({"equilibrium_bias_deg": [0.0]}, "2 worlds and 1 plants"),
        ({"timestep_s": [0.0005, 0.001]}, "timestep_s"),
        ({"model": ["scissored_pair.xml", "single_gimbal.xml"]}, "joints"),
    ],
)
def test_what_cannot_vary_is_refused(vary: dict[str, Any], field: str) -> None:
    with pytest.raises(InputError, match=field):
        experiment().run_many(2, settings=vary)


def test_plants_and_vary_are_not_given_together() -> None:
    with pytest.raises(InputError, match="not both"):
        experiment().run_many(1, plants=[load_plant()], settings={"equilibrium_bias_deg": [0.0]})


def test_wrong_keys_and_groups_are_refused() -> None:
    with pytest.raises(InputError, match="did you mean 'tilt_rms_deg'"):
        result().values("tilt_rms_dg")
    with pytest.raises(InputError, match="no open-loop observer of this run; did you mean 'linear'"):
        result().values(ERROR, "liner")
    for count in (0, -1, 3):
        with pytest.raises(InputError, match=r"split\(-?\d+\): \d+ worlds do not make -?\d+ equal groups"):
            result().split(count)


@pytest.mark.parametrize("metadata", [{"observers": ["homogeneous"]}, {"layout": 3}, [1]])
def test_a_trajectory_of_an_earlier_version_is_named_so(metadata: Any, tmp_path: Path) -> None:
    table = pa.table({"time_s": [0.0], "x1_rad": [0.0]}).replace_schema_metadata(
        {b"cmg_mj": json.dumps(metadata).encode()}
    )
    pq.write_table(table, tmp_path / "old.parquet")
    with pytest.raises(InputError, match="run its scenario"):
        Trajectory.load(tmp_path / "old.parquet")

"""A mounted robot through all that runs a rig: it is one like the others, on a hinge or on its feet."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cmg_mj.features.gymnasium import ScissoredPairEnv
from cmg_mj.features.mounting import mount
from cmg_mj.features.mounting.write import write_scenario
from cmg_mj.features.sweeps import sweep
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario
from tests.command import cmg_mj
from tests.features.gymnasium.test_gymnasium_env import act
from tests.features.mounting.robots import ROBOTS
from tests.features.studio.session import Session, as_rows
from tests.features.studio.test_session import same

PUSH_SETTINGS = ["duration_s=1.0", "plant.initial_tilt_deg=0.2", "push=[{start_s=0.25,torque_n_m=1.0}]"]

PUSH = 7
"""Column of a session's rows."""

pytestmark = pytest.mark.usefixtures("elsewhere")


@pytest.fixture(scope="module", params=["bicycle", "inverted_double_pendulum, its joint held"])
def scenario(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> str:
    """A scenario file: of a robot that stands on the floor, and of one on a hinge."""
    robot = ROBOTS[request.param]
    model = mount(robot.path, **robot.options).save(tmp_path_factory.mktemp("robot") / "balanced.xml")
    write_scenario(model, robot.path, "homogeneous")
    return str(model.with_suffix(".toml"))


def open_experiment(scenario: str) -> Experiment:
    return prepare(load_scenario(scenario, PUSH_SETTINGS))


@pytest.mark.daily_cases("bicycle")
def test_the_callback_and_a_batch_give_the_runners_trajectory(scenario: str) -> None:
    experiment = open_experiment(scenario)
    native, callback = (experiment.run(driver) for driver in ("native", "callback"))
    many = experiment.run_many(2)
    assert native.trajectory is not None
    assert callback.trajectory is not None
    assert many.trajectory is not None
    assert native.stood.all()
    for name, values in native.trajectory.columns.items():
        np.testing.assert_array_equal(callback.trajectory[name], values, err_msg=name)
        np.testing.assert_array_equal(many.trajectory.world(0)[name], values, err_msg=name)


@pytest.mark.daily_cases("bicycle")
def test_studio_gives_it_too(scenario: str) -> None:
    studio = Session(lambda _: open_experiment(scenario))
    try:
        studio.run(1.0)
        assert (studio.live.stopped, studio.live.note) == ("", "")
        rows = studio.rows
    finally:
        studio.handle.close()
    trajectory = open_experiment(scenario).run().trajectory
    assert trajectory is not None
    assert len(rows) == 200
    rows[:, PUSH] = rows[:, PUSH].round(12)  # put together again from a free joint's three torques
    same(rows, as_rows(trajectory))


@pytest.mark.daily_cases("bicycle")
def test_the_environment_gives_it_too(scenario: str) -> None:
    env = ScissoredPairEnv(scenario, PUSH_SETTINGS, in_rad_s=True)
    ticks, infos, _ = act(env, 0)
    trajectory = open_experiment(scenario).run().trajectory
    assert trajectory is not None
    assert len(ticks) == 200
    for name in ("x1_rad", "x2_rad_s", "x3_rad"):
        np.testing.assert_array_equal([info[name] for info in infos[:-1]], trajectory[name])


@pytest.mark.daily_cases("inverted_double_pendulum, its joint held")
def test_a_sweep(scenario: str) -> None:
    result = sweep(
        load_scenario(scenario, PUSH_SETTINGS), {"push.0.torque_n_m": [1.0, 200.0]}, ["homogeneous"], worlds=2
    )
    standing_at = {row["push.0.torque_n_m"]: row["stood"] for row in result.trials.to_pylist()}
    assert standing_at == {1.0: True, 200.0: False}


@pytest.mark.slow
def test_commands(scenario: str, tmp_path: Path) -> None:
    """A run with its recording, a check, a comparison."""
    settings = [part for value in PUSH_SETTINGS for part in ("--set", value)]
    outcome = cmg_mj("run", scenario, *settings, "--out", str(tmp_path / "run"))
    assert outcome.status == 0, outcome.err
    assert (tmp_path / "run" / "recording.rrd").stat().st_size > 10_000
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["outcome"] == "done"
    assert cmg_mj("check", scenario).status == 0
    observers = ("--observers", "homogeneous,linear", "--worlds", "2")
    outcome = cmg_mj("compare", scenario, *settings, *observers, "--out", str(tmp_path / "compared"))
    assert outcome.status == 0, outcome.err

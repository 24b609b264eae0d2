"""`cmg-mj tune-log`, and what logs and runs bring to it."""

from __future__ import annotations

import dataclasses
import json
import os
from pathlib import Path

import numpy as np
import pytest

from cmg_mj import InputError, load_scenario, prepare
from cmg_mj.features.replay.log import REFERENCE
from cmg_mj.features.replay.log_replay import replay_log, replay_prepared
from cmg_mj.features.replay.reading import read_log
from cmg_mj.features.tuning import tune_on_logs
from tests.command import cmg_mj
from tests.features.replay.motion import AMPLITUDE, COLUMNS, rate, sine, two_accelerometers, write_csv
from tests.recorded import recorded

PLAIN = ",".join(f"{role}={name}" for role, name in COLUMNS.items())
SETTINGS = ["duration_s=1.4", "push.0.start_s=0.3", "observer.k1=23.0", "seed=5"]


@pytest.fixture
def sine_log(elsewhere: None) -> None:
    write_csv("sine.csv", sine())


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The recording of a run."""
    path = tmp_path_factory.mktemp("runs") / "trajectory.parquet"
    experiment = prepare(load_scenario("push_recovery", SETTINGS))
    metadata = {"scenario": experiment.resolved()}
    dataclasses.replace(recorded(experiment.run()), metadata=metadata).save(path)
    return path


def test_tune_on_a_log(sine_log: None) -> None:
    """For a sine without noise the smallest time constant is the best; fitted on one part, scored on the other."""
    arguments = ("sine.csv", "--columns", PLAIN, "--observer", "linear", "--range", "tau=0.004:0.1")
    outcome = cmg_mj("tune-log", *arguments, "--split", "0.3", "--json", "--out", "it", "--closed-loop", "none")
    result = json.loads(outcome.out)
    assert result["parameters"]["tau"] == pytest.approx(0.004, rel=0.01)
    assert result["at_a_limit"] == ["tau"]
    assert (result["split"], result["held_out_stretches"], result["verdict"]) == (0.3, 10, "better")
    assert "tuned.json" in os.listdir("it")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("sine.csv", "--columns", PLAIN), "Missing option '--observer'"),
        (("sine.csv", "--columns", "time=t_s,tilt=tilt_rad", "--observer", "linear"), "no reference to tune to"),
        (("sine.csv", "--columns", PLAIN, "--observer", "linear", "--split", "1"), "between 0 and 1"),
        (("sine.csv", "--columns", PLAIN, "--observer", "ltv"), "needs a model"),
        (("sine.csv", "--columns", PLAIN, "--observer", "linear", "--worlds", "20"), "No such option"),
        (("sine.csv", "--columns", PLAIN, "--observer", "linear", "--closed-loop", "x"), "--closed-loop: scenario 'x'"),
        (("sine.csv", "--columns", PLAIN, "--observer", "linear", "--noise", "100,200"), "--noise 100: no such"),
        (("sine.csv", "--columns", PLAIN, "--observer", "linear", "--set", "tau=1"), "write observer.PARAMETER=VALUE"),
        ((), "Missing argument 'LOG...'"),
    ],
)
def test_wrong_tuning(sine_log: None, arguments: tuple, message: str) -> None:
    assert message in cmg_mj("tune-log", *arguments).complaint


def test_a_runs_recording_is_tuned_as_it_replays(run: Path) -> None:
    """Its rig (no --model), its sensors' noise and its observer's parameters: the given error is that of a replay."""
    run_log = read_log(run)
    study = tune_on_logs([run_log], "homogeneous", parameters=["k1"], ranges={"k1": (22.0, 24.0)}, settle_s=0.3)
    assert study.start_parameters["k1"] == 23.0
    assert study.logs[0].noise == prepare(load_scenario("push_recovery", SETTINGS)).design.constructor_arguments[2]
    half = run_log.cut(slice(len(run_log) // 2, None))
    study = tune_on_logs([run_log], "gyro_free", parameters=["jerk"], settle_s=0.3)
    error = half["reference_rad_s"] - replay_prepared(half, ["gyro_free"]).estimates["gyro_free"]["x2_rad_s"]
    stretches = np.array_split(error[half.scored(0.3)], len(study.level.given_rms))
    np.testing.assert_allclose(study.level.given_rms, [np.sqrt(np.mean(s**2)) for s in stretches], rtol=1e-9)


def test_a_log_is_tuned_as_it_replays(tmp_path: Path) -> None:
    """Each log's own rate is assumed at the start."""
    logs, expected = [], []
    for swing in (0.02, 0.35):
        log = two_accelerometers(tmp_path, swing, noise=0.04)
        true = swing / AMPLITUDE * rate(log["time_s"])
        logs.append(dataclasses.replace(log, columns={**log.columns, REFERENCE: true}, has=log.has | {"reference"}))
        half = logs[-1].cut(slice(len(log) // 2, None))
        error = (half[REFERENCE] - replay_log(half, ["gyro_free"]).estimates["gyro_free"]["x2_rad_s"])[half.scored(1.0)]
        expected += [np.sqrt(np.mean(stretch**2)) for stretch in np.array_split(error, 10)]
    study = tune_on_logs(logs, "gyro_free", parameters=["jerk"])
    np.testing.assert_allclose(study.level.given_rms, expected, rtol=2e-3)


def test_runs_with_other_parameters_are_not_tuned_together(run: Path) -> None:
    run_log = read_log(run)
    assert run_log.scenario is not None
    scenario = dict(run_log.scenario, observer={**run_log.scenario["observer"], "k1": 21.0})
    with pytest.raises(InputError, match="different parameters of homogeneous"):
        tune_on_logs([run_log, dataclasses.replace(run_log, scenario=scenario)], "homogeneous", settle_s=0.2)

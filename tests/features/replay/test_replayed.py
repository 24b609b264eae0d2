"""Who takes part in a replay and why, and a run's own recording, which replays to the figures of its run."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from cmg_mj import InputError, ReducedModel, load_scenario, prepare
from cmg_mj.core.types import needs
from cmg_mj.features.replay.log import Log, ReadOptions
from cmg_mj.features.replay.log_replay import model_of, observer_inputs, replay_log, replay_prepared
from cmg_mj.features.replay.noise import noise_numbers
from cmg_mj.features.replay.reading import read_log
from cmg_mj.observers import OBSERVER_CLASSES, OBSERVERS, Measurement
from cmg_mj.observers.parameter_options import parameters_of
from cmg_mj.results.folder import METADATA_KEY
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.save import report_run, save_run
from tests.command import cmg_mj
from tests.features.replay.motion import AMPLITUDE, COLUMNS, DT, N, rate, read, sine, two_accelerometers
from tests.observers.reference import PAPER

KEYS = ("velocity_rms_error_rad_s", "velocity_fit", "velocity_rms_error_push_rad_s", "velocity_fit_push")
SETTINGS = ["duration_s=1.4", "push.0.start_s=0.3", 'open_loop_observers="all"', "observer.k1=23.0", "seed=5"]
SETTINGS += ["sensors.accelerometer.noise_density_ug_rthz=300"]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    experiment = prepare(load_scenario("push_recovery", SETTINGS))
    folder = tmp_path_factory.mktemp("runs") / "a-run"
    result = experiment.run()
    save_run(folder, report_run(experiment, result))
    assert report_run(experiment, result).summary["observer"] == "homogeneous"
    return folder


def test_an_axis_cut_out_of_a_run_of_two_is_refused(tmp_path: Path) -> None:
    experiment = prepare(load_scenario("two_axes", ["duration_s=0.1", "push=[]"]))
    trajectory = report_run(experiment, experiment.run()).trajectory
    trajectory.save(tmp_path / "both.parquet")
    assert "about several axes (roll, pitch)" in cmg_mj("replay", tmp_path / "both.parquet").complaint
    trajectory.along("pitch").save(tmp_path / "pitch.parquet")
    assert "tilts about several axes" in cmg_mj("replay", tmp_path / "pitch.parquet").complaint


def log(tmp_path: Path, **more: np.ndarray) -> Log:
    return read(tmp_path, {**sine(), **more}, {**COLUMNS, **{name.partition("_")[0]: name for name in more}})


def test_a_run_replays_to_its_figures(run: Path) -> None:
    """Estimates bit for bit, of the loop's observer (whose k1 is not the default) and of every open-loop observer."""
    result = replay_prepared(read_log(run))
    summary = json.loads((run / "summary.json").read_text())
    expected = {"homogeneous": summary, **summary["open_loop_observers"], **summary["references"]}
    trajectory = Trajectory.load(run / "trajectory.parquet")
    assert result.left_out == {}
    assert set(result.estimates) == set(OBSERVERS)
    for name, figures in result.summaries.items():
        for key in KEYS:
            assert figures[key] == pytest.approx(expected[name][key], rel=1e-12, abs=1e-13), (name, key)
        for signal, values in result.estimates.get(name, {}).items():
            np.testing.assert_array_equal(values, trajectory[f"estimate/{name}/{signal}"])


def test_a_runs_parameters_model_and_noise_can_be_changed(run: Path) -> None:
    run_log = read_log(run)
    original = replay_prepared(run_log, ["homogeneous", "gyro_free"])
    parameters = {"homogeneous": {"alpha": 0.9}}
    changed = replay_prepared(run_log, ["homogeneous", "gyro_free"], parameters=parameters, noises={"tilt": 1.0})
    for name in ("homogeneous", "gyro_free"):
        assert np.abs(changed.estimates[name]["x2_rad_s"] - original.estimates[name]["x2_rad_s"]).max() > 1e-3


@pytest.mark.slow
def test_who_takes_part(tmp_path: Path) -> None:
    """The observer's needs and the log's signals decide, for every combination."""
    plain = log(tmp_path)
    t = DT * np.arange(N)
    gimbals = {"gimbal_rad": 0.01 * t, "command_rad_s": 0.01 + 0.0 * t}
    for more, signals in (
        ({}, set()),
        (gimbals, {"gimbals"}),
        ({"acceleration_rad_s2": -sine()["tilt_rad"]}, {"acceleration"}),
    ):
        one = log(tmp_path, **more)
        for model in (None, PAPER):
            inputs = signals | ({"model"} if model else set())
            result = replay_log(one, model=model)
            for kind in OBSERVERS:
                missing_inputs = set(needs(OBSERVER_CLASSES.find(kind))) - inputs
                assert (kind in result.left_out) == bool(missing_inputs), kind
                assert (kind in result.estimates) != bool(missing_inputs), kind
    assert "needs a model (--model)" in replay_log(plain).left_out["ltv"]


def test_of_a_pendulum_without_gimbals_the_model_alone_is_enough(tmp_path: Path) -> None:
    pendulum = model_of("inertia=0.06,gravity_torque=3.4")
    assert pendulum == ReducedModel(0.06, 0.0, 0.0, 1.0, 3.4)
    result = replay_log(log(tmp_path), ["homogeneous", "high_gain", "gyro_free"], model=pendulum)
    assert set(result.left_out) == {"gyro_free"}


def test_parts_are_replayed_each_from_its_start(tmp_path: Path) -> None:
    rows = np.r_[0:2000, 2300:N]
    whole = read(tmp_path, {name: values[rows] for name, values in sine().items()})
    second = read(tmp_path, {name: values[2300:] for name, values in sine().items()})
    of_parts, of_second = (replay_log(one, ["linear"], settle_s=0.5).estimates["linear"] for one in (whole, second))
    np.testing.assert_array_equal(of_parts["x2_rad_s"][2000:], of_second["x2_rad_s"])
    assert whole.scored(0.5).sum() == 1900 + 1600


def test_one_that_is_lost_is_said_and_the_others_go_on(tmp_path: Path) -> None:
    loses, raises = (f"tests.features.replay.test_replayed:{name}" for name in ("Loses", "Raises"))
    result = replay_log(log(tmp_path), ["linear", loses, raises])
    assert set(result.estimates) == {"linear"}
    assert "x2_rad_s is not finite from 0.05 s on" in result.left_out[loses]
    assert re.fullmatch(r"raised ZeroDivisionError: .* \(test_replayed\.py, line \d+\).*", result.left_out[raises])


class Loses:
    needs = ()

    def __init__(self, dt: float, model: ReducedModel) -> None:
        pass

    def init(self, y: Measurement) -> int:
        return 0

    def step(self, state: int, y: Measurement, u: float) -> tuple[int, tuple]:
        return state + 1, (y.y1, float("nan") if state == 9 else 0.0, 0.0)


class Raises(Loses):
    def step(self, state: int, y: Measurement, u: float) -> tuple[int, tuple]:
        return state + 1, (y.y1, 1.0 / (9 - state), 0.0)


def test_the_noise_of_a_runs_accelerometers_can_be_set(run: Path) -> None:
    """All else of its sensors stays: told what it had, it is the run's; of its resolution the rest."""
    run_log = read_log(run)
    run_noise = prepare(load_scenario("push_recovery", SETTINGS)).design.constructor_arguments[2]
    assert observer_inputs(run_log, noises={"accelerometer": 300.0}).noise == run_noise
    more = observer_inputs(run_log, noises={"accelerometer": 600.0}).noise
    assert more.tilt == pytest.approx(2.0 * run_noise.tilt, rel=1e-4)
    assert more.gimbal == run_noise.gimbal
    with pytest.raises(InputError, match="give accelerometer"):
        observer_inputs(run_log, noises={"accelerometer": 300.0, "tilt": 0.1})


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (lambda: model_of("inertia=0.06"), "--model: gravity_torque"),
        (lambda: model_of("inertia=-1,gravity_torque=3"), "must be greater than 0"),
        (lambda: model_of("inertia=a,gravity_torque=3"), "--model inertia=a: "),
        (lambda: model_of("mass=2"), "--model mass: "),
        (lambda: noise_numbers("tild=3"), "--noise tild: "),
        (lambda: noise_numbers("tilt=0"), "--noise tilt=0: "),
        (lambda: parameters_of(["k1=3"]), "--set 'k1=3': "),
        (lambda: parameters_of(["homogenous.k1=3"]), "did you mean 'homogeneous'?"),
        (lambda: parameters_of(["homogeneous.k1=x"]), "'x' is no number"),
    ],
)
def test_what_cannot_be(action: Callable[[], object], message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        action()


def test_wrong_parameters_and_nothing_to_judge(tmp_path: Path) -> None:
    one = log(tmp_path)
    with pytest.raises(InputError, match="no such field of linear"):
        replay_log(one, ["linear"], parameters={"linear": {"tou": 0.1}})
    with pytest.raises(InputError, match="nothing is left to score"):
        replay_log(one, settle_s=20.0)
    with pytest.raises(InputError, match="no observer can take part: ltv needs a model"):
        replay_log(one, ["ltv"])


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ({"units": {"tilt": "rad"}}, "units"),
        ({"delay_s": 0.1}, "delay_s"),
        ({"windows_s": [(5.0, 6.0)]}, "--window 5:6"),
    ],
)
def test_options_that_change_a_runs_recording_are_refused(run: Path, option: dict, message: str) -> None:
    assert read_log(run, ReadOptions(windows_s=[(0.4, 0.6)])).windows == ((0.4, 0.6),)
    with pytest.raises(InputError, match=message):
        read_log(run, ReadOptions(**option))


def test_a_replay_has_its_columns_and_a_frame(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    result = replay_log(log(tmp_path), ["linear"])
    assert list(dict(result)) == result.keys()
    np.testing.assert_array_equal(result.to_pandas()["estimate/linear/x2_rad_s"], result["estimate/linear/x2_rad_s"])


FOREIGN = {
    "text": lambda t: t.set_column(t.column_names.index("y1_rad"), "y1_rad", pa.array(["x"] * len(t))),
    "without the tilt": lambda t: t.drop_columns("y1_rad"),
    "without the rate": lambda t: t.drop_columns("x2_rad_s"),
    "constant time": lambda t: t.set_column(0, "time_s", pa.array(np.zeros(len(t)))),
    "backwards": lambda t: t.set_column(0, "time_s", pa.array(t["time_s"].to_numpy()[::-1].copy())),
    "another scenario": lambda t: t.replace_schema_metadata(
        {METADATA_KEY: json.dumps({**json.loads(t.schema.metadata[METADATA_KEY]), "scenario": {"push": 7}})}
    ),
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_a_foreign_recording_is_refused_in_a_line(kind: str, run: Path, tmp_path: Path) -> None:
    table = pq.read_table(run / "trajectory.parquet")
    assert table.column_names[0] == "time_s"
    pq.write_table(FOREIGN[kind](table), tmp_path / "foreign.parquet")
    words = "time_s: its rows are not" if kind in ("constant time", "backwards") else "--columns"
    assert words in cmg_mj("replay", tmp_path / "foreign.parquet").complaint


@pytest.mark.parametrize("swing", [1.0, 8.0, 20.0])
def test_an_observer_may_start_in_the_middle_of_a_motion(swing: float, tmp_path: Path) -> None:
    """On a pivot at rest `free_pivot` does as `gyro_free`, however fast the log begins."""
    log = two_accelerometers(tmp_path, np.radians(swing), noise=0.04)
    true = np.radians(swing) / AMPLITUDE * rate(log["time_s"])
    replayed = replay_log(log, ["gyro_free", "free_pivot"])
    ends = [estimates["x2_rad_s"][200:] - true[200:] for estimates in replayed.estimates.values()]
    gyro_free, free_pivot = (np.sqrt(np.mean(error**2)) for error in ends)
    assert gyro_free < 0.013
    assert free_pivot == pytest.approx(gyro_free, rel=0.05)

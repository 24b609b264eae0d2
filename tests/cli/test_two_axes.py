"""Scenarios of several axes: their description, the files of their runs, and refusals."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmg_mj import InputError, controller, load_plant
from cmg_mj.results.summary_keys import AXES, KEYS
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.runs.save import report_run, save_run
from cmg_mj.scenario.loading import load_scenario
from tests.command import CommandOutcome, cmg_mj
from tests.recorded import assert_same_bits, recorded

SHORT = ("duration_s=2", "push.0.start_s=1", "push.1.start_s=1")

pytestmark = pytest.mark.usefixtures("elsewhere")


def two_axes(*settings: str) -> Experiment:
    return prepare(load_scenario("two_axes", [*SHORT, *settings]))


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("runs") / "it"


@pytest.fixture(scope="module")
def run_outcome(run_folder: Path) -> CommandOutcome:
    """What the command line says of a run, which is then in the folder."""
    options = [part for setting in SHORT for part in ("--set", setting)]
    return cmg_mj("run", "two_axes", *options, "--out", str(run_folder))


@pytest.fixture(scope="module")
def run_summary(run_folder: Path, run_outcome: CommandOutcome) -> dict[str, Any]:
    return json.loads((run_folder / "summary.json").read_text(encoding="utf-8"))


def test_an_axis_has_what_it_is_given_and_the_rest_of_what_holds_for_all() -> None:
    scenario = load_scenario(
        "two_axes",
        [
            "axes.roll.observer.k1=25",
            "axes.pitch.observer.kind=linear",
            "axes.pitch.controller.gains=[1, 2, 3, 4]",
            "axes.roll.sensors.accelerometer.latency_s=0.005",
        ],
    )
    roll, pitch = (scenario.axis_scenario(name) for name in ("roll", "pitch"))
    assert roll.observer.parameters == {"k1": 25}
    assert (pitch.observer.kind, pitch.observer.parameters) == ("linear", {})
    assert (roll.controller.gains, pitch.controller.gains) == ("scaled", (1.0, 2.0, 3.0, 4.0))
    assert (roll.sensors.accelerometer.latency_s, pitch.sensors.accelerometer.latency_s) == (0.005, 0.0)
    assert (roll.plant.equilibrium_bias_deg, pitch.plant.equilibrium_bias_deg) == (0.5, -0.3)
    assert roll.plant.turn_rate_rad_s == pitch.plant.turn_rate_rad_s == 1.0


@pytest.mark.slow
def test_what_a_run_writes_reruns_and_has_every_axis(tmp_path: Path) -> None:
    experiment = two_axes("axes.roll.observer.kind=adaptive", "axes.pitch.controller.lqr.state_cost=[1, 1, 1, 1]")
    result = experiment.run()
    place = save_run(tmp_path / "run", report_run(experiment, result), plot=True)
    trajectory = Trajectory.load(place / "trajectory.parquet")
    assert trajectory.axes == ("roll", "pitch")
    assert trajectory.layout == recorded(result).layout
    assert_same_bits(trajectory, recorded(result))
    assert_same_bits(recorded(prepare(load_scenario(str(place / "scenario.toml"))).run()), trajectory)
    roll = trajectory.along("roll")
    assert roll.observers == ("adaptive",)
    np.testing.assert_array_equal(roll["estimate/adaptive/bias_rad"], trajectory["roll/estimate/adaptive/bias_rad"])
    np.testing.assert_array_equal(roll.qpos(), trajectory.qpos())
    with pytest.raises(InputError, match="axis 'rol': did you mean 'roll'"):
        trajectory.along("rol")
    assert {"plot-roll.png", "plot-pitch.png", "recording.rrd"} <= {path.name for path in place.iterdir()}


def test_the_observer_that_is_named_is_that_of_all_axes() -> None:
    mixed_axes = load_scenario("two_axes", ["axes.roll.observer.kind=linear"])
    assert prepare(mixed_axes).observer_title == "roll linear, pitch homogeneous"
    for kind in ("homogeneous", "linear", "kalman"):
        assert prepare(mixed_axes.with_observer(kind)).observer_title == kind
    tuned_axis = load_scenario("two_axes", ["axes.roll.observer.k1=25"])
    assert tuned_axis.with_observer("homogeneous").axis_scenario("roll").observer.parameters == {"k1": 25}


def test_another_law_does_without_the_files_gains() -> None:
    assert load_scenario("two_axes", ["controller.kind=lqg"]).controller.gains is None
    assert two_axes("controller.kind=lqg").run().outcomes[0].kind == "done"
    with pytest.raises(InputError, match="lqg takes no gains"):
        two_axes("controller.kind=lqg", "controller.gains=[1, 2, 3, 4]")
    lqg_scenario = load_scenario(
        "two_axes", ["axes.roll.controller.rate_limit_rad_s=3", "axes.roll.controller.gains=[1, 2, 3, 4]"]
    )
    roll = lqg_scenario.with_kind("controller", "lqg").axis_scenario("roll").controller
    assert (roll.kind, roll.gains, roll.rate_limit_rad_s) == ("lqg", None, 3.0)


def test_the_rigs_figures_are_the_worst_of_its_axes(run_summary: dict[str, Any]) -> None:
    summary = run_summary
    axes = list(summary[AXES].values())
    for key, description in KEYS.items():
        if key in summary and None not in (values := [axis[key] for axis in axes]):
            assert summary[key] == (min(values) if description.better == "more" else max(values)), key
    zero = [axis["references"]["zero"]["velocity_rms_error_rad_s"] for axis in axes]
    assert summary["references"]["zero"]["velocity_rms_error_rad_s"] == max(zero)


def test_a_push_moves_the_axis_that_it_is_about() -> None:
    calm = (
        "plant.turn_rate_rad_s=0",
        "plant.initial_tilt_deg=0",
        "plant.equilibrium_bias_deg=0",
        "controller.feedback=fog",
    )
    for i, name in enumerate(("roll", "pitch")):
        settings = "axes.pitch.plant.equilibrium_bias_deg=0", f"push.{1 - i}.torque_n_m=0"
        trajectory = recorded(two_axes(*calm, *settings).run())
        push_rows = slice(200, 230)
        peaks = {axis: np.abs(trajectory[f"{axis}/x2_rad_s"][push_rows]).max() for axis in ("roll", "pitch")}
        assert peaks.pop(name) > 5.0 * max(peaks.values())
        assert trajectory[f"{name}/push_n_m"][205] == 1.0


def test_check_says_what_each_axis_amounts_to() -> None:
    outcome = cmg_mj("check", "two_axes")
    assert outcome.status == 0
    assert outcome.out.count(": valid") == 2
    assert "two_axes, axis roll" in outcome.out
    assert "equilibrium bias -0.3 deg" in outcome.out
    assert outcome.out.count("push        1 N m about pitch from 6 s to 6.1 s") == 1


SHAKEN = "sensors.accelerometer.averaged=false"


def test_what_is_of_the_robot_is_said_once() -> None:
    (hint,) = prepare(load_scenario("walk", [SHAKEN])).hints
    assert hint.startswith("[gait]: the legs' servos shake accelerometers that show instants")
    out = cmg_mj("check", "walk", "--set", SHAKEN).out
    shared = out.partition("walk, on all axes\n")[2]
    assert [line.split()[0] for line in shared.splitlines()] == ["omitted", "gait", "hint"]
    assert out.count(hint) == 1


def test_a_push_beyond_the_ceiling_is_said_of_its_own_axis() -> None:
    (hint,) = two_axes("push.0.torque_n_m=30").hints
    assert hint.startswith("roll: push.0.torque_n_m = 30: no controller recovers from more than 4.84 N m")
    roll, pitch = cmg_mj("check", "two_axes", "--set", "push.0.torque_n_m=30").out.split("two_axes, axis pitch")
    assert "no controller recovers from more than" in roll
    assert "no controller recovers from more than" not in pitch
    assert two_axes("push.0.torque_n_m=30", 'plant.locked_axes=["roll"]').hints == []


def test_the_command_prints_each_axis(run_outcome: CommandOutcome, run_summary: dict[str, Any]) -> None:
    assert run_outcome.status == 0, run_outcome
    assert "roll" in run_outcome.out
    assert "Open loop, pitch" in run_outcome.out
    assert list(run_summary["axes"]) == ["roll", "pitch"]


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        (["axes.rol.plant.initial_tilt_deg=1"], "axes = 'rol': the rig has no such axis; did you mean 'roll'"),
        (["axes.roll.plant.modl=1"], "axes.roll.plant.modl: no such field; allowed: accelerometer_inner_a"),
        (["axes.roll.controller.rate_hz=100"], "[axes.roll]: controller.rate_hz: is the same on all axes"),
        (
            ["swing=[{frequency_hz=15.0, axis='roll'}]", "controller.rate_hz=100"],
            "at most 10 Hz at controller.rate_hz = 100",
        ),
        (["axes.pitch.observer.kind=lineer"], "[axes.pitch]: observer.kind = 'lineer'"),
        (["axes.roll.plant.initial_tilt_deg=60"], "axes.roll.plant.initial_tilt_deg = 60"),
        (["push.0.axis=yaw"], "push.0.axis = 'yaw': the rig has no such axis; allowed: pitch, roll"),
        (["push=[{start_s=1.0}]"], "push.0.axis: the rig has several axes: which of roll, pitch?"),
        (
            ["swing=[{frequency_hz=1.0, axis='roll', start_s=20.0}]"],
            "swing.0.start_s = 20: must be less than duration_s",
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_line(settings: list[str], complaint: str) -> None:
    with pytest.raises(InputError) as error:
        prepare(load_scenario("two_axes", settings))
    assert complaint in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("setting", ["push.0.axis=roll", "axes.roll.plant.initial_tilt_deg=1"])
def test_a_rig_of_one_axis_without_a_name_has_none_to_speak_of(setting: str) -> None:
    with pytest.raises(InputError, match="the rig has one axis, without a name"):
        prepare(load_scenario("push_recovery", [setting]))


def test_what_takes_one_axis_says_so() -> None:
    with pytest.raises(
        InputError, match=r"tilts about several axes \(roll, pitch\), and tuning takes one.*locked_axes"
    ):
        two_axes().require_single_axis("tuning")


def test_in_a_loop_of_ones_own() -> None:
    import mujoco

    from cmg_mj import StateFeedback, control

    rig = load_plant(model="two_axes", equilibrium_bias_deg=0.3, turn_rate_rad_s=1.0)
    law = StateFeedback(dt=0.005, gains=(71.9, 9.54, -0.862, 0.223))
    made = controller(rig, "gyro_free", seed=3, law=law)
    data = rig.new_data()
    while data.time < 3.0:
        control(rig, made, data)
        mujoco.mj_step(rig.model, data)
    assert abs(rig.largest_tilt(data.qpos)) < 0.03
    assert len(made.axes) == 2

"""The biped walks by its gyros, and falls without."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.features.gait import walk as stage
from cmg_mj.results.result import Result
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario
from tests.command import cmg_mj
from tests.recorded import assert_same_bits, recorded

QUIET = "sensors.accelerometer.noise_density_ug_rthz=100"
HELD = "controller.rate_limit_rad_s=1e-6"
SHORT = "gait.steps=2", "duration_s=5.0"
LONG = pytest.mark.slow
E_DEG = [f"axes.{axis}.plant.equilibrium_bias_deg" for axis in ("roll", "pitch")]


def walked(worlds: int, *settings: str, e_deg: float = 0.0, keep_trajectory: bool = False) -> Result:
    """Run worlds with e uniform about both axes."""
    generator = np.random.default_rng(1)
    own = {field: generator.uniform(-e_deg, e_deg, worlds).tolist() for field in E_DEG} if e_deg else None
    experiment = prepare(load_scenario("walk", [*(f"{field}=0.0" for field in E_DEG), *settings]))
    return experiment.run_many(worlds, settings=own, keep_trajectory=keep_trajectory)


def stood(result: Result) -> int:
    return int(result.stood.sum())


def test_it_takes_two_steps_and_stands() -> None:
    result = walked(2, QUIET, *SHORT)
    assert stood(result) == 2
    assert (result.mean("tilt_rms_deg") or 9.0) < 0.2
    assert [result.mean("steps"), round(result.mean("distance_m") or 0.0, 2)] == [2.0, 0.1]  # the second one closes up


def test_with_its_gimbals_held_it_falls_at_the_first_step() -> None:
    result = walked(2, QUIET, HELD, *SHORT)
    assert stood(result) == 0
    assert all(1.75 < outcome.time_s < 3.5 for outcome in result.outcomes)


@LONG
@pytest.mark.parametrize(
    ("settings", "e_deg", "least"),
    [
        ([], 0.0, 20),
        ([QUIET], 0.25, 19),
        ([QUIET, "gait.tiles_m=0.002"], 0.25, 18),
        ([QUIET, "observer.kind=homogeneous"], 0.1, 18),
        ([QUIET, "gait.step_length_m=0.0"], 0.0, 20),
        ([QUIET, "gait.step_length_m=0.15", "gait.single_s=0.7", "duration_s=29.0"], 0.0, 20),
    ],
)
def test_of_20_worlds_walk(settings: list[str], e_deg: float, least: int) -> None:
    assert stood(walked(20, *settings, e_deg=e_deg)) >= least


@LONG
@pytest.mark.parametrize("still", [[HELD], ["plant.flywheel_speed_rad_s=0.001", "controller.gains=[1,1,1,1]"]])
def test_without_gyros_none_of_20_walks(still: list[str]) -> None:
    assert stood(walked(20, QUIET, *still)) == 0


@LONG
@pytest.mark.parametrize(("share", "steps"), [(0.8, 22.0), (1.1, 22.0), (0.0, 2.0)])
def test_the_planned_acceleration_is_needed_and_need_not_be_exact(
    monkeypatch: pytest.MonkeyPatch, share: float, steps: float
) -> None:
    """With 80 to 110 % of it taken off the tilt, all steps are walked; with none, it falls at the second or third."""
    planned = stage.planned

    def wrong(*arguments: object) -> object:
        plan = planned(*arguments)  # type: ignore[arg-type]
        return dataclasses.replace(plan, acceleration=share * plan.acceleration)

    monkeypatch.setattr(stage, "planned", wrong)
    taken = [float(summary["steps"]) for summary in walked(4, QUIET).summaries]  # type: ignore[arg-type]
    assert max(taken) <= steps if share == 0.0 else min(taken) == steps


@LONG
def test_figures_do_not_depend_on_the_step() -> None:
    coarse, fine = (walked(8, QUIET, f"plant.timestep_s={step}") for step in (0.0025, 0.001))
    for key in ("tilt_rms_deg", "gimbal_peak_deg", "velocity_rms_error_rad_s", "leg_energy_j"):
        assert coarse.mean(key) == pytest.approx(fine.mean(key), rel=0.1)


@LONG
@pytest.mark.parametrize(("roll", "pitch"), [(0.4, -0.4), (-0.4, 0.4)])
def test_the_equilibrium_bias_is_found(roll: float, pitch: float) -> None:
    """Within 0.1 deg, and the torso is moved by all of it."""
    own = [f"{field}={e}" for field, e in zip(E_DEG, (roll, pitch), strict=True)]
    experiment = prepare(load_scenario("walk", [*own, QUIET]))
    controller = experiment.controller(range(4))
    experiment.simulate([experiment.plant] * 4, controller, keep_trajectory=False)
    assert controller.state.deciding is not None
    leaning = controller.state.deciding.between[0].leaning
    np.testing.assert_allclose(np.degrees(np.mean(leaning.bias, axis=1)), [roll, pitch], atol=0.1)
    np.testing.assert_allclose(np.degrees(np.mean(leaning.lean, axis=1)), [roll, pitch], atol=0.1)


def test_tiles_differ_from_world_to_world_and_not_from_run_to_run() -> None:
    height = [
        recorded(walked(2, QUIET, *SHORT, "gait.tiles_m=0.004", keep_trajectory=True))["position/torso/z_m"][-1]
        for _ in range(2)
    ]
    np.testing.assert_array_equal(*height)
    assert abs(height[0][0] - height[0][1]) > 1e-4


def test_a_world_is_the_same_alone_by_callback_and_among_others() -> None:
    settings = [QUIET, *SHORT, "gait.tiles_m=0.001", "plant.equilibrium_bias_deg=0.2"]
    experiment = prepare(load_scenario("walk", settings))
    alone = recorded(experiment.run(world=1))
    assert_same_bits(recorded(experiment.run(world=1, driver="callback")), alone)
    assert_same_bits(recorded(experiment.run_many([0, 1])).world(1), alone)


def test_what_the_legs_do_not_reach_is_refused() -> None:
    with pytest.raises(InputError, match=r"gait\.step_length_m, .*: take left/hip_pitch to .*its range is"):
        walked(1, "gait.step_length_m=0.5")


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        (["duration_s=10.0"], r"gait\.steps = 22: end at 23.75 s, and duration_s = 10"),
        (["gait.steps=0", "gait.tiles_m=0.002"], r"gait\.tiles_m = 0.002: are laid along a walk"),
        (["gait.lean_s=0.01"], r"gait\.lean_s = 0.01: must be 0 or at least"),
    ],
)
def test_what_does_not_go_together_is_refused(settings: list[str], complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        prepare(load_scenario("walk", settings))


def test_a_track_moves_no_leg_that_walks(tmp_path: Path) -> None:
    (tmp_path / "legs.csv").write_text("time_s,left/hip_roll\n0,0\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"track\.0\.file: moves left/hip_roll, as \[gait\] does"):
        prepare(load_scenario("walk", [f'track=[{{file="{tmp_path / "legs.csv"}"}}]']))


def test_means_need_the_models_sensors() -> None:
    with pytest.raises(InputError, match=r"accelerometer.averaged = true: .*scissored_pair.xml has no sensors"):
        prepare(load_scenario("push_recovery", ["sensors.accelerometer.averaged=true"]))


@pytest.mark.parametrize(
    ("command", "complaint"),
    [(["plugin", "gyro_free"], "a plugin does not have it"), (["export", "gyro_free"], "two axes|several axes|axes")],
)
def test_no_plugin_and_no_c_have_legs(elsewhere: None, command: list[str], complaint: str) -> None:
    said = cmg_mj(*command, "--scenario", "walk", "--out", "there").complaint
    assert any(part in said for part in complaint.split("|"))
    assert not Path("there").exists()

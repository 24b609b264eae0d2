"""The simulation's side of Studio against the runner, through Studio's own messages and with a clock of its own."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from mujoco.studio import messages

from cmg_mj import load_scenario, prepare
from cmg_mj.features.studio.panel import ChangeSettings, PushRequest
from cmg_mj.features.studio.settings import NOISE
from tests.features.studio.session import as_rows, session
from tests.recorded import recorded

RATE, PUSH = 1, 7
"""Columns of a row."""


@cache
def runner_rows(*settings: str, scenario: str = "push_recovery") -> np.ndarray:
    return as_rows(recorded(prepare(load_scenario(scenario, list(settings))).run()))


def same(rows: np.ndarray, expected: np.ndarray) -> None:
    """Bit for bit, but for the time: MuJoCo adds steps up."""
    np.testing.assert_allclose(rows[:, 0], expected[: len(rows), 0], atol=1e-9)
    np.testing.assert_array_equal(rows[:, 1:], expected[: len(rows), 1:])


@pytest.mark.daily_cases("settings1", "settings3", "settings4")
@pytest.mark.parametrize(
    "settings",
    [
        (),
        ("observer.kind=adaptive", "plant.gimbal_friction_n_m=0.05", "seed=3"),
        ("plant.flywheel_imbalance_kg_m=1e-5", "plant.equilibrium_bias_deg=1.0"),
        ("sensors.accelerometer.latency_s=0.003", "controller.feedback=fog"),
        ("sensors.accelerometer.bandwidth_hz=94", "plant.lock_thrust_bearing=true"),
    ],
)
def test_untouched_it_is_the_runners_trajectory(settings: tuple[str, ...]) -> None:
    settings = ("duration_s=2.0", "push.0.start_s=0.5", *settings)
    with session(*settings) as studio:
        studio.run(2.0)
        assert (studio.live.stopped, studio.live.note) == ("", "")
        assert len(studio.rows) == 400
        same(studio.rows, runner_rows(*settings))


def test_it_keeps_the_clocks_pace() -> None:
    with session() as studio:
        for _ in range(100):
            studio.now += 0.01
            studio.handle.sync()
        assert studio.data.time == pytest.approx(1.0, abs=0.006)
        studio.send(messages.StepControlSnapshot(speed=10.0))
        for _ in range(100):
            studio.now += 0.01
            studio.handle.sync()
        assert studio.data.time == pytest.approx(1.1, abs=0.006)
        studio.now += 60.0  # a machine that sleeps for a minute does not run it to catch up
        studio.handle.sync()
        assert studio.data.time < 1.5


def test_pause_and_single_steps_change_nothing() -> None:
    with session() as studio:
        studio.run(1.0)
        studio.pause()
        pause_time = studio.data.time
        studio.now += 5.0
        studio.handle.sync()
        assert studio.data.time == pause_time
        for _ in range(3):
            studio.send(messages.SingleStepEvent())
            studio.handle.sync()
        assert studio.data.time == pytest.approx(pause_time + 3 * studio.live.timestep)
        studio.pause(False)
        studio.run(2.0)
        same(studio.rows, runner_rows("duration_s=4.0"))


@pytest.mark.daily_cases("-1")
@pytest.mark.parametrize("key", [-1, None])
def test_reset_is_the_scenarios_start_with_the_wheels_at_speed(key: int | None) -> None:
    with session() as studio:
        studio.run(1.5)
        studio.stepping.rows.clear()
        studio.send(messages.ResetEvent(key=key))
        assert studio.data.time == 0.0
        for module in studio.live.plant.axis.modules:
            assert studio.data.qvel[module.flywheel] == module.speed != 0.0
        studio.run(3.0)
        same(studio.rows, runner_rows("duration_s=4.0"))


def test_reload_begins_as_the_file_is_now() -> None:
    settings = ["observer.kind=linear"]
    with session() as studio:
        studio.stepping._load = lambda path: prepare(load_scenario("push_recovery", settings))
        studio.run(1.0)
        studio.send(ChangeSettings({NOISE: 0.0}))
        studio.stepping.rows.clear()
        studio.send(messages.LoadModelEvent(path=""))
        studio.run(3.0)
        same(studio.rows, runner_rows("duration_s=3.0", *settings))
        settings[0] = "observer.kind=no_such"
        studio.send(messages.LoadModelEvent(path=""))
        assert "no such observer" in studio.session_state().note
        before = studio.data.time
        studio.run(0.5)
        assert studio.data.time == pytest.approx(before + 0.5)


@pytest.mark.parametrize(("step_s", "frames"), [(0.005, 150), (0.001, 188)])
def test_back_in_time_the_controller_goes_on_as_it_was_and_later_pushes_are_forgotten(
    step_s: float, frames: int
) -> None:
    """Studio's history has MuJoCo's states alone."""
    settings = ("duration_s=2.0", "push.0.start_s=0.8", f"plant.timestep_s={step_s}")
    expected = runner_rows(*settings)
    with session(*settings) as studio:
        studio.run(1.2, every_s=0.004)
        studio.send(PushRequest(0.8, 0.1))
        studio.run(0.8, every_s=0.004)
        studio.scrub(-frames)
        time = studio.data.time
        assert time == pytest.approx(0.5, abs=0.011)
        del studio.stepping.rows[:]
        studio.pause(False)
        studio.run(1.4)
        assert (studio.live.stopped, studio.live.note) == ("", "")
        same(studio.rows, expected[expected[:, 0] > time - 1e-9])


def test_where_it_has_not_been_the_controller_starts_afresh() -> None:
    with session("push=[]") as studio:
        studio.run(0.5)
        studio.data.time = 1.0
        studio.run(0.5)
        assert studio.session_state().note == "the controller starts afresh at t = 1 s"
        assert not studio.live.stopped
        assert np.abs(studio.rows[:, RATE]).max() < 0.3

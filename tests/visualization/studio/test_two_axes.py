"""A rig of several axes in Studio: it is the runner's on each of them, pushed about any, switched and brought back."""

from __future__ import annotations

import numpy as np
import pytest
from mujoco.studio import messages

from cmg_mj import load_scenario, prepare
from cmg_mj.observers import Estimate
from cmg_mj.visualization.studio.messages import ChangeSettings, PushRequest, ShowAxis
from cmg_mj.visualization.studio.settings import BIAS, FEEDBACK, NOISE, OBSERVER, choosable_laws, current_law
from tests.visualization.studio.session import SIGNALS, Session, as_rows, session
from tests.visualization.studio.test_session import runner_rows, same

ROLL, PITCH = 0, len(SIGNALS)
RATE, PUSH = 1, 7
"""Columns of roll's in a row; pitch's come so many later."""

SWING = (
    "swing=[{frequency_hz=1.3, amplitude_n_m=0.3, axis='pitch'},"
    " {frequency_hz=2.0, amplitude_n_m=0.2, start_s=0.2513, axis='roll'}]"
)
REAL = (
    "sensors.accelerometer.vibration_mg=4",
    "sensors.accelerometer.wheel_harmonics_mg=[5, 2]",
    "plant.accelerometer_outer_misplaced_mm=3",
    "pivot=[{kind='noise', acceleration_m_s2=0.3, corner_hz=5.0, axis='pitch'},"
    " {kind='sine', acceleration_m_s2=0.2, frequency_hz=3.0, start_s=0.2513, direction='vertical'}]",
)


def runner(*settings: str) -> np.ndarray:
    return runner_rows(*settings, scenario="two_axes")


@pytest.mark.daily_cases("swings", "free base", "locked")
@pytest.mark.parametrize(
    "settings",
    [
        ("duration_s=2.0", "push.0.start_s=0.5", "push.1.start_s=0.75"),
        ("duration_s=1.5", "plant.model=two_axes_free_base", "axes.roll.observer.kind=adaptive", "push=[]"),
        ("duration_s=1.0", "push.0.start_s=0.313", "push.1.start_s=0.32", "plant.timestep_s=0.001", SWING),
        ("duration_s=1.0", 'plant.locked_axes=["roll"]', "push.1.start_s=0.5", "push.0.start_s=0.253"),
        ("duration_s=1.0", "push.0.start_s=0.313", "push.1.start_s=0.32", "plant.timestep_s=0.001", *REAL),
    ],
    ids=["pushed", "free base", "swings", "locked", "a real rig"],
)
def test_untouched_it_is_the_runners_trajectory_of_each_axis(settings: tuple[str, ...]) -> None:
    expected = runner(*settings)
    with session(*settings, scenario="two_axes") as studio:
        studio.run(float(settings[0].partition("=")[2]))
        assert (studio.live.stopped, studio.live.note) == ("", "")
        assert len(studio.rows) == len(expected)
        same(studio.rows, expected)


def test_a_push_by_button_is_about_the_axis_that_is_shown() -> None:
    with session("push=[]", scenario="two_axes") as studio:
        studio.run(1.0)
        studio.send(ShowAxis("pitch"), PushRequest(-0.8, 0.2))
        state = studio.session_state()
        assert state.settings is not None
        assert (state.axes, state.axis, state.settings.bias_deg) == (("roll", "pitch"), "pitch", -0.3)
        studio.run(1.0)
        rows = studio.rows
        expected = runner("duration_s=2.0", 'push=[{start_s=1.0, duration_s=0.2, torque_n_m=-0.8, axis="pitch"}]')
        same(rows[: len(expected)], expected)
        assert np.count_nonzero(rows[:, PUSH + PITCH]) == 40
        assert np.count_nonzero(rows[:, PUSH + ROLL]) == 0
        ticks = studio.session_state().ticks
        np.testing.assert_array_equal(ticks[: len(rows), 2], rows[: len(ticks), RATE + PITCH])
        studio.send(ShowAxis("roll"), PushRequest(0.8, 0.2))  # what was plotted of it is there
        np.testing.assert_array_equal(studio.session_state().ticks[: len(rows), 2], rows[:, RATE + ROLL])
        studio.run(0.5)
        assert np.count_nonzero(studio.rows[:, PUSH + PITCH]) == 40
        assert np.count_nonzero(studio.rows[:, PUSH + ROLL]) == 40


def test_the_axis_shown_stays_through_a_reload_as_long_as_there_is_one() -> None:
    settings: list[str] = []
    studio = Session(lambda path: prepare(load_scenario("two_axes", settings)))
    assert studio.session_state().axis == "roll"
    with studio.handle:
        studio.send(ShowAxis("pitch"), messages.LoadModelEvent())
        assert studio.session_state().axis == "pitch"
        settings.append('plant.locked_axes=["pitch"]')
        studio.send(messages.LoadModelEvent())
        assert (studio.session_state().axes, studio.session_state().axis) == (("roll",), "roll")


@pytest.mark.daily_cases("-81")
@pytest.mark.parametrize("back", [-1, -30, -81])
def test_history_brings_all_axes_back(back: int) -> None:
    """The gyro about the vertical and each axis' sensors, observer and integrator; pushes on both come and go."""
    pushes = ("push.0.start_s=0.5", "push.1.start_s=0.75", "axes.pitch.observer.kind=adaptive")
    with session(*pushes, scenario="two_axes") as studio:
        studio.run(1.0, every_s=0.004)
        studio.send(ShowAxis("pitch"), PushRequest(1.0, 0.1))  # is not to come again
        studio.run(0.1, every_s=0.004)
        studio.scrub(back - 10)
        time = studio.data.time
        assert time == pytest.approx(1.0 + 0.01 * back, abs=0.011)
        studio.pause(False)
        del studio.stepping.rows[len([row for row in studio.rows if row[0] < time - 1e-9]) :]
        studio.run(0.75)
        assert studio.live.note == ""
        same(studio.rows, runner("duration_s=2.0", *pushes))


def test_what_is_chosen_is_chosen_on_all_axes_and_history_brings_it_back() -> None:
    settings_of_axes = ("axes.pitch.observer.k1=40.0", "axes.pitch.controller.feedback=truth", "observer.k1=50.0")
    with session(*settings_of_axes, scenario="two_axes") as studio:
        live = studio.live
        studio.run(0.5, every_s=0.004)
        rows = len(studio.rows)
        studio.send(ChangeSettings({OBSERVER: "linear"}), ChangeSettings(choosable_laws(live.base)["LQR"]))
        parts = live.now.parts
        assert [part.scenario.observer.kind for part in parts] == ["linear", "linear"]
        assert [part.scenario.controller.lqr is not None for part in parts] == [True, True]
        assert [part.scenario.controller.feedback for part in parts] == ["observer", "truth"]
        assert [type(part.observer).__name__ for part in live.controller.parts] == ["LinearDifferentiator"] * 2
        assert studio.session_state().law == "LQR"
        studio.run(0.5, every_s=0.004)
        assert len(studio.rows) > rows
        studio.send(ChangeSettings({FEEDBACK: "fog"}), ChangeSettings({BIAS: 0.5}), ChangeSettings({NOISE: 0.0}))
        for part in live.now.parts:
            settings = part.scenario
            assert (settings.controller.feedback, settings.plant.equilibrium_bias_deg) == (
                "fog",
                0.5,
            )  # which was roll's
            assert settings.sensors.accelerometer.noise_density_ug_rthz == 0.0
        assert [part.feedback for part in live.controller.parts] == ["fog", "fog"]
        assert [part.sensors.accelerometer.noise_density_ug_rthz for part in live.controller.parts] == [0.0, 0.0]
        ipos = live.model.body_ipos.copy()
        studio.run(0.25, every_s=0.004)
        before = studio.rows
        studio.scrub(-63)  # 0.62 s
        time = studio.data.time
        del studio.stepping.rows[:]
        studio.pause(False)
        studio.run(0.35)
        assert not np.array_equal(live.model.body_ipos, ipos)
        assert [part.scenario.plant.equilibrium_bias_deg for part in live.now.parts] == [0.5, -0.3]
        again, then = studio.rows, before[(before[:, 0] > time - 1e-9) & (before[:, 0] < 1.0 - 1e-9)]
        assert len(then) > 60
        np.testing.assert_array_equal(again[: len(then)], then[: len(again)])
        studio.send(
            ChangeSettings({OBSERVER: "homogeneous"}), ChangeSettings(choosable_laws(live.base)["the scenario's"])
        )
        assert [part.scenario.observer.parameters for part in live.now.parts] == [{"k1": 50.0}, {"k1": 40.0}]
        assert live.now.scenario.controller.gains == "scaled"
        assert live.now.scenario.axes["pitch"].plant.model_dump()["equilibrium_bias_deg"] == -0.3
        assert not live.stopped


def test_a_law_is_the_runners_on_both_axes_from_the_start() -> None:
    settings = ("axes.pitch.controller.lqr.state_cost=[2,1,1,1]", "axes.pitch.controller.rate_limit_rad_s=3.0")
    with session(*settings, scenario="two_axes") as studio:
        laws = choosable_laws(studio.live.base)
        assert current_law(studio.live.base, studio.live.now) == "the scenario's"
        studio.send(ChangeSettings(laws["LQR"]), ChangeSettings({FEEDBACK: "truth"}))
        assert current_law(studio.live.base, studio.live.now) == "LQR"
        studio.run(1.0)
        base = prepare(load_scenario("two_axes", ["axes.pitch.controller.rate_limit_rad_s=3.0", "push=[]"]))
        law = {"lqr": {"state_cost": [1, 1, 1, 1]}, "feedback": "truth"}
        trajectory = base.with_settings({"controller": law, "duration_s": 1.0}).run().trajectory
        assert trajectory is not None
        same(studio.rows[:200], as_rows(trajectory))


@pytest.mark.slow
def test_what_is_refused_changes_no_axis() -> None:
    with session(scenario="two_axes") as studio:
        studio.run(0.5)
        for values, complaint in (
            ({OBSERVER: "no_such"}, "no such observer"),
            ({BIAS: 60.0}, "less than 45"),
            ({"controller.rate_hz": 100.0}, "stays 200 Hz"),
        ):
            studio.send(ChangeSettings(values))
            assert complaint in studio.session_state().note
        studio.run(0.5)
        same(studio.rows, runner("duration_s=2.0", "push=[]"))


def test_a_fall_about_the_second_axis_is_a_fall() -> None:
    with session(scenario="two_axes") as studio:
        studio.send(ShowAxis("pitch"), PushRequest(30.0, 0.5))
        studio.run(1.5)
        push_setting = 'push=[{start_s=0.0, duration_s=0.5, torque_n_m=30.0, axis="pitch"}]'
        outcome = prepare(load_scenario("two_axes", [push_setting])).run().outcomes[0]
        assert outcome.kind == "fell"
        assert studio.session_state().stopped.startswith(f"the rig fell at t = {outcome.time_s:g} s")
        for axis in studio.live.plant.axes:
            assert np.all(studio.data.ctrl[axis.servos] == 0.0)
        studio.send(messages.ResetEvent(key=-1))
        studio.stepping.rows.clear()
        studio.run(1.0)
        same(studio.rows, runner("duration_s=2.0", "push=[]"))


class Fragile:
    """A user's observer that works for half a second, on the axis that leans the other way."""

    def __init__(self, dt: float, **options: object) -> None:
        self.dt = dt

    def init(self, y: tuple) -> int:
        return 0

    def step(self, state: int, y: tuple, u: float) -> tuple[int, Estimate]:
        if state == 100:
            raise KeyError("gone")
        return state + 1, Estimate(y[0], 0.0, y[1])


def test_an_axis_whose_observer_fails_stops_all_and_history_goes_back_to_before_it() -> None:
    settings = (
        "axes.pitch.observer.kind=tests.visualization.studio.test_two_axes:Fragile",
        "axes.pitch.controller.feedback=truth",
    )
    with session(*settings, scenario="two_axes") as studio:
        studio.run(0.8, every_s=0.004)
        stopped = studio.session_state().stopped or ""
        assert stopped.startswith("observer Fragile raised KeyError: 'gone' at t = 0.505 s (")
        for axis in studio.live.plant.axes:
            assert np.all(studio.data.ctrl[axis.servos] == 0.0)
        studio.scrub(-60)  # 0.2 s
        assert studio.session_state().stopped == ""
        time = studio.data.time
        del studio.stepping.rows[len([row for row in studio.rows if row[0] < time - 1e-9]) :]
        studio.pause(False)
        studio.run(0.2)
        same(studio.rows, runner("duration_s=2.0", "push=[]", *settings))
        studio.send(ChangeSettings({OBSERVER: "homogeneous"}))
        studio.run(1.0)
        assert not studio.live.stopped


def test_a_rig_of_one_axis_is_shown_without_a_choice() -> None:
    with session() as studio:
        state = studio.session_state()
        assert (state.axes, state.axis) == (("",), "")

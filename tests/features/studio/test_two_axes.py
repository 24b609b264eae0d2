"""A rig of several axes in Studio: it is the runner's on each of them, pushed about any, switched and brought back."""

from __future__ import annotations

import numpy as np
import pytest

from cmg_mj.features.studio.panel import ChangeSettings, PushRequest, ShowAxis
from cmg_mj.features.studio.settings import BIAS, FEEDBACK, NOISE, OBSERVER
from tests.features.studio.session import SIGNALS, session
from tests.features.studio.test_session import runner_rows, same

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
        studio.send(ShowAxis("roll"))  # what was plotted of it is there
        ticks = studio.session_state().ticks
        np.testing.assert_array_equal(ticks[: len(rows), 2], rows[:, RATE + ROLL])


def test_what_is_chosen_is_chosen_on_all_axes() -> None:
    settings_of_axes = ("axes.pitch.observer.k1=40.0", "axes.pitch.controller.feedback=truth", "observer.k1=50.0")
    with session(*settings_of_axes, scenario="two_axes") as studio:
        live = studio.live
        studio.run(0.5)
        studio.send(ChangeSettings({OBSERVER: "linear"}))
        scenarios = [part.scenario for part in live.now.axes]
        assert [scenario.observer.kind for scenario in scenarios] == ["linear", "linear"]
        assert [scenario.controller.feedback for scenario in scenarios] == ["observer", "truth"]
        studio.send(ChangeSettings({FEEDBACK: "fog"}), ChangeSettings({BIAS: 0.5}), ChangeSettings({NOISE: 0.0}))
        for scenario in (part.scenario for part in live.now.axes):
            assert (scenario.controller.feedback, scenario.plant.equilibrium_bias_deg) == ("fog", 0.5)
            assert scenario.sensors.accelerometer.noise_density_ug_rthz == 0.0
        np.testing.assert_array_equal(live.model.body_ipos, live.now.plant.model.body_ipos)
        studio.send(ChangeSettings({OBSERVER: "homogeneous"}))
        assert [part.scenario.observer.parameters for part in live.now.axes] == [{"k1": 50.0}, {"k1": 40.0}]

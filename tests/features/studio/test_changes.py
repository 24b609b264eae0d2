"""Changes by a user during a run: observer, law, noise, e, pushes by button and by mouse; and failures."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from mujoco.studio import (
    messages,
    sim,  # pyright: ignore[reportAttributeAccessIssue]
)

from cmg_mj import load_scenario, prepare
from cmg_mj.features.studio.panel import ChangeSettings, PushRequest, RestartController
from cmg_mj.features.studio.settings import BIAS, FEEDBACK, NOISE, OBSERVER
from cmg_mj.inputs.files import folder
from cmg_mj.observers import OBSERVERS, Estimate
from tests.features.studio.session import Session, session
from tests.features.studio.test_session import runner_rows, same

TIME, RATE, U, PUSH = 0, 1, 5, 7


def test_a_push_by_button_is_a_push_of_the_scenario() -> None:
    with session("push=[]") as studio:
        studio.run(1.0)
        studio.send(PushRequest(-0.8, 0.2))
        studio.run(2.0)
        settings = ("duration_s=3.0", "push.0.start_s=1.0", "push.0.duration_s=0.2", "push.0.torque_n_m=-0.8")
        expected = runner_rows(*settings)
        same(studio.rows, expected)
        assert np.count_nonzero(studio.rows[:, PUSH]) == 40


def test_pushes_add_up() -> None:
    with session("push.0.start_s=0.5", "push.0.torque_n_m=0.5") as studio:
        studio.run(0.55)
        studio.send(PushRequest(0.3, 0.1), PushRequest(0.3, 0.1))
        studio.run(0.45)
        rows = studio.rows
        assert rows[rows[:, TIME] > 0.499][:, PUSH][:31].round(12).tolist() == [0.5] * 10 + [1.1] * 10 + [0.6] * 10 + [
            0.0
        ]


def test_what_is_refused_changes_nothing_and_is_said() -> None:
    with session() as studio:
        studio.run(0.5)
        for values, field in (
            ({OBSERVER: "no_such"}, "observer"),
            ({BIAS: 60.0}, "equilibrium_bias_deg"),
            ({NOISE: -1.0}, "noise_density_ug_rthz"),
        ):
            studio.send(ChangeSettings(values))
            assert field in studio.session_state().note
        studio.run(1.0)
        same(studio.rows, runner_rows("duration_s=2.5"))


def test_studios_physics_settings_cannot_change_the_step() -> None:
    with session() as studio:
        studio.run(0.5)
        opt = mujoco.MjSpec().compile().opt
        opt.timestep = 0.001
        studio.send(messages.MjOptionSnapshot(opt=opt))
        assert studio.live.model.opt.timestep == 0.005
        assert "the physics step stays 0.005 s" in studio.session_state().note
        assert [snapshot.opt.timestep for snapshot in studio.receive(messages.MjOptionSnapshot)][-1:] in ([], [0.005])
        studio.send(messages.StepControlSnapshot(noise_scale=0.1))
        assert "noise on the controls is not applied" in studio.session_state().note


class Fragile:
    """A user's observer that works for two seconds."""

    def __init__(self, dt: float, **options: object) -> None:
        self.dt = dt

    def init(self, y: object) -> int:
        return 0

    def step(self, state: int, y: tuple, u: float) -> tuple[int, Estimate]:
        if state == 400:
            raise KeyError("gone")
        return state + 1, Estimate(y[0], 0.0, y[1])


FRAGILE = "tests.features.studio.test_changes:Fragile"


def test_an_observer_that_raises_stops_the_controller_and_nothing_else() -> None:
    with session() as studio:
        studio.run(0.5)
        studio.send(ChangeSettings({OBSERVER: FRAGILE, FEEDBACK: "truth"}))
        studio.run(3.0, every_s=0.004)
        state = studio.session_state()
        assert (state.stopped or "").startswith("observer Fragile failed at t = 2.505 s")
        assert studio.data.time == pytest.approx(3.5, abs=0.05)
        assert np.all(studio.data.ctrl[studio.live.plant.axis.servos] == 0.0)
        assert studio.rows[-1, TIME] < 2.51
        studio.send(ChangeSettings({OBSERVER: "linear", FEEDBACK: "observer"}), messages.ResetEvent(key=-1))
        studio.run(0.1)
        assert studio.session_state().stopped == ""


def test_a_fall_is_said_and_reset_stands_up_again() -> None:
    with session("push.0.start_s=0.5") as studio:
        studio.send(PushRequest(30.0, 0.5))
        studio.run(3.0)
        assert studio.session_state().stopped.startswith("the rig fell at t = 0.")
        studio.send(RestartController())
        studio.run(0.5)
        assert "fell" in studio.session_state().stopped
        studio.send(messages.ResetEvent(key=-1))
        studio.stepping.rows.clear()
        studio.run(1.0)
        same(studio.rows, runner_rows("push.0.start_s=0.5"))


def test_physics_that_diverges_is_paused() -> None:
    with session() as studio:
        studio.run(0.5)
        studio.data.qvel[:] = 1e200
        for _ in range(20):
            studio.now += 0.02
            studio.handle.sync()
        assert studio.live.stopped == "the physics diverged at t = 0.505 s; reset"
        snapshot = studio.receive(messages.StepControlSnapshot)[-1]
        assert snapshot.pause_state == sim.PauseState.NORMAL_PAUSED
        studio.send(messages.ResetEvent(key=-1))
        studio.pause(False)
        studio.stepping.rows.clear()
        studio.run(1.0)
        same(studio.rows, runner_rows("duration_s=2.5"))


def test_a_model_dropped_on_the_viewer_takes_the_rigs_place(tmp_path: Path) -> None:
    """A robot of one's own: here a heavier one, whose numbers the controller learns."""
    for name in ("scissored_pair.xml", "cube.xml"):
        (tmp_path / name).write_text((folder("models") / name).read_text(encoding="utf-8"), encoding="utf-8")
    other = tmp_path / "scissored_pair.xml"
    other.write_text(other.read_text(encoding="utf-8").replace('gravity="0 0 -9.81"', 'gravity="0 0 -9.6"'))
    base = prepare(load_scenario("push_recovery"))
    studio = Session(lambda path: base.with_settings({"plant.model": path}) if path else base)
    with studio.handle:
        studio.send(messages.LoadModelEvent(path=str(other)))
        studio.run(3.0)
        same(studio.rows, runner_rows(f"plant.model={other}"))
        other.write_text("<mujoco/>", encoding="utf-8")
        studio.send(messages.LoadModelEvent(path=str(other)))
        assert "joint" in studio.session_state().note
        assert studio.data.time > 3.0


@pytest.mark.slow
def test_every_observer_starts_from_the_present_state() -> None:
    """In the middle of the push's swing, as in a fresh controller; all but what needs the whole push recover."""
    with session("push.0.start_s=0.5", "controller.feedback=fog") as studio:
        for kind in OBSERVERS:
            studio.send(messages.LoadModelEvent())
            studio.run(0.62)
            studio.send(ChangeSettings({OBSERVER: kind}))
            studio.run(2.0)
            assert studio.settings().observer == kind
            assert not studio.live.stopped, kind


def test_the_rate_fed_back_is_the_runners() -> None:
    with session() as studio:
        studio.send(ChangeSettings({FEEDBACK: "truth"}))
        studio.run(1.0)
        assert studio.settings().feedback == "truth"
        same(studio.rows, runner_rows("controller.feedback=truth"))

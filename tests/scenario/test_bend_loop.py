"""The loop of a rig that bends: its transfer, its margins, and what `check` says of it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from cmg_mj import load_scenario, prepare
from cmg_mj.controllers.laws.state_feedback import StateFeedback
from cmg_mj.plant.bend_model import bend_model
from cmg_mj.plant.plant import load_plant
from cmg_mj.plant.step_limit import input_column, state_matrix
from cmg_mj.scenario import bend_loop as module
from cmg_mj.scenario.bend_cures import Trial, cure_among, margins, try_loop
from cmg_mj.scenario.bend_decay import Decay, Motion
from cmg_mj.scenario.bend_loop import BentLoop, bent_loop
from tests.command import cmg_mj

FEW = np.array([0.7, 3.0, 8.0, 19.0, 33.0])


def trial_of(*settings: str) -> Trial:
    experiment = prepare(load_scenario("push_recovery", settings))
    result = try_loop(experiment.scenario, experiment.plant.parameters)
    assert result is not None
    return result


def test_the_rig_with_its_bend_held_is_the_rigid_rig() -> None:
    plant, rigid = load_plant(bend_frequency_hz=20.0), load_plant()
    bend = bend_model(plant.model, plant.key, plant.axis, plant.settings)
    assert bend is not None
    assert bend_model(rigid.model, rigid.key, rigid.axis, rigid.settings) is None
    command = np.zeros(rigid.model.nu)
    for one in rigid.axis.modules:
        command[one.servo] = one.direction
    A, B = state_matrix(rigid.model, rigid.key), input_column(rigid.model, rigid.key, command)
    tilt = rigid.axis.line.dof
    answers = bend.rigid.response(FEW, 1e-4)
    for k, hz in enumerate(FEW):
        s = 2j * math.pi * hz
        states = np.linalg.solve(s * np.eye(len(A)) - A, B)
        assert answers.y1[k] == pytest.approx(states[tilt], rel=0.02)  # held for 0.1 ms
        assert answers.acceleration[k] == pytest.approx(s * s * states[tilt], rel=0.02)


def test_a_poorly_damped_pole_is_at_the_mode() -> None:
    plant = load_plant(bend_frequency_hz=40.0)
    bend = bend_model(plant.model, plant.key, plant.axis, plant.settings)
    assert bend is not None
    (pole,) = bend.bending.lightly_damped()
    assert abs(pole) == pytest.approx(80.0 * math.pi, rel=0.02)  # wheels and gravity shift it


def test_the_transfer_of_the_true_state_is_the_laws_gains(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_frequencies", lambda *_: FEW)
    settings = ["plant.bend_frequency_hz=20", "controller.feedback=truth", "observer.kind=linear"]
    experiment = prepare(load_scenario("push_recovery", settings))
    bend, law = experiment.plant.parameters.bend, experiment.law
    assert bend is not None
    assert isinstance(law, StateFeedback)
    found = bent_loop(experiment.design, bend)
    assert found is not None
    k1, k2, k3, k4 = law.gains
    for plant, transfer in ((bend.bending, found.transfer), (bend.rigid, found.rigid)):
        x = plant.response(FEW, law.dt)
        x_e = -law.dt * x.y2 / (np.exp(2j * np.pi * FEW * law.dt) - 1.0)
        np.testing.assert_allclose(transfer, k1 * x.y1 + k2 * x.true_rate + k3 * x.y2 + k4 * x_e, rtol=1e-4)


def test_margins_are_those_of_an_integrator_behind_a_delay() -> None:
    hz = np.geomspace(0.05, 20.0, 2000)
    s = 2j * np.pi * hz
    result = margins(BentLoop(hz, 2.0 * np.exp(-0.1 * s) / s, 1.0 / s))
    assert result.largest_gain == pytest.approx(math.pi / (2.0 * 0.1 * 2.0), rel=1e-3)
    assert result.phase_deg == pytest.approx(90.0 - math.degrees(0.1 * 2.0), rel=1e-3)
    assert result.phase_at_hz == pytest.approx(2.0 / (2.0 * math.pi), rel=1e-3)
    assert result.least_gain == 0.0


def test_the_cure_has_the_fewest_settings_and_then_margin() -> None:
    hz = np.array([1.0, 2.0])

    def trial(name: str, distance: float, bending: Motion = "decays", rigid: Motion = "decays") -> Trial:
        loop = BentLoop(hz, np.full(2, -1.0 + distance + 0j), np.zeros(2, complex))
        return Trial((name,), Decay(bending, rigid), loop)

    bad, poor, good = trial("bad", 0.05), trial("poor", 0.3), trial("good", 0.8)
    assert cure_among([bad, poor, good]) == good
    assert cure_among([bad, poor, trial("poorer", 0.25)]) == poor
    assert cure_among([bad, poor, good._replace(settings=("a", "b"))]) == poor
    assert cure_among([bad]) is None
    assert cure_among([trial("falls", 0.8, "falls"), trial("falls rigid", 0.8, rigid="swings"), good]) == good
    assert poor.is_near
    assert not good.is_near
    assert not trial("falls rigid", 0.3, rigid="falls").is_near  # the bend is not at fault


@pytest.mark.slow
@pytest.mark.parametrize("hz", [10, 40])
@pytest.mark.parametrize("place", ["sensors", "both"])
@pytest.mark.parametrize("rate", ["fog", "homogeneous", "gyro_free"])
@pytest.mark.parametrize("cured", [False, True])
def test_its_verdict_is_that_of_the_simulation(hz: float, place: str, rate: str, cured: bool) -> None:
    settings = [f"plant.bend_frequency_hz={hz}", f"plant.bend_beyond={place}", "plant.bend_share=0.5"]
    settings += [f"controller.feedback={rate}"] if rate in ("fog", "truth") else [f"observer.kind={rate}"]
    settings += [f"controller.notch_hz={hz}"] if cured else []
    verdict = trial_of(*settings)
    bending, rigid = (
        prepare(load_scenario("push_recovery", ["duration_s=6.0", *settings, *more])).run_many(3)
        for more in ([], ["plant.bend_frequency_hz=0"])
    )
    commands = [result.mean("command_rms_rad_s") or math.inf for result in (bending, rigid)]
    swings = bool(bending.fell.any()) or commands[0] > 1.2 * commands[1]
    if not verdict.is_stable or verdict.distance > 0.15:
        assert verdict.is_stable != swings


@pytest.mark.slow
@pytest.mark.usefixtures("elsewhere")
@pytest.mark.parametrize(
    ("hz", "observer", "words"),
    [
        (20, "gyro_free", ["cure        --set controller.notch_hz=", "feedback from the observer: UNSTABLE"]),
        (3, "gyro_free", ["cure        none of these: the mode is too near the loop's bandwidth", "tried "]),
        (5, "gyro_free", ["cure        none of these: the mode is too near the loop's bandwidth", "tried "]),
        (20, "homogeneous", ["feedback from the observer: stable, nearest to -1 0.8"]),
    ],
)
def test_check_proposes_a_cure_or_says_that_there_is_none(hz: int, observer: str, words: list[str]) -> None:
    fields = f"[plant]\nbend_frequency_hz = {hz}\n[observer]\nkind = '{observer}'\n"
    Path("bend.toml").write_text(fields)
    out = cmg_mj("check", "bend.toml").out
    assert all(word in out for word in words)
    assert "the frame's bend: not in the reduced model" in out
    assert ("hint" in out) == (observer == "gyro_free")


@pytest.mark.slow
@pytest.mark.usefixtures("elsewhere")
@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["controller.gains=[0,0,0,0]"], "UNSTABLE (with a rigid frame: UNSTABLE)"),
        (["observer.kind=linear", "observer.tau=0.3"], "UNSTABLE (with a rigid frame: UNSTABLE)"),
        (["observer.kind=luenberger"], "(with a rigid frame: stable for small motions, but NOT for its own initial"),
        (["controller.rate_hz=1"], "UNSTABLE (with a rigid frame: UNSTABLE)"),
    ],
    ids=["no gains", "slow", "luenberger", "1 Hz"],
)
def test_check_tries_no_cure_where_the_rigid_loop_is_not_stable(settings: list[str], words: str) -> None:
    options = [f"--set={setting}" for setting in ["plant.bend_frequency_hz=20", *settings]]
    out = cmg_mj("check", "push_recovery", *options).out
    (line,) = (line for line in out.splitlines() if "feedback from the observer: " in line)
    assert words in line
    assert "none is tried: law, observer and notch have to hold a rigid frame first" in out
    assert "the loop is not stable with a rigid frame either" in out
    assert "tried  " not in out


@pytest.mark.usefixtures("elsewhere")
def test_check_takes_settings_for_a_scenario_alone() -> None:
    assert "initial tilt 3 deg" in cmg_mj("check", "push_recovery", "--set=plant.initial_tilt_deg=3").out
    outcome = cmg_mj("check", "rig.xml", "--set=plant.initial_tilt_deg=3")
    assert outcome.status == 2
    assert "--set plant.initial_tilt_deg=3: is for a scenario; rig.xml is a model" in outcome.err

"""The push that a mounted robot itself stands: the search for it, and whether it is true on other seeds."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from cmg_mj.core.loop import ControlLoop
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.features.mounting import mount, write
from cmg_mj.features.mounting import push as simulated_push
from cmg_mj.features.mounting.limits import PUSH_S, WORLDS, PushLimits, PushMargin, push_limits
from cmg_mj.features.mounting.push import MARGIN, RESOLUTION, SimulatedPush, TimeLimit
from cmg_mj.features.mounting.write import PUSH_SHARE, write_scenario
from cmg_mj.linear.ceiling import ceiling
from cmg_mj.plant.physics import OneWorld
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.scenario.schema import Scenario
from cmg_mj.stages.push import Pushes
from tests.command import cmg_mj
from tests.features.mounting.push_robots import LEG, PENDULUM, ROBOTS, cart_pole, without_time_limit

pytestmark = pytest.mark.usefixtures("elsewhere")

MODEL = ReducedModel(0.3, 0.0, 0.0011, 314.0, 6.0, 2)
LIMIT = ceiling(MODEL, 4.7)


def limits(share: float = 0.8) -> PushLimits:
    E = share * LIMIT.push_impulse(PUSH_S)
    return PushLimits(MODEL, LIMIT, PushMargin(E, 0.9 * E), LIMIT.pole)


class Stub:
    """A robot whose worlds stand pushes up to their limits; notes what is tried."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, right: float, left: float, seconds: float = 0.0) -> None:
        self.tried: list[float] = []
        self.now = 0.0
        self.others = 1.0
        """Other worlds stand so much of what the first ten do."""

        def attempt(_: object, pushes: list[tuple[int, float]], *arguments: Any, **__: object) -> Any:
            self.now += seconds
            arguments[2].check("")
            self.tried.append(max(impulse for _, impulse in pushes))
            worlds = [1.0 if world < WORLDS else self.others for world, _ in pushes]
            fallen = sum(
                not -left * share <= impulse <= right * share
                for (_, impulse), share in zip(pushes, worlds, strict=True)
            )
            return simulated_push._Attempt(fallen, 1.5, 4.7)

        monkeypatch.setattr(simulated_push, "_attempt", attempt)
        monkeypatch.setattr(simulated_push, "_tilted", lambda experiment, *_: experiment)

    def search(self, share: float = 0.8) -> SimulatedPush:
        experiment: Any = None
        return simulated_push.simulated_push(experiment, limits(share), time_limit=TimeLimit(clock=lambda: self.now))


@pytest.mark.parametrize("share", [0.05, 0.3, 0.6, 0.75, 0.9, 1.0, 1.7, 4.0])
@pytest.mark.parametrize("known", [0.0, 0.1, 0.8])
def test_the_largest_that_all_stand_less_a_tenth(monkeypatch: pytest.MonkeyPatch, share: float, known: float) -> None:
    """To the side where less is stood, whatever the reduced model expects."""
    top = LIMIT.push_impulse(PUSH_S)
    result = Stub(monkeypatch, right=share * top, left=1.2 * share * top).search(known)
    assert (result.standing, result.complete) == (WORLDS, True)
    found = result.impulse / (1.0 - MARGIN)
    assert found <= share * top
    assert found >= share * top - max(1.1 * RESOLUTION * share, simulated_push.MIN_SHARE) * top


def test_what_other_worlds_do_not_stand_is_reduced_again(monkeypatch: pytest.MonkeyPatch) -> None:
    top = limits().push_margin.median_impulse
    stub = Stub(monkeypatch, right=top, left=top)
    alone = stub.search()
    stub.others = 0.8
    assert stub.search().impulse == pytest.approx((1.0 - MARGIN) ** 2 * alone.impulse)
    assert (alone.servo_torque, alone.servo_rate) == (1.5, 4.7)
    stub.others = 0.0
    assert stub.search() == SimulatedPush(WORLDS)


def test_a_robot_that_falls_is_not_pushed(monkeypatch: pytest.MonkeyPatch) -> None:
    stub = Stub(monkeypatch, right=-1.0, left=1.0)
    result = stub.search()
    assert (result.standing, result.impulse, result.falls, stub.tried) == (0, 0.0, True, [0.0])


@pytest.mark.parametrize("worst", [0.7, 0.8])
def test_where_the_noise_may_fell_it_others_must_stand_too(monkeypatch: pytest.MonkeyPatch, worst: float) -> None:
    """Ten worlds of a bicycle stood 20 s, and one of ten others fell: with E near the noise the worlds differ much."""
    top = limits().push_margin.median_impulse
    stub = Stub(monkeypatch, right=top, left=top)
    noisy = replace(limits(), push_margin=PushMargin(top, worst * top))
    experiment: Any = None
    result = simulated_push.simulated_push(experiment, noisy, time_limit=TimeLimit(clock=lambda: 0.0))
    assert (result.standing, result.worlds, result.falls) == ((30, 30, False) if worst < 0.75 else (10, 10, False))
    stub.others = -1.0  # fall without a push
    fallen = simulated_push.simulated_push(experiment, noisy, time_limit=TimeLimit(clock=lambda: 0.0))
    assert fallen == (SimulatedPush(10, worlds=30) if worst < 0.75 else SimulatedPush(10))
    assert fallen.falls == (worst < 0.75)
    assert stub.tried[-1] == 0.0 or worst > 0.75
    assert any(f"worst world recovers from {worst:.0%} of E" in hint for hint in noisy.hints) == (worst < 0.75)


def test_it_ends_after_a_minute_with_what_it_has(monkeypatch: pytest.MonkeyPatch) -> None:
    top = limits().push_margin.median_impulse
    result = Stub(monkeypatch, right=0.95 * top, left=top, seconds=25.0).search()
    assert result == SimulatedPush(WORLDS, (1.0 - MARGIN) * simulated_push.FIRST_SHARE * top, complete=False)
    assert Stub(monkeypatch, right=top, left=top, seconds=61.0).search() == SimulatedPush(None, complete=False)


def pushed(scenario: Scenario, torque: float, seed: int) -> int:
    """In how many of twenty worlds it stands a push, half of them to either side."""
    experiment = prepare(scenario).with_settings({"seed": seed, "duration_s": 14.0, "push": []})
    signs = np.repeat([1.0, -1.0], WORLDS)
    push = {"push": [{"start_s": 3.0, "duration_s": PUSH_S, "torque_n_m": torque}], "plant.initial_tilt_deg": 0.0}
    pushes = experiment.with_settings(push)
    vary = {"push.0.torque_n_m": (torque * signs).tolist()}
    return int(pushes.run_many(2 * WORLDS, settings=vary, keep_trajectory=False).stood.sum())


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_what_is_said_is_stood_on_new_seeds(name: str) -> None:
    """By all worlds, later than it was tried; 1.8 times that by none."""
    text, options = ROBOTS[name]
    model = mount(mujoco.MjSpec.from_string(text), **options).save("rig.xml")
    experiment = write_scenario(model, model, "gyro_free")
    result = simulated_push.simulated_push(experiment, push_limits(experiment), time_limit=TimeLimit(1000.0))
    assert (result.standing, result.complete) == (WORLDS, True)
    assert result.impulse > 0.0
    for seed in (1, 2):
        assert pushed(experiment.scenario, result.impulse / PUSH_S, seed) == 2 * WORLDS
        assert pushed(experiment.scenario, 1.8 * result.impulse / PUSH_S, seed) == 0


@pytest.mark.slow
def test_a_robot_that_does_not_stand_stands_with_a_larger_pair(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a pair of half the size it falls, and the files stay; with a larger one it stands on another seed."""
    without_time_limit(monkeypatch)
    Path("leg.xml").write_text(LEG, encoding="utf-8")
    arguments = ("mount", "leg.xml", "--body", "torso", "--axis", "x", "--free-base")
    done = cmg_mj(*arguments, "--scale", "0.7", "-o", "a.xml", "--json")
    figures = json.loads(done.out)
    assert figures["stand_unpushed"] < figures["stand_unpushed_of"] == WORLDS
    assert figures["stands_push_impulse_n_m_s"] == 0.0
    assert sorted(path.name for path in Path().iterdir()) == ["a.toml", "a.xml", "leg.xml"]
    assert cmg_mj(*arguments, "--scale", "1.6", "-o", "b.xml", "--quick").status == 0
    other = prepare(load_scenario("b.toml", ["seed=7", "push=[]", "duration_s=30.0"]))
    assert other.run_many(WORLDS, keep_trajectory=False).stood.all()


@pytest.fixture
def pendulum(monkeypatch: pytest.MonkeyPatch) -> tuple[str, ...]:
    """A command that mounts a pair, with a push margin that takes no time to find."""
    Path("pendulum.xml").write_text(PENDULUM, encoding="utf-8")
    monkeypatch.setattr("cmg_mj.features.mounting.limits.push_margin", lambda *_: PushMargin(0.4, 0.3))
    return ("mount", "pendulum.xml", "--body", "pole", "-o", "rig.xml")


@pytest.mark.parametrize(
    ("simulated", "text"),
    [
        (SimulatedPush(10, 0.3), "gyro_free: stands a push of 3 N m for 0.1 s either way (MuJoCo, all of 10 worlds, "),
        (SimulatedPush(10, 0.3, complete=False), "60 s were too short to try it in 20 others"),
        (SimulatedPush(10, 0.0), "gyro_free: stands in MuJoCo only unpushed"),
        (SimulatedPush(28, worlds=30), "gyro_free: does not stand: in MuJoCo 2 of 30 worlds fall"),
        (SimulatedPush(None, complete=False), "in MuJoCo nothing found within 60 s"),
        (SimulatedPush(10, complete=False), "till then the scenario's push is 0.6 E"),
    ],
)
def test_it_says_what_the_robot_itself_stands(
    pendulum: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, simulated: SimulatedPush, text: str
) -> None:
    monkeypatch.setattr(write, "simulated_push", lambda *_: simulated)
    done = cmg_mj(*pendulum)
    assert done.status == 0, done.err
    assert text in done.out
    assert ("it does not stand; take a larger --scale" in done.out) == simulated.falls
    pushes = load_scenario("rig.toml").push
    E = 0.4  # of the fixture; where the search came to no end, nothing better is known
    torque = PUSH_SHARE * (simulated.impulse if simulated.complete else simulated.impulse or E) / PUSH_S
    assert [push.torque_n_m for push in pushes] == pytest.approx([torque] if torque else [])


def test_the_demands_of_a_pair(pendulum: tuple[str, ...]) -> None:
    """Closed forms of the papers' numbers: 2.62 kg and 1.1e-3 kg m^2 a module, 314 rad/s, scaled."""
    figures = json.loads(cmg_mj(*pendulum, "--quick", "--json", "--scale", "1.5").out)
    assert figures["pair_mass_kg"] == pytest.approx(2 * 2.62 * 1.5**3)
    assert figures["robot_mass_kg"] == pytest.approx(1.0)
    energy = 2 * 0.5 * 1.1e-3 * 1.5**5 * 314.0**2
    assert figures["wheels_energy_j"] == pytest.approx(energy, rel=1e-3)
    assert figures["wheels_spin_up_power_w"] == pytest.approx(energy / 60.0, rel=1e-3)
    assert figures["servo_limit_torque_n_m"] == pytest.approx(8.4 * 1.5**3, rel=1e-5)
    assert figures["servo_limit_rate_rad_s"] == 4.7
    moment = 0.5 * 0.0015 * 330.0 * 0.008  # of a 608 at a tenth of its rating
    assert figures["wheels_holding_power_assumed_w"] == pytest.approx(2 * 2 * moment * 314.0 * 1.5**3)


@pytest.mark.slow
def test_a_servo_takes_what_one_world_shows() -> None:
    """One world of the runner's, its torque read at every physics step by hand."""
    model = mount(mujoco.MjSpec.from_string(cart_pole()), "pole").save("rig.xml")
    experiment = write_scenario(model, model, "gyro_free")
    push: dict[str, Any] = {"push": [{"start_s": 2.0, "duration_s": PUSH_S, "torque_n_m": 3.5}], "duration_s": 4.0}
    pushed = experiment.with_settings({**push, "plant.initial_tilt_deg": 0.0})
    attempt = simulated_push._attempt(pushed, [(0, 0.35)], 4.0, "", TimeLimit(1000.0), "")
    physics, controller = OneWorld(pushed.plant), pushed.controller(0)
    pushes = Pushes(pushed.scenario.push, pushed.plant.timestep, [""])
    end = round(4.0 / pushed.plant.timestep)
    loop, torques, rates = ControlLoop(physics, controller, end, [pushes], 1.0), [0.0], [0.0]
    servos = [module.servo for module in pushed.plant.axis.modules]
    for tick in loop.ticks():
        loop.decide()
        loop.advance()
        torques.append(float(np.abs(physics.data.actuator_force[servos]).max()))
        rates.append(max(abs(float(tick.v[module.gimbal_dof])) for module in pushed.plant.axis.modules))
    assert attempt.servo_torque == pytest.approx(max(torques), rel=1e-6)
    assert attempt.servo_rate == pytest.approx(max(rates), rel=1e-6)

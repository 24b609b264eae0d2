"""The rig as a Gymnasium environment: Gymnasium's own checker, and the runner's trajectory bit for bit."""

from __future__ import annotations

import copy
import math
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from cmg_mj.core.axis import Tick
from cmg_mj.core.errors import InputError
from cmg_mj.features.gymnasium import ID, READINGS, STATE_COST, ScissoredPairEnv
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario
from tests.command import ROOT, environment
from tests.recorded import recorded

SHORT = ["duration_s=3.0", "push.0.start_s=0.5"]
REAL = [
    'pivot=[{kind="noise", acceleration_m_s2=0.3, corner_hz=5.0}]',
    "sensors.accelerometer.vibration_mg=4",
    "sensors.accelerometer.wheel_harmonics_mg=[5, 2]",
    "plant.accelerometer_inner_misplaced_mm=-3",
]
UNEVEN = [
    *SHORT,
    "plant.gimbal_backlash_arcmin=20.0",
    "sensors.accelerometer.latency_s=0.002",
    "sensors.accelerometer.skew_s=0.001",
    "controller.feedback='fog'",
    "push.0.start_s=0.503",
]


def act(env: ScissoredPairEnv, seed: int, **options: Any) -> tuple[list[Tick], list[dict[str, Any]], float]:
    """The bench's own controller at the environment's sensors: its ticks, the infos, the sum of rewards."""
    _, info = env.reset(seed=seed, options=options)
    controller = env.experiment.axis_controller()
    ticks, infos, total, over = [], [info], 0.0, False
    while not over:
        ticks.append(controller.decide(*info["readings"]))
        _, reward, is_terminated, is_truncated, info = env.step(np.array([ticks[-1].u]))
        infos.append(info)
        total += reward
        over = is_terminated or is_truncated
    return ticks, infos, total


@pytest.mark.daily_cases("push", "uneven", "fall")
@pytest.mark.parametrize(
    ("scenario", "settings", "seed", "world"),
    [
        ("push_recovery", SHORT, 0, 0),
        ("push_recovery", SHORT, 7, 3),
        ("push_recovery", UNEVEN, 1, 0),
        ("push_recovery", [*SHORT, "push.0.torque_n_m=40.0"], 0, 0),
        ("bias_estimation", ["duration_s=2.0"], 0, 0),
        ("push_recovery", [*SHORT, *REAL], 1, 2),
        ("push_recovery", [*SHORT, "observer.kind=mems_fused"], 1, 2),
    ],
    ids=["push", "another world", "uneven", "fall", "bias", "a real rig", "a cheap gyro"],
)
def test_our_controller_gives_the_runners_trajectory(scenario: str, settings: list[str], seed: int, world: int) -> None:
    """Bit for bit: what is measured, estimated, commanded, and where the rig is."""
    env = ScissoredPairEnv(scenario, settings, in_rad_s=True)
    ticks, infos, _ = act(env, seed, world=world)
    result = prepare(load_scenario(scenario, [*settings, f"seed={seed}"])).run(world=world)
    trajectory = recorded(result)
    assert len(ticks) == len(trajectory)
    for name, field in (("y1_rad", "y1"), ("y2_rad", "y2"), ("u_rad_s", "u"), ("fog_rad_s", "fog")):
        assert [getattr(tick, field) for tick in ticks] == trajectory[name].tolist(), name
    name_in_loop = trajectory.observers[0]
    assert [tick.estimates[0][1] for tick in ticks] == trajectory[f"estimate/{name_in_loop}/x2_rad_s"].tolist()
    for name in ("x1_rad", "x2_rad_s", "x3_rad"):
        assert [info[name] for info in infos[:-1]] == trajectory[name].tolist(), name
    assert infos[-1]["time_s"] == pytest.approx(result.outcomes[0].time_s)


def test_a_fall_ends_it_and_never_pays() -> None:
    """Who does nothing falls, and has less than who stands, though it is over sooner."""
    env = ScissoredPairEnv("push_recovery", ["duration_s=5.0"], in_rad_s=True)
    _, _, standing = act(env, 0)
    _, info = env.reset(seed=0)
    total, is_terminated = 0.0, False
    while not is_terminated:
        _, reward, is_terminated, is_truncated, info = env.step(np.zeros(1))
        assert not is_truncated
        total += reward
    assert info["time_s"] < 2.0
    assert total < 2.0 * standing < 0.0
    with pytest.raises(InputError, match="call reset"):
        env.step(np.zeros(1))


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copy", "pickle"])
def test_a_copy_goes_on_as_the_original(copied: Callable[[ScissoredPairEnv], ScissoredPairEnv]) -> None:
    """Bit for bit, from the middle of an episode to its end, and over when it is over."""
    env = ScissoredPairEnv("push_recovery", [*UNEVEN, *REAL, "swing=[{frequency_hz=2.0}]"], in_rad_s=True)
    env.reset(seed=3)
    for _ in range(30):
        env.step(np.array([0.3]))
    other, is_over = copied(env), False
    while not is_over:
        results = [each.step(np.array([0.2])) for each in (env, other)]
        assert repr(results[0]) == repr(results[1])
        is_over = results[0][2]
    assert not copied(env)._physics.any_running
    with pytest.raises(InputError, match="call reset"):
        copied(env).step(np.zeros(1))


def test_the_reward_is_the_cost_of_the_state_and_the_action() -> None:
    env = ScissoredPairEnv()
    _, before = env.reset(seed=0)
    _, reward, *_ = env.step(np.array([0.25]))
    x = [before[name] for name in ("x1_rad", "x2_rad_s", "x3_rad")]
    u = 0.25 * env.experiment.law.rate_limit
    assert reward == pytest.approx(-0.005 * (sum(w * a * a for w, a in zip(STATE_COST, x, strict=True)) + u * u))


def test_it_is_truncated_when_the_time_is_over() -> None:
    env = ScissoredPairEnv("push_recovery", SHORT)
    env.reset(seed=0)
    results = [env.step(np.array([0.0]))[2:4] for _ in range(20)]
    assert not any(map(any, results))
    env = ScissoredPairEnv("push_recovery", ["duration_s=0.1", "push=[]"])
    env.reset(seed=0)
    results = [env.step(np.array([0.0]))[2:4] for _ in range(20)]
    assert results == [(False, False)] * 19 + [(False, True)]


def test_an_observation_is_what_the_sensors_show() -> None:
    env = ScissoredPairEnv("push_recovery", SHORT, readings=READINGS, in_rad_s=True)
    observation, info = env.reset(seed=2)
    tick = env.experiment.axis_controller().decide(*info["readings"])
    assert observation[:2].tolist() == [tick.y1, tick.y2]
    assert observation[3:].tolist() == [tick.acceleration, tick.fog]
    rates = [(observation[2], info["x2_rad_s"])]
    for _ in range(60):
        observation, *_, info = env.step(np.zeros(1))
        rates.append((observation[2], info["x2_rad_s"]))
    reading, true = np.array(rates).T
    assert 1e-4 < np.std(reading - 1.03 * true) < 0.01
    assert ScissoredPairEnv("push_recovery", SHORT).reset(seed=2)[0].tolist() == observation_at(2, ())


def observation_at(seed: int, readings: tuple[str, ...], **options: Any) -> list[float]:
    return ScissoredPairEnv("push_recovery", SHORT, readings=readings).reset(seed=seed, options=options)[0].tolist()


def test_seeds_and_worlds() -> None:
    """A seed repeats; a reset without one goes on to the next world; without any, no two are alike."""
    env = ScissoredPairEnv("push_recovery", SHORT)
    first = [env.reset(seed=5)[0].tolist(), env.reset()[0].tolist(), env.reset()[0].tolist()]
    assert first == [observation_at(5, (), world=world) for world in (0, 1, 2)]
    assert env.reset(seed=5)[0].tolist() == first[0]
    assert ScissoredPairEnv().reset()[0].tolist() != ScissoredPairEnv().reset()[0].tolist()


def test_settings_of_an_episode() -> None:
    """They hold for one episode."""
    env = ScissoredPairEnv("push_recovery", SHORT)
    _, info = env.reset(seed=0, options={"settings": {"plant.initial_tilt_deg": 3.0}})
    assert math.degrees(info["x1_rad"]) == pytest.approx(3.0)
    assert math.degrees(env.reset(seed=0)[1]["x1_rad"]) == pytest.approx(1.0)


@pytest.mark.parametrize("options", [{}, {"readings": READINGS}, {"scenario": "bias_estimation"}], ids=str)
def test_gymnasiums_checker_has_nothing_to_say(options: dict[str, Any]) -> None:
    """Warnings are errors here. The passive checker is on in what `make` gives."""
    env = gymnasium.make(ID, **options)
    check_env(env.unwrapped, skip_render_check=True)
    env.reset(seed=0)
    for _ in range(3):
        env.step(env.action_space.sample())
    env.close()


@pytest.mark.slow
def test_pictures() -> None:
    """In a process of its own, which MUJOCO_GL tells what to draw with; where nothing can, that is all that is said."""
    program = f"""
import gymnasium, cmg_mj.features.gymnasium
from gymnasium.utils.env_checker import check_env
check_env(gymnasium.make({ID!r}, render_mode="rgb_array").unwrapped)
env = gymnasium.make({ID!r}, render_mode="rgb_array")
env.reset(seed=0)
picture = env.render()
print(picture.shape, picture.dtype, picture.std() > 10.0)
env.close()
"""
    process = subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        env=environment(MUJOCO_GL=os.environ.get("MUJOCO_GL", "egl")),
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    if process.returncode and "MUJOCO_GL" not in os.environ and ("OpenGL" in process.stderr or "EGL" in process.stderr):
        pytest.skip("nothing draws here")
    assert (process.returncode, process.stdout) == (0, "(480, 640, 3) uint8 True\n"), process.stderr


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ({"readings": ["mems_giro"]}, "readings: 'mems_giro': no such reading; did you mean 'mems_gyro'"),
        ({"render_mode": "human"}, "render_mode='human': must be 'rgb_array' or None"),
        ({"scenario": "push_recover"}, "push_recover"),
    ],
)
def test_wrong_arguments(arguments: dict[str, Any], complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        ScissoredPairEnv(**arguments)


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"wold": 1}, "reset: 'wold': no such option; did you mean 'world'"),
        ({"world": -1}, "reset: world = -1: must be"),
        ({"settings": {"plant.initial_tilt": 1.0}}, "initial_tilt"),
        ({"settings": {"controller.rate_hz": 100.0}}, "reset: settings: the control rate"),
    ],
)
def test_wrong_options(options: dict[str, Any], complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        ScissoredPairEnv().reset(seed=0, options=options)


@pytest.mark.parametrize("action", [np.array([math.nan]), np.zeros(2)], ids=["nan", "two"])
def test_a_wrong_action(action: np.ndarray) -> None:
    env = ScissoredPairEnv()
    env.reset(seed=0)
    with pytest.raises(InputError, match="the action must be one finite number"):
        env.step(action)


@pytest.mark.slow
def test_without_gymnasium_it_says_how_to_get_it() -> None:
    program = "import sys; sys.modules['gymnasium'] = None\nimport cmg_mj.features.gymnasium"
    process = subprocess.run([sys.executable, "-c", program], env=environment(), capture_output=True, text=True)
    assert 'environment: gymnasium is not installed: python -m pip install "cmg_mj[gymnasium]"' in process.stderr

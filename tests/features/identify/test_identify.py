"""A rig identified from simulated logs, whose truth is known."""

from __future__ import annotations

import re
from collections import Counter

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.features.identify.identify import Identified, identify_rig
from cmg_mj.features.identify.report import noises
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.scenario.schema import Scenario
from tests.features.identify.simulated import ACCELEROMETER_NOISE, SimulatedLog, off, simulated_log, swaying

DRIVEN = {"inertia J": 0.0071, "m g l": 0.64, "equilibrium": 0.01, "damping": 0.008, "dry friction": 0.001}
WHEEL = {"wheel's damping": 1e-4, "wheel's dry friction": 0.005}
LATE_S = 0.013


def covered(found: Identified, truth: dict[str, float], hits: Counter[str], counts: Counter[str]) -> None:
    """Count which intervals hold the truth, by kinds of parameters."""
    for number in found.numbers:
        if number.name in truth:
            kind = re.sub(" [12]", "", number.name)
            counts[kind] += 1
            hits[kind] += abs(off(number.value, truth[number.name], number.name)) <= number.error


def run_of(scenario: Scenario, seed: int) -> Trajectory:
    """Run a scenario; of several axes return the first."""
    run = prepare(scenario.model_copy(update={"seed": seed})).run().trajectory
    assert run is not None
    return run.along(run.axes[0]) if run.axes else run


def driven_log(seed: int, sign: float = 1.0) -> SimulatedLog:
    """Make a log with the torque that a motion takes: inverse dynamics, with a wheel that turns as it likes."""
    time, tilt = swaying(30.0)
    channels, values, truth = simulated_log(time, tilt, seed, n_accelerometers=0)
    t, y = time[5:-5], np.interp
    rate, J = np.gradient(tilt, time), DRIVEN["inertia J"]
    wheel = 20.0 * np.sin(0.9 * time + seed)
    torque = J * np.gradient(rate, time) - DRIVEN["m g l"] * np.sin(tilt - DRIVEN["equilibrium"])
    torque += DRIVEN["damping"] * rate + DRIVEN["dry friction"] * np.sign(rate)
    torque -= WHEEL["wheel's damping"] * wheel + WHEEL["wheel's dry friction"] * np.sign(wheel)
    values["torque"], values["wheel"] = sign * y(t + LATE_S, time, torque), wheel[5:-5]
    return SimulatedLog(channels, values, truth | DRIVEN | WHEEL | {"torque delay": LATE_S})


def test_a_place_is_found_to_a_millimetre() -> None:
    channels, _, truth = simulated_log(*swaying(15.0), seed=1, n_accelerometers=1)
    numbers = {number.name: number for number in identify_rig(channels).numbers}
    for part, bound in (("across", 2e-3), ("up", 2e-3), ("delay", 3e-4)):
        number = numbers[f"accelerometer 1 {part}"]
        assert abs(number.value - truth[number.name]) < min(bound, 2.0 * number.error)
        assert number.told
    assert numbers["accelerometer 1 scale 2"].value * truth["accelerometer 1 scale 2"] > 0.0  # not turned round


@pytest.mark.parametrize(("gyro", "off"), [(0.0, 0.1), (0.01, 0.3)])
def test_the_noise_of_an_accelerometer_is_not_the_gyros(gyro: float, off: float) -> None:
    """A gyro's noise is an angular acceleration's, times the place: here 2.5 times the accelerometer's own."""
    channels, values, _ = simulated_log(*swaying(15.0), seed=2)
    values["rate"] += gyro * np.random.default_rng(1).normal(size=len(values["rate"]))
    sizes = noises(identify_rig(channels).geometry)
    for number in (1, 2):
        assert sizes[f"accelerometer {number}"] == pytest.approx(ACCELEROMETER_NOISE, rel=off)


def test_a_pendulum_with_a_wheel() -> None:
    channels, _, truth = driven_log(2)
    numbers = {number.name: number for number in identify_rig(channels).numbers}
    for name in (*DRIVEN, "torque delay"):
        assert abs(numbers[name].value - truth[name]) < 1.5 * numbers[name].error
    assert numbers["inertia J"].error < 0.05 * DRIVEN["inertia J"]
    # A wheel's friction turns round over 1 rad/s in the fit, at once in the log.
    assert numbers["wheel's dry friction"].value == pytest.approx(WHEEL["wheel's dry friction"], rel=0.1)


def mistaken(seed: int, mistake: str) -> SimulatedLog:
    """Make a log with a mistake."""
    log = driven_log(seed, -1.0) if mistake == "torque" else simulated_log(*swaying(15.0), seed)
    values = log.values
    change = {
        "sign": {"rate": lambda: -values["rate"]},
        "unit": {"rate": lambda: np.degrees(values["rate"])},
        "tilt": {"tilt": lambda: 1.3 * values["tilt"], "rate": lambda: 1.3 * values["rate"]},
        "noise": {"rate": lambda: np.random.default_rng(1).normal(size=len(values["rate"]))},
        "g": {name: lambda name=name: values[name] / 9.81 for name in ("x1", "y1")},
        "mixed": {"y1": lambda: values["y2"], "y2": lambda: values["y1"]},
        "torque": {},
        "noisy torque": {"torque": lambda: np.random.default_rng(1).normal(size=len(values["rate"]))},
    }[mistake]
    values.update({name: make() for name, make in change.items()})
    return log


@pytest.mark.parametrize(
    ("mistake", "message"),
    [
        ("sign", "turns against the tilt: --scale rate=-1"),
        ("unit", "is 5[0-9.]+ times the tilt's derivative: give the right unit"),
        ("noise", "are these the columns"),
        (
            "g",
            "shows 0.1.. times gravity's 9.81 m/s.2, taken as m_s2: give the right unit, as in --accelerometer x1,y1,g",
        ),
        pytest.param("mixed", "accelerometer", marks=pytest.mark.slow),
        pytest.param("tilt", "no sensor is so far off 1", marks=pytest.mark.slow),
        pytest.param("noisy torque", "does not move the body beyond chance", marks=pytest.mark.slow),
        pytest.param("torque", "turns the body against its sign: --scale torque=-1", marks=pytest.mark.slow),
    ],
)
def test_a_mistake_is_named(mistake: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        identify_rig(mistaken(3, mistake).channels, 8.0)


def test_a_short_log_is_refused() -> None:
    with pytest.raises(InputError, match=r"lasts 2.89 s; below 8 Hz, where noise does not hide the motion, it takes 3"):
        identify_rig(simulated_log(*swaying(3.0), seed=1).channels, 8.0)


def test_the_bundled_scenario_that_falls_is_too_short() -> None:
    run = run_of(load_scenario("luenberger_fails"), 0)
    with pytest.raises(InputError, match=r"lasts 2\.19 s; .* it takes 3\.\d* s: give a longer log"):
        identify_rig(simulated_log(run["time_s"], run["x1_rad"], 0).channels)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "sensors"),
    [
        ("push_recovery", {}),
        ("push_recovery", {"angle": False}),
        ("push_recovery", {"gyro": False}),
        ("two_axes", {}),
        ("observer_tuning", {"angle": False}),
        ("single_gimbal", {"gyro": False}),
        ("bias_estimation", {}),
    ],
)
def test_intervals_hold_the_truth(scenario: str, sensors: dict[str, bool]) -> None:
    hits, counts = Counter[str](), Counter[str]()
    for seed in range(20):
        run = run_of(load_scenario(scenario), seed)
        channels, _, truth = simulated_log(run["time_s"], run["x1_rad"], seed, **sensors)
        covered(identify_rig(channels), truth, hits, counts)
    assert sum(hits.values()) >= 0.92 * sum(counts.values())
    assert all(hits[kind] >= 0.8 * counts[kind] for kind in counts), {
        kind: hits[kind] / counts[kind] for kind in counts
    }


@pytest.mark.slow
def test_intervals_of_the_plants_pendulum_hold_the_truth() -> None:
    experiment = prepare(load_scenario("push_recovery"))
    model, hits, counts = experiment.plant.reduced, Counter[str](), Counter[str]()
    truth = {"m g l": model.gravity_torque, "inertia J": model.J1}
    truth = {name: model.gimbals * value for name, value in truth.items()}
    for seed in range(20):
        run = run_of(experiment.scenario, seed)
        channels, values, _ = simulated_log(run["time_s"], run["x1_rad"], seed)
        values["gimbal"] = run["y2_rad"][5:-5]
        found = identify_rig(channels, momentum=model.gimbals * model.J_d * model.omega_d)
        covered(found, truth, hits, counts)
    assert min(hits[name] / counts[name] for name in truth) >= 0.9

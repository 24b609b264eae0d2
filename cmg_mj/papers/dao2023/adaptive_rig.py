"""The adaptive observer at work on the six-body rig: many worlds, each figure a function of seed and counts."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from cmg_mj.experiment import prepare
from cmg_mj.plant import load_plant
from cmg_mj.push import Push
from cmg_mj.scenario import load_scenario
from cmg_mj.schema import Scenario
from cmg_mj.trajectory import Trajectory

DURATION_S, LATE_S = 10.0, 5.0


def quiet(seed: int, *settings: str, pushes: Sequence[Push] = ()) -> Scenario:
    """The scenario push_recovery for ten seconds, without its push."""
    scenario = load_scenario("push_recovery", [f"seed={seed}", f"duration_s={DURATION_S}", *settings])
    return scenario.model_copy(update={"push": list(pushes)})


def run(scenario: Scenario, biases_deg: Sequence[float]) -> Trajectory:
    """One world a bias, side by side.

    Args:
        scenario: The experiment; its own bias does not count.
        biases_deg: e in each world, (n_worlds,) [deg].

    Returns:
        What was recorded, (n_ticks, n_worlds).
    """
    plants = {bias: load_plant(dataclasses.replace(scenario.plant, equilibrium_bias_deg=bias)) for bias in biases_deg}
    result = prepare(scenario).run_many(range(len(biases_deg)), plants=[plants[bias] for bias in biases_deg])
    assert result.trajectory is not None
    return result.trajectory


def rms_in_time(error: np.ndarray) -> np.ndarray:
    """RMS over the ticks, (n_ticks, n_worlds) -> (n_worlds,); infinite for a world that ended early."""
    ended = np.isnan(error).any(axis=0)
    return np.where(ended, np.inf, np.sqrt(np.mean(np.where(ended, 0.0, error) ** 2, axis=0)))


def signed_biases(seed: int, worlds: int, low_deg: float = 0.3, high_deg: float = 1.5) -> list[float]:
    """Biases of both signs, their sizes spread evenly over the range, in a random order [deg]."""
    rng = np.random.default_rng(seed)
    sizes = np.linspace(low_deg, high_deg, worlds) * rng.choice([-1.0, 1.0], worlds)
    return rng.permutation(sizes).tolist()


def learnt_bias(
    seed: int, biases_deg: Sequence[float], accelerometer_bias_mg: tuple[float, float] = (0.0, 0.0)
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What `adaptive`, in the loop, finds of the bias.

    Args:
        seed: Of the sensors' noise.
        biases_deg: e in each world, (n_worlds,) [deg].
        accelerometer_bias_mg: Zero offsets of the inner and outer accelerometer's tangential axes [mg].

    Returns:
        Times (n_ticks,) [s], the estimate less e (n_ticks, n_worlds) [deg], and what should be found less e,
        (n_worlds,) [deg].
    """
    setting = f"sensors.accelerometer.bias_mg=[{accelerometer_bias_mg[0]}, {accelerometer_bias_mg[1]}]"
    scenario = quiet(seed, "observer.kind=adaptive", setting)
    recorded = run(scenario, biases_deg)
    e = np.radians(biases_deg)
    plants = [load_plant(dataclasses.replace(scenario.plant, equilibrium_bias_deg=bias)) for bias in biases_deg]
    apparent = np.array([plant.apparent_bias(scenario.sensors.accelerometer) for plant in plants])
    estimate = recorded["estimate/adaptive/bias_rad"]
    return recorded["time_s"], np.degrees(estimate - e), np.degrees(apparent - e)


def bias_errors(seed: int, biases_deg: Sequence[float]) -> np.ndarray:
    """RMS error of the bias over seconds 5 to 10, (n_worlds,) [deg]."""
    time, error, apparent = learnt_bias(seed, biases_deg)
    return rms_in_time((error - apparent)[time >= LATE_S])


def velocity_errors(
    seed: int, worlds: int, observers: Sequence[str], biases_deg: Sequence[float]
) -> dict[str, np.ndarray]:
    """Velocity RMS error over ten seconds with each observer in the loop, no push.

    Args:
        seed: Of the sensors' noise; world i of every observer has the same.
        worlds: Worlds a bias.
        observers: Names.
        biases_deg: The biases [deg].

    Returns:
        Observer -> errors, (n_biases, worlds) [rad/s].
    """
    each = [bias for bias in biases_deg for _ in range(worlds)]
    found = {}
    for name in observers:
        recorded = run(quiet(seed, f"observer.kind={name}"), each)
        error = recorded[f"estimate/{name}/x2_rad_s"] - recorded["x2_rad_s"]
        found[name] = rms_in_time(error).reshape(len(biases_deg), worlds)
    return found


def gait(amplitude_n_m: float, frequency_hz: float, piece_s: float = 0.005) -> list[Push]:
    """A sinusoidal torque on the rig, as short pushes."""
    starts = np.arange(0.0, DURATION_S, piece_s)
    torques = amplitude_n_m * np.sin(2.0 * math.pi * frequency_hz * (starts + piece_s / 2.0))
    return [
        Push(start_s=round(float(start), 6), duration_s=piece_s, torque_n_m=float(torque))
        for start, torque in zip(starts, torques, strict=True)
    ]


def learnt_gait(
    seed: int, biases_deg: Sequence[float], amplitude_n_m: float = 0.3, frequency_hz: float = 1.0
) -> dict[str, np.ndarray]:
    """`adaptive` that knows a gait's frequency, and one that does not, each in the loop under that gait.

    Args:
        seed: Of the sensors' noise.
        biases_deg: e in each world, (n_worlds,) [deg].
        amplitude_n_m: Of the torque [N m].
        frequency_hz: Of the torque [Hz].

    Returns:
        RMS errors over seconds 5 to 10, (n_worlds,): `knowing_rad_s` and `not_knowing_rad_s` of the velocity,
        `disturbance_n_m` and `bias_deg` of what the first finds.
    """
    pushes = gait(amplitude_n_m, frequency_hz)
    found = {}
    for name, hertz in (("knowing_rad_s", frequency_hz), ("not_knowing_rad_s", 0.0)):
        settings = ("observer.kind=adaptive", f"observer.sinusoid_hz={hertz}")
        recorded = run(quiet(seed, *settings, pushes=pushes), biases_deg)
        late = recorded["time_s"] >= LATE_S
        time = recorded["time_s"][late][:, None]
        found[name] = rms_in_time((recorded["estimate/adaptive/x2_rad_s"] - recorded["x2_rad_s"])[late])
        if hertz:
            torque = amplitude_n_m * np.sin(2.0 * math.pi * frequency_hz * time)
            found["disturbance_n_m"] = rms_in_time(recorded["estimate/adaptive/disturbance_n_m"][late] - torque)
            estimate = recorded["estimate/adaptive/bias_rad"][late]
            found["bias_deg"] = np.degrees(rms_in_time(estimate - np.radians(biases_deg)))
    return found


def learnt_torque(seed: int, worlds: int, torque_n_m: float = 0.1, bias_deg: float = 0.5) -> np.ndarray:
    """RMS error over seconds 5 to 10 of a constant torque that acts from the start, e being known, (worlds,) [N m]."""
    scenario = quiet(
        seed,
        "observer.kind=adaptive",
        "observer.bias=false",
        "observer.torque=true",
        f"observer.known_bias_deg={bias_deg}",
        pushes=[Push(start_s=0.0, duration_s=DURATION_S, torque_n_m=torque_n_m)],
    )
    recorded = run(scenario, [bias_deg] * worlds)
    late = recorded["time_s"] >= LATE_S
    return rms_in_time(recorded["estimate/adaptive/torque_n_m"][late] - torque_n_m)

"""The adaptive observer at work on the six-body rig: many worlds, each figure a function of seed and counts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from cmg_mj.papers.recorded import rms, trajectory_of
from cmg_mj.results.result import Result
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import prepare
from cmg_mj.runs.side_by_side import BatchJob, run_side_by_side
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.scenario.schema import Scenario
from cmg_mj.stages.push import Push

DURATION_S, LATE_S = 10.0, 5.0


def without_push(seed: int, *settings: str, pushes: Sequence[Push] = ()) -> Scenario:
    """Build the scenario push_recovery for ten seconds, without its push, or with others."""
    common = [f"seed={seed}", f"duration_s={DURATION_S}", "open_loop_observers=[]"]
    scenario = load_scenario("push_recovery", [*common, *settings])
    return scenario.model_copy(update={"push": list(pushes)})


def run(scenario: Scenario, biases_deg: Sequence[float], **options: Any) -> Result:
    """Run one world a bias, side by side; options are those of `simulate`."""
    return prepare(scenario).run_many(len(biases_deg), vary={"equilibrium_bias_deg": biases_deg}, **options)


def record(scenario: Scenario, biases_deg: Sequence[float]) -> Trajectory:
    """Record one world a bias over seconds 5 to 10, (n_ticks, n_worlds)."""
    return trajectory_of(run(scenario, biases_deg)).between(LATE_S, DURATION_S)


def errors(result: Result, key: str) -> np.ndarray:
    """Return an error of every world, (n_worlds,); infinite for one that ended early."""
    return np.nan_to_num(result.values(key), nan=np.inf)


def rms_in_time(error: np.ndarray) -> np.ndarray:
    """Return the RMS over the ticks, (n_ticks, n_worlds) -> (n_worlds,); infinite for a world that ended early."""
    ended = np.isnan(error).any(axis=0)
    return np.where(ended, np.inf, rms(np.where(ended, 0.0, error)))


def signed_biases(seed: int, worlds: int, low_deg: float = 0.3, high_deg: float = 1.5) -> list[float]:
    """Draw biases of both signs, their sizes spread evenly over the range, in a random order [deg]."""
    rng = np.random.default_rng(seed)
    sizes = np.linspace(low_deg, high_deg, worlds) * rng.choice([-1.0, 1.0], worlds)
    return rng.permutation(sizes).tolist()


def learnt_bias(
    seed: int,
    biases_deg: Sequence[float],
    accelerometer_bias_mg: tuple[float, float] = (0.0, 0.0),
    *,
    keep_trajectory: bool = False,
) -> Result:
    """Let `adaptive`, in the loop, find the bias.

    Args:
        seed: Seed of the sensors' noise.
        biases_deg: e in each world, (n_worlds,) [deg].
        accelerometer_bias_mg: Zero offsets of the inner and outer accelerometer's tangential axes [mg].
        keep_trajectory: Whether to keep every tick.

    Returns:
        The run, whose summaries have what should be found, what was found over seconds 5 to 10, and its RMS error.
    """
    setting = f"sensors.accelerometer.bias_mg=[{accelerometer_bias_mg[0]}, {accelerometer_bias_mg[1]}]"
    return run(without_push(seed, "observer.kind=adaptive", setting), biases_deg, keep_trajectory=keep_trajectory)


def bias_errors(seed: int, biases_deg: Sequence[float]) -> np.ndarray:
    """Return the RMS error of the bias over seconds 5 to 10, (n_worlds,) [deg]."""
    return errors(learnt_bias(seed, biases_deg), "bias_rms_error_deg")


def velocity_errors(
    seed: int, worlds: int, observers: Sequence[str], biases_deg: Sequence[float]
) -> dict[str, np.ndarray]:
    """Return the velocity RMS error over ten seconds with each observer in the loop, no push.

    Args:
        seed: Seed of the sensors' noise; world i of every observer has the same.
        worlds: Worlds a bias.
        observers: Names.
        biases_deg: The biases [deg].

    Returns:
        Observer -> errors, (n_biases, worlds) [rad/s].
    """
    biases = np.repeat(biases_deg, worlds).tolist()
    runs = []
    for name in observers:
        experiment = prepare(without_push(seed, f"observer.kind={name}"))
        runs.append(BatchJob(experiment.with_varied({"equilibrium_bias_deg": biases}), range(len(biases))))
    return {
        name: errors(result, "velocity_rms_error_rad_s").reshape(len(biases_deg), worlds)
        for name, result in zip(observers, run_side_by_side(runs, keep_trajectory=False), strict=True)
    }


def gait(amplitude_n_m: float, frequency_hz: float, piece_s: float = 0.005) -> list[Push]:
    """Build a sinusoidal torque on the rig, as short pushes."""
    starts = np.arange(0.0, DURATION_S, piece_s)
    torques = amplitude_n_m * np.sin(2.0 * math.pi * frequency_hz * (starts + piece_s / 2.0))
    return [
        Push(start_s=round(float(start), 6), duration_s=piece_s, torque_n_m=float(torque))
        for start, torque in zip(starts, torques, strict=True)
    ]


def learnt_gait(
    seed: int, biases_deg: Sequence[float], amplitude_n_m: float = 0.3, frequency_hz: float = 1.0
) -> dict[str, np.ndarray]:
    """Run `adaptive` that knows a gait's frequency, and one that does not, each in the loop under that gait.

    Args:
        seed: Seed of the sensors' noise.
        biases_deg: e in each world, (n_worlds,) [deg].
        amplitude_n_m: Amplitude of the torque [N m].
        frequency_hz: Frequency of the torque [Hz].

    Returns:
        RMS errors over seconds 5 to 10, (n_worlds,): `knowing_rad_s` and `not_knowing_rad_s` of the velocity,
        `disturbance_n_m` and `bias_deg` of what the first finds.
    """
    pushes = gait(amplitude_n_m, frequency_hz)
    informed, blind = (
        record(without_push(seed, "observer.kind=adaptive", f"observer.sinusoid_hz={hertz}", pushes=pushes), biases_deg)
        for hertz in (frequency_hz, 0.0)
    )
    torque = amplitude_n_m * np.sin(2.0 * math.pi * frequency_hz * informed["time_s"][:, None])
    return {
        "knowing_rad_s": rms_in_time(informed["estimate/adaptive/x2_rad_s"] - informed["x2_rad_s"]),
        "disturbance_n_m": rms_in_time(informed["estimate/adaptive/disturbance_n_m"] - torque),
        "bias_deg": np.degrees(rms_in_time(informed["estimate/adaptive/bias_rad"] - np.radians(biases_deg))),
        "not_knowing_rad_s": rms_in_time(blind["estimate/adaptive/x2_rad_s"] - blind["x2_rad_s"]),
    }


def learnt_torque(seed: int, worlds: int, torque_n_m: float = 0.1, bias_deg: float = 0.5) -> np.ndarray:
    """Return the RMS error over seconds 5 to 10 of a constant torque from the start, e being known, (worlds,) [N m]."""
    scenario = without_push(
        seed,
        "observer.kind=adaptive",
        "observer.bias=false",
        "observer.torque=true",
        f"observer.known_bias_deg={bias_deg}",
        pushes=[Push(start_s=0.0, duration_s=DURATION_S, torque_n_m=torque_n_m)],
    )
    trajectory = record(scenario, [bias_deg] * worlds)
    return rms_in_time(trajectory["estimate/adaptive/torque_n_m"] - torque_n_m)

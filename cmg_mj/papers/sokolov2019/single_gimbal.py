"""The single-gimbal rig of sokolov2019 on MuJoCo: servos with another lag, releases without noise, runs over seeds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from cmg_mj.experiment import Experiment, prepare
from cmg_mj.papers.sokolov2019.sampled_loop import Servo
from cmg_mj.plant import Plant, load_plant
from cmg_mj.plant_settings import PlantSettings
from cmg_mj.scenario import load_scenario
from cmg_mj.schema import ControllerSettings
from cmg_mj.simulate import Result
from cmg_mj.trajectory import Trajectory

SCENARIO = "single_gimbal"

NO_NOISE = (
    "sensors.accelerometer.noise_density_ug_rthz=0.0",
    "sensors.accelerometer.counts_per_g=0.0",
    "sensors.encoder.counts_per_revolution=0.0",
    "sensors.fog.angle_random_walk_deg_rth=0.0",
)

RELEASE = (*NO_NOISE, "plant.equilibrium_bias_deg=0.0", "plant.initial_tilt_deg=0.2", "push=[]", "duration_s=6.0")
"""Let go 0.2 degrees off, nothing else disturbing it."""

WINDOW_S = 2.0
"""Two windows of this length, the last of a release, are compared."""
FLOOR_RAD_S = 1e-3
"""A tilt rate below this is no oscillation: a release begins with thirty times as much."""
RATE_LIMIT = ControllerSettings().rate_limit_rad_s
"""Largest command [rad/s]."""
RK4_LIMIT = 2.7
"""Runge-Kutta 4 follows x' = -x only for steps below 2.785."""
LATE_S = 4.0
"""The end of a run with noise that counts as after the push [s]."""
STEADY = 0.98
"""Share of the amplitude that an oscillation keeps from one window to the next if it is sustained."""


def experiment(settings: Sequence[str] = (), observer: str = "homogeneous", feedback: str = "observer") -> Experiment:
    """The scenario with other settings."""
    return prepare(load_scenario(SCENARIO, [f"controller.feedback={feedback}", *settings], observer))


def servo_of(plant: Plant) -> Servo:
    """The gimbal servo that the model file describes."""
    (servo,) = plant.servos
    (cube,) = plant.cubes
    dof = int(plant.model.jnt_dofadr[cube.gimbal])
    return Servo(
        float(plant.model.actuator_gainprm[servo, 0]),
        float(-plant.model.actuator_biasprm[servo, 2]),
        float(plant.model.dof_M0[dof]),
    )


def rig_with(settings: PlantSettings, servo: Servo) -> Plant:
    """The rig with another servo: a plant of its own, whose model is changed before anything runs on it.

    Raises:
        ValueError: The servo is too stiffly damped for RK4 at this timestep: it would chatter by itself.
    """
    decay = servo.kv * settings.timestep_s / servo.inertia
    if decay > RK4_LIMIT:
        raise ValueError(
            f"servo lag {1e3 * servo.lag_s:.3g} ms: kv h/I = {decay:.3g} must be at most {RK4_LIMIT} at timestep_s = "
            f"{settings.timestep_s:g}"
        )
    plant = load_plant(settings)
    for i in plant.servos:
        plant.model.actuator_gainprm[i, 0] = servo.kp
        plant.model.actuator_biasprm[i, 1:3] = -servo.kp, -servo.kv
    return plant


# --- does it oscillate by itself? ---------------------------------------------------------------------------


def amplitudes(trajectory: Trajectory) -> np.ndarray:
    """Largest tilt rate in the last two windows of a release, (2, n_worlds) [rad/s]; infinite for a world that fell."""
    t, x2 = trajectory["time_s"], trajectory["x2_rad_s"]
    x2 = x2.reshape(len(t), -1)
    end = t[-1]
    windows = [(t > end - (i + 1) * WINDOW_S) & (t <= end - i * WINDOW_S) for i in (1, 0)]
    return np.array([np.where(np.isfinite(x2[-1]), np.abs(x2[w]).max(axis=0), np.inf) for w in windows])


def is_sustained(trajectory: Trajectory) -> np.ndarray:
    """Which worlds of a release oscillate without end, grow or fall, (n_worlds,).

    Sustained: the tilt rate's peak over the last 2 s is at least 98 % of that over the 2 s before, and above 1e-3
    rad/s. A fall counts too.
    """
    before, last = amplitudes(trajectory)
    with np.errstate(invalid="ignore"):
        return (last > FLOOR_RAD_S) & ((last >= STEADY * before) | np.isinf(last))


def release(observer: str, servos: Sequence[Servo], settings: Sequence[str] = (), feedback: str = "observer") -> Result:
    """Let the rig go without noise, one world a servo."""
    prepared = experiment([*RELEASE, *settings], observer, feedback)
    plants = [rig_with(prepared.scenario.plant, servo) for servo in servos]
    return prepared.run_many(len(plants), plants=plants)


def sustained_by_lag(
    observer: str, lags_s: Sequence[float], make: Callable[[Servo, float], Servo], feedback: str = "observer"
) -> np.ndarray:
    """For each servo lag whether the loop oscillates by itself, (n_lags,)."""
    servo = servo_of(experiment().plant)
    result = release(observer, [make(servo, lag) for lag in lags_s], feedback=feedback)
    assert result.trajectory is not None
    return is_sustained(result.trajectory)


class Threshold(NamedTuple):
    """Where something begins: not yet at `low`, already at `high`; `high` is None if nowhere in the range."""

    low: float
    high: float | None

    @property
    def middle(self) -> float | None:
        """The best guess."""
        return None if self.high is None else (self.low + self.high) / 2.0


def servo_lag_threshold(
    observer: str,
    *,
    feedback: str = "observer",
    make: Callable[[Servo, float], Servo] = Servo.damped,
    low: float = 5e-3,
    high: float = 0.045,
    cuts: int = 3,
    parts: int = 9,
) -> Threshold:
    """The least servo lag at which the loop oscillates by itself, by cutting a range into parts again and again [s].

    Args:
        observer: In the loop.
        feedback: Which rate the law uses.
        make: How a servo gets its lag: `Servo.damped` (as stiff) or `Servo.softened` (critically damped).
        low: A lag at which it does not.
        high: The largest lag tried.
        cuts: How often the range is cut.
        parts: Into how many.
    """
    ceiling: float | None = None
    for _ in range(cuts):
        grid = np.linspace(low, high, parts + 1)[1:]
        found = np.flatnonzero(sustained_by_lag(observer, grid.tolist(), make, feedback))
        if not len(found):
            return Threshold(high, ceiling)
        first = int(found[0])
        low, high = (float(grid[first - 1]) if first else low), float(grid[first])
        ceiling = high
    return Threshold(low, ceiling)


def latency_threshold(observer: str, largest_steps: int = 64) -> Threshold:
    """The least latency of the accelerometers at which the loop oscillates by itself, to one physics step [s].

    They are sampled at every physics step here, so that the latency is not rounded up to control periods.
    """

    def sustained(steps: int) -> bool:
        latency = f"sensors.accelerometer.latency_s={steps / 1000}"
        result = experiment([*RELEASE, "sensors.accelerometer.rate_hz=1000.0", latency], observer).run()
        assert result.trajectory is not None
        fell = result.outcomes[0].kind != "done"
        return fell or bool(is_sustained(result.trajectory)[0])

    low, high = 0, largest_steps
    if not sustained(high):
        return Threshold(high / 1000, None)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if sustained(middle) else (middle, high)
    return Threshold(low / 1000, high / 1000)


# --- over seeds ---------------------------------------------------------------------------------------------


class Runs(NamedTuple):
    """What an observer does in the loop, over seeds; NaN where a world fell."""

    velocity_error: np.ndarray
    """RMS error of the estimated rate, (n_worlds,) [rad/s]."""
    tilt: np.ndarray
    """RMS tilt, (n_worlds,) [deg]."""
    shaking: np.ndarray
    """Standard deviation of the tilt over the last `LATE_S`, (n_worlds,) [deg]."""
    fell: np.ndarray
    """Which worlds fell, (n_worlds,)."""
    trajectory: Trajectory


def runs(
    observer: str,
    worlds: int,
    seed: int,
    settings: Sequence[str] = (),
    servo_lag_s: float | None = None,
    feedback: str = "observer",
) -> Runs:
    """The closed loop with noise and the push.

    Args:
        observer: In the loop.
        worlds: Seeds.
        seed: The first.
        settings: Of the scenario.
        servo_lag_s: Another servo lag, as stiff [s].
        feedback: Which rate the law uses.
    """
    prepared = experiment([f"seed={seed}", *settings], observer, feedback)
    plants = None
    if servo_lag_s is not None:
        plant = rig_with(prepared.scenario.plant, servo_of(prepared.plant).damped(servo_lag_s))
        plants = [plant] * worlds
    result = prepared.run_many(worlds, plants=plants)
    trajectory = result.trajectory
    assert trajectory is not None
    fell = np.array([outcome.kind != "done" for outcome in result.outcomes])
    late = trajectory["time_s"] >= prepared.scenario.duration_s - LATE_S

    def of(name: str) -> np.ndarray:
        return np.array([np.nan if down else s[name] for s, down in zip(result.summaries, fell, strict=True)])

    x1 = np.degrees(trajectory["x1_rad"][late])
    shaking = np.where(fell, np.nan, x1.std(axis=0) if len(x1) else np.nan)
    return Runs(of("velocity_rms_error_rad_s"), of("tilt_rms_deg"), shaking, fell, trajectory)


def main_frequency(trajectory: Trajectory) -> float:
    """Where the tilt rate's spectrum has its peak over the last `LATE_S`, averaged over the worlds that stood [Hz]."""
    t = trajectory["time_s"]
    late = trajectory["x2_rad_s"][t >= t[-1] - LATE_S]
    late = late[:, np.isfinite(late).all(axis=0)]
    padded = 8 * len(late)
    spectrum = (np.abs(np.fft.rfft(late - late.mean(axis=0), padded, axis=0)) ** 2).mean(axis=1)
    return float(np.fft.rfftfreq(padded, t[1] - t[0])[spectrum.argmax()])


def limited_share(trajectory: Trajectory) -> float:
    """Share of the ticks of the last `LATE_S` at which the command is at its limit, over the worlds that stood."""
    t = trajectory["time_s"]
    late = np.abs(trajectory["u_rad_s"][t >= t[-1] - LATE_S])
    return float((late[:, np.isfinite(late).all(axis=0)] >= RATE_LIMIT).mean())


def pushed(trajectory: Trajectory) -> list[tuple[float, float]]:
    """When the push acted, to shade it [s]."""
    push = trajectory["push_n_m"].reshape(len(trajectory), -1)[:, 0]
    times = trajectory["time_s"][np.nan_to_num(push) != 0.0]
    return [(float(times[0]), float(times[-1]))] if len(times) else []

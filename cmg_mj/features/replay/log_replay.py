"""Replay of observers on a user's log, their inputs and their scores."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cmg_mj.core.errors import InputError, counted, raised
from cmg_mj.core.reduced_model import NO_MODEL, ReducedModel
from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.core.types import STATE_SIGNALS, extra_signals, needs
from cmg_mj.features.replay.log import REFERENCE, TORQUE_MOMENTUM, Log
from cmg_mj.features.replay.noise import noise_of
from cmg_mj.features.replay.reference import SPAN_S, Alignment, alignment_of
from cmg_mj.features.replay.scores import rms, scores
from cmg_mj.inputs.users_line import users_line
from cmg_mj.observers import OBSERVER_CLASSES, OBSERVERS, Observer, make_observer
from cmg_mj.observers.parameter_options import Parameters, ParameterValue, numbers
from cmg_mj.observers.scaling import scaled_parameters
from cmg_mj.results.baselines import ZERO
from cmg_mj.results.summary_keys import Figures
from cmg_mj.results.trajectory import GYRO, Layout, NamedColumns, Trajectory
from cmg_mj.runs.experiment import prepare
from cmg_mj.runs.open_loop import replay_all
from cmg_mj.scenario.loading import parse_scenario

if TYPE_CHECKING:
    import pandas as pd

SETTLE_S = 1.0
"""Default time at the start of each part that is not scored [s]."""
NEEDS_IN_WORDS = {
    "model": "a model (--model)",
    "gimbals": "the gimbal angle and the command (--columns gimbal=...,command=...)",
    "acceleration": "two accelerometers (--columns inner_x=...) or the angular acceleration",
    "gyro": "a gyro (--columns gyro=...; of a run, run it with --set open_loop_observers='[\"mems_fused\"]')",
}
NUMBERS = {
    "inertia": "tilt inertia about the pivot, J1 [kg m^2]",
    "gravity_torque": "mass x gravity x height of its centre, positive if it falls over [N m]",
    "momentum": "spin momentum of the flywheels together, J_d omega_d [N m s]",
    "gimbal_inertia": "what the gimbals' turn by 90 degrees adds to the inertia, J2 [kg m^2]",
}
"""Numbers of `--model`. The first two are required; the others are 0 for a pendulum without gimbals."""
EXACTLY = 1e-9
"""White noise of the gimbal that a known torque stands for, in the observers' own field [rad]."""
SEED = 0
"""Seed of the noise for noise gains."""

OnShare = Callable[[float], None]


@dataclass(frozen=True)
class ReplayResult(NamedColumns):
    """Estimates and scores of observers on one log.

    It has the log's signals and the estimates as columns: `replayed["estimate/linear/x2_rad_s"]`, `dict(replayed)`.

    Attributes:
        log: The log.
        estimates: Observer -> signal -> (n,), as in a trajectory; NaN outside the parts.
        summaries: Observer -> its figures; `zero`, an estimate of zero, is the last.
        left_out: Observer -> why it does not take part, or failed.
        alignment: Lag, scale and offset of the reference; None without a reference.
        settle_s: Time at the start of each part that is not scored [s].
        noise: The sensors' noise that observers assumed; also the noise of the noise gain.
        parameters: Parameters that were set.
    """

    log: Log
    estimates: Mapping[str, Mapping[str, np.ndarray]]
    summaries: Mapping[str, Figures]
    left_out: Mapping[str, str]
    alignment: Alignment | None
    settle_s: float
    noise: MeasurementNoise
    parameters: Parameters

    @cached_property
    def trajectory(self) -> Trajectory:
        """The log's signals and all estimates, evenly sampled, in SI units and radians."""
        columns = {name: values for name, values in self.log.columns.items() if np.isfinite(values).any()}
        for kind, signals in self.estimates.items():
            columns |= {f"estimate/{kind}/{name}": values for name, values in signals.items()}
        extra = tuple(
            tuple(name for name in signals if name not in STATE_SIGNALS) for signals in self.estimates.values()
        )
        return Trajectory(columns, {}, Layout(tuple(self.estimates), extra, ()))

    @cached_property
    def columns(self) -> Mapping[str, np.ndarray]:
        """The columns of `trajectory`."""
        return self.trajectory.columns

    def to_pandas(self) -> pd.DataFrame:
        """Make a pandas frame of the log's signals and the estimates, a row a sample.

        Raises:
            InputError: pandas is not installed.
        """
        return self.trajectory.to_pandas()


def replay_log(
    log: Log,
    observers: Sequence[str] | None = None,
    *,
    model: ReducedModel | None = None,
    noise: MeasurementNoise | None = None,
    parameters: Parameters | None = None,
    settle_s: float = SETTLE_S,
    on_share: OnShare | None = None,
) -> ReplayResult:
    """Replay observers on a log.

    Args:
        log: The log.
        observers: Names, or `package.module:Class`; all by default. Observers whose needs the log lacks are omitted.
        model: The pendulum, if it is known.
        noise: The sensors' noise that observers assume; by default `noise_of(log)`.
        parameters: Observer -> parameter -> value, where not the default.
        settle_s: Time at the start of each part that is not scored [s].
        on_share: Called now and then with the completed share.

    Returns:
        Estimates and figures.

    Raises:
        InputError: An observer does not exist or refuses its parameters, or nothing is left to score.
    """
    noise, parameters = noise or noise_of(log), dict(parameters or {})
    if model and "torque" in log.options.columns:
        if model.J_d * model.omega_d:
            raise InputError("--columns torque: the model has a momentum, which is of gimbals: leave it out")
        model = replace(model, J_d=TORQUE_MOMENTUM, omega_d=1.0)
    if not 0.0 <= settle_s < math.inf:
        raise InputError(f"--settle-s {settle_s:g}: must be a number of seconds not below 0")
    scored = log.scored(settle_s)
    if scored.sum() < 10:
        raise InputError(
            f"{log.name}: nothing is left to score: {log.duration_s:.3g} s in {counted(len(log.parts), 'part')}, "
            f"without the first {settle_s:g} s of each (--settle-s)"
        )
    if "reference" in log.has and np.isfinite(log[REFERENCE][scored]).sum() < 10:
        raise InputError(f"{log.name}: the reference has no number where estimates are scored")
    ready, left_out = _ready(log, OBSERVERS if observers is None else observers, model, noise, parameters)
    estimates: dict[str, Mapping[str, np.ndarray]] = {}
    summaries: dict[str, Figures] = {}
    noisy = _with_noise(log, noise)
    for i, (name, observer) in enumerate(ready.items()):
        if on_share:
            on_share(i / len(ready))
        signals, disturbed = _estimates(observer, log), _estimates(observer, noisy)
        if isinstance(signals, str):
            left_out[name] = signals
            continue
        estimates[name], rate = signals, signals["x2_rad_s"]
        response = None if isinstance(disturbed, str) else rms((disturbed["x2_rad_s"] - rate)[scored])
        gain = None if response is None or not noise.tilt > 0.0 else response / noise.tilt
        summaries[name] = scores(log, rate, scored, gain)
    summaries[ZERO] = scores(log, np.zeros(len(log)), scored, 0.0)
    return ReplayResult(log, estimates, summaries, left_out, alignment_of(log), settle_s, noise, parameters)


def _ready(
    log: Log, names: Iterable[str], model: ReducedModel | None, noise: MeasurementNoise, parameters: Parameters
) -> tuple[dict[str, Observer], dict[str, str]]:
    """Make the observers that can take part, and say why the others cannot."""
    available = set(log.has)
    if model:
        available.add("model")
        if model.J2 == model.J_d * model.omega_d == 0.0:
            available.add("gimbals")  # a pendulum without any: they do not move its tilt
    ready: dict[str, Observer] = {}
    left_out: dict[str, str] = {}
    for name in dict.fromkeys(names):
        lacks = [need for need in needs(OBSERVER_CLASSES.find(name)) if need not in available]
        if lacks:
            OBSERVER_CLASSES.check_names(name, parameters.get(name, {}))
            left_out[name] = "needs " + " and ".join(NEEDS_IN_WORDS[need] for need in lacks)
            continue
        try:
            ready[name] = observer_on(log, name, model, noise, **parameters.get(name, {}))
        except InputError as error:
            if name in parameters:
                raise
            left_out[name] = f"refused: {error}"
    if not ready:
        reasons = "; ".join(f"{name} {reason}" for name, reason in left_out.items())
        raise InputError(f"{log.name}: no observer can take part: {reasons}")
    return ready, left_out


def observer_on(
    log: Log, name: str, model: ReducedModel | None, noise: MeasurementNoise, **parameters: ParameterValue
) -> Observer:
    """Make an observer for a log; without a `rate_start` it takes the log's, since a log may begin in a motion."""
    takes = OBSERVER_CLASSES.takes(name)
    if "rate_start" in takes and log.scenario is None:
        parameters.setdefault("rate_start", max(takes["rate_start"].default, _rate_of(log)))
    return make_observer(name, log.dt, model or NO_MODEL, noise, **parameters)


def _rate_of(log: Log) -> float:
    """Return the RMS of the tilt's mean rate over `SPAN_S` [rad/s]."""
    span = max(1, round(SPAN_S / log.dt))
    rises = [log["y1_rad"][part][span:] - log["y1_rad"][part][:-span] for part in log.parts]
    return (rms(np.concatenate(rises)) or 0.0) / (span * log.dt)


def _estimates(observer: Observer, log: Log) -> Mapping[str, np.ndarray] | str:
    """Return the observer's estimates, part by part, NaN outside; or how it failed."""
    estimates = {name: np.full(len(log), np.nan) for name in (*STATE_SIGNALS, *extra_signals(observer))}
    for part in log.parts:
        try:
            with np.errstate(all="ignore"), warnings.catch_warnings(action="ignore"):
                signals = replay_all(observer, log.trajectory(part))
        except Exception as error:  # a user's observer may fail in any way
            line = users_line(error.__traceback__)
            return f"raised {raised(error)}" + (f" ({line})" if line else "")
        for name, values in signals.items():
            if not np.isfinite(values).all():
                time = log["time_s"][part][int(np.argmin(np.isfinite(values)))]
                return f"{name} is not finite from {time:.6g} s on"
            estimates[name][part] = values
    return estimates


def _with_noise(log: Log, noise: MeasurementNoise) -> Log:
    """Add noise to the tilt, and to angular acceleration and gyro, if there are any, with the given correlation."""
    random = np.random.default_rng(SEED)
    first, other = random.standard_normal(len(log)), random.standard_normal(len(log))
    second = noise.correlation * first + math.sqrt(1.0 - noise.correlation**2) * other
    noisy = {
        "y1_rad": log["y1_rad"] + noise.tilt * first,
        "acceleration_rad_s2": log["acceleration_rad_s2"] + noise.acceleration * second,
    }
    if "gyro" in log.has:
        noisy[GYRO] = log[GYRO] + noise.gyro * math.sqrt(0.5 / log.dt) * random.standard_normal(len(log))
    return replace(log, columns={**log.columns, **noisy})


def model_of(text: str) -> ReducedModel:
    """Return the reduced model of a user's pendulum.

    Args:
        text: Path or bundled name of a plant's MJCF, or numbers, `inertia=0.06,gravity_torque=3.4,...` (`NUMBERS`).

    Returns:
        The reduced model.

    Raises:
        InputError: There is no such file, or a number is missing or impossible.
    """
    if "=" not in text:
        experiment = prepare(parse_scenario({"plant": {"model": text}}, f"--model {text}"))
        experiment.require_single_axis("replay")
        return experiment.plant.reduced
    values = numbers(text, "--model", NUMBERS)
    for name in ("inertia", "gravity_torque"):
        if name not in values:
            raise InputError(f"--model: {name} is missing: {NUMBERS[name]}")
    inertia, added = values["inertia"], values.get("gimbal_inertia", 0.0)
    if not inertia > 0.0 or not inertia + added > 0.0:
        raise InputError("--model: inertia, and inertia + gimbal_inertia, must be greater than 0 [kg m^2]")
    return ReducedModel(inertia, added, values.get("momentum", 0.0), 1.0, values["gravity_torque"])


class ObserverInputs(NamedTuple):
    """Inputs of the observers of a log, as `replay_log` takes them: model, noise and parameters."""

    model: ReducedModel | None
    noise: MeasurementNoise
    parameters: Parameters


def observer_inputs(
    log: Log,
    *,
    model: ReducedModel | None = None,
    noises: Mapping[str, float] | None = None,
    parameters: Parameters | None = None,
) -> ObserverInputs:
    """Collect the inputs of the observers of a log.

    A run's recording brings its plant, its sensors' noise, and the parameters of its loop's observer.

    Args:
        log: The log.
        model: The pendulum, which replaces the run's.
        noises: Noises from `noise_numbers`, which replace the default or the run's.
        parameters: Observer -> parameter -> value, which take precedence over the run's.

    Raises:
        InputError: An option does not fit the log.
    """
    noises, parameters = noises or {}, dict(parameters or {})
    if log.scenario is None:
        if model and model.gravity_torque > 0.0:  # the papers' parameters are for their rig
            scaled = {kind: scaled_parameters(kind, model) for kind in OBSERVERS}
            if "torque" in log.options.columns:
                scaled["kalman"]["gimbal_white"] = EXACTLY
            parameters = {
                kind: {**scaled.get(kind, {}), **parameters.get(kind, {})} for kind in {**scaled, **parameters}
            }
        return ObserverInputs(model, noise_of(log, noises), parameters)
    part = prepare(parse_scenario(dict(log.scenario), log.name)).require_single_axis("replay")
    scenario, plant, loop = part.scenario, part.plant.parameters, part.scenario.observer
    _, run_model, noise = part.design.constructor_arguments
    if "accelerometer" in noises:  # the sensors' other errors stay
        if len(noises) > 1:
            raise InputError("--noise: for two accelerometers give accelerometer [ug/rtHz]; the others follow from it")
        noise = plant.noise(scenario.sensors.with_noise_density(noises["accelerometer"]))
    elif noises:
        noise = noise_of(log, noises)
    parameters[loop.kind] = {**loop.parameters, **parameters.get(loop.kind, {})}
    return ObserverInputs(model or run_model, noise, parameters)


def replay_prepared(
    log: Log,
    observers: Sequence[str] | None = None,
    *,
    settle_s: float | None = None,
    on_share: OnShare | None = None,
    **given: Any,
) -> ReplayResult:
    """Replay observers on a log with the inputs of `observer_inputs`, which takes the given ones.

    The others are those of `replay_log`; by default a run's recording is scored from its start.
    """
    if settle_s is None:
        settle_s = SETTLE_S if log.scenario is None else 0.0
    return replay_log(log, observers, **observer_inputs(log, **given)._asdict(), settle_s=settle_s, on_share=on_share)

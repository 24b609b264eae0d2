"""Inputs of the observers of a log; for a run's own recording, those that they had in the run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from cmg_mj.core.tilt import TiltNoise
from cmg_mj.errors import InputError
from cmg_mj.observers.reduced_model import ReducedModel
from cmg_mj.replay.log_replay import SETTLE_S, OnShare, ReplayResult, replay_log
from cmg_mj.replay.logs import Log
from cmg_mj.replay.parameter_options import Parameters
from cmg_mj.replay.user_noise import noise_of
from cmg_mj.replay.user_pendulum import plant_parameters_of
from cmg_mj.scenario.design import design
from cmg_mj.scenario.loading import parse_scenario
from cmg_mj.scenario.plant_parameters import PlantParameters
from cmg_mj.scenario.schema import Scenario


class ObserverInputs(NamedTuple):
    """Inputs of the observers of a log."""

    model: ReducedModel | None
    """The pendulum, if it is known."""
    noise: TiltNoise
    """The sensors' noise."""
    parameters: Parameters
    """Observer -> parameter -> value, where not the default."""


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

    Returns:
        The inputs.

    Raises:
        InputError: An option does not fit the log.
    """
    noises, parameters = noises or {}, dict(parameters or {})
    if log.scenario is None:
        return ObserverInputs(model, noise_of(log, noises), parameters)
    scenario = parse_scenario(dict(log.scenario), log.name)
    plant = plant_parameters_of(scenario)
    noise = _run_noise(log, scenario, plant, noises)
    _, run_model, sensor_noise = design(scenario, plant).constructor_arguments
    in_loop = {scenario.observer.kind: scenario.observer.parameters}
    merged = {kind: {**in_loop.get(kind, {}), **parameters.get(kind, {})} for kind in {**in_loop, **parameters}}
    return ObserverInputs(model or run_model, noise or sensor_noise, merged)


def replay_prepared(
    log: Log,
    observers: Sequence[str] | None = None,
    *,
    model: ReducedModel | None = None,
    noises: Mapping[str, float] | None = None,
    parameters: Parameters | None = None,
    settle_s: float | None = None,
    on_share: OnShare | None = None,
) -> ReplayResult:
    """Replay observers on a log with the inputs of `observer_inputs`.

    Args:
        log: The log.
        observers: As `replay_log` takes them.
        model: As `observer_inputs` takes it.
        noises: As `observer_inputs` takes them.
        parameters: As `observer_inputs` takes them.
        settle_s: By default `replay_log`'s; 0 for a run's recording.
        on_share: Called now and then with the completed share.

    Returns:
        Estimates and figures.

    Raises:
        InputError: An option does not fit the log.
    """
    inputs = observer_inputs(log, model=model, noises=noises, parameters=parameters)
    if settle_s is None:
        settle_s = SETTLE_S if log.scenario is None else 0.0
    return replay_log(log, observers, **inputs._asdict(), settle_s=settle_s, on_share=on_share)


def _run_noise(log: Log, scenario: Scenario, plant: PlantParameters, noises: Mapping[str, float]) -> TiltNoise | None:
    """Return another noise than that of the run's sensors; another density alone leaves their other errors."""
    if "accelerometer" not in noises:
        return noise_of(log, noises) if noises else None
    if len(noises) > 1:
        raise InputError("--noise: for two accelerometers give accelerometer [ug/rtHz]; the others follow from it")
    return plant.noise(scenario.sensors.with_noise_density(noises["accelerometer"]))

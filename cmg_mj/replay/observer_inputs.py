"""What the observers of a log are told: of a run's own recording what they were told in the run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from cmg_mj.errors import InputError
from cmg_mj.observers.reduced_model import ReducedModel
from cmg_mj.replay.log_replay import SKIPPED_S, OnShare, ReplayResult, replay_log
from cmg_mj.replay.logs import Log
from cmg_mj.replay.user_noise import noise_of, noise_told
from cmg_mj.replay.user_pendulum import rig_of
from cmg_mj.scenario.design import design
from cmg_mj.scenario.loading import parse_scenario
from cmg_mj.scenario.plant_parameters import PlantParameters
from cmg_mj.scenario.schema import Scenario
from cmg_mj.sensors.tilt import TiltNoise


class ObserverInputs(NamedTuple):
    """What the observers of a log are told."""

    model: ReducedModel | None
    """The pendulum, if it is known."""
    noise: TiltNoise
    """Of the sensors."""
    parameters: Mapping[str, Mapping[str, Any]]
    """Observer -> parameter -> value, where not the default."""


def observer_inputs(
    log: Log,
    *,
    model: ReducedModel | None = None,
    noises: Mapping[str, float] | None = None,
    parameters: Mapping[str, Mapping[str, Any]] | None = None,
) -> ObserverInputs:
    """What the observers of a user's log are told, or those of a run's recording as they were in the run.

    Args:
        log: The log. A run's recording brings its rig, its sensors' noise, the parameters of its loop's observer.
        model: The pendulum, instead of the run's.
        noises: What `noise_numbers` gives; nothing else is told of the sensors' noise.
        parameters: Observer -> parameter -> value, before the run's.

    Returns:
        All three.

    Raises:
        InputError: Something does not fit.
    """
    parameters = dict(parameters or {})
    if log.scenario is None:
        return ObserverInputs(model, noise_told(log, noises or {}) or noise_of(log), parameters)
    scenario = parse_scenario(dict(log.scenario), log.name)
    facts = rig_of(scenario)
    noise = _noise_of_a_run(log, scenario, facts, noises or {})
    _, of_the_run, of_its_sensors = design(scenario, facts).given
    in_its_loop = {scenario.observer.kind: scenario.observer.parameters}
    merged = {kind: {**in_its_loop.get(kind, {}), **parameters.get(kind, {})} for kind in {**in_its_loop, **parameters}}
    return ObserverInputs(model or of_the_run, noise or of_its_sensors, merged)


def replay_prepared(
    log: Log,
    observers: Sequence[str] | None = None,
    *,
    model: ReducedModel | None = None,
    noises: Mapping[str, float] | None = None,
    parameters: Mapping[str, Mapping[str, Any]] | None = None,
    skip_s: float | None = None,
    on_share: OnShare | None = None,
) -> ReplayResult:
    """Replay observers on a user's log, or on a run's recording as they were in the run.

    Args:
        log: The log. A run's recording brings its rig, its sensors' noise, the parameters of its loop's observer.
        observers: As `replay_log` takes them.
        model: The pendulum, instead of the run's.
        noises: What `noise_numbers` gives; nothing else is told of the sensors' noise.
        parameters: As `replay_log` takes them.
        skip_s: By default `replay_log`'s; of a run's recording all is judged.
        on_share: Called now and then with the share done.

    Returns:
        Estimates and figures.

    Raises:
        InputError: Something does not fit.
    """
    what = observer_inputs(log, model=model, noises=noises, parameters=parameters)
    if skip_s is None:
        skip_s = SKIPPED_S if log.scenario is None else 0.0
    return replay_log(log, observers, **what._asdict(), skip_s=skip_s, on_share=on_share)


def _noise_of_a_run(
    log: Log, scenario: Scenario, facts: PlantParameters, noises: Mapping[str, float]
) -> TiltNoise | None:
    """Another noise than that of the run's sensors; with another density, all else of these stays."""
    if "accelerometer" not in noises:
        return noise_told(log, noises)
    if len(noises) > 1:
        raise InputError("--noise: of two accelerometers give accelerometer [ug/rtHz]; the others follow from it")
    sensors = scenario.sensors
    accelerometer = replace(sensors.accelerometer, noise_density_ug_rthz=noises["accelerometer"])
    return facts.noise(replace(sensors, accelerometer=accelerometer))

"""Inputs of the observers of a log; for a run's own recording, those that they had in the run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from cmg_mj.core.errors import InputError
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.tilt import TiltNoise
from cmg_mj.features.replay.log import Log
from cmg_mj.features.replay.log_replay import SETTLE_S, OnShare, ReplayResult, replay_log
from cmg_mj.features.replay.noise import noise_of
from cmg_mj.observers.parameter_options import Parameters, numbers
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.design import PlantParameters, design
from cmg_mj.scenario.loading import parse_scenario
from cmg_mj.scenario.schema import Scenario

NUMBERS = {
    "inertia": "tilt inertia about the pivot, J1 [kg m^2]",
    "gravity_torque": "mass x gravity x height of its centre, positive if it falls over [N m]",
    "momentum": "spin momentum of the flywheels together, J_d omega_d [N m s]",
    "gimbal_inertia": "what the gimbals' turn by 90 degrees adds to the inertia, J2 [kg m^2]",
}
"""Numbers of `--model`. The first two are required; the others are 0 for a pendulum without gimbals."""


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
        return plant_parameters_of(parse_scenario({"plant": {"model": text}}, f"--model {text}")).reduced
    values = numbers(text, "--model", NUMBERS)
    for name in ("inertia", "gravity_torque"):
        if name not in values:
            raise InputError(f"--model: {name} is missing: {NUMBERS[name]}")
    inertia, added = values["inertia"], values.get("gimbal_inertia", 0.0)
    if not inertia > 0.0 or not inertia + added > 0.0:
        raise InputError("--model: inertia, and inertia + gimbal_inertia, must be greater than 0 [kg m^2]")
    return ReducedModel(inertia, added, values.get("momentum", 0.0), 1.0, values["gravity_torque"])


def plant_parameters_of(scenario: Scenario) -> PlantParameters:
    """Return the parameters of a scenario's plant."""
    experiment = prepare(scenario)
    experiment.require_single_axis("replay")
    return experiment.plant.parameters


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
    """Replay observers on a log with the inputs of `observer_inputs`, whose arguments it takes.

    Args:
        log: The log.
        observers: As `replay_log` takes them.
        model: The pendulum, which replaces the run's.
        noises: Noises from `noise_numbers`.
        parameters: Observer -> parameter -> value.
        settle_s: By default `replay_log`'s; 0 for a run's recording.
        on_share: Called now and then with the completed share.

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

"""A log made ready to be replayed: the user's pendulum, and of a run's own recording its rig, sensors and observers."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from cmg_mj.design import design
from cmg_mj.errors import InputError, nearest
from cmg_mj.experiment import load_rig
from cmg_mj.known_rigs import RigFacts, known_rig
from cmg_mj.logs import Log
from cmg_mj.observers import OBSERVERS, observer_class
from cmg_mj.reduced import ReducedModel
from cmg_mj.replay.replayed import SKIPPED_S, OnShare, Replayed, noise_of, replay_log
from cmg_mj.scenario import parse_scenario
from cmg_mj.schema import Scenario
from cmg_mj.tilt import TiltNoise

NUMBERS = {
    "inertia": "tilt inertia about the pivot, J1 [kg m^2]",
    "gravity_torque": "mass x gravity x height of its centre, positive if it falls over [N m]",
    "momentum": "spin momentum of the flywheels together, J_d omega_d [N m s]",
    "gimbal_inertia": "what the gimbals' turn by 90 degrees adds to the inertia, J2 [kg m^2]",
}
"""Of `--model`: the first two must be given, the others are 0 for a pendulum without gimbals."""
NOISES = ("accelerometer", "tilt", "acceleration")


def model_of(text: str) -> ReducedModel:
    """A user's pendulum.

    Args:
        text: An MJCF rig's path or bundled name, or numbers, `inertia=0.06,gravity_torque=3.4,...` (`NUMBERS`).

    Returns:
        Its reduced model.

    Raises:
        InputError: There is no such file or rig, or the numbers are not as they must be.
    """
    if "=" not in text:
        return _rig(parse_scenario({"plant": {"model": text}}, f"--model {text}")).reduced
    found: dict[str, float] = {}
    for part in text.split(","):
        name, _, value = (piece.strip() for piece in part.partition("="))
        if name not in NUMBERS:
            raise InputError(f"--model {name}: no such number; {nearest(name, NUMBERS)}")
        if name in found:
            raise InputError(f"--model {name}: given twice")
        found[name] = _finite(value, f"--model {name}")
    for name in ("inertia", "gravity_torque"):
        if name not in found:
            raise InputError(f"--model: {name} is missing: {NUMBERS[name]}")
    inertia, added = found["inertia"], found.get("gimbal_inertia", 0.0)
    if not inertia > 0.0 or not inertia + added > 0.0:
        raise InputError("--model: inertia, and inertia + gimbal_inertia, must be greater than 0 [kg m^2]")
    return ReducedModel(inertia, added, found.get("momentum", 0.0), 1.0, found["gravity_torque"])


def _rig(scenario: Scenario) -> RigFacts:
    return known_rig(scenario.plant) or load_rig(scenario).facts


def noise_numbers(text: str) -> dict[str, float]:
    """`--noise tilt=0.05,acceleration=2` -> by name: ug/rtHz, deg, rad/s^2."""
    found: dict[str, float] = {}
    for part in text.split(",") if text.strip() else ():
        name, _, value = (piece.strip() for piece in part.partition("="))
        if name not in NOISES:
            raise InputError(f"--noise {name}: no such noise; {nearest(name, NOISES)}")
        if name in found:
            raise InputError(f"--noise: {name} is given twice")
        found[name] = _finite(value, f"--noise {name}")
        if not found[name] > 0.0:
            raise InputError(f"--noise {name}={value}: must be greater than 0")
    return found


def parameters_of(settings: Sequence[str]) -> dict[str, dict[str, Any]]:
    """`--set homogeneous.k1=20` -> observer -> parameter -> value.

    Args:
        settings: Each OBSERVER.PARAMETER=VALUE.

    Returns:
        Values as TOML reads them.

    Raises:
        InputError: Not of this form, or no such observer.
    """
    found: dict[str, dict[str, Any]] = {}
    for setting in settings:
        place, equals, text = setting.partition("=")
        kind, dot, name = place.strip().rpartition(".")
        if not (equals and dot and kind and name):
            raise InputError(f"--set {setting!r}: write OBSERVER.PARAMETER=VALUE, for example homogeneous.k1=20")
        if ":" not in kind and kind not in OBSERVERS:
            raise InputError(f"--set {setting!r}: no such observer; {nearest(kind, OBSERVERS)}")
        observer_class(kind)
        try:
            (value,) = tomllib.loads(f"value = {text}").values()
        except (ValueError, RecursionError):
            raise InputError(f"--set {setting!r}: {text!r} is no number, list or text in quotes") from None
        found.setdefault(kind, {})[name] = value
    return found


class Told(NamedTuple):
    """What the observers of a log are told."""

    model: ReducedModel | None
    """The pendulum, if it is known."""
    noise: TiltNoise
    """Of the sensors."""
    parameters: Mapping[str, Mapping[str, Any]]
    """Observer -> parameter -> value, where not the default."""


def told(
    log: Log,
    *,
    model: ReducedModel | None = None,
    noises: Mapping[str, float] | None = None,
    parameters: Mapping[str, Mapping[str, Any]] | None = None,
) -> Told:
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
    noise, parameters = _noise(log, noises or {}), dict(parameters or {})
    if log.scenario is None:
        return Told(model, noise or noise_of(log), parameters)
    scenario = parse_scenario(dict(log.scenario), log.name)
    _, of_the_run, of_its_sensors = design(scenario, _rig(scenario)).given
    in_its_loop = {scenario.observer.kind: scenario.observer.parameters}
    merged = {kind: {**in_its_loop.get(kind, {}), **parameters.get(kind, {})} for kind in {**in_its_loop, **parameters}}
    return Told(model or of_the_run, noise or of_its_sensors, merged)


def replay_ready(
    log: Log,
    observers: Sequence[str] | None = None,
    *,
    model: ReducedModel | None = None,
    noises: Mapping[str, float] | None = None,
    parameters: Mapping[str, Mapping[str, Any]] | None = None,
    skip_s: float | None = None,
    on_share: OnShare | None = None,
) -> Replayed:
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
    what = told(log, model=model, noises=noises, parameters=parameters)
    if skip_s is None:
        skip_s = SKIPPED_S if log.scenario is None else 0.0
    return replay_log(log, observers, **what._asdict(), skip_s=skip_s, on_share=on_share)


def _noise(log: Log, noises: Mapping[str, float]) -> TiltNoise | None:
    if not noises:
        return None
    if log.tilt is not None and ({"tilt", "acceleration"} & noises.keys()):
        raise InputError("--noise: of two accelerometers give accelerometer [ug/rtHz]; the others follow from it")
    if log.tilt is None and "accelerometer" in noises:
        raise InputError("--noise accelerometer: the tilt is not that of two accelerometers; give tilt [deg]")
    return noise_of(
        log,
        accelerometer_ug_rthz=noises.get("accelerometer"),
        tilt_deg=noises.get("tilt"),
        acceleration_rad_s2=noises.get("acceleration"),
    )


def _finite(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or abs(value) > 1e30:
        raise InputError(f"{where}={text}: must be a finite number")
    return value

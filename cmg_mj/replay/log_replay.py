"""Observers replayed on a user's log, and judged there."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cmg_mj.controllers.dry_run import dry_run_observer
from cmg_mj.errors import InputError, raised
from cmg_mj.observers import OBSERVERS, Observer, check_names, make_observer, observer_class
from cmg_mj.observers.protocol import needs
from cmg_mj.observers.reduced_model import ReducedModel
from cmg_mj.replay.alignment import Alignment
from cmg_mj.replay.logs import Log
from cmg_mj.replay.logs.log import REFERENCE
from cmg_mj.replay.open_loop import replay_all
from cmg_mj.replay.reference import alignment_of
from cmg_mj.replay.scores import noise_gain, scores
from cmg_mj.replay.user_noise import noise_of
from cmg_mj.results.baselines import ZERO
from cmg_mj.sensors.tilt import TiltNoise

SKIPPED_S = 1.0
"""By default the observers have so long at the start of each part before they are judged [s]."""
NO_MODEL = ReducedModel(J1=math.nan, J2=math.nan, J_d=math.nan, omega_d=math.nan, gravity_torque=math.nan)
"""Given to observers that need none: whatever is made of it is no number."""
IN_WORDS = {
    "model": "a model (--model)",
    "gimbals": "the gimbal angle and the command (--columns gimbal=...,command=...)",
    "acceleration": "two accelerometers (--columns inner_x=...) or the angular acceleration",
}
SEED = 0
"""Of the noise that noise gains are measured with."""

OnShare = Callable[[float], None]


@dataclass(frozen=True)
class ReplayResult:
    """What the observers make of one log.

    Attributes:
        log: The log.
        estimates: Observer -> signal -> (n,), as in a trajectory; NaN where it was lost.
        summaries: Observer -> its figures; `zero`, an estimate of zero, is the last.
        left_out: Observer -> why it does not take part, or was lost.
        alignment: What the reference is to the tilt; None without a reference.
        skip_s: How long from the start of each part is not judged [s].
        noise: What observers were told of the sensors' noise, and the noise of the noise gain.
        parameters: Those that were set: observer -> parameter -> value.
    """

    log: Log
    estimates: Mapping[str, Mapping[str, np.ndarray]]
    summaries: Mapping[str, Mapping[str, Any]]
    left_out: Mapping[str, str]
    alignment: Alignment | None
    skip_s: float
    noise: TiltNoise
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


def replay_log(
    log: Log,
    observers: Sequence[str] | None = None,
    *,
    model: ReducedModel | None = None,
    noise: TiltNoise | None = None,
    parameters: Mapping[str, Mapping[str, Any]] | None = None,
    skip_s: float = SKIPPED_S,
    on_share: OnShare | None = None,
) -> ReplayResult:
    """Replay observers on a log.

    Args:
        log: The log.
        observers: Names, or `package.module:Class`; all by default. Those that need what is not there are left out.
        model: The pendulum, if it is known.
        noise: What observers are told of the sensors' noise; by default `noise_of(log)`.
        parameters: Observer -> parameter -> value, where not the default.
        skip_s: So long from the start of each part is not judged [s].
        on_share: Called now and then with the share done.

    Returns:
        Estimates and figures.

    Raises:
        InputError: An observer does not exist or refuses its parameters, or nothing is left to be judged.
    """
    names = list(OBSERVERS) if observers is None else list(dict.fromkeys(observers))
    parameters = dict(parameters or {})
    noise = noise or noise_of(log)
    if not 0.0 <= skip_s < math.inf:
        raise InputError(f"--skip {skip_s:g}: must be a number of seconds not below 0")
    scored = log.scored(skip_s)
    _check_scored(log, scored, skip_s)
    ready, left_out = _ready(log, names, model, noise, parameters)
    estimates: dict[str, Mapping[str, np.ndarray]] = {}
    summaries: dict[str, Mapping[str, Any]] = {}
    noisy = _with_noise(log, noise)
    for i, (name, observer) in enumerate(ready.items()):
        if on_share:
            on_share(i / len(ready))
        found = _estimates(observer, log)
        if isinstance(found, str):
            left_out[name] = found
            continue
        estimates[name] = found
        disturbed = _estimates(observer, noisy)
        gain = (
            None
            if isinstance(disturbed, str)
            else noise_gain(disturbed["x2_rad_s"] - found["x2_rad_s"], noise.tilt, scored)
        )
        summaries[name] = {**scores(log, found["x2_rad_s"], scored), "noise_gain_1_s": gain}
    zero = {**scores(log, np.zeros(len(log)), scored), "noise_gain_1_s": 0.0}
    return ReplayResult(
        log, estimates, {**summaries, ZERO: zero}, left_out, alignment_of(log), skip_s, noise, parameters
    )


def _check_scored(log: Log, scored: np.ndarray, skip_s: float) -> None:
    if scored.sum() < 10:
        raise InputError(
            f"{log.name}: nothing is left to be judged: {log.duration_s:.3g} s in {len(log.parts)} "
            f"part{'' if len(log.parts) == 1 else 's'}, of which --skip {skip_s:g} s each is not"
        )
    if "reference" in log.has and not np.isfinite(log[REFERENCE][scored]).sum() >= 10:
        raise InputError(f"{log.name}: the reference has no number where estimates are judged")


def gimbals_matter(model: ReducedModel | None) -> bool:
    """Whether gimbals move the tilt; they do not in the model of a pendulum without any, J2 = J_d omega_d = 0."""
    return model is None or model.J2 != 0.0 or model.J_d * model.omega_d != 0.0


def _ready(
    log: Log,
    names: Sequence[str],
    model: ReducedModel | None,
    noise: TiltNoise,
    parameters: Mapping[str, Mapping[str, Any]],
) -> tuple[dict[str, Observer], dict[str, str]]:
    """Observers that can take part, and why the others cannot."""
    there = set(log.has) | ({"model"} if model is not None else set())
    if not gimbals_matter(model):
        there.add("gimbals")
    ready: dict[str, Observer] = {}
    left_out: dict[str, str] = {}
    for name in names:
        cls = observer_class(name)
        lacks = [what for what in needs(cls) if what not in there]
        if lacks:
            check_names(name, parameters.get(name, {}))
            assumed = "" if hasattr(cls, "needs") else ", as a class does that does not say what it needs (needs = ())"
            left_out[name] = "needs " + " and ".join(IN_WORDS[what] for what in lacks) + assumed
            continue
        try:
            observer = make_observer(name, log.dt, model or NO_MODEL, noise, **parameters.get(name, {}))
        except InputError as error:
            if name in parameters:
                raise
            left_out[name] = f"refused: {error}"
            continue
        with np.errstate(all="ignore"):
            dry_run_observer(observer, None)
        ready[name] = observer
    if not ready:
        reasons = "; ".join(f"{name} {reason}" for name, reason in left_out.items())
        raise InputError(f"{log.name}: no observer can take part: {reasons}")
    return ready, left_out


def _estimates(observer: Observer, log: Log) -> dict[str, np.ndarray] | str:
    """Part by part what the observer estimates; or how it was lost."""
    parts = []
    for part in log.parts:
        try:
            with np.errstate(all="ignore"):
                found = replay_all(observer, log.trajectory(part))
        except (Exception, SystemExit) as error:  # a user's observer may fail in any way
            return f"raised {raised(error)}"
        for name, values in found.items():
            if not np.isfinite(values).all():
                at = log["time_s"][part][int(np.argmin(np.isfinite(values)))]
                return f"{name} is not finite from {at:.6g} s on"
        parts.append(found)
    columns = {name: np.full(len(log), np.nan) for name in parts[0]}
    for part, found in zip(log.parts, parts, strict=True):
        for name, values in found.items():
            columns[name][part] = values
    return columns


def _with_noise(log: Log, noise: TiltNoise) -> Log:
    """The log with more noise: in the tilt, and where there is one in the angular acceleration, correlated as told."""
    first, second = np.random.default_rng(SEED).standard_normal((2, len(log)))
    second = noise.correlation * first + math.sqrt(1.0 - noise.correlation**2) * second
    columns = {**log.columns, "y1_rad": log["y1_rad"] + noise.tilt * first}
    columns["acceleration_rad_s2"] = log["acceleration_rad_s2"] + noise.acceleration * second
    return dataclasses.replace(log, columns=columns)


def described(log: Log) -> str:
    """A log in one line."""
    parts = "" if len(log.parts) == 1 else f" in {len(log.parts)} parts"
    return f"{log.name}: {len(log):,} samples at {1.0 / log.dt:.6g} Hz, {log.duration_s:.6g} s{parts}"

"""An observer's parameters fitted to one part of users' logs and scored on another."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from cmg_mj.errors import InputError
from cmg_mj.observers import Observer, make_observer
from cmg_mj.observers.reduced_model import ReducedModel
from cmg_mj.replay import replay
from cmg_mj.replay.alignment import Alignment
from cmg_mj.replay.log_replay import NO_MODEL, replay_log
from cmg_mj.replay.logs import Log
from cmg_mj.replay.logs.log import REFERENCE
from cmg_mj.replay.observer_inputs import ObserverInputs, observer_inputs
from cmg_mj.replay.reference import alignment_of, remarks_on
from cmg_mj.sensors.tilt import TiltNoise
from cmg_mj.studies.tuning.parameters import TunedScalar, narrowed, numbers_of, parameters_of
from cmg_mj.studies.tuning.search import evaluations
from cmg_mj.studies.tuning.study import NoiseLevelResult, OnShare, ParameterFit, level_of, names_of

BLOCKS = 10
"""So many stretches of each log's part are scored on their own, for an interval."""
SHORTEST_S = 0.5
"""Of shorter stretches there is no interval [s]."""


@dataclass(frozen=True)
class LogSegments:
    """The parts of some logs that are fitted, or those that are scored, in stretches of equal length.

    Attributes:
        logs: The parts.
        skip_s: So long from every start of an observer is not judged [s].
    """

    logs: Sequence[Log]
    skip_s: float
    fell: int = 0

    @property
    def worlds(self) -> int:
        """How many stretches."""
        return sum(len(self._stretches(log)) for log in self.logs)

    @property
    def shortest_s(self) -> float:
        """How long the shortest stretch is [s]."""
        return min(len(rows) * log.dt for log in self.logs for rows in self._stretches(log))

    @property
    def zero_rms(self) -> float:
        """The error of an estimate of zero: the RMS of the reference, mean of the stretches [rad/s]."""
        return float(np.mean([_rms(log[REFERENCE][rows]) for log in self.logs for rows in self._stretches(log)]))

    @property
    def largest_acceleration(self) -> float:
        """Of the tilt, by differences of the reference [rad/s^2]."""
        return max(float(np.nanmax(np.abs(np.diff(log[REFERENCE]) / log.dt))) for log in self.logs)

    def _stretches(self, log: Log) -> list[np.ndarray]:
        judged = np.flatnonzero(log.scored(self.skip_s) & np.isfinite(log[REFERENCE]))
        return [rows for rows in np.array_split(judged, BLOCKS) if len(rows)]

    def errors(self, observers: Sequence[Observer], /) -> np.ndarray:
        """RMS of the estimated rate less the reference in every stretch, (n_stretches,) [rad/s]: an observer a log."""
        found = []
        for log, observer in zip(self.logs, observers, strict=True):
            rate = np.full(len(log), math.nan)
            for part in log.parts:
                with np.errstate(all="ignore"):
                    rate[part] = replay(observer, log.trajectory(part)).x2
            found += [_rms((rate - log[REFERENCE])[rows]) for rows in self._stretches(log)]
        return np.array(found)


def _rms(values: np.ndarray) -> float:
    with np.errstate(all="ignore"):
        return math.sqrt(float(np.mean(values**2)))


@dataclass(frozen=True)
class LogStudy:
    """An observer tuned on logs.

    Attributes:
        kind: The observer.
        given: Its parameters before.
        numbers: What was tuned.
        insensitive_parameters: Names of the numbers that were not, because the estimated rate does not depend on them.
        names: The logs.
        split: The share of each log that was fitted; the rest is scored.
        level: What came out.
        noises: Log by log what the observer was told of the sensors.
        alignments: Log by log what the reference is to the tilt.
        remarks: Log by log what is said of it, as in a replay.
        stretch_s: The shortest of the stretches that are scored [s].
    """

    kind: str
    given: Mapping[str, Any]
    numbers: Sequence[TunedScalar]
    insensitive_parameters: Sequence[str]
    names: Sequence[str]
    split: float
    level: NoiseLevelResult
    noises: Sequence[TiltNoise]
    alignments: Sequence[Alignment | None]
    remarks: Sequence[Sequence[str]]
    stretch_s: float

    @property
    def tells(self) -> bool:
        """Whether the stretches are long enough for an interval: shorter ones are not independent of each other."""
        return self.stretch_s >= SHORTEST_S


def tune_on_logs(
    logs: Sequence[Log],
    kind: str,
    *,
    model: ReducedModel | None = None,
    noises: Mapping[str, float] | None = None,
    given: Mapping[str, Any] | None = None,
    split: float = 0.5,
    skip_s: float = 1.0,
    parameters: Sequence[str] = (),
    ranges: Mapping[str, tuple[float, float]] | None = None,
    starts: int = 2,
    on_share: OnShare | None = None,
) -> LogStudy:
    """Fit an observer's parameters to the reference of some logs.

    Args:
        logs: With a reference; all with the same sample period.
        kind: The observer.
        model: The pendulum, for an observer that needs it; a run's recording brings its own.
        noises: What `noise_numbers` gives; by default each log's own, as `replay_prepared` has them.
        given: Parameters to start from and to compare with, where not the defaults, or those of a run's loop.
        split: The share of each log, from its start, that is fitted; the rest is scored.
        skip_s: So long from every start of an observer is not judged [s].
        parameters: Names to tune; by default every number of the observer.
        ranges: Number -> smallest and largest size.
        starts: Starts of a search in several dimensions.
        on_share: Called now and then with the share done.

    Returns:
        The study.

    Raises:
        InputError: A log has no reference or is too short, the observer cannot take part, or nothing can be tuned.
    """
    if not 0.0 < split < 1.0:
        raise InputError(f"--split {split:g}: must be between 0 and 1, the share that is fitted")
    dt = logs[0].dt
    for log in logs:
        if "reference" not in log.has:
            raise InputError(f"{log.name}: no reference to tune to: name it, --columns rate=...")
        if abs(log.dt / dt - 1.0) > 1e-3:
            raise InputError(f"{log.name}: {1.0 / log.dt:g} Hz, {logs[0].name} {1.0 / dt:g} Hz: give --rate HZ")
    each = [observer_inputs(log, model=model, noises=noises, parameters={kind: given or {}}) for log in logs]
    given = _common(kind, logs, each)
    fit, held_out = (
        LogSegments([log.cut(_share(log, split, first=first)) for log in logs], skip_s) for first in (True, False)
    )
    for part, what in zip((*fit.logs, *held_out.logs), (*each, *each), strict=True):
        # An observer that cannot take part is refused, with the reason.
        replay_log(part, [kind], **what._asdict(), skip_s=skip_s)
    makers: list[Callable[..., Observer]] = [
        partial(make_observer, kind, dt, what.model or NO_MODEL, what.noise) for what in each
    ]
    values = parameters_of(kind, makers[0](**given), given)
    numbers = narrowed(numbers_of(kind, values, makers[0], parameters), ranges or {}, "--range")

    def one_a_log(**tried: Any) -> list[Observer]:
        return [make(**tried) for make in makers]

    fitter = ParameterFit(kind, one_a_log, values, fit, on_share or (lambda share: None))
    still = fitter.insensitive_parameters(numbers)
    if len(still) == len(numbers):
        raise InputError(f"the rate that {kind} estimates does not depend on {names_of(numbers)}")
    numbers = [number for number in numbers if number not in still]
    fitter.expected = evaluations(len(numbers))
    level = level_of(0.0, fitter, numbers, held_out, starts)
    names, noises_told = [log.name for log in logs], [what.noise for what in each]
    alignments = [alignment_of(log) for log in logs]
    return LogStudy(
        kind,
        values,
        numbers,
        [n.name for n in still],
        names,
        split,
        level,
        noises_told,
        alignments,
        [remarks_on(log, found) for log, found in zip(logs, alignments, strict=True)],
        held_out.shortest_s,
    )


def _common(kind: str, logs: Sequence[Log], each: Sequence[ObserverInputs]) -> dict[str, Any]:
    """The parameters that the observer is given, the same in all logs."""
    given = dict(each[0].parameters[kind])
    for log, what in zip(logs, each, strict=True):
        if what.parameters[kind] != given:
            raise InputError(
                f"{logs[0].name} and {log.name} ran with different parameters of {kind}: say with which to begin, "
                "--set observer.NAME=VALUE"
            )
    return given


def _share(log: Log, split: float, *, first: bool) -> slice:
    middle = round(split * len(log))
    return slice(0, middle) if first else slice(middle, len(log))

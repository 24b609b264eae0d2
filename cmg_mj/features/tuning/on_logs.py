"""An observer's parameters fitted to one part of users' logs and scored on another."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.tilt import TiltNoise
from cmg_mj.features.replay.log import REFERENCE, Log
from cmg_mj.features.replay.log_replay import NO_MODEL, ObserverInputs, misfit_of, observer_inputs, replay_log
from cmg_mj.features.replay.noise import noise_figures, noise_remarks
from cmg_mj.features.replay.reference import Alignment, alignment_of, model_remark, remarks_on
from cmg_mj.features.tuning.closed_loop import LoopComparison, compare_in_loop, judged
from cmg_mj.features.tuning.fit import NoiseLevelResult, OnShare, ParameterFit, level_of
from cmg_mj.features.tuning.parameters import (
    MakeObserver,
    ParameterValues,
    TunedScalar,
    narrowed,
    numbers_of,
    parameters_of,
    plain,
)
from cmg_mj.features.tuning.search import evaluations
from cmg_mj.observers import Observer, make_observer
from cmg_mj.observers.parameter_options import ParameterValue
from cmg_mj.results.intervals import PairedVerdict
from cmg_mj.results.summary_keys import SummaryValue
from cmg_mj.runs.open_loop import replay
from cmg_mj.scenario.schema import Scenario

BLOCKS = 10
"""Stretches of each log's part that are scored one by one, for an interval."""
SHORTEST_S = 0.5
"""Shortest stretches with an interval [s]; shorter ones are not independent."""


@dataclass(frozen=True)
class LogSegments:
    """Parts of logs that are fitted or scored, in stretches of equal length.

    Attributes:
        logs: The parts.
        settle_s: Time from every start of an observer that is not scored [s].
        fell: 0: no log falls.
    """

    logs: Sequence[Log]
    settle_s: float
    fell: int = 0

    @property
    def worlds(self) -> int:
        """Number of stretches."""
        return sum(len(self._stretches(log)) for log in self.logs)

    @property
    def shortest_s(self) -> float:
        """Length of the shortest stretch [s]."""
        return min(len(rows) * log.dt for log in self.logs for rows in self._stretches(log))

    @property
    def zero_rms(self) -> float:
        """Error of an estimate of zero: RMS of the reference, mean of the stretches [rad/s]."""
        return float(np.mean([_rms(log[REFERENCE][rows]) for log in self.logs for rows in self._stretches(log)]))

    @property
    def largest_acceleration(self) -> float:
        """Largest acceleration of the tilt, by differences of the reference [rad/s^2]."""
        return max(float(np.nanmax(np.abs(np.diff(log[REFERENCE]) / log.dt))) for log in self.logs)

    def _stretches(self, log: Log) -> list[np.ndarray]:
        scored = np.flatnonzero(log.scored(self.settle_s) & np.isfinite(log[REFERENCE]))
        return [rows for rows in np.array_split(scored, BLOCKS) if len(rows)]

    def errors(self, observers: Sequence[Observer], /) -> np.ndarray:
        """Return the RMS of the estimated rate less the reference in every stretch, (n_stretches,) [rad/s].

        Args:
            observers: One observer for each log.
        """
        errors = []
        for log, observer in zip(self.logs, observers, strict=True):
            rate = np.full(len(log), math.nan)
            for part in log.parts:
                with np.errstate(all="ignore"):
                    rate[part] = replay(observer, log.trajectory(part)).x2
            errors += [_rms((rate - log[REFERENCE])[rows]) for rows in self._stretches(log)]
        return np.array(errors)


def _rms(values: np.ndarray) -> float:
    with np.errstate(all="ignore"):
        return math.sqrt(float(np.mean(values**2)))


@dataclass(frozen=True)
class LogStudy:
    """An observer tuned on logs.

    Attributes:
        kind: The observer.
        start_parameters: Its parameters before.
        numbers: The tuned numbers.
        insensitive_parameters: Names of numbers that are not tuned, since the estimated rate does not depend on them.
        names: The logs.
        split: The share of each log that was fitted; the rest is scored.
        level: Tuned parameters and their scores.
        noises: Sensor noise that the observer assumed, log by log.
        noises_by_the_logs: White noise that the logs show, as `--json` prints it, log by log.
        alignments: Lag, scale and offset of the reference, log by log.
        remarks: Remarks as in a replay, log by log.
        stretch_s: The shortest of the scored stretches [s].
        loop: Given and tuned parameters in a scenario's closed loop; None if none was asked for.
    """

    kind: str
    start_parameters: ParameterValues
    numbers: Sequence[TunedScalar]
    insensitive_parameters: Sequence[str]
    names: Sequence[str]
    split: float
    level: NoiseLevelResult
    noises: Sequence[TiltNoise]
    noises_by_the_logs: Sequence[Mapping[str, SummaryValue]]
    alignments: Sequence[Alignment | None]
    remarks: Sequence[Sequence[str]]
    stretch_s: float
    loop: LoopComparison | None = None

    @property
    def verdict(self) -> PairedVerdict | None:
        """Compare the tuned parameters with the given ones; None if the stretches are too short for an interval.

        Better is better by more than 1 % and beyond chance, over the held-out stretches. Given parameters with which
        the observer fails are worse than any.
        """
        if not self.has_interval:
            return None
        return judged(self.level.ratio) if np.isfinite(self.level.given_rms).all() else "better"

    @property
    def limits(self) -> list[str]:
        """Name the tuned numbers that ended at a limit of their range, with the limit."""
        ends = []
        for number in self.numbers:
            if number.name in self.level.edges:
                size = self.level.sizes[number.name]
                lowest = size / number.low < number.high / size
                ends.append(f"{number.name} ({'lowest' if lowest else 'highest'}, {size:.4g})")
        return ends

    @property
    def has_interval(self) -> bool:
        """Return whether the stretches are long enough for an interval."""
        return self.stretch_s >= SHORTEST_S

    def settings(self) -> list[str]:
        """Return the tuned parameters as `--set` of a replay takes them."""
        tuned = plain({number.parameter: self.level.parameters[number.parameter] for number in self.numbers})
        return [f"{self.kind}.{name}={json.dumps(value)}" for name, value in tuned.items()]


def tune_on_logs(
    logs: Sequence[Log],
    kind: str,
    *,
    model: ReducedModel | None = None,
    noises: Mapping[str, float] | None = None,
    start_parameters: ParameterValues | None = None,
    split: float = 0.5,
    settle_s: float = 1.0,
    parameters: Sequence[str] = (),
    ranges: Mapping[str, tuple[float, float]] | None = None,
    starts: int = 2,
    closed_loop: Scenario | None = None,
    on_share: OnShare | None = None,
) -> LogStudy:
    """Fit an observer's parameters to the reference of some logs.

    Args:
        logs: Logs with a reference and the same sample period.
        kind: The observer.
        model: The pendulum, for an observer that needs it; a run's recording brings its own.
        noises: Noises from `noise_numbers`; by default each log's own, as in `replay_prepared`.
        start_parameters: Parameters to start from and to compare with, instead of the defaults or a run's own.
        split: The share of each log, from its start, that is fitted; the rest is scored.
        settle_s: Time from every start of an observer that is not scored [s].
        parameters: Names to tune; by default every number of the observer.
        ranges: Number -> smallest and largest size.
        starts: Starts of a search in several dimensions.
        closed_loop: A scenario in whose loop the tuned parameters are compared with the given ones.
        on_share: Called now and then with the completed share.

    Returns:
        The study.

    Raises:
        InputError: A log has no reference or is too short, the observer cannot take part, or nothing can be tuned.
    """
    if not 0.0 < split < 1.0:
        raise InputError(f"--split {split:g}: must be between 0 and 1, the share that is fitted")
    dt = _common_period(logs)
    inputs = [
        observer_inputs(log, model=model, noises=noises, parameters={kind: start_parameters or {}}) for log in logs
    ]
    start_parameters = _common_parameters(kind, logs, inputs)
    ends = [round(split * len(log)) for log in logs]
    fit = LogSegments([log.cut(slice(0, end)) for log, end in zip(logs, ends, strict=True)], settle_s)
    held_out = LogSegments([log.cut(slice(end, None)) for log, end in zip(logs, ends, strict=True)], settle_s)
    for part, log_inputs in zip((*fit.logs, *held_out.logs), (*inputs, *inputs), strict=True):
        # An observer that cannot take part is refused, with the reason.
        replay_log(part, [kind], **log_inputs._asdict(), settle_s=settle_s)
    makers: list[MakeObserver] = [partial(make_observer, kind, dt, log.model or NO_MODEL, log.noise) for log in inputs]
    values = parameters_of(kind, makers[0](**start_parameters), start_parameters)
    numbers = narrowed(numbers_of(kind, values, makers[0], parameters), ranges or {}, "--range")

    def one_per_log(**candidate: ParameterValue) -> list[Observer]:
        return [make(**candidate) for make in makers]

    fitter = ParameterFit(kind, one_per_log, values, fit, on_share or (lambda share: None))
    numbers, insensitive = fitter.sensitive_parameters(numbers)
    fitter.expected = evaluations(len(numbers))
    level = level_of(0.0, fitter, numbers, held_out, starts)
    alignments = [alignment_of(log) for log in logs]
    return LogStudy(
        kind,
        values,
        numbers,
        [number.name for number in insensitive],
        [log.name for log in logs],
        split,
        level,
        [log_inputs.noise for log_inputs in inputs],
        [noise_figures(log, log_inputs.noise) for log, log_inputs in zip(logs, inputs, strict=True)],
        alignments,
        [
            [
                *remarks_on(log, aligned),
                *noise_remarks(log, of_log.noise),
                *filter(None, [model_remark(misfit_of(log, of_log.model))]),
            ]
            for log, aligned, of_log in zip(logs, alignments, inputs, strict=True)
        ],
        held_out.shortest_s,
        closed_loop and compare_in_loop(closed_loop, kind, values, level.parameters),
    )


def _common_period(logs: Sequence[Log]) -> float:
    """Return the sample period of logs that all have a reference [s]."""
    dt = logs[0].dt
    for log in logs:
        if "reference" not in log.has:
            raise InputError(f"{log.name}: no reference to tune to: name it, --columns rate=...")
        if abs(log.dt / dt - 1.0) > 1e-3:
            raise InputError(f"{log.name}: {1.0 / log.dt:g} Hz, {logs[0].name} {1.0 / dt:g} Hz: give --rate HZ")
    return dt


def _common_parameters(kind: str, logs: Sequence[Log], inputs: Sequence[ObserverInputs]) -> ParameterValues:
    """Return the observer's parameters, which must be the same in all logs."""
    parameters = dict(inputs[0].parameters[kind])
    for log, log_inputs in zip(logs, inputs, strict=True):
        if log_inputs.parameters[kind] != parameters:
            raise InputError(
                f"{logs[0].name} and {log.name} ran with different parameters of {kind}: say with which to begin, "
                "--set observer.NAME=VALUE"
            )
    return parameters

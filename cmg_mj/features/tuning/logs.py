"""An observer tuned to one part of users' logs, scored on another, and compared in a closed loop."""

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
from cmg_mj.features.replay.inputs import ObserverInputs, observer_inputs
from cmg_mj.features.replay.log import REFERENCE, Log
from cmg_mj.features.replay.log_replay import NO_MODEL, misfit_of, replay_log
from cmg_mj.features.replay.noise import noise_figures, noise_remarks
from cmg_mj.features.replay.reference import Alignment, alignment_of, model_remark, remarks_on
from cmg_mj.features.tuning.fit import NoiseLevelResult, OnShare, ParameterFit, level_of
from cmg_mj.features.tuning.search import (
    MakeObserver,
    ParameterValues,
    TunedScalar,
    evaluations,
    narrowed,
    numbers_of,
    parameters_of,
    plain,
)
from cmg_mj.observers import Observer, make_observer
from cmg_mj.observers.parameter_options import ParameterValue
from cmg_mj.results.intervals import CONFIDENCE, Interval, PairedVerdict, paired_verdict, ratio_interval
from cmg_mj.results.summary_keys import SummaryValue
from cmg_mj.runs.experiment import prepare
from cmg_mj.runs.open_loop import replay
from cmg_mj.runs.side_by_side import run_of, run_side_by_side
from cmg_mj.scenario.loading import load_scenario, parse_scenario
from cmg_mj.scenario.schema import ObserverSettings, Scenario
from cmg_mj.stages.push import push_windows

SCENARIO = "push_recovery"
"""The scenario by default."""
NO_LOOP = "none"
"""Name of no scenario: nothing is simulated."""
WORLDS = 16
USUAL_S = 5.0
"""The loop runs for so long, or until the scenario ends [s]; longer only if the second after a push ends later."""
RELEVANT = 1.01
"""A smaller ratio of two errors is no difference."""


def judged(ratio: Interval) -> PairedVerdict:
    """Judge a ratio, above 1 for the better: it must differ by more than 1 %, and beyond chance.

    Args:
        ratio: With its 95 % interval.
    """
    if 1.0 / RELEVANT <= ratio.mean <= RELEVANT:
        return "tie"
    return paired_verdict(Interval(*(value - 1.0 for value in ratio)))


@dataclass(frozen=True)
class LoopComparison:
    """A loop closed on the observer with the given parameters, and with the tuned ones.

    Attributes:
        scenario: Its title.
        duration_s: Simulated time [s].
        worlds: Number of worlds, the same noise in both loops.
        stood: Number of worlds that stood to the end, with the given and with the tuned parameters.
        stood_alone: Number of those that fell with the other parameters.
        ratio: RMS of the tilt, given by tuned, over the worlds that stood with both; None of fewer than two.
        refused: Why an observer could not be in this loop; empty if it could.
    """

    scenario: str
    duration_s: float
    worlds: int
    stood: tuple[int, int] = (0, 0)
    stood_alone: tuple[int, int] = (0, 0)
    ratio: Interval | None = None
    refused: str = ""

    @property
    def verdict(self) -> PairedVerdict | None:
        """Compare the tuned parameters with the given ones: by falls if these are beyond chance, else by the tilt."""
        if self.refused:
            return None
        given, tuned = self.stood_alone
        if _beyond_chance(given, tuned):
            return "better" if tuned > given else "worse"
        return "tie" if self.ratio is None else judged(self.ratio)

    @property
    def remark(self) -> str:
        """Describe the comparison in one line."""
        loop = f"In the closed loop of {self.scenario} ({self.worlds} worlds of {self.duration_s:g} s, its rig, sensors"
        loop += " and control rate)"
        if self.refused:
            return f"{loop} the parameters cannot be compared: {self.refused}."
        given, tuned = self.stood
        given_alone, tuned_alone = self.stood_alone
        line = f"{loop} the tuned parameters stand {tuned} times ({tuned_alone} where the given ones fall), "
        line += f"the given ones {given} ({given_alone} where the tuned ones fall)"
        if self.ratio is not None:
            line += "; RMS of the tilt, given / tuned, {:.3f} ({:.3f} to {:.3f})".format(*self.ratio)
        words = {"better": "better there", "worse": "WORSE there", "tie": "not different there beyond chance"}
        return f"{line}: the tuned ones are {words[self.verdict or 'tie']}."


def _beyond_chance(one: int, other: int) -> bool:
    """Return whether worlds that stood with one set alone and with the other alone differ by the sign test, 5 %."""
    n, fewer = one + other, min(one, other)
    return 2.0 * sum(math.comb(n, k) for k in range(fewer + 1)) / 2.0**n < 1.0 - CONFIDENCE


def loop_scenario(name: str | None, log: Log) -> Scenario | None:
    """Return the scenario whose loop is closed.

    Args:
        name: A bundled scenario or a file; None for the scenario of a run's own recording, else `SCENARIO`.
        log: The log.

    Returns:
        The scenario; None if it is `NO_LOOP`.

    Raises:
        InputError: There is no such scenario, or it is wrong.
    """
    if name == NO_LOOP:
        return None
    if name is None and log.scenario is not None:
        return parse_scenario(dict(log.scenario), log.name)
    try:
        return load_scenario(name or SCENARIO, [])
    except InputError as error:
        raise InputError(f"--closed-loop: {error}") from None


def compare_in_loop(
    scenario: Scenario, kind: str, given: ParameterValues, tuned: ParameterValues, *, worlds: int = WORLDS
) -> LoopComparison:
    """Close the loop of a scenario on an observer with two sets of parameters, on the same worlds.

    Args:
        scenario: The scenario, which is cut short.
        kind: The observer.
        given: The parameters before.
        tuned: The parameters after.
        worlds: Number of worlds.

    Returns:
        The comparison.
    """
    calm = max((end for _, end in push_windows(scenario.push)), default=0.0)  # a second after the last push
    duration = min(scenario.duration_s, max(USUAL_S, float(math.ceil(calm))))
    loop = scenario.model_copy(
        update={
            "duration_s": duration,
            "open_loop_observers": [],
            "controller": scenario.controller.model_copy(update={"feedback": "observer", "bias_trim_s": 0.0}),
        }
    )
    title = scenario.title or "the scenario"
    try:
        experiments = [
            prepare(loop.model_copy(update={"observer": ObserverSettings(kind=kind, **parameters)}))
            for parameters in (plain(given), plain(tuned))
        ]
        for experiment in experiments:
            experiment.require_single_axis("tune-log")
    except InputError as error:
        return LoopComparison(title, duration, worlds, refused=str(error))
    results = run_side_by_side([run_of(experiment, worlds) for experiment in experiments], keep_trajectory=False)
    if any(outcome.kind == "interrupted" for result in results for outcome in result.outcomes):
        raise KeyboardInterrupt
    tilts = [result.values("tilt_rms_deg") for result in results]
    both = np.isfinite(tilts[0]) & np.isfinite(tilts[1])
    ratio = ratio_interval(tilts[0][both], tilts[1][both]) if both.sum() >= 2 else None
    given_stood, tuned_stood = (result.stood for result in results)
    stood = int(given_stood.sum()), int(tuned_stood.sum())
    alone = int((given_stood & ~tuned_stood).sum()), int((tuned_stood & ~given_stood).sum())
    return LoopComparison(title, duration, worlds, stood, alone, ratio)


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

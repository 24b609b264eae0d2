"""An observer tuned to one part of users' logs, scored on another, and compared in a closed loop."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.stats import binomtest

from cmg_mj.core.errors import InputError
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.features.replay.log import REFERENCE, Log
from cmg_mj.features.replay.log_replay import observer_inputs, observer_on, replay_log
from cmg_mj.features.replay.noise import noise_figures
from cmg_mj.features.replay.reference import Alignment, alignment_of, remarks_on
from cmg_mj.features.tuning.fit import RELEVANT, NoiseLevelResult, OnShare, ParameterFit, ScoringData, Study, judged
from cmg_mj.features.tuning.search import ParameterValues, plain
from cmg_mj.features.tuning.simulations import plain_loop
from cmg_mj.observers import Observer
from cmg_mj.observers.parameter_options import ParameterValue
from cmg_mj.results.intervals import CONFIDENCE, Interval, PairedVerdict, ratio_interval
from cmg_mj.results.summary_keys import Summary, SummaryValue, finite
from cmg_mj.runs.experiment import prepare
from cmg_mj.runs.open_loop import replay
from cmg_mj.runs.side_by_side import run_jobs, run_of
from cmg_mj.scenario.loading import load_scenario, parse_scenario
from cmg_mj.scenario.schema import ObserverSettings, Scenario
from cmg_mj.stages.push import push_windows

BLOCKS = 10
"""Stretches of each log's part that are scored one by one, for an interval."""
MIN_STRETCH_S = 0.5
"""Shortest stretches with an interval [s]; shorter ones are not independent."""
SCENARIO = "push_recovery"
"""The scenario of the closed loop by default."""
NO_LOOP = "none"
"""Name of no scenario: nothing is simulated."""
LOOP_WORLDS = 16
USUAL_S = 5.0
"""The loop runs for so long, or until the scenario ends [s]; longer only if the second after a push ends later."""


@dataclass(frozen=True)
class LoopComparison:
    """A loop closed on the observer with the given parameters, and with the tuned ones.

    Attributes:
        scenario: Its title.
        duration_s: Simulated time [s].
        worlds: Number of worlds, the same noise in both loops.
        given_stood: Number of worlds that stood to the end with the given parameters.
        tuned_stood: Number of worlds that stood to the end with the tuned parameters.
        given_stood_alone: Number of those that fell with the tuned parameters.
        tuned_stood_alone: Number of those that fell with the given parameters.
        tilt_rms_ratio: RMS of the tilt, given by tuned, over the worlds that stood with both; None of fewer than two.
        refused: Why an observer could not be in this loop; empty if it could.
    """

    scenario: str
    duration_s: float
    worlds: int
    given_stood: int = 0
    tuned_stood: int = 0
    given_stood_alone: int = 0
    tuned_stood_alone: int = 0
    tilt_rms_ratio: Interval | None = None
    refused: str = ""

    @property
    def verdict(self) -> PairedVerdict | None:
        """Compare the tuned parameters with the given ones: by falls if these are beyond chance, else by the tilt."""
        if self.refused:
            return None
        given, tuned = self.given_stood_alone, self.tuned_stood_alone
        if given + tuned and binomtest(given, given + tuned).pvalue < 1.0 - CONFIDENCE:  # the sign test
            return "better" if tuned > given else "worse"
        return "tie" if self.tilt_rms_ratio is None else judged(self.tilt_rms_ratio)

    def figures(self) -> dict[str, SummaryValue]:
        """Return the figures that `--json` prints."""
        ratio = self.tilt_rms_ratio and list(self.tilt_rms_ratio)
        return {**asdict(self), "tilt_rms_ratio": ratio, "verdict": self.verdict, "refused": self.refused or None}

    @property
    def remark(self) -> str:
        """Describe the comparison in one line."""
        loop = f"In the closed loop of {self.scenario} ({self.worlds} worlds of {self.duration_s:g} s, its rig, sensors"
        loop += " and control rate)"
        if self.refused:
            return f"{loop} the parameters cannot be compared: {self.refused}."
        line = (
            f"{loop} the tuned parameters stand {self.tuned_stood} times ({self.tuned_stood_alone} where the given "
            f"ones fall), the given ones {self.given_stood} ({self.given_stood_alone} where the tuned ones fall)"
        )
        if self.tilt_rms_ratio is not None:
            line += "; RMS of the tilt, given / tuned, {:.3f} ({:.3f} to {:.3f})".format(*self.tilt_rms_ratio)
        words = {"better": "better there", "worse": "WORSE there", "tie": "not different there beyond chance"}
        return f"{line}: the tuned ones are {words[self.verdict or 'tie']}."


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
    scenario: Scenario, kind: str, given: ParameterValues, tuned: ParameterValues, *, worlds: int = LOOP_WORLDS
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
    loop = plain_loop(scenario, duration, "observer")
    title = scenario.title or "the scenario"
    try:
        experiments = [
            prepare(loop.model_copy(update={"observer": ObserverSettings(kind=kind, **plain(parameters))}))
            for parameters in (given, tuned)
        ]
        for experiment in experiments:
            experiment.require_single_axis("tune-log")
    except InputError as error:
        return LoopComparison(title, duration, worlds, refused=str(error))
    results = run_jobs([run_of(experiment, worlds) for experiment in experiments], keep_trajectory=False)
    if any(result.interrupted for result in results):
        raise KeyboardInterrupt
    tilts = [result.values("tilt_rms_deg") for result in results]
    both = np.isfinite(tilts).all(axis=0)
    ratio = ratio_interval(tilts[0][both], tilts[1][both]) if both.sum() >= 2 else None
    stood = [result.stood for result in results]
    counts = [int(which.sum()) for which in (*stood, stood[0] & ~stood[1], stood[1] & ~stood[0])]
    return LoopComparison(title, duration, worlds, *counts, tilt_rms_ratio=ratio)


class LogSegments(ScoringData):
    """Parts of logs that are fitted or scored, in stretches of equal length.

    Args:
        logs: The parts.
        settle_s: Time from every start of an observer that is not scored [s].
    """

    def __init__(self, logs: Sequence[Log], settle_s: float) -> None:
        self.logs, self.references = logs, [log[REFERENCE] for log in logs]
        self.stretches = [
            (i, rows)
            for i, log in enumerate(logs)
            for rows in np.array_split(np.flatnonzero(log.scored(settle_s) & np.isfinite(log[REFERENCE])), BLOCKS)
            if len(rows)
        ]

    def rates(self, observers: Sequence[Observer]) -> list[np.ndarray]:
        """See `ScoringData`."""
        rates = [np.full(len(log), math.nan) for log in self.logs]
        for log, observer, rate in zip(self.logs, observers, rates, strict=True):
            for part in log.parts:
                rate[part] = replay(observer, log.trajectory(part)).x2
        return rates


class LogEvidence(NamedTuple):
    """A log beside its errors."""

    log: Log
    alignment: Alignment | None
    """Lag, scale and offset of the reference."""
    noise: MeasurementNoise
    """Sensor noise that the observer assumed."""


@dataclass(frozen=True)
class LogStudy(Study):
    """An observer tuned on logs.

    Attributes:
        logs: The logs.
        split: The share of each log that was fitted; the rest is scored.
        level: Tuned parameters and their scores.
        stretch_s: The shortest of the scored stretches [s].
        loop: Given and tuned parameters in a scenario's closed loop; None if none was asked for.
    """

    logs: Sequence[LogEvidence]
    split: float
    level: NoiseLevelResult
    stretch_s: float
    loop: LoopComparison | None = None

    @property
    def verdict(self) -> PairedVerdict | None:
        """Compare the tuned parameters with the given ones; None if the stretches are too short for an interval.

        Better is better by more than 1 % and beyond chance, over the held-out stretches.
        """
        return self.level.judged(RELEVANT) if self.stretch_s >= MIN_STRETCH_S else None

    @property
    def title(self) -> str:
        """The table's."""
        return f"{', '.join(one.log.name for one in self.logs)}: {self.kind}"

    @property
    def rows(self) -> list[tuple[str, NoiseLevelResult, PairedVerdict | None]]:
        """Names, levels and verdicts of the table's rows."""
        return [(self.kind, self.level, self.verdict)]

    def opening(self) -> Iterator[str]:
        """Say what the errors are."""
        for one in self.logs:
            for remark in remarks_on(*one):
                yield f"{one.log.name}: {remark}" if len(self.logs) > 1 else remark
        share = f"{self.split:.0%} of each log, scored on the rest, in {len(self.level.rms)} stretches"
        yield f"RMS of the estimated rate less the reference. Fitted on the first {share}."

    def closing(self) -> Iterator[str]:
        """Say why there is no verdict, or a tie, and what the tuned parameters do in a closed loop."""
        if self.verdict is None:
            short = f"No interval: the scored stretches are {self.stretch_s:.2g} s short"
            yield f"{short}; there is one from {MIN_STRETCH_S:g} s on."
        elif self.verdict == "tie":
            yield f"A tie: the difference is not beyond chance, or is less than {RELEVANT - 1.0:.0%}."
        if self.loop is not None:
            yield self.loop.remark

    def settings(self) -> list[str]:
        """Return the tuned parameters as `--set` of a replay takes them."""
        tuned = plain({number.parameter: self.level.parameters[number.parameter] for number in self.numbers})
        return [f"{self.kind}.{name}={json.dumps(value)}" for name, value in tuned.items()]

    def figures(self) -> Summary:
        """Return the figures that `cmg-mj tune-log --json` prints."""
        figures: dict[str, SummaryValue] = {
            "logs": [one.log.name for one in self.logs],
            **self.common_figures(),
            "split": self.split,
            "noise": [
                {
                    "tilt_rad": noise.tilt,
                    "acceleration_rad_s2": noise.acceleration,
                    "correlation": noise.correlation,
                    **noise_figures(log, noise),
                }
                for log, _, noise in self.logs
            ],
            "notes": [remarks_on(*one) for one in self.logs],
            "reference": [one.alignment and one.alignment._asdict() for one in self.logs],
            "held_out_stretches": len(self.level.rms),
            "held_out_stretch_s": self.stretch_s,
            **self.level.figures(),
            **({} if self.verdict else {"held_out_ratio": None}),
            "verdict": self.verdict,
            **({"closed_loop": self.loop.figures()} if self.loop else {}),
        }
        return finite(figures)


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
        closed_loop: A scenario in whose loop the tuned parameters are compared with the given ones.
        on_share: Called now and then with the completed share.

    Returns:
        The study.

    Raises:
        InputError: A log has no reference or is too short, the observer cannot take part, or nothing can be tuned.
    """
    if not 0.0 < split < 1.0:
        raise InputError(f"--split {split:g}: must be between 0 and 1, the share that is fitted")
    inputs = [
        observer_inputs(log, model=model, noises=noises, parameters={kind: start_parameters or {}}) for log in logs
    ]
    first, given, halves = logs[0], inputs[0].parameters[kind], []
    for log, own in zip(logs, inputs, strict=True):
        if "reference" not in log.has:
            raise InputError(f"{log.name}: no reference to tune to: name it, --columns rate=...")
        if abs(log.dt / first.dt - 1.0) > 1e-3:
            raise InputError(f"{log.name}: {1.0 / log.dt:g} Hz, {first.name} {1.0 / first.dt:g} Hz: give --rate HZ")
        if own.parameters[kind] != given:
            raise InputError(
                f"{first.name} and {log.name} ran with different parameters of {kind}: say with which to begin, "
                "--set observer.NAME=VALUE"
            )
        end = round(split * len(log))
        halves.append([log.cut(slice(end)), log.cut(slice(end, None))])
        for half in halves[-1]:  # an observer that cannot take part is refused, with the reason
            replay_log(half, [kind], **own._asdict(), settle_s=settle_s)
    fitted, held_out = (LogSegments(segments, settle_s) for segments in zip(*halves, strict=True))
    makers = [partial(observer_on, log, kind, own.model, own.noise) for log, own in zip(logs, inputs, strict=True)]

    def chosen(parameters: ParameterValues) -> dict[str, ParameterValue]:
        """Return the given and the tuned parameters: the others are each log's own, and those of a loop."""
        return {**given, **{number.parameter: parameters[number.parameter] for number in fit.numbers}}

    def one_per_log(**candidate: ParameterValue) -> list[Observer]:
        return [make(**chosen(candidate)) for make in makers]

    fit = ParameterFit(kind, makers[0], given, parameters, ranges)
    level = fit.level(one_per_log, fitted, held_out, on_share)
    return LogStudy(
        **fit.study,
        logs=[LogEvidence(log, alignment_of(log), own.noise) for log, own in zip(logs, inputs, strict=True)],
        split=split,
        level=level,
        stretch_s=min(len(rows) * logs[i].dt for i, rows in held_out.stretches),
        loop=closed_loop and compare_in_loop(closed_loop, kind, given, chosen(level.parameters)),
    )

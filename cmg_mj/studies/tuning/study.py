"""Parameters fitted on some worlds, scored on others beside those given, at one sensor noise or several."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np

from cmg_mj.errors import InputError
from cmg_mj.observers import Observer, make_observer
from cmg_mj.results.intervals import Interval, PairedVerdict, paired_verdict, ratio_interval
from cmg_mj.scenario.schema import ObserverSettings, Scenario
from cmg_mj.simulation.experiment import Experiment, prepare
from cmg_mj.studies.tuning.on_simulations import WARM_UP_S, Recorded, Window, halves, recorder
from cmg_mj.studies.tuning.parameters import TunedScalar, narrowed, numbers_of, parameters_of, replaced
from cmg_mj.studies.tuning.search import crossing, evaluations, idle, search

DIGITS = 4
"""Significant digits of the tuned parameters: what is written is what was scored."""
AT_A_LIMIT = 1.02
"""A number this close to a limit of its range is at the limit."""

OnShare = Callable[[float], None]


class ScoringData(Protocol):
    """What parameters are scored on: recorded worlds, or stretches of logs."""

    @property
    def fell(self) -> int:
        """How many more fell."""
        ...

    @property
    def worlds(self) -> int:
        """How many."""
        ...

    @property
    def zero_rms(self) -> float:
        """The error of an estimate of zero, their mean [rad/s]."""
        ...

    @property
    def largest_acceleration(self) -> float:
        """Of the tilt [rad/s^2]."""
        ...

    def errors(self, made: Any, /) -> np.ndarray:
        """An observer's RMS error in each, (n,) [rad/s]; NaN where it is lost.

        `made` is what `ParameterFit.make` gives.
        """
        ...


@dataclass(frozen=True)
class NoiseLevelResult:
    """What came out at one sensor noise.

    Attributes:
        noise_ug_rthz: Noise density of the accelerometers [ug/sqrt(Hz)].
        parameters: All parameters of the tuned observer.
        sizes: The tuned numbers among them, by name.
        edges: Names of those that ended at a limit of their range.
        fit_rms: Mean over the fitted worlds of the velocity RMS error, tuned [rad/s].
        fit_given_rms: The same with the given parameters [rad/s].
        rms: On the held-out worlds, tuned, (n_worlds,) [rad/s].
        given_rms: On the held-out worlds, given, (n_worlds,) [rad/s].
        zero_rms: What an estimate of zero would have there, mean over the held-out worlds [rad/s].
        largest_acceleration: Of the tilt, in the fitted worlds [rad/s^2].
        fell: Worlds that fell, and were left out.
    """

    noise_ug_rthz: float
    parameters: Mapping[str, Any]
    sizes: Mapping[str, float]
    edges: Sequence[str]
    fit_rms: float
    fit_given_rms: float
    rms: np.ndarray
    given_rms: np.ndarray
    zero_rms: float
    largest_acceleration: float
    fell: int

    @property
    def ratio(self) -> Interval:
        """Held-out error with the given parameters by that with the tuned ones, world by world."""
        return ratio_interval(self.given_rms, self.rms)

    @property
    def fit(self) -> float:
        """Of the tuned parameters in what is scored, 1 - error/motion: 0 is what an estimate of zero has."""
        return self._fit(self.rms)

    @property
    def given_fit(self) -> float:
        """The same of the given parameters."""
        return self._fit(self.given_rms)

    def _fit(self, rms: np.ndarray) -> float:
        return 1.0 - float(rms.mean()) / self.zero_rms if self.zero_rms else math.nan

    @property
    def verdict(self) -> PairedVerdict:
        """The tuned parameters beside the given ones: is 1 below, inside or above the interval of the ratio?

        Given ones that lose the observer are worse than any.
        """
        if not np.isfinite(self.given_rms).all():
            return "better"
        return paired_verdict(Interval(*(value - 1.0 for value in self.ratio)))


@dataclass(frozen=True)
class TuningResult:
    """An observer tuned at one sensor noise or several.

    Attributes:
        scenario: The experiment.
        kind: The observer.
        given: Its parameters before.
        numbers: What was tuned.
        insensitive_parameters: Names of the numbers that were not, because the estimated rate does not depend on them.
        worlds: How many were to be fitted, and as many to be scored.
        window: What was scored [s].
        levels: One a sensor noise, in ascending order.
    """

    scenario: Scenario
    kind: str
    given: Mapping[str, Any]
    numbers: Sequence[TunedScalar]
    insensitive_parameters: Sequence[str]
    worlds: int
    window: Window
    levels: Sequence[NoiseLevelResult]


def tune(
    scenario: Scenario,
    *,
    worlds: int = 20,
    parameters: Sequence[str] = (),
    ranges: Mapping[str, tuple[float, float]] | None = None,
    noise_ug_rthz: Sequence[float] = (),
    warm_up_s: float = WARM_UP_S,
    starts: int = 2,
    recorded: Callable[..., Recorded] | None = None,
    on_share: OnShare | None = None,
) -> TuningResult:
    """Fit the parameters of the scenario's observer to the gyro.

    Worlds 0 to n - 1 are fitted, worlds n to 2n - 1 scored.

    Args:
        scenario: The experiment, with the observer and the parameters to start from and to compare with.
        worlds: How many are fitted, and as many held out.
        parameters: Names to tune; by default every number of the observer.
        ranges: Number -> smallest and largest size, where the observer's own limits are not enough.
        noise_ug_rthz: Noise densities of the accelerometers; by default the scenario's [ug/sqrt(Hz)].
        warm_up_s: How much is replayed before the window [s].
        starts: Starts of a search in several dimensions.
        recorded: Hands out the recordings, for those who keep them; left out, they are made here, all at once.
        on_share: Called now and then with the share done.

    Returns:
        The study. If the user interrupted, with the noise densities that were done until then.

    Raises:
        InputError: A name or a range does not fit, nothing can be tuned, or too many worlds fell.
        KeyboardInterrupt: The user interrupted before the first was done.
    """
    if worlds < 2:
        raise InputError(f"--worlds {worlds}: at least 2, for an interval")
    own = scenario.sensors.accelerometer.noise_density_ug_rthz
    densities = sorted(dict.fromkeys(noise_ug_rthz or [own]))
    kind, settings = scenario.observer.kind, scenario.observer
    experiment = prepare(scenario)
    experiment.require_single_axis("tuning")
    experiment.rehearse(worlds=2)
    given = parameters_of(kind, experiment.design.observer(), settings.parameters)
    numbers = numbers_of(kind, given, _maker(experiment), parameters)
    numbers = narrowed(numbers, ranges or {}, "--range")

    levels: list[NoiseLevelResult] = []
    still: list[TunedScalar] = []
    window: Window = (0.0, 0.0)
    recorded = recorded or recorder(halves(scenario, worlds, densities), warm_up_s=warm_up_s)
    for i, density in enumerate(densities):

        def share(done: float, i: int = i) -> None:
            if on_share:
                on_share((i + min(done, 1.0)) / len(densities))

        fit, held_out = (
            recorded(scenario, span, noise_ug_rthz=density, warm_up_s=warm_up_s)
            for span in (range(worlds), range(worlds, 2 * worlds))
        )
        fitter = ParameterFit(kind, _maker(experiment, density), given, fit, share)
        if not levels:
            still, window = fitter.insensitive_parameters(numbers), fit.window
            if len(still) == len(numbers):
                raise InputError(f"the rate that {kind} estimates does not depend on {names_of(numbers)}")
            numbers = [number for number in numbers if number not in still]
        fitter.expected = evaluations(len(numbers))
        # What was best at the noise before is near the best at this one.
        from_here = (
            [replace(n, given=math.copysign(levels[-1].sizes[n.name], n.given)) for n in numbers] if levels else numbers
        )
        try:
            levels.append(level_of(density, fitter, from_here, held_out, starts))
            share(1.0)
        except KeyboardInterrupt:
            if not levels:
                raise
            break
    return TuningResult(scenario, kind, given, numbers, [number.name for number in still], worlds, window, levels)


def names_of(numbers: Sequence[TunedScalar]) -> str:
    """Numbers in a message."""
    return ", ".join(number.name for number in numbers)


def _maker(experiment: Experiment, noise_ug_rthz: float | None = None) -> Callable[..., Observer]:
    """Makes the scenario's observer of its parameters, told the noise of the sensors it is tuned at."""
    dt, model, noise = experiment.design.given
    if noise_ug_rthz is not None:
        sensors = experiment.scenario.sensors
        accelerometer = replace(sensors.accelerometer, noise_density_ug_rthz=noise_ug_rthz)
        noise = experiment.plant.parameters.noise(replace(sensors, accelerometer=accelerometer))
    return partial(make_observer, experiment.scenario.observer.kind, dt, model, noise)


class ParameterFit:
    """Scores parameters on the fitted worlds, and counts how often."""

    def __init__(
        self, kind: str, make: Callable[..., Any], given: Mapping[str, Any], recorded: ScoringData, on_share: OnShare
    ) -> None:
        self.kind, self.make, self.given, self.recorded = kind, make, given, recorded
        self.on_share = on_share
        self.expected = 1
        self.count = 0
        self.given_loss = self._mean(given)

    def errors(self, parameters: Mapping[str, Any], recorded: ScoringData) -> np.ndarray:
        """Velocity RMS errors, (n_worlds,) [rad/s]; not a number where the observer refuses or fails."""
        try:
            return recorded.errors(self.make(**parameters))
        except KeyboardInterrupt:
            raise
        except Exception:  # a user's observer may fail in any way, at parameters nobody has tried
            return np.full(recorded.worlds, math.nan)

    def _mean(self, parameters: Mapping[str, Any]) -> float:
        errors = self.errors(parameters, self.recorded)
        return float(errors.mean()) if np.isfinite(errors).all() else math.inf

    def loss(self, numbers: Sequence[TunedScalar], sizes: Sequence[float]) -> float:
        """Mean over the worlds of the velocity RMS error [rad/s]; infinite for one that is lost."""
        self.count += 1
        self.on_share(self.count / self.expected)
        return self._mean(replaced(self.given, numbers, sizes))

    def insensitive_parameters(self, numbers: Sequence[TunedScalar]) -> list[TunedScalar]:
        """Those that do not matter."""
        return idle(lambda sizes: self.loss(numbers, sizes), numbers, self.given_loss)


def level_of(
    noise: float, fitter: ParameterFit, numbers: Sequence[TunedScalar], held_out: ScoringData, starts: int
) -> NoiseLevelResult:
    """Search, and score what was found.

    Args:
        noise: Noise density of the accelerometers, to be told [ug/sqrt(Hz)].
        fitter: Scores on what is fitted.
        numbers: What is tuned.
        held_out: What is scored.
        starts: Starts of a search in several dimensions.

    Returns:
        What came out.

    Raises:
        InputError: No parameters give an estimate that stays finite.
    """
    fitter.count = 0
    sizes, found = search(lambda tried: fitter.loss(numbers, tried), numbers, starts=starts)
    if not math.isfinite(found):
        raise InputError(f"{fitter.kind}: no parameters give an estimate that stays finite")
    before = [abs(_get(fitter.given[number.parameter], number.place)) for number in numbers]
    inside = all(number.low <= size <= number.high for number, size in zip(numbers, before, strict=True))
    if inside and fitter.given_loss <= found:  # a search stops within its tolerance
        sizes = before
    else:
        rounded = [float(f"{size:.{DIGITS}g}") for size in sizes]
        if math.isfinite(fitter.loss(numbers, rounded)):  # not beyond an open limit
            sizes = rounded
    tuned = replaced(fitter.given, numbers, sizes)
    return NoiseLevelResult(
        noise_ug_rthz=noise,
        parameters=tuned,
        sizes={n.name: size for n, size in zip(numbers, sizes, strict=True)},
        edges=[n.name for n, size in zip(numbers, sizes, strict=True) if _at_a_limit(n, size)],
        fit_rms=fitter._mean(tuned),
        fit_given_rms=fitter.given_loss,
        rms=fitter.errors(tuned, held_out),
        given_rms=fitter.errors(fitter.given, held_out),
        zero_rms=held_out.zero_rms,
        largest_acceleration=fitter.recorded.largest_acceleration,
        fell=fitter.recorded.fell + held_out.fell,
    )


def _at_a_limit(number: TunedScalar, size: float) -> bool:
    return not number.low * AT_A_LIMIT < size < number.high / AT_A_LIMIT


def _get(value: Any, place: tuple[int, ...]) -> float:
    for i in place:
        value = value[i]
    return float(value)


class BestNoise(NamedTuple):
    """The sensor noise at which the given parameters are the best ones."""

    where: Literal["found", "below", "above", "not bracketed"]
    """Whether the noises tried have it between them; below or above them; or none of the three can be said."""
    noise_ug_rthz: float | None
    """If it was found [ug/sqrt(Hz)]."""


def best_noise(study: TuningResult) -> BestNoise:
    """At which sensor noise the given parameters are the best ones.

    With one tuned number, where its best value crosses the given one, on straight lines between the levels, both in the
    logarithm. With more, the level at which the given parameters lose least; at an end of the list it may lie beyond.

    Args:
        study: With several levels.

    Returns:
        The noise density, or on which side of the levels it lies, if there is one.
    """
    levels = [level for level in study.levels if level.noise_ug_rthz > 0.0 or len(study.numbers) > 1]
    if len(levels) < 2:
        return BestNoise("not bracketed", None)
    if len(study.numbers) == 1:
        (number,) = study.numbers
        off = [math.log(level.sizes[number.name] / abs(number.given)) for level in levels]
        crossed = crossing([math.log(level.noise_ug_rthz) for level in levels], off)
        if crossed is not None:
            return BestNoise("found", math.exp(crossed))
        lost = [abs(value) for value in off]
    else:
        lost = [level.ratio.mean for level in levels]
    if not np.isfinite(lost).all():
        return BestNoise("not bracketed", None)
    least = int(np.argmin(lost))
    if least == 0:
        return BestNoise("below", None)
    if least == len(levels) - 1:
        return BestNoise("above", None)
    found = len(study.numbers) > 1
    return BestNoise("found", levels[least].noise_ug_rthz) if found else BestNoise("not bracketed", None)


def tuned_scenario(study: TuningResult, level: NoiseLevelResult) -> Scenario:
    """The scenario with the tuned observer in the loop, at the level's sensor noise."""
    sensors = study.scenario.sensors
    accelerometer = replace(sensors.accelerometer, noise_density_ug_rthz=level.noise_ug_rthz)
    return study.scenario.model_copy(
        update={
            "observer": ObserverSettings(kind=study.kind, **level.parameters),  # type: ignore[arg-type]
            "sensors": replace(sensors, accelerometer=accelerometer),
        }
    )

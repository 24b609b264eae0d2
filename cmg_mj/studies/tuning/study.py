"""Parameters fitted on some worlds, scored on others beside those given, at one sensor noise or several."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Generic, Literal, NamedTuple, Protocol, TypeVar

import numpy as np

from cmg_mj.errors import InputError
from cmg_mj.observers import make_observer
from cmg_mj.replay.parameter_options import ParameterValue
from cmg_mj.results.intervals import Interval, PairedVerdict, paired_verdict, ratio_interval
from cmg_mj.scenario.schema import ObserverSettings, Scenario
from cmg_mj.simulation.experiment import Experiment, prepare
from cmg_mj.studies.tuning.on_simulations import WARM_UP_S, Recorded, Window, halves, recorder
from cmg_mj.studies.tuning.parameters import (
    MakeObserver,
    ParameterValues,
    TunedScalar,
    narrowed,
    numbers_of,
    parameters_of,
    replaced,
)
from cmg_mj.studies.tuning.search import crossing, evaluations, insensitive_numbers, search

DIGITS = 4
"""Significant digits of the tuned parameters: what is written is what was scored."""
AT_A_LIMIT = 1.02
"""A number this close to a limit of its range is at the limit."""

OnShare = Callable[[float], None]
M = TypeVar("M")
M_contra = TypeVar("M_contra", contravariant=True)


class ScoringData(Protocol[M_contra]):
    """Data on which parameters are scored: recorded worlds, or stretches of logs."""

    @property
    def fell(self) -> int:
        """Number of worlds that fell and are not scored."""
        ...

    @property
    def worlds(self) -> int:
        """Number of worlds or stretches."""
        ...

    @property
    def zero_rms(self) -> float:
        """Error of an estimate of zero, the mean over worlds or stretches [rad/s]."""
        ...

    @property
    def largest_acceleration(self) -> float:
        """Largest acceleration of the tilt [rad/s^2]."""
        ...

    def errors(self, observers: M_contra, /) -> np.ndarray:
        """Return the RMS errors of what `ParameterFit.make` makes, (n,) [rad/s]; NaN where an observer fails."""
        ...


@dataclass(frozen=True)
class NoiseLevelResult:
    """Tuned parameters and their scores at one sensor noise.

    Attributes:
        noise_ug_rthz: Noise density of the accelerometers [ug/sqrt(Hz)].
        parameters: All parameters of the tuned observer.
        sizes: The tuned numbers among them, by name.
        edges: Names of those that ended at a limit of their range.
        fit_rms: Mean over the fitted worlds of the velocity RMS error, tuned [rad/s].
        fit_given_rms: Mean over the fitted worlds with the given parameters [rad/s].
        rms: On the held-out worlds, tuned, (n_worlds,) [rad/s].
        given_rms: On the held-out worlds, given, (n_worlds,) [rad/s].
        zero_rms: Error of an estimate of zero, mean over the held-out worlds [rad/s].
        largest_acceleration: Largest acceleration of the tilt in the fitted worlds [rad/s^2].
        fell: Number of worlds that fell and are discarded.
    """

    noise_ug_rthz: float
    parameters: ParameterValues
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
        """Ratio of the held-out errors, given parameters by tuned ones, world by world."""
        return ratio_interval(self.given_rms, self.rms)

    @property
    def fit(self) -> float:
        """Fit of the tuned parameters on the held-out worlds, 1 - error/motion; 0 for an estimate of zero."""
        return self._fit(self.rms)

    @property
    def given_fit(self) -> float:
        """Fit of the given parameters on the held-out worlds."""
        return self._fit(self.given_rms)

    def _fit(self, rms: np.ndarray) -> float:
        return 1.0 - float(rms.mean()) / self.zero_rms if self.zero_rms else math.nan

    @property
    def verdict(self) -> PairedVerdict:
        """Compare the tuned parameters with the given ones, by the interval of the ratio.

        Given parameters with which the observer fails are worse than any.
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
        start_parameters: Its parameters before.
        numbers: The tuned numbers.
        insensitive_parameters: Names of numbers that are not tuned, since the estimated rate does not depend on them.
        worlds: Number of worlds to fit; as many are held out for scoring.
        window: Start and end of the scored time [s].
        levels: Results by sensor noise, in ascending order.
    """

    scenario: Scenario
    kind: str
    start_parameters: ParameterValues
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
        worlds: Number of worlds to fit; as many are held out.
        parameters: Names to tune; by default every number of the observer.
        ranges: Number -> smallest and largest size, where the observer's own limits are not enough.
        noise_ug_rthz: Noise densities of the accelerometers; by default the scenario's [ug/sqrt(Hz)].
        warm_up_s: Time replayed before the window [s].
        starts: Starts of a search in several dimensions.
        recorded: Returns recordings made before; by default they are made here, all at once.
        on_share: Called now and then with the completed share.

    Returns:
        The result. After an interrupt, it has the noise densities done until then.

    Raises:
        InputError: A name or a range does not fit, nothing can be tuned, or too many worlds fell.
        KeyboardInterrupt: The user interrupted before the first was done.
    """
    if worlds < 2:
        raise InputError(f"--worlds {worlds}: at least 2, for an interval")
    accelerometer = scenario.sensors.accelerometer
    densities = sorted(dict.fromkeys(noise_ug_rthz or [accelerometer.noise_density_ug_rthz]))
    kind = scenario.observer.kind
    experiment = prepare(scenario)
    experiment.require_single_axis("tuning")
    experiment.dry_run(worlds=2)
    start_parameters = parameters_of(kind, experiment.design.observer(), scenario.observer.parameters)
    numbers = numbers_of(kind, start_parameters, _maker(experiment), parameters)
    numbers = narrowed(numbers, ranges or {}, "--range")
    recorded = recorded or recorder(halves(scenario, worlds, densities), warm_up_s=warm_up_s)
    spans = range(worlds), range(worlds, 2 * worlds)

    levels: list[NoiseLevelResult] = []
    insensitive: list[TunedScalar] = []
    window: Window = (0.0, 0.0)
    for i, density in enumerate(densities):

        def share(done: float, i: int = i) -> None:
            if on_share:
                on_share((i + min(done, 1.0)) / len(densities))

        fit, held_out = (recorded(scenario, span, noise_ug_rthz=density, warm_up_s=warm_up_s) for span in spans)
        fitter = ParameterFit(kind, _maker(experiment, density), start_parameters, fit, share)
        if not levels:
            window = fit.window
            numbers, insensitive = fitter.sensitive_parameters(numbers)
        fitter.expected = evaluations(len(numbers))
        start = numbers
        if levels:  # the best values at the level before are near the best at this one
            start = [replace(n, start=math.copysign(levels[-1].sizes[n.name], n.start)) for n in numbers]
        try:
            levels.append(level_of(density, fitter, start, held_out, starts))
            share(1.0)
        except KeyboardInterrupt:
            if not levels:
                raise
            break
    names = [number.name for number in insensitive]
    return TuningResult(scenario, kind, start_parameters, numbers, names, worlds, window, levels)


def _maker(experiment: Experiment, noise_ug_rthz: float | None = None) -> MakeObserver:
    """Return what makes the scenario's observer from its parameters, for the sensor noise of the tuning."""
    dt, model, noise = experiment.design.constructor_arguments
    if noise_ug_rthz is not None:
        sensors = experiment.scenario.sensors
        accelerometer = replace(sensors.accelerometer, noise_density_ug_rthz=noise_ug_rthz)
        noise = experiment.plant.parameters.noise(replace(sensors, accelerometer=accelerometer))
    return partial(make_observer, experiment.scenario.observer.kind, dt, model, noise)


class ParameterFit(Generic[M]):
    """Scores parameters on the fitted worlds, and counts the evaluations.

    Args:
        kind: The observer's name.
        make: Makes what is scored from parameters: an observer, or one for each log.
        start_parameters: The given parameters.
        data: The fitted worlds, or stretches of logs.
        on_share: Called with the completed share of the evaluations.

    Attributes:
        expected: Expected number of evaluations.
        given_loss: Loss of the given parameters [rad/s].
    """

    def __init__(
        self,
        kind: str,
        make: Callable[..., M],
        start_parameters: ParameterValues,
        data: ScoringData[M],
        on_share: OnShare,
    ) -> None:
        self.kind, self.make, self.start_parameters, self.data = kind, make, start_parameters, data
        self.on_share = on_share
        self.expected = 1
        self.count = 0
        self.given_loss = self.mean_error(start_parameters)

    def errors(self, parameters: ParameterValues, data: ScoringData[M]) -> np.ndarray:
        """Return velocity RMS errors, (n_worlds,) [rad/s]; NaN where the observer refuses or fails."""
        try:
            return data.errors(self.make(**parameters))
        except KeyboardInterrupt:
            raise
        except Exception:  # a user's observer may fail in any way, at parameters nobody has tried
            return np.full(data.worlds, math.nan)

    def mean_error(self, parameters: ParameterValues) -> float:
        """Return the mean velocity RMS error of the fitted worlds [rad/s]; infinite if one of them fails."""
        errors = self.errors(parameters, self.data)
        return float(errors.mean()) if np.isfinite(errors).all() else math.inf

    def loss(self, numbers: Sequence[TunedScalar], sizes: Sequence[float]) -> float:
        """Return the mean error of parameters with some sizes [rad/s], and report the progress."""
        self.count += 1
        self.on_share(self.count / self.expected)
        return self.mean_error(replaced(self.start_parameters, numbers, sizes))

    def sensitive_parameters(self, numbers: Sequence[TunedScalar]) -> tuple[list[TunedScalar], list[TunedScalar]]:
        """Divide numbers into those that the estimated rate depends on and the others.

        Raises:
            InputError: The rate depends on none of them.
        """
        insensitive = insensitive_numbers(lambda sizes: self.loss(numbers, sizes), numbers, self.given_loss)
        if len(insensitive) == len(numbers):
            names = ", ".join(number.name for number in numbers)
            raise InputError(f"the rate that {self.kind} estimates does not depend on {names}")
        return [number for number in numbers if number not in insensitive], insensitive


def level_of(
    noise: float, fitter: ParameterFit[M], numbers: Sequence[TunedScalar], held_out: ScoringData[M], starts: int
) -> NoiseLevelResult:
    """Search for the best parameters, and score them on held-out data.

    Args:
        noise: Noise density of the accelerometers, for the result [ug/sqrt(Hz)].
        fitter: Scores on the fitted data.
        numbers: The tuned numbers.
        held_out: The held-out data.
        starts: Starts of a search in several dimensions.

    Returns:
        The parameters and their scores.

    Raises:
        InputError: No parameters give an estimate that stays finite.
    """
    fitter.count = 0
    sizes, loss = search(lambda sizes: fitter.loss(numbers, sizes), numbers, starts=starts)
    if not math.isfinite(loss):
        raise InputError(f"{fitter.kind}: no parameters give an estimate that stays finite")
    given_sizes = [abs(_get(fitter.start_parameters[number.parameter], number.place)) for number in numbers]
    inside = all(number.low <= size <= number.high for number, size in zip(numbers, given_sizes, strict=True))
    if inside and fitter.given_loss <= loss:  # a search stops within its tolerance
        sizes = given_sizes
    else:
        rounded = [float(f"{size:.{DIGITS}g}") for size in sizes]
        if math.isfinite(fitter.loss(numbers, rounded)):  # not beyond an open limit
            sizes = rounded
    tuned = replaced(fitter.start_parameters, numbers, sizes)
    return NoiseLevelResult(
        noise_ug_rthz=noise,
        parameters=tuned,
        sizes={n.name: size for n, size in zip(numbers, sizes, strict=True)},
        edges=[n.name for n, size in zip(numbers, sizes, strict=True) if _at_a_limit(n, size)],
        fit_rms=fitter.mean_error(tuned),
        fit_given_rms=fitter.given_loss,
        rms=fitter.errors(tuned, held_out),
        given_rms=fitter.errors(fitter.start_parameters, held_out),
        zero_rms=held_out.zero_rms,
        largest_acceleration=fitter.data.largest_acceleration,
        fell=fitter.data.fell + held_out.fell,
    )


def _at_a_limit(number: TunedScalar, size: float) -> bool:
    return not number.low * AT_A_LIMIT < size < number.high / AT_A_LIMIT


def _get(value: ParameterValue, place: tuple[int, ...]) -> float:
    for i in place:
        assert isinstance(value, Sequence)
        value = value[i]
    assert isinstance(value, (int, float))
    return float(value)


class BestNoise(NamedTuple):
    """The sensor noise at which the given parameters are the best ones."""

    where: Literal["found", "below", "above", "not bracketed"]
    """Place of that noise: found between the levels, below or above them, or not bracketed."""
    noise_ug_rthz: float | None
    """The noise density, if it was found [ug/sqrt(Hz)]."""


def best_noise(study: TuningResult) -> BestNoise:
    """Find the sensor noise at which the given parameters are the best ones.

    With one tuned number, it is the noise at which the best value crosses the given one, on straight lines between the
    levels, both in the logarithm. With more, it is the level at which the given parameters lose least, unless that is
    the first or the last.

    Args:
        study: A result with several levels.

    Returns:
        The noise density, or the side of the levels on which it lies.
    """
    levels = [level for level in study.levels if level.noise_ug_rthz > 0.0 or len(study.numbers) > 1]
    if len(levels) < 2:
        return BestNoise("not bracketed", None)
    if len(study.numbers) == 1:
        (number,) = study.numbers
        off = [math.log(level.sizes[number.name] / abs(number.start)) for level in levels]
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
    if len(study.numbers) > 1:
        return BestNoise("found", levels[least].noise_ug_rthz)
    return BestNoise("not bracketed", None)


def tuned_scenario(study: TuningResult, level: NoiseLevelResult) -> Scenario:
    """Return the scenario with the tuned observer in the loop, at the level's sensor noise."""
    sensors = study.scenario.sensors
    accelerometer = replace(sensors.accelerometer, noise_density_ug_rthz=level.noise_ug_rthz)
    return study.scenario.model_copy(
        update={
            "observer": ObserverSettings(kind=study.kind, **level.parameters),  # type: ignore[arg-type]
            "sensors": replace(sensors, accelerometer=accelerometer),
        }
    )

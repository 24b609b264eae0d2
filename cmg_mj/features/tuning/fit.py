"""Fit of an observer's parameters on some worlds or logs, scored on others beside those given."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.features.tuning.search import (
    ParameterValues,
    StopSearch,
    TunedScalar,
    insensitive_numbers,
    replaced,
    search,
)
from cmg_mj.observers.parameter_options import ParameterValue
from cmg_mj.results.intervals import Interval, PairedVerdict, paired_verdict, ratio_interval

DIGITS = 4
"""Significant digits of the tuned parameters: what is written is what was scored."""
AT_A_LIMIT = 1.02
"""A number this close to a limit of its range is at the limit."""

OnShare = Callable[[float], None]
Stop = Callable[[], bool]
"""Asked before every evaluation: from the first yes on none is made, and the best so far counts."""
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


class ParameterFit(Generic[M]):
    """Scores parameters on the fitted worlds, and counts the evaluations.

    Args:
        kind: The observer's name.
        make: Makes what is scored from parameters: an observer, or one for each log.
        start_parameters: The given parameters.
        data: The fitted worlds, or stretches of logs.
        on_share: Called with the completed share of the evaluations.
        stop: Whether to end the search early.

    Attributes:
        stopped: Whether it was ended early.
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
        stop: Stop = lambda: False,
    ) -> None:
        self.kind, self.make, self.start_parameters, self.data = kind, make, start_parameters, data
        self.on_share, self._stop, self.stopped = on_share, stop, False
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
        """Return the mean error of parameters with some sizes [rad/s], and report the progress.

        Raises:
            StopSearch: The search is to end.
        """
        self.stopped = self.stopped or self._stop()
        if self.stopped:
            raise StopSearch
        self.count += 1
        self.on_share(self.count / self.expected)
        return self.mean_error(replaced(self.start_parameters, numbers, sizes))

    def sensitive_parameters(self, numbers: Sequence[TunedScalar]) -> tuple[list[TunedScalar], list[TunedScalar]]:
        """Divide numbers into those that the estimated rate depends on and the others.

        Raises:
            InputError: The rate depends on none of them.
        """
        try:
            insensitive = insensitive_numbers(lambda sizes: self.loss(numbers, sizes), numbers, self.given_loss)
        except StopSearch:
            return list(numbers), []
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
    if not math.isfinite(loss) and not fitter.stopped:
        raise InputError(f"{fitter.kind}: no parameters give an estimate that stays finite")
    given_sizes = [abs(_get(fitter.start_parameters[number.parameter], number.place)) for number in numbers]
    inside = all(number.low <= size <= number.high for number, size in zip(numbers, given_sizes, strict=True))
    if inside and fitter.given_loss <= loss:  # a search stops within its tolerance
        sizes = given_sizes
    else:
        rounded = [float(f"{size:.{DIGITS}g}") for size in sizes]
        if math.isfinite(fitter.mean_error(replaced(fitter.start_parameters, numbers, rounded))):  # no open limit
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

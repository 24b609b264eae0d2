"""Fit of an observer's parameters on some worlds or logs, scored on others beside those given."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.features.tuning.search import (
    MakeObserver,
    ParameterValues,
    StopSearch,
    TunedScalar,
    evaluations,
    insensitive_numbers,
    numbers_of,
    parameters_of,
    plain,
    replaced,
    search,
)
from cmg_mj.results.intervals import Interval, PairedVerdict, paired_verdict, ratio_interval
from cmg_mj.results.summary_keys import SummaryValue

DIGITS = 4
"""Significant digits of the tuned parameters: what is written is what was scored."""
AT_A_LIMIT = 1.02
"""A number this close to a limit of its range is at the limit."""
RELEVANT = 1.01
"""A smaller ratio of two errors on logs is no difference."""

OnShare = Callable[[float], None]
"""Asked before every evaluation: from the first yes on none is made, and the best so far counts."""


def judged(ratio: Interval, relevant: float = RELEVANT) -> PairedVerdict:
    """Judge a ratio, above 1 for the better: it must differ by more than what is relevant, and beyond chance.

    Args:
        ratio: With its 95 % interval.
        relevant: The ratio from which there is a difference.
    """
    if 1.0 / relevant <= ratio.mean <= relevant:
        return "tie"
    return paired_verdict(Interval(*(value - 1.0 for value in ratio)))


class ScoringData:
    """Data on which parameters are scored: recorded worlds, or stretches of logs.

    Attributes:
        references: The rate of each recording that estimates are compared with, (n,) or (n, n_worlds) [rad/s].
        stretches: Number of a recording, and its rows that are scored together.
        fell: Number of worlds that fell and are not scored.
    """

    references: Sequence[np.ndarray]
    stretches: Sequence[tuple[int, np.ndarray]]
    fell: int = 0

    def rates(self, observers: Any) -> list[np.ndarray]:
        """Return the estimated rates of an observer, or of one for each log [rad/s]."""
        raise NotImplementedError

    def errors(self, observers: Any) -> np.ndarray:
        """Return the RMS of the estimated rate less the reference, (n,) [rad/s]; NaN where an observer fails.

        Args:
            observers: An observer, or one for each log.
        """
        with np.errstate(all="ignore"):
            return self._rms(self.rates(observers))

    @cached_property
    def zero_errors(self) -> np.ndarray:
        """Errors of an estimate of zero, one a world or a stretch [rad/s]."""
        return self._rms([np.zeros(())] * len(self.references))

    @property
    def zero_rms(self) -> float:
        """Error of an estimate of zero, the mean over worlds or stretches [rad/s]."""
        return float(self.zero_errors.mean())

    def _rms(self, rates: Sequence[np.ndarray]) -> np.ndarray:
        off = [rate - reference for rate, reference in zip(rates, self.references, strict=True)]
        return np.hstack([np.sqrt(np.mean(off[i][rows] ** 2, axis=0)) for i, rows in self.stretches])


@dataclass(frozen=True)
class Study:
    """An observer that was tuned.

    Attributes:
        kind: The observer.
        start_parameters: Its parameters before.
        numbers: The tuned numbers.
        insensitive_parameters: Names of numbers that are not tuned, since the estimated rate does not depend on them.
    """

    kind: str
    start_parameters: ParameterValues
    numbers: Sequence[TunedScalar]
    insensitive_parameters: Sequence[str]

    def common_figures(self) -> dict[str, SummaryValue]:
        """Return the figures that a tuning on simulations and one on logs print with `--json`."""
        return {
            "observer": self.kind,
            "given_parameters": plain(self.start_parameters),
            "tuned": [number.name for number in self.numbers],
            "idle": list(self.insensitive_parameters),
        }


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
        """Compare the tuned parameters with the given ones, by the interval of the ratio."""
        return self.judged(1.0)

    def judged(self, relevant: float) -> PairedVerdict:
        """Compare as `judged` does; given parameters with which the observer fails are worse than any."""
        return judged(self.ratio, relevant) if np.isfinite(self.given_rms).all() else "better"

    def limits(self, numbers: Sequence[TunedScalar]) -> list[str]:
        """Name the tuned numbers that ended at a limit of their range, with the limit."""
        ends = [(number, self.sizes[number.name]) for number in numbers if number.name in self.edges]
        return [f"{n.name} ({'lowest' if size / n.low < n.high / size else 'highest'}, {size:.4g})" for n, size in ends]

    def figures(self) -> dict[str, SummaryValue]:
        """Return the figures of a simulation and of a log, by the names that `--json` prints."""
        return {
            "parameters": plain(self.parameters),
            "at_a_limit": list(self.edges),
            "fit_rms_error_rad_s": self.fit_rms,
            "fit_given_rms_error_rad_s": self.fit_given_rms,
            "held_out_rms_error_rad_s": float(self.rms.mean()),
            "held_out_given_rms_error_rad_s": float(self.given_rms.mean()),
            "held_out_fit": self.fit,
            "held_out_given_fit": self.given_fit,
            "held_out_ratio": list(self.ratio),
            "verdict": self.verdict,
            "zero_estimate_rms_error_rad_s": self.zero_rms,
        }


class ParameterFit:
    """Fits an observer's numbers on some data and scores them on other, at one sensor noise after another.

    Args:
        kind: The observer's name.
        make: Makes the observer from its parameters.
        given: Parameters to start from and to compare with, where not the defaults.
        chosen: Names of the numbers to tune; by default all.
        ranges: Number -> smallest and largest size.
        starts: Starts of a search in several dimensions.

    Attributes:
        start_parameters: All given parameters.
        numbers: The tuned numbers; after the first fit those that the estimated rate depends on.
        insensitive_parameters: Names of the others.
    """

    def __init__(
        self,
        kind: str,
        make: MakeObserver,
        given: ParameterValues,
        chosen: Sequence[str],
        ranges: Mapping[str, tuple[float, float]] | None,
        starts: int = 2,
    ) -> None:
        self.kind, self._starts = kind, starts
        self.start_parameters = parameters_of(kind, make(**given), given)
        self.numbers = numbers_of(kind, self.start_parameters, make, chosen, ranges or {})
        self.insensitive_parameters: list[str] = []
        self._best: Mapping[str, float] = {}

    @property
    def study(self) -> dict[str, Any]:
        """What a `Study` has of it."""
        names = ("kind", "start_parameters", "numbers", "insensitive_parameters")
        return {name: getattr(self, name) for name in names}

    def level(
        self,
        make: Callable[..., Any],
        fitted: ScoringData,
        held_out: ScoringData,
        on_share: OnShare | None = None,
        noise: float = 0.0,
    ) -> NoiseLevelResult:
        """Search for the best parameters, and score them on held-out data.

        Args:
            make: Makes what the data score from parameters: an observer, or one for each log.
            fitted: The fitted data.
            held_out: The held-out data.
            on_share: Called with the completed share of the evaluations; it may raise `StopSearch`.
            noise: Noise density of the accelerometers, for the result [ug/sqrt(Hz)].

        Returns:
            The parameters and their scores.

        Raises:
            InputError: The rate depends on no number, or no parameters give an estimate that stays finite.
        """
        count, expected = 0, 1

        def errors(parameters: ParameterValues, data: ScoringData) -> np.ndarray:
            try:
                return data.errors(make(**parameters))
            except Exception:  # a user's observer may fail in any way, at parameters nobody has tried
                return np.full(data.zero_errors.shape, math.nan)

        def mean_error(parameters: ParameterValues) -> float:
            """Return the mean error of the fitted data [rad/s]; infinite if an observer fails."""
            rms = errors(parameters, fitted)
            return float(rms.mean()) if np.isfinite(rms).all() else math.inf

        def loss(sizes: Sequence[float]) -> float:
            nonlocal count
            count += 1
            if on_share:
                on_share(min(count / expected, 1.0))
            return mean_error(replaced(self.start_parameters, self._named(sizes)))

        given_loss = mean_error(self.start_parameters)
        if not self._best:
            with suppress(StopSearch):
                idle = insensitive_numbers(loss, self.numbers, given_loss)
                self.insensitive_parameters = [number.name for number in idle]
                self.numbers = [number for number in self.numbers if number not in idle]
            if not self.numbers:
                names = ", ".join(self.insensitive_parameters)
                raise InputError(f"the rate that {self.kind} estimates does not depend on {names}")
        count, expected = 0, evaluations(len(self.numbers))
        # The best values at the noise before are near the best at this one.
        near = [replace(n, start=self._best.get(n.name, n.start)) for n in self.numbers]
        found, best_loss = search(loss, near, starts=self._starts)
        if not math.isfinite(min(best_loss, given_loss)):
            raise InputError(f"{self.kind}: no parameters give an estimate that stays finite")
        rounded = self._named([float(f"{size:.{DIGITS}g}") for size in found])
        if given_loss <= best_loss and all(n.low <= abs(n.start) <= n.high for n in self.numbers):
            self._best = {n.name: abs(n.start) for n in self.numbers}  # a search stops within its tolerance
        elif math.isfinite(mean_error(replaced(self.start_parameters, rounded))):
            self._best = rounded
        else:  # beyond an open limit
            self._best = self._named(found)
        tuned = replaced(self.start_parameters, self._best)
        return NoiseLevelResult(
            noise_ug_rthz=noise,
            parameters=tuned,
            sizes=self._best,
            edges=[n.name for n in self.numbers if not n.low * AT_A_LIMIT < self._best[n.name] < n.high / AT_A_LIMIT],
            fit_rms=mean_error(tuned),
            fit_given_rms=given_loss,
            rms=errors(tuned, held_out),
            given_rms=errors(self.start_parameters, held_out),
            zero_rms=held_out.zero_rms,
            fell=fitted.fell + held_out.fell,
        )

    def _named(self, sizes: Sequence[float]) -> dict[str, float]:
        return {number.name: size for number, size in zip(self.numbers, sizes, strict=True)}

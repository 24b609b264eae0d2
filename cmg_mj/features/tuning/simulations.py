"""An observer tuned to the gyro of a scenario, on recordings of a loop that is closed on the gyro."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, NamedTuple

import numpy as np

from cmg_mj.core.axis import Feedback
from cmg_mj.core.errors import InputError
from cmg_mj.core.types import law_needs, reads_gyro
from cmg_mj.features.tuning.fit import NoiseLevelResult, OnShare, ParameterFit, ScoringData, Study
from cmg_mj.features.tuning.search import StopSearch, crossing
from cmg_mj.laws import LAW_CLASSES
from cmg_mj.observers import OBSERVER_CLASSES, Observer, make_observer
from cmg_mj.results.intervals import PairedVerdict
from cmg_mj.results.summary_keys import Summary, SummaryValue, finite
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import prepare
from cmg_mj.runs.open_loop import replay
from cmg_mj.runs.side_by_side import BatchJob, run_jobs
from cmg_mj.scenario.schema import ObserverSettings, Scenario
from cmg_mj.scenario.time_grid import common_period
from cmg_mj.stages.push import Window, inside, push_windows

WARM_UP_S = 2.0
"""Time before the window that is replayed as well, for the observer to settle [s]."""


def windows_of(scenario: Scenario) -> list[Window]:
    """Return the scored windows: from each push to one second after its end; the whole run without a push.

    Over a whole run with a push, an estimate of zero would have the smallest error: outside that second the plant
    hardly moves.
    """
    end = scenario.duration_s
    windows = push_windows(scenario.push) or [(0.0, end)]
    return [(start, min(stop, end)) for start, stop in windows if start < end] or windows


def window_of(scenario: Scenario) -> Window:
    """Return the start of the first window and the end of the last [s]."""
    windows = windows_of(scenario)
    return windows[0][0], windows[-1][1]


class Recorded(ScoringData):
    """Measurements and commands of some worlds, all of which stood, scored by the gyro.

    Args:
        trajectory: Trajectory from the warm-up to the window's end.
        windows: Times that are scored [s].
        fell: Number of worlds that fell and are discarded.
    """

    def __init__(self, trajectory: Trajectory, windows: Sequence[Window], fell: int = 0) -> None:
        self.trajectory, self.fell = trajectory, fell
        self.references = [trajectory["fog_rad_s"]]
        self.stretches = [(0, inside(trajectory["time_s"], windows))]

    def rates(self, observers: Observer) -> list[np.ndarray]:
        """See `ScoringData`."""
        return [replay(observers, self.trajectory).x2]


def tuning_scenario(scenario: Scenario, noise_ug_rthz: float | None = None) -> Scenario:
    """Return the scenario of the tuning experiment: the law fed by the gyro and the measured angles.

    No observer takes part in that loop, so one recording serves all observers; it ends with the window.

    Args:
        scenario: The experiment.
        noise_ug_rthz: Another noise density of the accelerometers [ug/sqrt(Hz)].

    Returns:
        The scenario to record.
    """
    sensors = scenario.sensors
    if noise_ug_rthz is not None:
        sensors = sensors.with_noise_density(noise_ug_rthz)
    period = scenario.plant.timestep_s or common_period(scenario)
    duration = math.ceil(window_of(scenario)[1] / period - 1e-9) * period
    feedback = scenario.controller.feedback
    if feedback == "observer" and law_needs(LAW_CLASSES.find(scenario.controller.kind)):
        feedback = "fog"
    observer = ObserverSettings(kind="finite_difference")  # its angles are the measured ones
    tuned = scenario.observer.kind
    changes = {"observer": observer, "sensors": sensors}
    if reads_gyro(OBSERVER_CLASSES.find(tuned)):  # so that the gyro is recorded
        changes["open_loop_observers"] = [tuned]
    return plain_loop(scenario, duration, feedback).model_copy(update=changes)


def plain_loop(scenario: Scenario, duration_s: float, feedback: Feedback) -> Scenario:
    """Return a scenario of another duration and feedback, without open-loop observers and trim."""
    controller = scenario.controller.model_copy(update={"feedback": feedback, "bias_trim_s": 0.0})
    return scenario.model_copy(update={"duration_s": duration_s, "controller": controller, "open_loop_observers": []})


def recorder(
    scenario: Scenario, requests: Sequence[tuple[range, float | None]], *, warm_up_s: float = WARM_UP_S
) -> Callable[[range, float | None], Recorded]:
    """Make the recordings of one scenario, in one batch where possible.

    Args:
        scenario: The scenario, which `tuning_scenario` changes; its observer takes no part.
        requests: The worlds' numbers, and another noise density of the accelerometers [ug/sqrt(Hz)], of each.
        warm_up_s: Time before the window that is kept [s].

    Returns:
        A function of a request's two values that returns the worlds that stood, the `recorded` of `tune`.

    Raises:
        InputError: Fewer than two worlds of a request stood.
        KeyboardInterrupt: The user interrupted.
    """
    jobs = [BatchJob([prepare(tuning_scenario(scenario, noise))] * len(worlds), worlds) for worlds, noise in requests]
    windows, recordings = windows_of(scenario), {}
    for request, job, result in zip(requests, jobs, run_jobs(jobs), strict=True):
        if result.interrupted:
            raise KeyboardInterrupt
        loop, stood = job.experiments[0].scenario, result.stood
        if stood.sum() < 2:
            raise InputError(
                f"{scenario.title or 'the scenario'}: with the law fed by the {loop.controller.feedback}, "
                f"{len(stood) - stood.sum()} of {len(stood)} worlds fell before {loop.duration_s:g} s: there is "
                "nothing to tune on"
            )
        assert result.trajectory is not None
        trajectory = result.trajectory.of_worlds(stood).between(windows[0][0] - warm_up_s, windows[-1][1])
        recordings[request] = Recorded(trajectory, windows, int((~stood).sum()))
    return lambda worlds, noise_ug_rthz: recordings[worlds, noise_ug_rthz]


def record(scenario: Scenario, worlds: range, noise_ug_rthz: float | None = None) -> Recorded:
    """Run one tuning experiment; see `recorder`."""
    return recorder(scenario, [(worlds, noise_ug_rthz)])(worlds, noise_ug_rthz)


def halves(worlds: int, noise_ug_rthz: Sequence[float]) -> list[tuple[range, float]]:
    """Return the requests of `tune`: worlds to fit and as many held out, at every noise."""
    spans = range(worlds), range(worlds, 2 * worlds)
    return [(span, density) for density in noise_ug_rthz for span in spans]


@dataclass(frozen=True)
class TuningResult(Study):
    """An observer tuned at one sensor noise or several.

    Attributes:
        scenario: The experiment.
        worlds: Number of worlds to fit; as many are held out for scoring.
        levels: Results by sensor noise, in ascending order.
    """

    scenario: Scenario
    worlds: int
    levels: Sequence[NoiseLevelResult]

    @property
    def title(self) -> str:
        """The table's."""
        return f"{self.scenario.title or 'Tuning'}: {self.kind}, seed {self.scenario.seed}"

    @property
    def rows(self) -> list[tuple[str, NoiseLevelResult, PairedVerdict | None]]:
        """Names, levels and verdicts of the table's rows."""
        return [(f"{level.noise_ug_rthz:g}", level, level.verdict) for level in self.levels]

    def opening(self) -> Iterator[str]:
        """Say what the errors are."""
        spans = ", ".join(f"{start:g} s to {end:g} s" for start, end in windows_of(self.scenario))
        yield f"RMS of the estimated rate less the gyro's, {spans}, on worlds that were not fitted."
        if not self.scenario.push:
            yield "There is no push: the window is the whole run, where an estimate of zero may do best."

    def closing(self) -> Iterator[str]:
        """Say at which noise the given parameters are the best ones."""
        where, noise = best_noise(self)
        if len(self.levels) < 2:
            return
        if where == "not bracketed":
            yield "The noises tried do not show at which one the given parameters are best."
        elif noise is None:
            yield f"The given parameters are best at a noise {where} these, if at any."
        elif len(self.numbers) == 1:
            yield f"The given parameters are best at about {noise:.0f} ug/rtHz."
        else:
            yield f"Among these noises the given parameters lose least at {noise:g} ug/rtHz."

    def figures(self) -> Summary:
        """Return the figures that `cmg-mj tune --json` prints."""
        best = best_noise(self)
        levels = [
            {
                "noise_density_ug_rthz": level.noise_ug_rthz,
                **level.figures(),
                "held_out_worlds": len(level.rms),
                "worlds_that_fell": level.fell,
            }
            for level in self.levels
        ]
        figures: dict[str, SummaryValue] = {
            "scenario": self.scenario.title,
            "seed": self.scenario.seed,
            "worlds_fitted": self.worlds,
            "window_s": list(window_of(self.scenario)),
            "scored_s": [list(window) for window in windows_of(self.scenario)],
            **self.common_figures(),
            "levels": levels,
            "given_best_at_noise_density_ug_rthz": best.noise_ug_rthz,
            **({"given_best_noise_is": best.where} if len(levels) > 1 else {}),
        }
        return finite(figures)


def tune(
    scenario: Scenario,
    *,
    worlds: int = 20,
    parameters: Sequence[str] = (),
    ranges: Mapping[str, tuple[float, float]] | None = None,
    noise_ug_rthz: Sequence[float] = (),
    warm_up_s: float = WARM_UP_S,
    starts: int = 2,
    recorded: Callable[[range, float], Recorded] | None = None,
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
        recorded: Returns recordings made before, as `recorder` does; by default they are made here, all at once.
        on_share: Called now and then with the completed share; if it raises `StopSearch`, the best so far are taken.

    Returns:
        The result. After an interrupt, it has the noise densities done until then.

    Raises:
        InputError: A name or a range does not fit, nothing can be tuned, or too many worlds fell.
        KeyboardInterrupt: The user interrupted before the first was done.
    """
    if worlds < 2:
        raise InputError(f"--worlds {worlds}: at least 2, for an interval")
    sensors, kind = scenario.sensors, scenario.observer.kind
    densities = sorted(dict.fromkeys(noise_ug_rthz or [sensors.accelerometer.noise_density_ug_rthz]))
    experiment = prepare(scenario)
    experiment.require_single_axis("tuning")
    dt, model, noise = experiment.design.constructor_arguments
    make = partial(make_observer, kind, dt, model, noise)
    fit = ParameterFit(kind, make, scenario.observer.parameters, parameters, ranges, starts)
    recorded = recorded or recorder(scenario, halves(worlds, densities), warm_up_s=warm_up_s)

    levels: list[NoiseLevelResult] = []
    for i, density in enumerate(densities):

        def share(done: float, i: int = i) -> None:
            if on_share:
                on_share((i + done) / len(densities))

        fitted, held_out = (recorded(*half) for half in halves(worlds, [density]))
        noise = replace(experiment.plant.parameters.noise(sensors.with_noise_density(density)), repeats=noise.repeats)
        try:
            levels.append(fit.level(partial(make_observer, kind, dt, model, noise), fitted, held_out, share, density))
            with suppress(StopSearch):
                share(1.0)
        except KeyboardInterrupt:
            if not levels:
                raise
            break
    return TuningResult(**fit.study, scenario=scenario, worlds=worlds, levels=levels)


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
    least = int(np.argmin(lost))
    if not np.isfinite(lost).all() or (len(study.numbers) == 1 and 0 < least < len(levels) - 1):
        return BestNoise("not bracketed", None)
    if 0 < least < len(levels) - 1:
        return BestNoise("found", levels[least].noise_ug_rthz)
    return BestNoise("above" if least else "below", None)


def tuned_scenario(study: TuningResult, level: NoiseLevelResult) -> Scenario:
    """Return the scenario with the tuned observer in the loop, at the level's sensor noise."""
    return study.scenario.model_copy(
        update={
            "observer": ObserverSettings.model_validate({"kind": study.kind, **level.parameters}),
            "sensors": study.scenario.sensors.with_noise_density(level.noise_ug_rthz),
        }
    )

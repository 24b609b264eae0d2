"""An observer tuned to the gyro of a scenario, on recordings of a loop that is closed on the gyro."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal, NamedTuple

import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.core.types import law_needs
from cmg_mj.features.tuning.fit import NoiseLevelResult, OnShare, ParameterFit, Stop
from cmg_mj.features.tuning.search import ParameterValues, TunedScalar, crossing, plain
from cmg_mj.laws import LAW_CLASSES
from cmg_mj.observers import Observer, make_observer
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


@dataclass(frozen=True)
class Recorded:
    """Measurements and commands of some worlds, all of which stood.

    Attributes:
        trajectory: Trajectory from the warm-up to the window's end.
        windows: Times that are scored [s].
        fell: Number of worlds that fell and are discarded.
    """

    trajectory: Trajectory
    windows: Sequence[Window]
    fell: int = 0

    @property
    def worlds(self) -> int:
        """Number of worlds."""
        return self.trajectory["y1_rad"].shape[1]

    @property
    def largest_acceleration(self) -> float:
        """Largest acceleration of the tilt, by differences of its true rate [rad/s^2]."""
        steps = np.diff(self.trajectory["x2_rad_s"], axis=0) / np.diff(self.trajectory["time_s"])[:, None]
        return float(np.abs(steps).max())

    @property
    def zero_rms(self) -> float:
        """Error of an estimate of zero: RMS of the gyro's rate over the windows, mean of the worlds [rad/s]."""
        return float(self._rms(np.zeros(())).mean())

    def errors(self, observer: Observer) -> np.ndarray:
        """Return the RMS of the estimated rate less the gyro's, (n_worlds,) [rad/s]; NaN on failure."""
        with np.errstate(all="ignore"):
            return self._rms(replay(observer, self.trajectory).x2)

    def _rms(self, rate: np.ndarray) -> np.ndarray:
        difference = rate - self.trajectory["fog_rad_s"]
        scored = inside(self.trajectory["time_s"], self.windows)
        return np.sqrt(np.mean(difference[scored] ** 2, axis=0))


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
    loop = {"feedback": feedback, "bias_trim_s": 0.0}
    return scenario.model_copy(
        update={
            "duration_s": duration,
            "controller": scenario.controller.model_copy(update=loop),
            "observer": ObserverSettings(kind="finite_difference"),  # its angles are the measured ones
            "open_loop_observers": [],
            "sensors": sensors,
        }
    )


RecordingRequest = tuple[range, float | None]
"""The worlds' numbers, and another noise density of the accelerometers [ug/sqrt(Hz)]."""


def recorder(
    scenario: Scenario, requests: Sequence[RecordingRequest], *, warm_up_s: float = WARM_UP_S
) -> Callable[[range, float | None], Recorded]:
    """Make the recordings of one scenario, in one batch where possible.

    Args:
        scenario: The scenario, which `tuning_scenario` changes; its observer takes no part.
        requests: The recordings.
        warm_up_s: Time before the window that is kept [s].

    Returns:
        A function of a request's two values that returns the worlds that stood, the `recorded` of `tune`.

    Raises:
        InputError: Fewer than two worlds of a request stood.
        KeyboardInterrupt: The user interrupted.
    """
    experiments = [prepare(tuning_scenario(scenario, noise)) for _, noise in requests]
    jobs = [BatchJob([one] * len(worlds), worlds) for one, (worlds, _) in zip(experiments, requests, strict=True)]
    windows, recordings = windows_of(scenario), {}
    for request, experiment, result in zip(requests, experiments, run_jobs(jobs), strict=True):
        if any(outcome.kind == "interrupted" for outcome in result.outcomes):
            raise KeyboardInterrupt
        loop, stood = experiment.scenario, result.stood
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
class TuningResult:
    """An observer tuned at one sensor noise or several.

    Attributes:
        scenario: The experiment.
        kind: The observer.
        start_parameters: Its parameters before.
        numbers: The tuned numbers.
        insensitive_parameters: Names of numbers that are not tuned, since the estimated rate does not depend on them.
        worlds: Number of worlds to fit; as many are held out for scoring.
        levels: Results by sensor noise, in ascending order.
    """

    scenario: Scenario
    kind: str
    start_parameters: ParameterValues
    numbers: Sequence[TunedScalar]
    insensitive_parameters: Sequence[str]
    worlds: int
    levels: Sequence[NoiseLevelResult]

    @property
    def window(self) -> Window:
        """Start and end of the scored time [s]."""
        return window_of(self.scenario)

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
            "observer": self.kind,
            "seed": self.scenario.seed,
            "worlds_fitted": self.worlds,
            "window_s": list(self.window),
            "scored_s": [list(window) for window in windows_of(self.scenario)],
            "given_parameters": plain(self.start_parameters),
            "tuned": [number.name for number in self.numbers],
            "idle": list(self.insensitive_parameters),
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
    stop: Stop = lambda: False,
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
        on_share: Called now and then with the completed share.
        stop: Whether to end the search early, with the best parameters so far.

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
    fit = ParameterFit(kind, make, scenario.observer.parameters, parameters, ranges, starts, stop)
    recorded = recorded or recorder(scenario, halves(worlds, densities), warm_up_s=warm_up_s)

    levels: list[NoiseLevelResult] = []
    for i, density in enumerate(densities):

        def share(done: float, i: int = i) -> None:
            if on_share:
                on_share((i + done) / len(densities))

        fitted, held_out = (recorded(*half) for half in halves(worlds, [density]))
        noise = experiment.plant.parameters.noise(sensors.with_noise_density(density))
        try:
            levels.append(fit.level(partial(make_observer, kind, dt, model, noise), fitted, held_out, share, density))
            share(1.0)
        except KeyboardInterrupt:
            if not levels:
                raise
            break
    return TuningResult(scenario, kind, fit.start_parameters, fit.numbers, fit.insensitive_parameters, worlds, levels)


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
    if least in (0, len(levels) - 1):
        return BestNoise("above" if least else "below", None)
    if len(study.numbers) > 1:
        return BestNoise("found", levels[least].noise_ug_rthz)
    return BestNoise("not bracketed", None)


def tuned_scenario(study: TuningResult, level: NoiseLevelResult) -> Scenario:
    """Return the scenario with the tuned observer in the loop, at the level's sensor noise."""
    return study.scenario.model_copy(
        update={
            "observer": ObserverSettings.model_validate({"kind": study.kind, **level.parameters}),
            "sensors": study.scenario.sensors.with_noise_density(level.noise_ug_rthz),
        }
    )

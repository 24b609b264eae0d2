"""An observer tuned to the gyro at one sensor noise or several."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, NamedTuple

import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.features.tuning.fit import NoiseLevelResult, OnShare, ParameterFit, Stop, level_of
from cmg_mj.features.tuning.parameters import (
    MakeObserver,
    ParameterValues,
    TunedScalar,
    narrowed,
    numbers_of,
    parameters_of,
)
from cmg_mj.features.tuning.search import crossing, evaluations
from cmg_mj.features.tuning.simulations import WARM_UP_S, Recorded, Window, halves, recorder
from cmg_mj.observers import make_observer
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.schema import ObserverSettings, Scenario


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
        recorded: Returns recordings made before; by default they are made here, all at once.
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
    accelerometer = scenario.sensors.accelerometer
    densities = sorted(dict.fromkeys(noise_ug_rthz or [accelerometer.noise_density_ug_rthz]))
    kind = scenario.observer.kind
    experiment = prepare(scenario)
    experiment.require_single_axis("tuning")
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
        fitter = ParameterFit(kind, _maker(experiment, density), start_parameters, fit, share, stop)
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
        noise = experiment.plant.parameters.noise(experiment.scenario.sensors.with_noise_density(noise_ug_rthz))
    return partial(make_observer, experiment.scenario.observer.kind, dt, model, noise)


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
    return study.scenario.model_copy(
        update={
            "observer": ObserverSettings.model_validate({"kind": study.kind, **level.parameters}),
            "sensors": study.scenario.sensors.with_noise_density(level.noise_ug_rthz),
        }
    )

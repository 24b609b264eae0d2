"""The observers of a paper tuned again: fitted to the gyro under several pushes and noises, scored on other seeds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from cmg_mj.features.tuning import NoiseLevelResult, halves, recorder, tune
from cmg_mj.papers.claim import OnShare
from cmg_mj.scenario.schema import Scenario

WARM_UP_S = 0.5
"""Replayed before the window: many times the time constants of the observers [s]."""

Pushes = Mapping[str, tuple[Sequence[str], Sequence[float]]]
"""Push -> settings `section.field=value` that differ, and noise densities [ug/sqrt(Hz)]: the same for all observers."""

Studies = Mapping[str, Mapping[str, Sequence[NoiseLevelResult]]]
"""Push -> observer -> what came out, one a noise."""


def tune_all(
    scenario_of: Callable[[str, Sequence[str]], Scenario],
    pushes: Pushes,
    parameters: Mapping[str, Sequence[str]],
    worlds: int,
    on_share: OnShare,
) -> dict[str, dict[str, Sequence[NoiseLevelResult]]]:
    """Tune every observer on the same recordings of every push, as many worlds fitted as held out.

    Args:
        scenario_of: Makes the scenario of an observer with settings that differ.
        pushes: The experiments.
        parameters: Observer -> the numbers of it that are tuned.
        worlds: Number of worlds that are fitted.
        on_share: Called with the share done.

    Returns:
        What came out of each of them.
    """
    studies: dict[str, dict[str, Sequence[NoiseLevelResult]]] = {}
    for i, (push, (settings, noises)) in enumerate(pushes.items()):
        shared = scenario_of(next(iter(parameters)), settings)
        recorded = recorder(shared, halves(worlds, noises), warm_up_s=WARM_UP_S)
        studies[push] = {}
        for name, numbers in parameters.items():
            studies[push][name] = tune(
                scenario_of(name, settings),
                worlds=worlds,
                parameters=numbers,
                noise_ug_rthz=noises,
                warm_up_s=WARM_UP_S,
                starts=1,
                recorded=recorded,
            ).levels
            on_share((i + len(studies[push]) / len(parameters)) / len(pushes))
    return studies


def figures_of(levels: Sequence[NoiseLevelResult]) -> dict[str, Any]:
    """Return what came out of one observer for a claim's figures, a value a noise."""
    return {
        "noise_density_ug_rthz": [level.noise_ug_rthz for level in levels],
        "tuned": [dict(level.sizes) for level in levels],
        "table_2_by_tuned_error": [level.ratio for level in levels],
        "tuned_error_rad_s": [level.rms.mean() for level in levels],
        "zero_estimate_error_rad_s": [level.zero_rms for level in levels],
        "tuned_is": [level.verdict for level in levels],
    }

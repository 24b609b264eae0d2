"""Settle time and estimation RMS of every observer in one world: the acceptance tests of the daily tier.

The bounds are those of a mean over 20 worlds, four standard deviations either way. A world's figure spreads by the root
of 20 more, so its bounds are as much wider: what they miss the slow tests on 20 worlds see.
"""

from __future__ import annotations

import math

import pytest

from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario
from tests.acceptance.cases import BAND, GROUP, STANDING, closed_loop_figures
from tests.acceptance.test_acceptance import BOUNDS, SEED


@pytest.mark.daily_cases("*-0")
@pytest.mark.parametrize("world", [0, 1])
@pytest.mark.parametrize("observer", STANDING)
def test_figures_of_one_world(observer: str, world: int) -> None:
    settings = [f"observer.kind={observer}", BAND, *STANDING[observer], f"seed={SEED}"]
    result = prepare(load_scenario("push_recovery", settings)).run(world=world)
    assert [outcome.kind for outcome in result.outcomes] == ["done"]
    for name, value in closed_loop_figures(result).items():
        low, high = BOUNDS["closed_loop"][observer][name]
        middle, half = 0.5 * (low + high), 0.5 * (high - low) * math.sqrt(GROUP)
        if name == "settle_time_s":  # the median of 20, which one noisy sample does not move
            half = max(half, 1.0)
        assert middle - half <= value <= middle + half, f"{observer}: {name} = {value:.4g}, {middle:.4g} -+ {half:.4g}"

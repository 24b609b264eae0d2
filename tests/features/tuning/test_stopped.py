"""A search that is stopped keeps the best parameters so far."""

from __future__ import annotations

import pytest

from cmg_mj.features.tuning import NoiseLevelResult, tune
from cmg_mj.scenario.loading import load_scenario
from tests.features.tuning.test_planted import recorder


def stopped_after(evaluations: int) -> NoiseLevelResult:
    asked = 0

    def stop() -> bool:
        nonlocal asked
        asked += 1
        return asked > evaluations

    scenario = load_scenario("observer_tuning").with_observer("linear")
    recorded = recorder("linear", lambda *_: {"tau": 0.0337123})
    return tune(scenario, worlds=4, recorded=recorded, stop=stop).levels[0]


@pytest.mark.parametrize("evaluations", [0, 1])
def test_at_once_the_given_ones(evaluations: int) -> None:
    level = stopped_after(evaluations)
    assert level.parameters["tau"] == 0.02
    assert level.rms == pytest.approx(level.given_rms)


def test_later_better_ones() -> None:
    level = stopped_after(25)
    assert level.rms.mean() < 0.1 * level.given_rms.mean()
    assert level.parameters["tau"] == pytest.approx(0.0337, rel=0.05)

"""Planted parameters are found: the gyro shows what an observer with known parameters would say."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

from cmg_mj.features.tuning import NoiseLevelResult, Recorded, best_noise, tune
from cmg_mj.features.tuning.search import StopSearch
from cmg_mj.observers import make_observer
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import prepare
from cmg_mj.runs.open_loop import replay
from cmg_mj.scenario.loading import load_scenario
from tests.features.tuning.user_observer import USER_OBSERVER
from tests.observers.reference import DT


def plant_parameters(
    kind: str, parameters: Mapping[str, Any], seed: int, gyro_noise: float, worlds: int = 4
) -> Recorded:
    """A recording whose gyro is an observer's estimate: the loss of those parameters is zero."""
    rng = np.random.default_rng(seed)
    t = np.arange(150) * DT
    phases = rng.uniform(0.0, 6.0, (2, worlds))
    y1 = 0.05 * np.sin(9.0 * t[:, None] + phases[0]) + 0.02 * np.sin(31.0 * t[:, None] + phases[1])
    y1 = y1 + rng.normal(0.0, 2e-3, y1.shape)
    u = 2.0 * np.sin(5.0 * t)[:, None] + rng.normal(0.0, 0.5, y1.shape)
    columns = {"time_s": t, "y1_rad": y1, "y2_rad": DT * np.cumsum(u, axis=0), "u_rad_s": u}
    columns["fog_rad_s"] = columns["x2_rad_s"] = np.zeros_like(y1)
    model = prepare(load_scenario("observer_tuning")).plant.reduced
    rate = replay(make_observer(kind, DT, model, **parameters), Trajectory(columns)).x2
    gyro = rate + rng.normal(0.0, gyro_noise, rate.shape) if gyro_noise else rate
    return Recorded(Trajectory({**columns, "fog_rad_s": gyro, "x2_rad_s": rate}), [(0.15, 0.75)])


def recorder(
    kind: str, truth: Callable[[float, bool], Mapping[str, Any]], gyro_noise: float = 0.0
) -> Callable[..., Recorded]:
    """Recordings with parameters that depend on the noise and on whether the worlds are held out."""

    def record_planted(worlds: range, noise_ug_rthz: float) -> Recorded:
        return plant_parameters(kind, truth(noise_ug_rthz, worlds.start > 0), worlds.start, gyro_noise)

    return record_planted


@pytest.mark.parametrize(
    ("kind", "parameters", "truth"),
    [
        ("linear", [], {"tau": 0.0337123}),
        pytest.param(
            "homogeneous",
            ["k1", "k2", "alpha"],
            {"k1": 33.0123, "k2": 410.123, "alpha": 0.77123},
            marks=pytest.mark.slow,
        ),
        pytest.param("ltv", ["Q[1]"], {"Q": (1.0, 2.34567e5, 1.0)}, marks=pytest.mark.slow),
        pytest.param(
            "luenberger",
            ["L[0][0]", "L[1][0]"],
            {"L": ((31.0123, 0.0), (320.123, 0.0), (0.0, 20.0))},
            marks=pytest.mark.slow,
        ),
    ],
)
def test_planted_parameters_are_found(kind: str, parameters: list[str], truth: dict) -> None:
    scenario = load_scenario("observer_tuning", observer=kind)
    study = tune(scenario, worlds=4, parameters=parameters, recorded=recorder(kind, lambda *_: truth), starts=1)
    (level,) = study.levels
    for name, value in truth.items():
        np.testing.assert_allclose(np.array(level.parameters[name], dtype=float), value, rtol=0.02)
    assert level.rms.max() < 0.02 * level.given_rms.min()
    assert level.verdict == "better"
    assert level.ratio.low > 20.0


def test_the_verdict_is_of_the_worlds_that_were_not_fitted() -> None:
    """Fitted worlds want 0.05, the others Table 2's: the fit is perfect and the verdict is worse."""
    truth = recorder("linear", lambda _, held_out: {"tau": 0.02 if held_out else 0.05}, gyro_noise=1e-4)
    study = tune(load_scenario("observer_tuning", observer="linear"), worlds=4, recorded=truth)
    (level,) = study.levels
    assert level.sizes["tau"] == pytest.approx(0.05, rel=0.01)
    assert level.fit_rms < 0.01 * level.fit_given_rms
    assert level.verdict == "worse"
    assert level.ratio.high < 1.0


def test_where_the_given_parameters_are_the_best_the_verdict_is_a_tie() -> None:
    recordings = recorder("linear", lambda *_: {"tau": 0.02})
    study = tune(load_scenario("observer_tuning", observer="linear"), worlds=4, recorded=recordings)
    assert study.levels[0].sizes == {"tau": 0.02}
    assert study.levels[0].verdict == "tie"


def test_the_verdict_is_that_of_the_ratio_in_the_table() -> None:
    """Differences of 1 in large errors, ratios either side of 1: the difference alone would say better."""
    tuned_rms = np.array([0.100, 0.101, 0.102, 10.0])
    recordings = recorder("linear", lambda *_: {"tau": 0.02})
    level = tune(load_scenario("observer_tuning", observer="linear"), worlds=4, recorded=recordings).levels[0]
    for factor, verdict in (([1.2, 1.3, 1.25, 1.22], "better"), ([0.9, 1.1, 1.0, 1.3], "tie"), ([0.8] * 4, "worse")):
        changed = dataclasses.replace(level, rms=tuned_rms, given_rms=tuned_rms * factor)
        assert changed.verdict == verdict
        assert (changed.ratio.low > 1.0) == (verdict == "better")
        assert (changed.ratio.high < 1.0) == (verdict == "worse")


@pytest.mark.slow
def test_numbers_that_do_not_matter_are_left_alone() -> None:
    recordings = recorder("ltv", lambda *_: {"Q": (1.0, 2.3e5, 1.0)})
    scenario = load_scenario("observer_tuning", observer="ltv")
    study = tune(scenario, worlds=4, recorded=recordings, parameters=["Q[1]", "Q[2]"])
    assert study.insensitive_parameters == ["Q[2]"]  # the third state decouples
    assert [n.name for n in study.numbers] == ["Q[1]"]
    assert np.array(study.levels[0].parameters["Q"])[2] == 1.0


@pytest.mark.slow
def test_the_noise_at_which_the_given_parameters_are_best() -> None:
    """Planted: the best tau is 0.02 sqrt(noise/300), a straight line on logarithms, so 0.02 is best at 300."""
    recordings = recorder("linear", lambda noise, _: {"tau": 0.02 * math.sqrt(noise / 300.0)})
    scenario = load_scenario("observer_tuning", observer="linear")
    study = tune(scenario, worlds=4, recorded=recordings, noise_ug_rthz=[800.0, 100.0, 400.0])
    assert [level.noise_ug_rthz for level in study.levels] == [100.0, 400.0, 800.0]
    best = best_noise(study)
    assert best.where == "found"
    assert best.noise_ug_rthz == pytest.approx(300.0, rel=0.02)
    for noises, side in (([400.0, 800.0], "below"), ([100.0, 200.0], "above")):
        study_beyond = tune(scenario, worlds=4, recorded=recordings, noise_ug_rthz=noises)
        assert best_noise(study_beyond) == (side, None)
    assert best_noise(dataclasses.replace(study, levels=study.levels[:1])) == ("not bracketed", None)


@pytest.mark.slow
def test_of_several_numbers_the_level_with_the_least_loss_counts() -> None:
    """Planted: the given epsilon is nearly the best at 200; the gyro's own noise keeps every loss from zero."""
    true_values = {100.0: 0.02, 200.0: 0.029, 400.0: 0.04}
    recordings = recorder(
        "linear_high_gain", lambda noise, _: {"epsilon": true_values[noise], "a1": 1.5}, gyro_noise=0.05
    )
    scenario = load_scenario("observer_tuning", observer="linear_high_gain")
    options: dict[str, Any] = {"worlds": 4, "recorded": recordings, "parameters": ["epsilon", "a1"], "starts": 1}
    study = tune(scenario, noise_ug_rthz=list(true_values), **options)
    assert best_noise(study) == ("found", 200.0)
    # Two noises have nothing between them: 200 may be the best, and what is below it was not tried.
    assert best_noise(tune(scenario, noise_ug_rthz=[200.0, 400.0], **options)) == ("below", None)


def test_parameters_at_which_an_observer_fails_are_no_candidates() -> None:
    """`UserObserver` raises below 0.05, is not a number above 5, and is refused above 10."""
    recordings = recorder("finite_difference", lambda *_: {})  # which is `UserObserver` with a gain of 1
    study = tune(load_scenario("observer_tuning", observer=USER_OBSERVER), worlds=4, recorded=recordings)
    assert study.levels[0].sizes["gain"] == pytest.approx(1.0, rel=0.01)


def test_given_parameters_that_lose_the_observer_are_worse_than_any() -> None:
    recordings = recorder("finite_difference", lambda *_: {})
    study = tune(load_scenario("observer_tuning", ["observer.gain=7.0"], USER_OBSERVER), worlds=4, recorded=recordings)
    assert study.levels[0].verdict == "better"
    assert study.levels[0].sizes["gain"] == pytest.approx(1.0, rel=0.01)


def stopped_after(evaluations: int) -> NoiseLevelResult:
    asked = 0

    def on_share(share: float) -> None:
        nonlocal asked
        asked += 1
        if asked > evaluations:
            raise StopSearch

    scenario = load_scenario("observer_tuning").with_observer("linear")
    recorded = recorder("linear", lambda *_: {"tau": 0.0337123})
    return tune(scenario, worlds=4, recorded=recorded, on_share=on_share).levels[0]


@pytest.mark.parametrize("evaluations", [0, 1])
def test_at_once_the_given_ones(evaluations: int) -> None:
    level = stopped_after(evaluations)
    assert level.parameters["tau"] == 0.02
    assert level.rms == pytest.approx(level.given_rms)


def test_later_better_ones() -> None:
    level = stopped_after(25)
    assert level.rms.mean() < 0.1 * level.given_rms.mean()
    assert level.parameters["tau"] == pytest.approx(0.0337, rel=0.05)

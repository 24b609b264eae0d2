"""When parameters tuned on a log are called better, what is said of limits, and what they do in a closed loop."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cmg_mj import load_scenario
from cmg_mj.features.replay.log import Log, ReadOptions
from cmg_mj.features.replay.reading import read_log
from cmg_mj.features.tuning import tune_on_logs
from cmg_mj.features.tuning.fit import judged
from cmg_mj.features.tuning.logs import LogStudy, LoopComparison, compare_in_loop, loop_scenario
from cmg_mj.features.tuning.save import study_table
from cmg_mj.results.intervals import Interval
from tests.features.replay.motion import COLUMNS, sine, write_csv
from tests.features.tuning.user_observer import printed


@pytest.mark.parametrize(
    ("ratio", "verdict"),
    [
        ((1.2, 1.1, 1.3), "better"),
        ((1.2, 0.9, 1.5), "tie"),
        ((1.004, 1.003, 1.005), "tie"),
        ((1.011, 1.010, 1.012), "better"),
        ((0.8, 0.7, 0.9), "worse"),
        ((0.995, 0.994, 0.996), "tie"),
    ],
)
def test_better_is_more_than_a_hundredth_and_beyond_chance(ratio: tuple, verdict: str) -> None:
    assert judged(Interval(*ratio)) == verdict


def log(folder: Path, noise: float = 0.0, seed: int = 0) -> Log:
    columns = {name: values[:2080] for name, values in sine().items()}
    columns["tilt_rad"] = columns["tilt_rad"] + noise * np.random.default_rng(seed).standard_normal(2080)
    return read_log(write_csv(folder / "log.csv", columns), ReadOptions(COLUMNS))


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> LogStudy:
    ranges = {"tau": (0.019, 0.021)}
    return tune_on_logs([log(tmp_path_factory.mktemp("logs"))], "linear", settle_s=0.1, ranges=ranges)


def test_a_limit_is_named(study: LogStudy) -> None:
    assert study.level.limits(study.numbers) == ["tau (lowest, 0.019)"]


def test_a_tie_says_why(study: LogStudy) -> None:
    """Made 0.5 % apart without chance, and 5 % with it; the figures of the level itself stay."""
    given = study.level.given_rms
    for rms in (given / 1.005, given / np.linspace(0.5, 2.0, len(given))):
        changed = replace(study, level=replace(study.level, rms=rms))
        assert changed.verdict == changed.figures()["verdict"] == "tie"
        assert "A tie: the difference is not beyond chance, or is less than 1%" in printed(study_table(changed))


@pytest.mark.parametrize(
    ("alone", "ratio", "verdict"),
    [
        ((6, 0), Interval(1.5, 1.4, 1.6), "worse"),  # 2/2^6 = 3 %
        ((0, 6), None, "better"),
        ((5, 0), None, "tie"),  # 2/2^5 = 6 %
        ((0, 1), Interval(0.4, 0.3, 0.5), "worse"),
        ((0, 0), Interval(0.999, 0.998, 0.9995), "tie"),
    ],
)
def test_falls_count_only_beyond_chance(alone: tuple[int, int], ratio: Interval | None, verdict: str) -> None:
    assert LoopComparison("Push", 5.0, 16, 8, 8, *alone, ratio).verdict == verdict


@pytest.mark.slow
def test_what_is_best_on_a_log_may_fall_in_a_loop(tmp_path: Path) -> None:
    """On a log without noise the least time constant is the best; on the rig its noise drowns everything."""
    noiseless = log(tmp_path)
    loop = loop_scenario(None, noiseless)
    assert loop is not None
    study = tune_on_logs([noiseless], "linear", settle_s=0.1, ranges={"tau": (2e-4, 0.1)}, closed_loop=loop)
    assert study.verdict == "better"
    assert study.loop is not None
    assert study.loop.verdict == "worse"
    assert study.loop.duration_s == 5.0


@pytest.mark.slow
def test_the_same_parameters_are_no_different_in_a_loop() -> None:
    same = {"tau": 0.02}
    comparison = compare_in_loop(load_scenario("push_recovery", []), "linear", same, same, worlds=4)
    assert comparison.verdict == "tie"
    assert comparison.tilt_rms_ratio == Interval(1.0, 1.0, 1.0)
    assert (comparison.given_stood, comparison.tuned_stood) == (4, 4)


def test_parameters_that_the_loop_refuses_are_said() -> None:
    scenario = load_scenario("push_recovery", [])
    comparison = compare_in_loop(scenario, "linear", {"tau": 0.02}, {"tau": -1.0})
    assert "tau" in comparison.refused
    assert comparison.verdict is None

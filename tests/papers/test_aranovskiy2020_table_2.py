"""Table 2 of aranovskiy2020 tuned again, on other seeds than the report's."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from cmg_mj.features.tuning import NoiseLevelResult, TuningResult
from cmg_mj.papers.aranovskiy2020 import table_2
from cmg_mj.papers.aranovskiy2020.paper import OBSERVERS, TABLE_2
from cmg_mj.papers.aranovskiy2020.table_2 import Trial, nearest_joint, procedure_claim, run_trials
from cmg_mj.results.intervals import Interval
from cmg_mj.scenario.loading import load_scenario

SEED = 910_001
SCENARIO = load_scenario("observer_tuning")
ONE = Interval(1.0, 0.99, 1.01)
# Two numbers of three, which takes a third of the time.
TWO_OF_THREE = dataclasses.replace(table_2.HOMOGENEOUS, parameters=["k2", "alpha"])
STRONG = dataclasses.replace(table_2.STRONG, noise_ug_rthz=(200.0, 400.0))


def test_tuned_again_on_other_seeds() -> None:
    """Under this push (9) is best between 200 and 400, (10) near 400, (11) far from best at either."""
    cases = (table_2.LINEAR, table_2.LTV, TWO_OF_THREE)
    studies = table_2.all_studies(SEED, 6, lambda share: None, pushes=(STRONG,), cases=cases)
    for experiment in table_2.experiments(studies):
        # Recorded once for all: an estimate of zero has the same error in every observer's study.
        assert len({level.zero_rms for level in experiment.levels.values()}) == 1
        for name, level in experiment.levels.items():
            print(experiment.words, name, level.sizes, level.ratio, level.verdict)
            assert level.verdict in ("better", "tie")
            assert level.ratio.high > 1.0
    low, high = (experiment.levels for experiment in table_2.experiments(studies))
    assert low["linear"].sizes["tau"] < 0.02 < high["linear"].sizes["tau"]
    assert low["ltv"].ratio.mean > 1.04
    assert high["ltv"].ratio.mean < 1.02
    assert low["homogeneous"].ratio.low > high["homogeneous"].ratio.high > 1.2


def test_the_tuned_are_set_in_the_loop() -> None:
    """Table 2's own gains are as good as Table 2's, and slower ones worse by far."""
    table_level = dataclasses.replace(level(200.0, 1.0), parameters=TABLE_2["linear"])
    slow_level = dataclasses.replace(table_level, sizes={"tau": 0.04}, parameters={"tau": 0.04})
    ratios = table_2.loop_ratios([(table_2.LINEAR, case, STRONG) for case in (table_level, slow_level)], 3, SEED)
    assert ratios[0] == pytest.approx((1.0, 1.0, 1.0))
    assert ratios[1].high < 0.5  # Table 2's by that of the slow


# --- verdicts, from made-up levels ----------------------------------------------------------------------------

WAVE = 0.001 * np.array([1.0, -1.0, 1.0, -1.0])


def level(noise: float, ratio: float, tuned: float = 0.05, zero: float = 0.1, scatter: float = 1.0) -> NoiseLevelResult:
    """Table 2's error by the tuned's is the ratio, beyond chance if its scatter is small."""
    rms = np.full(4, tuned)
    return NoiseLevelResult(
        noise, {}, {"tau": 0.02}, [], tuned, ratio * tuned, rms, ratio * rms + scatter * WAVE, zero, 0.0, 0
    )


def make_studies(*levels: tuple[float, dict[str, float], float]) -> table_2.Studies:
    """Studies of one push: noise, ratios by observer, and the error of an estimate of zero."""

    def study(name: str) -> TuningResult:
        levels_of_name = [level(noise, of_name[name], zero=zero) for noise, of_name, zero in levels]
        return TuningResult(SCENARIO, name, TABLE_2[name], [], [], 4, (2.0, 3.1), levels_of_name)

    return {"a push": {name: study(name) for name in OBSERVERS}}


def ratios(linear: float, ltv: float, homogeneous: float) -> dict[str, float]:
    return {"linear": linear, "ltv": ltv, "homogeneous": homogeneous}


GOOD, BAD = ratios(1.04, 1.0, 1.03), ratios(1.02, 1.04, 1.3)


def test_the_joint_experiment_is_the_one_whose_worst_loses_least() -> None:
    nearest = nearest_joint(make_studies((100.0, ratios(1.0, 1.0, 1.4), 0.1), (200.0, ratios(1.2, 1.2, 1.2), 0.1)))
    assert nearest.words == "a push, 200 ug/rtHz"
    assert nearest.largest_ratio == pytest.approx(1.2, rel=1e-3)
    # Where zero is closer than the tuned nobody would tune, however good the given ones.
    nearest = nearest_joint(make_studies((100.0, BAD, 0.1), (200.0, GOOD, 0.049)))
    assert nearest.noise_ug_rthz == 100.0
    assert not nearest_joint(make_studies((100.0, BAD, 0.01), (200.0, GOOD, 0.01))).beats_zero


def test_three_lines_of_one_experiment() -> None:
    studies = make_studies((100.0, BAD, 0.1), (200.0, GOOD, 0.1))
    assert table_2.joint_claim(studies).holds
    experiment = nearest_joint(studies)
    claims = [table_2.table_2_claim(case, studies, experiment) for case in table_2.CASES]
    assert [claim.place for claim in claims] == ["Table 2, (9)", "Table 2, (10)", "Table 2, (11)"]
    assert all(claim.holds for claim in claims)
    assert {claim.verdict for claim in claims} == {"cannot be tested"}  # the recording is not given
    assert claims[2].figures["a push"]["table_2_by_tuned_error"][0].mean == pytest.approx(1.3, rel=1e-3)


def test_two_lines_of_one_experiment() -> None:
    studies = make_studies((100.0, BAD, 0.1))
    claim = table_2.joint_claim(studies)
    assert (claim.verdict, claim.holds) == ("cannot be tested", False)
    assert "(11) is not the best" in claim.reason
    holds = [table_2.table_2_claim(case, studies, nearest_joint(studies)).holds for case in table_2.CASES]
    assert holds == [True, True, False]


def test_nothing_is_tuned_where_zero_is_closer() -> None:
    studies = make_studies((100.0, GOOD, 0.04))
    claim = table_2.joint_claim(studies)
    assert (claim.verdict, claim.holds) == ("cannot be tested", False)
    assert "zero is better still" in claim.reason
    assert not table_2.table_2_claim(table_2.LINEAR, studies, nearest_joint(studies)).holds
    assert procedure_claim(studies, []).verdict == "not reproduced"


def test_best_is_a_tie_or_what_rounding_costs() -> None:
    assert table_2.is_best(level(100.0, 1.04, scatter=0.01))
    assert not table_2.is_best(level(100.0, 1.06, scatter=0.01))
    assert table_2.is_best(level(100.0, 1.06, scatter=10.0))  # which may be chance


def test_a_fit_to_the_gyro_need_not_be_one_for_the_loop() -> None:
    studies = make_studies((100.0, GOOD, 0.1), (200.0, GOOD, 0.04))
    quiet, noisy = table_2.experiments(studies)
    loop = {"linear": Interval(0.8, 0.7, 0.9), "ltv": ONE, "homogeneous": Interval(1.2, 1.1, 1.3)}
    claim = procedure_claim(studies, [Trial(quiet, loop), Trial(noisy, dict.fromkeys(OBSERVERS, ONE))])
    assert claim.verdict == "reproduced within stated conditions"
    assert "In 1 of the 2 experiments tried" in claim.reason
    assert "the tuned are worse than Table 2's for (9) at a push, 100 ug/rtHz." in claim.reason
    assert "At a push, 200 ug/rtHz zero is closer than (9), (10) and (11) at their best" in claim.reason
    assert Trial(quiet, loop).worse_in_loop == ["(9)"]
    assert Trial(quiet, loop).worse_than_zero == []
    fallen = Trial(quiet, dict.fromkeys(OBSERVERS, Interval(float("nan"), float("-inf"), float("inf"))))
    assert fallen.worse_in_loop == []
    assert procedure_claim(studies, [Trial(quiet, dict.fromkeys(OBSERVERS, ONE))]).reason.endswith(
        "worse than Table 2's."
    )


def test_the_loops_are_those_of_the_default_and_of_the_joint_experiment(monkeypatch: pytest.MonkeyPatch) -> None:
    requests = []

    def compare(
        trials: list[tuple[table_2.Tuning, NoiseLevelResult, table_2.Push]], worlds: int, seed: int
    ) -> list[Interval]:
        requests.extend((case.observer, level.noise_ug_rthz, push.words) for case, level, push in trials)
        return [ONE] * len(trials)

    monkeypatch.setattr("cmg_mj.papers.aranovskiy2020.table_2.loop_ratios", compare)
    studies = {STRONG.words: make_studies((200.0, GOOD, 0.1), (400.0, BAD, 0.1))["a push"]}
    first = next(table_2.experiments(studies))
    default, joint_trial = run_trials(studies, first, lambda share: None)
    assert default.experiment.words == "1 N m, e = 0.5 deg, 400 ug/rtHz"
    assert joint_trial.experiment.words == first.words
    assert requests == [(name, noise, STRONG.words) for noise in (400.0, 200.0) for name in OBSERVERS]

"""Table 2 of aranovskiy2020 tuned again, on other seeds than the report's."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from cmg_mj.papers.aranovskiy2020 import joint, retuned, table_2
from cmg_mj.papers.aranovskiy2020.joint import nearest_joint
from cmg_mj.papers.aranovskiy2020.paper import OBSERVERS, TABLE_2
from cmg_mj.papers.aranovskiy2020.tuning_procedure import Trial, procedure_claim, run_trials
from cmg_mj.results.intervals import Interval
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.studies.tuning import NoiseLevelResult, TuningResult

SEED = 910_001
SCENARIO = load_scenario("observer_tuning")
ONE = Interval(1.0, 0.99, 1.01)
# Two numbers of three, which takes a third of the time.
TWO_OF_THREE = dataclasses.replace(retuned.HOMOGENEOUS, parameters=["k2", "alpha"])
STRONG = dataclasses.replace(retuned.STRONG, noise_ug_rthz=(200.0, 400.0))


def test_tuned_again_on_other_seeds() -> None:
    """Under this push (9) is best between 200 and 400, (10) near 400, (11) far from best at either."""
    cases = (retuned.LINEAR, retuned.LTV, TWO_OF_THREE)
    found = retuned.all_studies(SEED, 6, lambda share: None, pushes=(STRONG,), cases=cases)
    for together in joint.experiments(found):
        # Recorded once for all: an estimate of zero has the same error in every observer's study.
        assert len({level.zero_rms for level in together.levels.values()}) == 1
        for name, level in together.levels.items():
            print(together.words, name, level.sizes, level.ratio, level.verdict)
            assert level.verdict in ("better", "tie")
            assert level.ratio.high > 1.0
    low, high = (together.levels for together in joint.experiments(found))
    assert low["linear"].sizes["tau"] < 0.02 < high["linear"].sizes["tau"]
    assert low["ltv"].ratio.mean > 1.04
    assert high["ltv"].ratio.mean < 1.02
    assert low["homogeneous"].ratio.low > high["homogeneous"].ratio.high > 1.2


def test_the_tuned_are_set_in_the_loop() -> None:
    """Table 2's own gains are as good as Table 2's, and slower ones worse by far."""
    same = dataclasses.replace(level(200.0, 1.0), parameters=TABLE_2["linear"])
    slow = dataclasses.replace(same, sizes={"tau": 0.04}, parameters={"tau": 0.04})
    found = retuned.compare_in_loop([(retuned.LINEAR, each, STRONG) for each in (same, slow)], 3, SEED)
    assert found[0] == pytest.approx((1.0, 1.0, 1.0))
    assert found[1].high < 0.5  # Table 2's by that of the slow


# --- verdicts, from made-up levels ----------------------------------------------------------------------------

WAVE = 0.001 * np.array([1.0, -1.0, 1.0, -1.0])


def level(noise: float, ratio: float, tuned: float = 0.05, zero: float = 0.1, scatter: float = 1.0) -> NoiseLevelResult:
    """Table 2's error by the tuned's is the ratio, beyond chance if its scatter is small."""
    rms = np.full(4, tuned)
    return NoiseLevelResult(
        noise, {}, {"tau": 0.02}, [], tuned, ratio * tuned, rms, ratio * rms + scatter * WAVE, zero, 0.0, 0
    )


def made(*levels: tuple[float, dict[str, float], float]) -> retuned.Studies:
    """Studies of one push: noise, ratios by observer, and the error of an estimate of zero."""

    def study(name: str) -> TuningResult:
        at = [level(noise, of_name[name], zero=zero) for noise, of_name, zero in levels]
        return TuningResult(SCENARIO, name, TABLE_2[name], [], [], 4, (2.0, 3.1), at)

    return {"a push": {name: study(name) for name in OBSERVERS}}


def ratios(linear: float, ltv: float, homogeneous: float) -> dict[str, float]:
    return {"linear": linear, "ltv": ltv, "homogeneous": homogeneous}


GOOD, BAD = ratios(1.04, 1.0, 1.03), ratios(1.02, 1.04, 1.3)


def test_the_joint_experiment_is_the_one_whose_worst_loses_least() -> None:
    found = nearest_joint(made((100.0, ratios(1.0, 1.0, 1.4), 0.1), (200.0, ratios(1.2, 1.2, 1.2), 0.1)))
    assert found.words == "a push, 200 ug/rtHz"
    assert found.largest_ratio == pytest.approx(1.2, rel=1e-3)
    # Where zero is closer than the tuned nobody would tune, however good the given ones.
    found = nearest_joint(made((100.0, BAD, 0.1), (200.0, GOOD, 0.049)))
    assert found.noise_ug_rthz == 100.0
    assert not nearest_joint(made((100.0, BAD, 0.01), (200.0, GOOD, 0.01))).beats_zero


def test_three_lines_of_one_experiment() -> None:
    found = made((100.0, BAD, 0.1), (200.0, GOOD, 0.1))
    assert joint.joint_claim(found).verdict == "reproduced within stated conditions"
    together = nearest_joint(found)
    claims = [table_2.table_2_claim(case, found, together) for case in retuned.CASES]
    assert [claim.place for claim in claims] == ["Table 2, (9)", "Table 2, (10)", "Table 2, (11)"]
    assert {claim.verdict for claim in claims} == {"reproduced within stated conditions"}
    assert claims[2].figures["a push"]["table_2_by_tuned_error"][0].mean == pytest.approx(1.3, rel=1e-3)


def test_two_lines_of_one_experiment() -> None:
    found = made((100.0, BAD, 0.1))
    claim = joint.joint_claim(found)
    assert claim.verdict == "not reproduced"
    assert "(11) is not the best" in claim.reason
    verdicts = [table_2.table_2_claim(case, found, nearest_joint(found)).verdict for case in retuned.CASES]
    assert verdicts == ["reproduced within stated conditions"] * 2 + ["not reproduced"]


def test_nothing_is_tuned_where_zero_is_closer() -> None:
    found = made((100.0, GOOD, 0.04))
    claim = joint.joint_claim(found)
    assert claim.verdict == "not reproduced"
    assert "zero is better still" in claim.reason
    assert table_2.table_2_claim(retuned.LINEAR, found, nearest_joint(found)).verdict == "not reproduced"
    assert procedure_claim(found, []).verdict == "not reproduced"


def test_best_is_a_tie_or_what_rounding_costs() -> None:
    assert joint.is_best(level(100.0, 1.04, scatter=0.01))
    assert not joint.is_best(level(100.0, 1.06, scatter=0.01))
    assert joint.is_best(level(100.0, 1.06, scatter=10.0))  # which may be chance


def test_a_fit_to_the_gyro_need_not_be_one_for_the_loop() -> None:
    found = made((100.0, GOOD, 0.1), (200.0, GOOD, 0.04))
    at, beaten = joint.experiments(found)
    loop = {"linear": Interval(0.8, 0.7, 0.9), "ltv": ONE, "homogeneous": Interval(1.2, 1.1, 1.3)}
    claim = procedure_claim(found, [Trial(at, loop), Trial(beaten, dict.fromkeys(OBSERVERS, ONE))])
    assert claim.verdict == "reproduced within stated conditions"
    assert "In 1 of the 2 experiments tried" in claim.reason
    assert "the tuned are worse than Table 2's for (9) at a push, 100 ug/rtHz." in claim.reason
    assert "At a push, 200 ug/rtHz zero is closer than (9), (10) and (11) at their best" in claim.reason
    assert Trial(at, loop).worse_in_loop == ["(9)"]
    assert Trial(at, loop).worse_than_zero == []
    fallen = Trial(at, dict.fromkeys(OBSERVERS, Interval(float("nan"), float("-inf"), float("inf"))))
    assert fallen.worse_in_loop == []
    assert procedure_claim(found, [Trial(at, dict.fromkeys(OBSERVERS, ONE))]).reason.endswith("worse than Table 2's.")


def test_the_loops_are_those_of_the_default_and_of_the_joint_experiment(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def looped(
        tried: list[tuple[retuned.TuningCase, NoiseLevelResult, retuned.Push]], worlds: int, seed: int
    ) -> list[Interval]:
        asked.extend((case.observer, level.noise_ug_rthz, push.words) for case, level, push in tried)
        return [ONE] * len(tried)

    monkeypatch.setattr("cmg_mj.papers.aranovskiy2020.tuning_procedure.compare_in_loop", looped)
    found = {STRONG.words: made((200.0, GOOD, 0.1), (400.0, BAD, 0.1))["a push"]}
    first = next(joint.experiments(found))
    default, other = run_trials(found, first, lambda share: None)
    assert default.experiment.words == "1 N m, e = 0.5 deg, 400 ug/rtHz"
    assert other.experiment.words == first.words
    assert asked == [(name, noise, STRONG.words) for noise in (400.0, 200.0) for name in OBSERVERS]

"""Table 2 of aranovskiy2020 tuned again, on other seeds than the report's."""

from __future__ import annotations

import dataclasses
from functools import cache

import pytest

from cmg_mj.papers.aranovskiy2020 import retuned
from cmg_mj.papers.aranovskiy2020.paper import OBSERVERS
from cmg_mj.papers.aranovskiy2020.table_2 import table_2_claim
from cmg_mj.papers.aranovskiy2020.tuning_procedure import procedure_claim
from cmg_mj.tuning import Study, best_noise

SEED = 910_001
CASES = {
    "linear": dataclasses.replace(retuned.LINEAR, noise_ug_rthz=(200.0, 400.0)),
    "ltv": dataclasses.replace(retuned.LTV, noise_ug_rthz=(400.0,)),
    # Two numbers of three, which takes a third of the time; 3200 is the best noise for any two of them.
    "homogeneous": dataclasses.replace(
        retuned.HOMOGENEOUS, parameters=["k2", "alpha"], noise_ug_rthz=(400.0, 3200.0, 6400.0)
    ),
}

recorded = retuned.recorder()


@cache
def study(observer: str) -> Study:
    return retuned.study_of(CASES[observer], SEED, 8, recorded=recorded)


@pytest.mark.parametrize("observer", CASES)
def test_tuned_gains_are_not_worse_on_held_out_seeds(observer: str) -> None:
    """At the default noise: better or a tie. For (11), Table 2's are far from the best under this push."""
    level = retuned.at_default(study(observer))
    print(observer, level.sizes, level.ratio, level.verdict)
    assert level.verdict in ("better", "tie")
    assert level.ratio.high > 1.0
    if observer == "ltv":
        assert level.ratio.mean < 1.02
    if observer == "homogeneous":
        assert level.ratio.low > 1.2


def test_noise_at_which_table_2s_tau_is_the_best() -> None:
    best = best_noise(study("linear")).noise_ug_rthz
    assert best is not None
    assert 200.0 < best < 330.0


def test_noise_at_which_table_2s_homogeneous_gains_lose_least() -> None:
    case, found = retuned.HOMOGENEOUS, study("homogeneous")
    claim = table_2_claim(case, found)
    assert best_noise(found) == ("found", 3200.0)
    assert claim.verdict == "reproduced within stated conditions"
    assert "There an estimate of zero is closer to the gyro than either." in claim.why
    # Two noises have nothing between them: the claim may not say that there is no such noise.
    two = dataclasses.replace(found, levels=found.levels[:2])
    assert best_noise(two) == ("above", None)
    claim = table_2_claim(case, two)
    assert claim.verdict == "not reproduced"
    assert "do not bracket" in claim.why


def test_when_an_estimate_of_zero_is_closer() -> None:
    level = retuned.at_default(study("homogeneous"))
    tuned, given = level.rms.mean(), level.given_rms.mean()
    assert tuned < given
    below, between = (dataclasses.replace(level, zero_rms=zero) for zero in (0.9 * tuned, 0.5 * (tuned + given)))
    assert retuned.zero_is_closer(below)
    assert not retuned.zero_is_closer(between)


def test_a_fit_that_does_not_carry_over_is_not_reproduced() -> None:
    (level,) = study("ltv").levels
    studies = dict.fromkeys(OBSERVERS, study("ltv"))
    assert procedure_claim(studies).verdict.startswith("reproduced")
    studies["ltv"] = dataclasses.replace(study("ltv"), levels=[dataclasses.replace(level, rms=1.2 * level.rms)])
    assert procedure_claim(studies).verdict == "not reproduced"

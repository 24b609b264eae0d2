"""dao2023's verdicts on made-up errors, each of which one part of a claim turns on."""

from __future__ import annotations

import numpy as np
import pytest

from cmg_mj.papers.dao2023 import figures, theory
from cmg_mj.papers.dao2023.figures import SIGMAS, Errors, Study

T = np.linspace(0.0, 200.0, 401)
WITHIN = "reproduced within stated conditions"


def errors(settle: dict[float, float], state: float = 0.05) -> Errors:
    """Two motions whose exogenous errors leave the band at a time a weight; the state's tail has one size."""
    exogenous = np.zeros((len(T), len(SIGMAS), 2, 3))
    for i, sigma in enumerate(SIGMAS):
        exogenous[settle[sigma] > T, i] = 5.0
    return Errors(T, np.full((len(T), len(SIGMAS), 2, 2), state / np.sqrt(2.0)), exogenous)


def study(settle: dict[float, float], state: float = 0.05, plain: float = 0.3) -> Study:
    conventional = Errors(T, np.full((len(T), 1, 2, 2), plain / np.sqrt(2.0)), np.zeros((len(T), 1, 2, 2)))
    return Study(errors(settle, state), conventional, 1.0)


AS_PRINTED = {10.0: 150.0, 1000.0: 50.0, 0.1: 190.0}


def test_conclusion_holds_for_the_weights_tested() -> None:
    """As the conclusion that the paper draws from them it takes one beyond, too."""

    def claim(**changed: float) -> tuple[str, bool]:
        settle = AS_PRINTED | {10_000.0: 20.0} | {float(key[1:].replace("_", ".")): t for key, t in changed.items()}
        result = figures.larger_gains(study(settle))
        return result.verdict, figures.TESTED in result.reason

    assert claim() == ("illustrated", False)
    assert claim(s10000=170.0) == ("not reproduced", True)  # it turns round beyond them
    assert claim(s1000=160.0) == ("not reproduced", False)
    assert claim(s0_1=140.0) == ("not reproduced", False)


def test_settling_order_needs_both_steps() -> None:
    def verdict(settle: dict[float, float]) -> str:
        return figures.settling_order(study(settle | {10_000.0: 20.0})).verdict

    assert verdict(AS_PRINTED) == WITHIN
    assert verdict(AS_PRINTED | {1000.0: 160.0}) == "not reproduced"
    assert verdict(AS_PRINTED | {0.1: 100.0}) == "not reproduced"
    assert verdict(dict.fromkeys(SIGMAS, 500.0)) == "not reproduced"  # none settles


@pytest.mark.parametrize(
    ("state", "plain", "two_a", "two_b"),
    [
        (0.05, 0.3, WITHIN, WITHIN),
        (0.15, 0.3, WITHIN, "not reproduced"),
        (0.05, 0.1, "not reproduced", WITHIN),
        (0.05, 0.04, "not reproduced", "not reproduced"),
    ],
)
def test_figure_2(state: float, plain: float, two_a: str, two_b: str) -> None:
    result = study(AS_PRINTED | {10_000.0: 20.0}, state, plain)
    assert figures.conventional(result).verdict == two_a
    assert figures.proposed(result).verdict == two_b


def test_soon_is_a_threshold_of_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    """The paper has none: neither too slow nor quick enough for ours says anything of it."""
    for factor, holds in ((9.9, True), (10.1, False)):
        times = factor * np.array([6.0, 6.0]), np.array([6.0, 6.0])
        monkeypatch.setattr(figures, "state_settle_times", lambda errors, times=times: times)
        claim = figures.speed_claim(study(AS_PRINTED | {10_000.0: 20.0}))
        assert (claim.verdict, claim.holds) == ("cannot be tested", holds)
        assert claim.reason.startswith("The paper gives no time")


def test_parameters_at_the_end() -> None:
    result = study(AS_PRINTED | {10_000.0: 20.0})
    assert figures.parameters(result).verdict == WITHIN
    result.proposed.exogenous[-1, 1, 0, 1] = 2e-3
    assert figures.parameters(result).verdict == "not reproduced"


def test_what_the_observer_finds_decides_what_is_meant(monkeypatch: pytest.MonkeyPatch) -> None:
    """(10) or (14): both are seen, a third is not."""
    for amplitude, verdict, scales_d in ((2.0, WITHIN, True), (1.0, WITHIN, False), (1.5, "not reproduced", True)):
        monkeypatch.setattr(theory, "amplitude_under_10", lambda a=amplitude: np.array([a, a]))
        claim = theory.misprint_claim()
        assert claim.verdict == verdict
        assert ("(14), not (10), scales d." in claim.conditions) is scales_d

"""A sweep's report and what the terminal says: read as somebody who has not seen the tables."""

from __future__ import annotations

from typing import Any

import numpy as np

from cmg_mj.features.sweeps.cells import Trials
from cmg_mj.features.sweeps.report import report, summary
from cmg_mj.features.sweeps.sobol import index_rows
from tests.features.sweeps.synthetic_trials import BIAS, NOISE, make_trials

RATES = "controller.rate_hz+sensors.accelerometer.rate_hz"


def row_of(text: str, first: str) -> list[str]:
    """The cells of a table's row that begins so."""
    (line,) = (line for line in text.splitlines() if line.startswith(f"| {first} "))
    return [cell.strip() for cell in line.strip("|").split("|")]


def sample() -> Trials:
    """At 24 points an error that is the bias, and 0.1 more in world 1, in which ltv falls at half of them."""

    def error(point: dict[str, Any], name: str, world: int) -> float | None:
        return None if name == "ltv" and world == 1 and point[BIAS] > 0.5 else point[BIAS] + 0.1 * world

    axes = {BIAS: "0:1", NOISE: "log:100:800", RATES: "100,200"}
    return make_trials(axes, ("linear", "ltv", "kalman"), 2, error, design="sample", n=24)


def test_of_a_design_an_observer_has_a_row() -> None:
    trials = sample()
    trials.outcome[:, 2] = "refused"
    trials.stood = trials.outcome == "done"
    bias = np.array([point[BIAS] for point in trials.study.points])
    falls = bias > 0.5
    for text in (report(trials, [], []), summary(trials, [])):
        for name, errors in (("linear", bias + 0.05), ("ltv", bias + 0.05 * ~falls)):
            figures = [errors.mean(), *np.quantile(errors, (0.1, 0.5, 0.9))]
            assert row_of(text, name)[1:6] == ["24 of 24", *(f"{figure:.4f}" for figure in figures)]
        assert row_of(text, "linear")[6] == "0 of 48 (0.0 %)"
        assert row_of(text, "ltv")[6] == f"{falls.sum()} of 48 ({100 * falls.sum() / 48:.1f} %)"
        assert row_of(text, "kalman")[1:] == ["0 of 24", "-", "-", "-", "-", "0 of 0"]
        assert "Every point is in cells.parquet." in text


def test_a_report_of_a_design_says_what_is_varied() -> None:
    lines = report(sample(), [], []).splitlines()
    assert f"- {BIAS}: 0 to 1" in lines
    assert f"- {NOISE}: 100 to 800, evenly in the logarithm" in lines
    assert f"- {RATES}: 100, 200" in lines
    many = make_trials({BIAS: "0:1:30"}, ("linear",), 1, lambda *_: 1.0, design="sample", n=4)
    assert any(line.endswith(", ..., 1 (30 values)") for line in report(many, [], []).splitlines())


def test_of_a_grid_a_point_has_a_row() -> None:
    trials = make_trials(
        {RATES: "100,200"}, ("linear", "ltv"), 2, lambda _, name, w: None if w and name == "ltv" else 0.5
    )
    for text in (report(trials, [], []), summary(trials, [])):
        assert [cell.strip() for cell in text.splitlines()[-1].strip("|").split("|")] == [
            "200",
            "0.5000",
            "0.5000 [1 fell]",
        ]
    assert "With controller.rate_hz go, alike: sensors.accelerometer.rate_hz." in report(trials, [], [])


def test_the_terminal_says_why_there_are_no_indices() -> None:
    def error(point: dict[str, Any], name: str, _: int) -> float | None:
        return None if name == "ltv" else point[BIAS] + point[NOISE]

    trials = make_trials({BIAS: "0:1", NOISE: "1:2"}, ("linear", "ltv"), 1, error, design="sobol", n=16)
    text = summary(trials, index_rows(trials))
    assert len([line for line in text.splitlines() if line.startswith("| linear ") and BIAS in line]) == 1
    assert "No indices of ltv, velocity RMS error: no value at 64 of 64 points: of 64 trials 64 fell." in text


def test_reasons_are_in_the_report_and_on_the_terminal() -> None:
    """Those that differ in their numbers are of one kind; a refusal begins with what is wrong, not with its point."""
    trials = make_trials({BIAS: "0,1"}, ("linear",), 4, lambda *_: 1.0)
    assert "refused" not in report(trials, [], []) + summary(trials, [])
    trials.reasons.add([("stopped", "gone at t = 0.5 s"), ("stopped", "gone at t = 1e-3 s"), ("stopped", None)])
    trials.reasons.add([("refused", f"it with --set x=1 with a=1, {BIAS}=2: b.c = 2: must be\n  less: than 1")])
    text = report(trials, [], [])
    assert "4 of 8 trials were refused or stopped" in text
    for reason in (
        "2 stopped, such as: gone at t = 0.5 s",
        "1 refused: b.c = 2: must be less: than 1",
        "1 stopped: no",
    ):
        assert f"- {reason}" in text
    assert "4 of 8 trials were refused or stopped. 2 stopped, such as: gone at t = 0.5 s (and 2 other" in summary(
        trials, []
    )

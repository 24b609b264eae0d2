"""A comparison in numbers: whose mean, over which worlds, and against whom."""

from __future__ import annotations

import copy
import math
import statistics
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import pyarrow.compute as pc
import pytest
from scipy import stats

from cmg_mj.core.errors import InputError
from cmg_mj.results.baselines import BASELINES
from cmg_mj.results.intervals import Interval, format_interval, in_line
from cmg_mj.results.result import Outcome, Result
from cmg_mj.runs import api
from cmg_mj.runs.comparison import (
    ComparedObserver,
    best_observer,
    compare,
    comparison_rows,
    prepare_comparison,
    standings,
    worlds_table,
)
from cmg_mj.runs.experiment import Experiment
from cmg_mj.scenario.loading import load_scenario

ERROR, PUSH_ERROR, FIT = "velocity_rms_error_rad_s", "velocity_rms_error_push_rad_s", "velocity_fit"


def entry(
    kind: str, errors: list[float | None], fallen_worlds: tuple[int, ...] = (), figures: dict[str, Any] | None = None
) -> ComparedObserver:
    """An observer with these errors in its worlds, some of which fell."""
    base_figures = {"settle_time_s": 1.0, "tilt_rms_deg": 0.5, PUSH_ERROR: None, FIT: None} | (figures or {})
    rate = {ERROR: 0.2, PUSH_ERROR: None, FIT: 0.0}
    references = dict.fromkeys(BASELINES, rate) | {"mems_gyro": rate | {ERROR: 0.01}}
    summaries = [{**base_figures, ERROR: error, "references": copy.deepcopy(references)} for error in errors]
    outcomes = [
        Outcome("fell" if i in fallen_worlds else "done", 3.0 if i in fallen_worlds else 9.0)
        for i in range(len(errors))
    ]
    return ComparedObserver(
        experiment_with(kind), Result(outcomes, summaries, observers=[kind], seed=7), Result(outcomes, summaries)
    )


@cache
def experiment_with(kind: str) -> Experiment:
    (experiment,) = prepare_comparison(load_scenario("push_recovery", ["seed=7"]), [kind])
    return experiment


def rows_by_name(observers: Sequence[ComparedObserver]) -> dict[str, dict[str, Any]]:
    return {str(row["observer"]): row for row in standings(observers)}


def student(values: list[float]) -> list[float]:
    low, high = stats.t.interval(0.95, len(values) - 1, np.mean(values), stats.sem(values))
    return [low, high]


def test_means_have_students_intervals_in_the_logarithm() -> None:
    errors = [0.1, 0.13, 0.12, 0.2]
    row = rows_by_name([entry("ltv", [*errors])])["ltv"]
    assert row[ERROR] == pytest.approx(np.mean(errors))
    factor = math.exp(student(errors)[1] / np.mean(errors) - 1.0)
    assert row["intervals"][ERROR] == pytest.approx([np.mean(errors) / factor, np.mean(errors) * factor])


def test_no_interval_of_settle_times_reaches_below_zero_but_one_of_fits_may() -> None:
    ltv = entry("ltv", [0.1, 0.1, 0.1, 0.1])
    settle, fits = [0.1, 0.1, 0.1, 4.0], [-0.2, 0.1, 0.3, 0.0]
    for summary, time, fit in zip(ltv.result.summaries, settle, fits, strict=True):
        summary |= {"settle_time_s": time, FIT: fit}
    row = rows_by_name([ltv])["ltv"]
    assert student(settle)[0] < 0.0 < row["intervals"]["settle_time_s"][0] < np.mean(settle)
    assert row["intervals"][FIT] == pytest.approx(student(fits))
    assert in_line(["1.08", *format_interval("{:.2f}", Interval(1.08, 0.05, 23.2))]) == "1.08 (0.05 to 23.20)"
    assert in_line(["1.08", *format_interval("{:.2f}", Interval(1.08, 1.0, 1.17))]) == "1.08 ±0.08"
    assert row["minus_best"] == {}  # it is the best itself, in every figure


def test_differences_are_taken_world_by_world() -> None:
    """The worlds differ far more than the observers."""
    first, second = [0.1, 0.5, 0.9], [0.11, 0.52, 0.90]
    rows = rows_by_name([entry("ltv", [*second]), entry("linear", [*first])])
    less = rows["ltv"]["minus_best"][ERROR]
    assert (less["best"], less["worlds"]) == ("linear", 3)
    assert less["mean"] == pytest.approx(0.01)
    assert less["interval"] == pytest.approx(student([0.01, 0.02, 0.0]))
    assert ERROR not in rows["linear"]["minus_best"]


def test_fallen_worlds_are_in_no_mean_and_no_difference() -> None:
    rows = rows_by_name([entry("ltv", [0.1, 0.2, 0.3, 0.4]), entry("linear", [0.2, 9.0, 0.4, 0.6], fallen_worlds=(1,))])
    assert rows["linear"][ERROR] == pytest.approx(0.4)
    assert rows["linear"]["fell_fraction"] == 0.25
    less = rows["linear"]["minus_best"][ERROR]
    assert (less["worlds"], less["mean"]) == (3, pytest.approx((0.1 + 0.1 + 0.2) / 3))


def test_the_best_is_sought_among_those_that_stood_most_often() -> None:
    steady, risky = entry("ltv", [0.3, 0.3]), entry("linear", [0.1, 0.1], fallen_worlds=(0,))
    assert best_observer([risky, steady], ERROR) is steady
    all_fallen = entry("linear", [0.1, 0.1], fallen_worlds=(0, 1))
    assert best_observer([all_fallen], ERROR) is None
    assert [row.name for row in comparison_rows([all_fallen])] == ["linear"]


def test_more_of_a_fit_is_better() -> None:
    good, bad = entry("ltv", [0.1, 0.1], figures={FIT: 0.7}), entry("linear", [0.1, 0.1], figures={FIT: -0.3})
    assert best_observer([bad, good], FIT) is good
    assert rows_by_name([bad, good])["linear"]["minus_best"][FIT]["mean"] == pytest.approx(-1.0)


def test_references_are_open_loop_in_the_run_of_the_best_in_the_push_window() -> None:
    """And with the best over the whole run, where there is no push."""
    slow = entry("ltv", [0.1, 0.1], figures={PUSH_ERROR: 0.4})
    quick = entry("linear", [0.2, 0.2], figures={PUSH_ERROR: 0.3})
    rows = rows_by_name([slow, quick])
    assert list(rows) == ["ltv", "linear", *BASELINES]
    assert {rows[name]["in_loop_of"] for name in BASELINES} == {"linear"}
    assert "in_loop_of" not in rows["linear"]
    calm = rows_by_name([entry("ltv", [0.1, 0.1]), entry("linear", [0.2, 0.2])])
    assert calm["zero"]["in_loop_of"] == "ltv"
    assert calm["zero"][ERROR] == 0.2
    assert calm["mems_gyro"]["minus_best"][ERROR]["mean"] == pytest.approx(-0.09)


def test_a_reference_has_no_loop_of_its_own() -> None:
    zero = rows_by_name([entry("ltv", [0.1, 0.1])])["zero"]
    for key in ("fell", "fell_fraction", "settle_time_s", "tilt_rms_deg"):
        assert zero[key] is None
    assert (zero["seed"], zero["worlds"]) == (7, 2)


def test_a_figure_that_is_missing_in_a_world() -> None:
    """One that did not settle: it counts neither in the mean nor in a difference."""
    linear = entry("linear", [0.2, 0.2, 0.2])
    linear.result.summaries[1]["settle_time_s"] = None
    less = rows_by_name([entry("ltv", [0.1, 0.1, 0.1], figures={"settle_time_s": 0.5}), linear])["linear"][
        "minus_best"
    ]["settle_time_s"]
    assert (less["worlds"], less["mean"]) == (2, 0.5)


# --- every world kept ----------------------------------------------------------------------------------------


@cache
def compare_two() -> tuple[ComparedObserver, ...]:
    """Two observers, of which one falls in all worlds within the time."""
    scenario = load_scenario("push_recovery", ["duration_s=2.2", "push.0.start_s=0.5", "seed=3"])
    return tuple(compare(prepare_comparison(scenario, ["ltv", "luenberger"]), 3))


def test_what_stood_averages_to_what_is_printed() -> None:
    """And the figures of those that fell are there, marked."""
    table = worlds_table(compare_two())
    for observer, row in rows_by_name(compare_two()).items():
        survivors = table.filter((pc.field("observer") == observer) & pc.field("stood"))
        for key in row["intervals"]:
            known = [value for value in survivors[key].to_pylist() if value is not None]
            assert (row[key] is None) == (not known), key
            assert not known or statistics.fmean(known) == pytest.approx(row[key], rel=1e-12), key
    fell = table.filter(pc.field("observer") == "luenberger")
    assert not any(fell["stood"].to_pylist())
    assert all(0.5 < end < 2.2 for end in fell["end_time_s"].to_pylist())
    assert all(math.isfinite(value) for value in fell[ERROR].to_pylist())
    assert set(fell["settle_time_s"].to_pylist()) == {None}


def test_a_comparison_as_a_mapping_and_a_frame() -> None:
    pytest.importorskip("pandas")
    scenario = load_scenario("push_recovery", ["duration_s=0.4", "push=[]"])
    compared = api.compare(scenario, ["linear", "gyro_free"], 2)
    assert list(dict(compared)) == list(compared) == ["linear", "gyro_free"]
    means: Any = compared.to_pandas().groupby("observer")["velocity_rms_error_rad_s"].mean()
    for summary in compared.summaries[:2]:
        assert means[summary["observer"]] == pytest.approx(summary["velocity_rms_error_rad_s"], rel=1e-12)


@pytest.mark.parametrize(
    ("observers", "worlds", "message"),
    [
        (["linear", "linear"], 2, "different names"),
        ("linear", 2, "different names"),
        ([], 2, "different names"),
        (["linear"], 0, "worlds = 0"),
        (["liner"], 1, "did you mean 'linear'"),
    ],
)
def test_a_comparison_that_cannot_be_is_refused(observers: Any, worlds: int, message: str) -> None:
    with pytest.raises(InputError, match=message):
        api.compare(load_scenario("push_recovery"), observers, worlds)

"""sokolov2019, Figs 4 to 6 and the comparisons of Sections V and VI: on other seeds, and turned round."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from scipy.signal import lsim

from cmg_mj.papers.recorded import trajectory_of
from cmg_mj.papers.sokolov2019 import section_5
from cmg_mj.papers.sokolov2019.backlash import WITH_Y2, Cycle, Cycles, PredictedCycle
from cmg_mj.papers.sokolov2019.lag import LAGS_S, Lags, Sweep, Threshold, predict
from cmg_mj.papers.sokolov2019.paper import OBSERVERS
from cmg_mj.papers.sokolov2019.section_5 import (
    Loops,
    cause_of_figure_5,
    deviation,
    figure_4,
    figure_5,
    figure_6,
    figure_6_at_rest,
    is_better,
    is_smaller,
    loops,
    numbers,
    tail,
)
from cmg_mj.results.result import Result
from tests.papers.worlds import make_result

SEED = 5_000
WITHIN = "reproduced within stated conditions"


@pytest.fixture(scope="module")
def runs() -> Loops:
    return loops(lambda share: None, worlds=4, seed=SEED)


@pytest.fixture(scope="module")
def lags() -> Lags:
    """The lags of MuJoCo in test_sokolov2019_lag.py: (8) alone oscillates by itself, from a servo lag of 20 ms on."""
    lags_s = np.array([0.0085, *LAGS_S])
    quiet, never = Sweep(lags_s, np.zeros(12, dtype=bool), np.zeros(12)), Threshold(0.045, None)
    return Lags(
        sweeps={
            "linear": quiet._replace(sustained=lags_s > 0.0195),
            "luenberger": quiet,
            "homogeneous": quiet,
        },
        thresholds={"linear": Threshold(0.0194, 0.0196), "luenberger": never, "homogeneous": never},
        latencies={},
        predictions={name: predict(name) for name in ("linear", "luenberger")},
        tau=None,
        own_lag_s=0.0085,
    )


@pytest.fixture(scope="module")
def cycles() -> Cycles:
    """The cycles of MuJoCo in test_sokolov2019_backlash.py."""
    ends = {"linear": 0.166, "luenberger": 0.219, "homogeneous": 0.097, WITH_Y2: 0.219}
    foreseen: dict[str, PredictedCycle | None] = {
        "linear": PredictedCycle(0.155, 3.2),
        "luenberger": PredictedCycle(0.205, 0.8),
    }
    return Cycles({name: Cycle(True, size, 1.0) for name, size in ends.items()}, foreseen)


def test_the_figures_on_other_seeds(runs: Loops, lags: Lags, cycles: Cycles) -> None:
    assert figure_4(runs, lags, cycles).verdict == WITHIN
    assert figure_5(runs, lags, cycles).verdict == WITHIN
    assert cause_of_figure_5(lags, cycles).verdict == "not reproduced"
    assert figure_6(runs, cycles).verdict == WITHIN
    assert figure_6_at_rest(lags, cycles).verdict == "cannot be tested"
    assert [claim.verdict for claim in section_5.best_claims(runs)] == [WITHIN, "not reproduced"]
    assert [claim.verdict for claim in section_5.model_based_claims(runs)] == [WITHIN, "not reproduced"]


def test_every_figure_shows_its_own_observers_runs(runs: Loops, lags: Lags, cycles: Cycles) -> None:
    """Not another's: the figures, and the curves of the pictures."""
    claims = {
        "linear": figure_4(runs, lags, cycles),
        "luenberger": figure_5(runs, lags, cycles),
        "homogeneous": figure_6(runs, cycles),
    }
    for name, claim in claims.items():
        no_gap, gap = runs.by_bias[0.25][name], runs.gap[name]
        assert claim.figures["without_backlash"] == numbers(no_gap)
        assert claim.figures["with_backlash"] == numbers(gap)
        assert claim.figures["cycle_amplitude_deg"] == cycles.ends[name].amplitude_deg
        (figure_picture,) = claim.pictures
        for panel, result in zip(figure_picture.panels[2:4], (no_gap, gap), strict=True):
            rates, recorded = [line.y for line in panel.lines], trajectory_of(result)
            np.testing.assert_array_equal(rates[0], recorded[f"estimate/{name}/x2_rad_s"][:, 0])
            np.testing.assert_array_equal(rates[1], recorded["x2_rad_s"][:, 0])
    assert claims["linear"].figures["gyro"] == numbers(runs.gyro)
    four = claims["linear"].figures
    assert four["main_frequency_hz"] == pytest.approx(four["predicted_frequency_hz"], rel=0.15)
    assert four["without_backlash"]["late_tilt_deviation_deg"][1] > 1.5 * four["gyro"]["late_tilt_deviation_deg"][2]
    assert claims["luenberger"].figures["fell_fraction"] == {"0_deg": 0.0, "0.25_deg": 0.0, "0.5_deg": 1.0}


def test_only_the_runs_behind_a_gap_have_one(runs: Loops) -> None:
    """There the gimbal stands half a gap, 10 arcmin, off where the servo would have it behind the commands."""

    def arcmin(result: Result) -> float:
        """Median distance from the setpoint, world 0, while it stands [arcmin]."""
        run = trajectory_of(result).of_worlds(slice(0, 1))
        t, u, x3 = (
            run[column][np.isfinite(run["x3_rad"].ravel())].ravel() for column in ("time_s", "u_rad_s", "x3_rad")
        )
        setpoint = np.concatenate([[0.0], np.cumsum(u[:-1]) * (t[1] - t[0])])
        _, followed, _ = lsim(([85.6], [1.56e-3, 0.731, 85.6]), setpoint, t)
        return float(np.degrees(np.median(np.abs(x3 - followed)))) * 60.0

    for name in OBSERVERS:
        assert all(arcmin(by_name[name]) < 2.5 for by_name in runs.by_bias.values())
        assert 7.0 < arcmin(runs.gap[name]) < 11.0
    # The same seeds: until the push the rigs differ by their bias alone.
    unbiased, biased = (trajectory_of(runs.by_bias[e]["homogeneous"]) for e in (0.0, 0.5))
    noise = unbiased["y1_rad"] - unbiased["x1_rad"], biased["y1_rad"] - biased["x1_rad"]
    assert np.corrcoef(noise[0][:100, 0], noise[1][:100, 0])[0, 1] > 0.9


def test_the_late_window_does_not_hold_the_pushs_tail(runs: Loops) -> None:
    for name in OBSERVERS:
        late = deviation(runs.by_bias[0.25][name])
        assert late is not None
        assert tail(runs.quiet[name]) < 0.1 * late.mean
        # An end at 7 s would be mostly tail with (9): the window is judged by what it leaves out.
        early = trajectory_of(runs.quiet[name]).between(3.0, 7.0)["x1_rad"]
        assert np.degrees(early).std() > 5.0 * tail(runs.quiet[name])


def test_verdicts_follow_the_lags_and_the_cycles(runs: Loops, lags: Lags, cycles: Cycles) -> None:
    """The lags and cycles that the verdicts rest on are exchanged."""

    def replace_lags(name: str, sustained: bool) -> Lags:
        sweep = lags.sweeps[name]._replace(sustained=np.full(12, sustained))
        return lags._replace(sweeps=lags.sweeps | {name: sweep})

    def replace_cycles(**ends: Cycle) -> Cycles:
        return cycles._replace(ends=cycles.ends | ends)

    calm = Cycle(False, 0.0, 0.1)
    assert figure_4(runs, lags, replace_cycles(linear=calm)).verdict == "not reproduced"
    by_itself = figure_4(runs, replace_lags("linear", True), replace_cycles(linear=calm))
    assert (by_itself.verdict, "backlash" in by_itself.assumes) == (WITHIN, False)
    assert figure_5(runs, lags, replace_cycles(luenberger=calm)).verdict == "not reproduced"
    by_itself = figure_5(runs, replace_lags("luenberger", True), replace_cycles(luenberger=calm))
    assert (by_itself.verdict, "backlash" in by_itself.assumes) == (WITHIN, False)
    assert figure_6_at_rest(lags, replace_cycles(homogeneous=calm)).holds
    quiet = replace_cycles(homogeneous=calm, linear=calm, luenberger=calm)
    assert not figure_6_at_rest(lags, quiet).holds  # nothing for (10) to be without
    assert cause_of_figure_5(lags, replace_cycles(**{WITH_Y2: Cycle(True, 0.1, 1.0)})).verdict == WITHIN
    other = cause_of_figure_5(lags, replace_cycles(**{WITH_Y2: Cycle(True, 0.12, 1.0)}))
    assert other.verdict == "not reproduced"
    assert other.reason.endswith("Without it (9) comes to rest.")
    assert "comes to rest" not in cause_of_figure_5(replace_lags("luenberger", True), cycles).reason


def test_figure_6_with_a_fall(runs: Loops, cycles: Cycles) -> None:
    fallen = replace_outcomes(runs.gap["homogeneous"], runs.gap["homogeneous"].values(VELOCITY), fell=1)
    claim = figure_6(runs._replace(gap=runs.gap | {"homogeneous": fallen}), cycles)
    assert claim.verdict == "not reproduced"
    assert claim.figures["largest_fell_fraction"] == pytest.approx(0.25)


# --- what is better -----------------------------------------------------------------------------------------

VELOCITY = "velocity_rms_error_rad_s"


def replace_outcomes(result: Result, errors: np.ndarray, *, fell: int = 0) -> Result:
    """The same recordings with other outcomes."""
    made_up = make_result(errors.tolist(), fell=fell)
    return Result(made_up.outcomes, made_up.summaries, result.trajectory, result.seconds)


def test_smaller_is_beyond_chance_and_world_by_world() -> None:
    low, high = make_result([1.0, 1.1, 1.2, 1.3]), make_result([1.1, 1.2, 1.3, 1.41])
    assert is_smaller(low, high) is True
    assert is_smaller(high, low) is False
    mixed = make_result([1.3, 0.9, 1.5, 1.2])  # larger in the mean, but not in every world: its interval holds zero
    assert np.mean(mixed.values(VELOCITY)) > np.mean(low.values(VELOCITY))
    assert is_smaller(low, mixed) is False
    assert is_smaller(low, make_result([2.0] * 4, fell=3)) is None
    assert (
        is_smaller(
            make_result([9.0] * 4, tilts=[1.0, 1.1, 1.0, 1.1]), make_result([1.0] * 4, tilts=[2.0] * 4), "tilt_rms_deg"
        )
        is True
    )


def test_better_counts_falls() -> None:
    low, high = make_result([1.0, 1.1, 1.2, 1.3]), make_result([1.1, 1.2, 1.3, 1.41])
    assert is_better(low, high)
    assert not is_better(high, low)
    assert is_better(high, make_result([1.0] * 4, fell=4))
    assert not is_better(make_result([1.0] * 4, fell=4), make_result([1.0] * 4, fell=4))
    assert not is_better(make_result([1.0] * 4, fell=3), make_result([2.0] * 4, fell=4))  # it does not stand itself
    assert not is_better(make_result([1.0, 1.1, 1.2, 0.0], fell=1), high)


def ranking(linear: Result, luenberger: Result, homogeneous: Result) -> Mapping[str, Result]:
    return {"linear": linear, "luenberger": luenberger, "homogeneous": homogeneous}


def test_section_6_needs_both_steps_and_no_fall() -> None:
    worst, middle, best = (make_result([size, size + 0.1, size + 0.2, size + 0.31]) for size in (3.0, 2.0, 1.0))
    assert section_5.is_ranked(ranking(worst, middle, best))
    assert not section_5.is_ranked(ranking(middle, worst, best))  # without a model it is better than (9)
    assert not section_5.is_ranked(ranking(worst, best, middle))  # (9) is better than (10)
    assert not section_5.is_ranked(
        ranking(make_result([1.0] * 4, fell=4), make_result([2.0, 2.1, 2.0, 2.1], fell=1), best)
    )


def test_verdict_of_the_comparison_follows_the_errors(runs: Loops) -> None:
    def spoil(by_name: Mapping[str, Result]) -> dict[str, Result]:
        errors = 2.0 * by_name["linear"].values(VELOCITY)
        return {**by_name, "homogeneous": replace_outcomes(by_name["homogeneous"], errors)}

    one_setting = runs.by_bias | {0.25: spoil(runs.by_bias[0.25])}
    by_error, _ = section_5.best_claims(runs._replace(by_bias=one_setting))
    assert by_error.verdict == "not reproduced"
    assert [setting for setting, wins in by_error.measures.items() if not wins] == ["e = 0.25 deg"]
    everywhere = {e: spoil(by_name) for e, by_name in runs.by_bias.items()}
    spoilt_results = runs._replace(by_bias=everywhere, gap=spoil(runs.gap))
    assert section_5.model_based_claims(spoilt_results)[0].verdict == "not reproduced"


def test_by_the_tilt_the_comparison_follows_the_tilt(runs: Loops) -> None:
    """Tilts made up: the least of (10), then of (9), whatever the errors are."""

    def still(by_name: Mapping[str, Result]) -> dict[str, Result]:
        errors = by_name["linear"].values(VELOCITY).tolist()
        sizes = {"linear": 3.0, "luenberger": 2.0, "homogeneous": 1.0}
        made_up = {name: make_result(errors, tilts=[size, size + 0.1, size, size]) for name, size in sizes.items()}
        return {name: Result(r.outcomes, r.summaries, by_name[name].trajectory) for name, r in made_up.items()}

    calm = runs._replace(by_bias={e: still(runs.by_bias[e]) for e in runs.by_bias}, gap=still(runs.gap))
    assert [claim.verdict for claim in section_5.best_claims(calm)] == ["not reproduced", WITHIN]
    assert [claim.verdict for claim in section_5.model_based_claims(calm)] == ["not reproduced", WITHIN]


def test_the_three_pictures_share_their_scales(runs: Loops, lags: Lags, cycles: Cycles) -> None:
    from cmg_mj.papers.scales import on_common_scales

    claims = on_common_scales([figure_4(runs, lags, cycles), figure_5(runs, lags, cycles), figure_6(runs, cycles)])
    panels = [panel for claim in claims for panel in claim.pictures[0].panels]
    assert {panel.y_label for panel in panels} >= {"tilt [deg]", "tilt rate [rad/s]"}
    for label in {panel.y_label for panel in panels}:
        panels_of_label = [panel for panel in panels if panel.y_label == label]
        assert len(panels_of_label) == 6
        (common,) = {panel.y_range for panel in panels_of_label}
        assert common is not None
        values = np.concatenate([np.asarray(line.y) for panel in panels_of_label for line in panel.lines])
        assert common[0] < values.min() < values.max() < common[1]
        assert np.ptp(values) > 0.85 * (common[1] - common[0])

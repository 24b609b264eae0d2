"""sokolov2019, Figs 4 to 6 and the comparisons of Sections V and VI: on other seeds, and turned round."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from scipy.signal import lsim

from cmg_mj.papers.claim import Claim
from cmg_mj.papers.recorded import on_common_scales, trajectory_of
from cmg_mj.papers.sokolov2019.backlash import WITH_Y2, Cycle, Cycles
from cmg_mj.papers.sokolov2019.lag import Lags, predict
from cmg_mj.papers.sokolov2019.paper import OBSERVERS
from cmg_mj.papers.sokolov2019.section_5 import (
    TILT,
    VELOCITY,
    Loops,
    best,
    cause_of_figure_5,
    figure_4,
    figure_5,
    figure_6,
    figure_6_at_rest,
    is_better,
    is_ranked,
    loops,
    model_based,
    numbers,
)
from cmg_mj.results.result import Result
from tests.papers.worlds import make_result

SEED = 5_000
WITHIN, NOT = "reproduced within stated conditions", "not reproduced"


@pytest.fixture(scope="module")
def runs() -> Loops:
    return loops(worlds=4, seed=SEED)


@pytest.fixture(scope="module")
def lags() -> Lags:
    return Lags({}, {}, {}, {name: predict(name) for name in ("linear", "luenberger")})


@pytest.fixture(scope="module")
def cycles() -> Cycles:
    """The cycles of MuJoCo in test_sokolov2019_backlash.py."""
    ends = {"linear": 0.166, "luenberger": 0.219, "homogeneous": 0.097, WITH_Y2: 0.219}
    foreseen = {"linear": Cycle(True, 0.155, 3.2), "luenberger": Cycle(True, 0.205, 0.8)}
    return Cycles({name: Cycle(True, size, 1.0) for name, size in ends.items()}, foreseen)


@pytest.fixture(scope="module")
def figures(runs: Loops, lags: Lags, cycles: Cycles) -> dict[str, Claim]:
    """Figs 4 to 6 by their observers."""
    claims = [figure_4(runs, lags, cycles), figure_5(runs, lags, cycles), figure_6(runs, cycles)]
    return dict(zip(OBSERVERS, on_common_scales(claims), strict=True))


def test_the_figures_on_other_seeds(runs: Loops, figures: dict[str, Claim], cycles: Cycles) -> None:
    assert [claim.verdict for claim in figures.values()] == [WITHIN] * 3
    assert cause_of_figure_5(cycles).verdict == NOT
    assert figure_6_at_rest(cycles).verdict == "cannot be tested"
    assert best(runs, VELOCITY).measures.items() >= {f"0.5 N m, e = {e:g} deg": True for e in runs.by_bias}.items()
    tilts = best(runs, TILT)  # at the weaker push alone
    assert {name[:5] for name, holds in tilts.measures.items() if holds} == {"0.1 N"}
    assert [best(runs, VELOCITY).verdict, tilts.verdict, model_based(runs, VELOCITY).verdict] == [WITHIN] * 3
    assert {name for name, holds in model_based(runs, TILT).measures.items() if holds} <= {"0.1 N m, e = 0 deg"}


def test_every_figure_shows_its_own_observers_runs(runs: Loops, figures: dict[str, Claim], cycles: Cycles) -> None:
    """Not another's: the figures, and the curves of the pictures, which share their scales."""
    first = figures["linear"].picture
    for name, claim in figures.items():
        assert first is not None
        assert claim.picture is not None
        no_gap, gap = runs.by_bias[0.25][name], runs.gap[name]
        assert claim.figures["without_backlash"] == numbers(no_gap)
        assert claim.figures["with_backlash"] == numbers(gap)
        assert claim.figures["cycle_amplitude_deg"] == cycles.ends[name].amplitude_deg
        for panel, result in zip(claim.picture.panels[2:4], (no_gap, gap), strict=True):
            rates, recorded = [line.y for line in panel.lines], trajectory_of(result)
            np.testing.assert_array_equal(rates[0], recorded[f"estimate/{name}/x2_rad_s"][:, 0])
            np.testing.assert_array_equal(rates[1], recorded["x2_rad_s"][:, 0])
            assert panel.y_range == first.panels[2].y_range is not None
    four = figures["linear"].figures
    assert four["gyro"] == numbers(runs.gyro)
    assert four["main_frequency_hz"] == pytest.approx(four["predicted_frequency_hz"], rel=0.15)
    assert four["without_backlash"]["late_tilt_deviation_deg"][1] > 1.5 * four["gyro"]["late_tilt_deviation_deg"][2]
    assert figures["luenberger"].figures["fell_fraction"] == {"0_deg": 0.0, "0.25_deg": 0.0, "0.5_deg": 1.0}


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
        assert all(arcmin(by_name[name]) < 2.5 for by_name in (*runs.by_bias.values(), *runs.weaker.values()))
        assert 7.0 < arcmin(runs.gap[name]) < 11.0
    # The same seeds: until the push the rigs differ by their bias alone.
    unbiased, biased = (trajectory_of(runs.by_bias[e]["homogeneous"]) for e in (0.0, 0.5))
    noise = unbiased["y1_rad"] - unbiased["x1_rad"], biased["y1_rad"] - biased["x1_rad"]
    assert np.corrcoef(noise[0][:100, 0], noise[1][:100, 0])[0, 1] > 0.9


def test_verdicts_follow_the_cycles(runs: Loops, lags: Lags, cycles: Cycles) -> None:
    """The cycles that the verdicts rest on are exchanged."""

    def replace_cycles(**ends: Cycle) -> Cycles:
        return cycles._replace(ends={**cycles.ends, **ends})

    calm = Cycle(False, 0.0, 0.1)
    assert figure_4(runs, lags, replace_cycles(linear=calm)).verdict == NOT
    assert figure_5(runs, lags, replace_cycles(luenberger=calm)).verdict == NOT
    assert figure_6_at_rest(replace_cycles(homogeneous=calm)).holds
    quiet = replace_cycles(homogeneous=calm, linear=calm, luenberger=calm)
    assert not figure_6_at_rest(quiet).holds  # nothing for (10) to be without
    assert cause_of_figure_5(replace_cycles(**{WITH_Y2: Cycle(True, 0.1, 1.0)})).verdict == WITHIN
    assert cause_of_figure_5(replace_cycles(**{WITH_Y2: Cycle(True, 0.12, 1.0)})).verdict == NOT


# --- what is better -----------------------------------------------------------------------------------------


def test_better_is_beyond_chance_and_counts_falls() -> None:
    low, high = make_result([1.0, 1.1, 1.2, 1.3]), make_result([1.1, 1.2, 1.3, 1.41])
    assert is_better(low, high)
    assert not is_better(high, low)
    mixed = make_result([1.3, 0.9, 1.5, 1.2])  # larger in the mean, but not in every world: its interval holds zero
    assert not is_better(low, mixed)
    assert is_better(high, make_result([1.0] * 4, fell=4))
    assert not is_better(make_result([1.0] * 4, fell=4), make_result([1.0] * 4, fell=4))
    assert not is_better(make_result([1.0] * 4, fell=3), make_result([2.0] * 4, fell=4))  # it does not stand itself
    assert not is_better(make_result([1.0, 1.1, 1.2, 0.0], fell=1), high)


WORST, MIDDLE, BEST = (make_result([size, size + 0.1, size + 0.2, size + 0.31]) for size in (3.0, 2.0, 1.0))


@pytest.mark.parametrize(
    ("results", "ranked"),
    [
        ((WORST, MIDDLE, BEST), True),
        ((MIDDLE, WORST, BEST), False),  # without a model it is better than (9)
        ((WORST, BEST, MIDDLE), False),  # (9) is better than (10)
        ((make_result([1.0] * 4, fell=4), make_result([2.0, 2.1, 2.0, 2.1], fell=1), BEST), False),
    ],
)
def test_section_6_needs_both_steps_and_no_fall(results: tuple[Result, ...], ranked: bool) -> None:
    assert is_ranked(dict(zip(OBSERVERS, results, strict=True))) is ranked


def make_up(by_name: Mapping[str, Result], key: str, *, fell: int = 0) -> dict[str, Result]:
    """The same recordings with other outcomes: by one measure (10) is best, then (9); by the other they are alike."""
    made_up = {}
    for size, name in zip((3.0, 2.0, 1.0), OBSERVERS, strict=True):
        ranked, alike = [size, size + 0.1, size, size], [1.0] * 4
        errors, tilts = (ranked, alike) if key == VELOCITY else (alike, ranked)
        result = make_result(errors, fell=fell, tilts=tilts)
        made_up[name] = Result(result.outcomes, result.summaries, by_name[name].trajectory)
    return made_up


@pytest.mark.parametrize("key", [VELOCITY, TILT])
def test_the_comparisons_follow_their_measure(runs: Loops, cycles: Cycles, key: str) -> None:
    """In every setting; and a fall is none that (10) stabilises."""
    gap = make_up(runs.gap, key)
    by_bias, weaker = ({e: make_up(of, key) for e, of in group.items()} for group in (runs.by_bias, runs.weaker))
    calm = runs._replace(by_bias=by_bias, weaker=weaker, gap=gap)
    for other in (VELOCITY, TILT):
        verdict = WITHIN if other == key else NOT
        assert best(calm, other).verdict == model_based(calm, other).verdict == verdict
    spoilt = calm._replace(gap={**gap, "homogeneous": gap["linear"]})
    assert [setting for setting, wins in best(spoilt, key).measures.items() if not wins] == [
        "e = 0.25 deg, 20 arcmin of backlash"
    ]
    fallen = figure_6(calm._replace(gap=make_up(runs.gap, key, fell=1)), cycles)
    assert fallen.verdict == NOT
    assert fallen.figures["largest_fell_fraction"] == pytest.approx(0.25)

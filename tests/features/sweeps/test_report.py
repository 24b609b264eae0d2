"""A sweep's report, what the terminal says, and its pictures: read as somebody who has not seen the tables."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmg_mj.features.sweeps.cells import Trials, fall_shares
from cmg_mj.features.sweeps.chunks import PICTURES
from cmg_mj.features.sweeps.pictures import Map, error_curve, maps, pictures_of
from cmg_mj.features.sweeps.report import report, summary
from cmg_mj.view.plots.figure import save_figure
from tests.features.sweeps.synthetic_trials import BIAS, NOISE, RATE, VELOCITY, make_trials

RATES = "controller.rate_hz+sensors.accelerometer.rate_hz"
OBSERVERS = ("linear", "ltv")


def row_of(text: str, first: str) -> list[str]:
    """The cells of a table's row that begins so."""
    (line,) = (line for line in text.splitlines() if line.startswith(f"| {first} "))
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_of_a_design_an_observer_has_a_row_and_the_report_says_what_is_varied() -> None:
    """At 24 points an error that is the bias, and 0.1 more in world 1, in which ltv falls at half of them."""

    def error(point: dict[str, Any], name: str, world: int) -> float | str | None:
        if name == "kalman":
            return "refused"
        return None if name == "ltv" and world == 1 and point[BIAS] > 0.5 else point[BIAS] + 0.1 * world

    axes = {BIAS: "0:1", NOISE: "log:100:800", RATES: "100,200"}
    trials = make_trials(axes, ("linear", "ltv", "kalman"), 2, error, sample=24)
    bias = np.array([trials.study.point(number)[BIAS] for number in range(24)])
    falls = bias > 0.5
    errors = bias + 0.05 * ~falls
    figures = [f"{figure:.4f}" for figure in (errors.mean(), *np.quantile(errors, (0.1, 0.5, 0.9)))]
    for text in (report(trials, []), summary(trials)):
        share = f"{falls.sum()} of 48 ({100 * falls.sum() / 48:.1f} %)"
        assert row_of(text, "ltv")[1:] == ["24 of 24", *figures, share]
        assert row_of(text, "kalman")[1:] == ["0 of 24", "-", "-", "-", "-", "0 of 0"]
    varied = {f"- {BIAS}: 0 to 1", f"- {NOISE}: 100 to 800, evenly in the logarithm", f"- {RATES}: 100, 200"}
    assert varied <= set(report(trials, []).splitlines())


def test_of_a_grid_a_point_has_a_row() -> None:
    trials = make_trials({RATES: "100,200"}, OBSERVERS, 2, lambda _, name, w: None if w and name == "ltv" else 0.5)
    for text in (report(trials, []), summary(trials)):
        assert row_of("| " + text.splitlines()[-1].lstrip("| "), "200") == ["200", "0.5000", "0.5000 [1 fell]"]
    assert "With controller.rate_hz go, alike: sensors.accelerometer.rate_hz." in report(trials, [])


def test_reasons_are_in_the_report_and_on_the_terminal() -> None:
    """Those that differ in their numbers are of one kind; a refusal begins with what is wrong, not with its point."""
    trials = make_trials({BIAS: "0,1"}, ("linear",), 4, lambda *_: 1.0)
    assert "refused" not in report(trials, []) + summary(trials)
    for reason in ("gone at t = 0.5 s", "gone at t = 1e-3 s", None):
        trials.add_reason("stopped", reason)
    trials.add_reason("refused", f"it with --set x=1 with a=1, {BIAS}=2: b.c = 2: must be\n  less: than 1")
    lines = report(trials, []).splitlines()
    assert "- 2 stopped, such as: gone at t = 0.5 s" in lines
    assert "- 1 refused: b.c = 2: must be less: than 1" in lines
    for text in (*lines, summary(trials)):
        if "were refused" in text:
            assert "4 of 8 trials were refused or stopped" in text


# --- pictures


def error(point: dict[str, Any], name: str, world: int) -> float | None:
    """Linear is better below a noise of 200, surely at 100; ltv falls in 3 of 4 worlds at 1 degree, both at 2.

    Zero has 0.15, and falls at 2 degrees.
    """
    if point[BIAS] == 2 or (name == "ltv" and point[BIAS] == 1 and world < 3):
        return None
    if name == "zero":
        return 0.15
    noise = 100.0 if name == "linear" and point[NOISE] == 100 else 200.0
    chance = (-1.0) ** world if name == "linear" and point[NOISE] == 400 else 0.0
    better = 0.1 * (point[NOISE] > 100) * (name == "ltv")
    return 1e-3 * (noise - better + 10.0 * chance)


def maps_of(trials: Trials) -> list[Map]:
    return list(maps(trials, *trials.study.axes).values())


def test_a_map_has_the_best_of_every_cell_and_each_ones_own_figure() -> None:
    """The values of the second field fall: the map's rise."""
    trials = make_trials({BIAS: "0,1,2", NOISE: "400,200,100"}, OBSERVERS, 4, error)
    velocity, falls = maps_of(trials)
    assert velocity.best.tolist() == [[0, 0, -1], [1, 0, -1], [1, 0, -1]]
    assert velocity.sure[:, 0].tolist() == [True, True, False]  # at 400 the worlds pull apart
    assert velocity.falls["ltv"].tolist() == falls.each["ltv"].tolist() == [[0.0, 0.75, 1.0]] * 3
    assert velocity.falls["linear"].tolist() == [[0.0, 0.0, 1.0]] * 3
    np.testing.assert_allclose(velocity.each["linear"][:, 0], [0.1, 0.2, 0.2])
    np.testing.assert_allclose(velocity.each["ltv"][:, 0], [0.2, 0.1999, 0.1999])
    assert np.isnan(velocity.each["ltv"][:, 1:]).all()  # it fell in some world
    assert falls.best.tolist() == [[-1, 0, -1]] * 3
    assert not falls.sure.any()  # none of 4 beside 3 of 4
    pictures = pictures_of(trials)
    assert {f"{picture.name}.png" for picture in pictures} <= set(PICTURES)
    assert all(f"({picture.name}.png)" in report(trials, pictures) for picture in pictures)


def test_a_map_shows_where_baselines_are_ahead() -> None:
    trials = make_trials({BIAS: "0,1,2", NOISE: "100,400"}, ("linear", "zero", "ltv"), 4, error)
    velocity, falls = maps_of(trials)
    assert velocity.best.tolist() == [[0, 0, -1], [2, 0, -1]]
    assert (velocity.ahead["zero"] > 0.5).tolist() == [[False, False, False], [True, True, False]]
    assert velocity.ahead["zero"][0, 0] == pytest.approx(0.1 / (0.1 + 0.15))
    assert falls.each["true"].tolist() == [[0.0, 0.0, 1.0]] * 2
    assert "zero" not in falls.each
    assert not (falls.best == 1).any()


def test_curves_have_intervals_and_say_where_some_worlds_fell() -> None:
    trials = make_trials({NOISE: "100,200,400"}, OBSERVERS, 4, lambda p, name, w: error({BIAS: 1, **p}, name, w))
    mean, low, _, is_part = error_curve(trials.figures[VELOCITY][:, 0]).T
    assert mean == pytest.approx([0.1, 0.2, 0.2])
    half_width = 3.1824 * np.std([1, -1, 1, -1], ddof=1) * 0.01 / 2.0
    assert low == pytest.approx([0.1, 0.2, 0.2 * math.exp(-half_width / 0.2)], rel=1e-4)
    assert not is_part.any()
    assert error_curve(trials.figures[VELOCITY][:, 1])[:, 3].all()
    assert fall_shares(trials)[0, 1] == pytest.approx((0.75, 0.3006, 0.9544), abs=1e-4)


@pytest.mark.parametrize(
    "axes", [{BIAS: "0,1", NOISE: "100,200", RATE: "100,200"}, {BIAS: "0,1", "plant.integrator": "RK4,implicit"}]
)
def test_other_sweeps_have_the_table_only(axes: dict[str, str]) -> None:
    assert pictures_of(make_trials(axes, OBSERVERS, 2, lambda *_: 0.1)) == []


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("worlds", [1, 4])
def test_they_can_be_drawn(tmp_path: Path, worlds: int) -> None:
    observers, falls = ("linear", "zero", "ltv"), {BIAS: "0,1,2"}
    one_field = make_trials(falls, observers, worlds, lambda p, name, w: error({NOISE: 100, **p}, name, w))
    all_fell = make_trials({BIAS: "0,1", NOISE: "1,2"}, OBSERVERS, worlds, lambda *_: None)
    pictures = [*pictures_of(make_trials(falls | {NOISE: "400,200,100"}, observers, worlds, error))]
    pictures += [*pictures_of(one_field), *pictures_of(all_fell)]
    assert [picture.name for picture in pictures] == ["map_velocity_error", "map_falls", "curves", "map_falls"]
    for picture in pictures:
        save_figure(tmp_path / "it.png", picture.draw(), picture.title, dpi=100)

"""Maps and curves of a sweep: what is drawn, and that it can be."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmg_mj.features.sweeps.cells import Trials
from cmg_mj.features.sweeps.chunks import PICTURES
from cmg_mj.features.sweeps.pictures import in_words, is_logarithmic, pictures_of, round_values
from cmg_mj.view.plots.figure import Picture, draw
from cmg_mj.view.plots.map_plot import Map
from tests.features.sweeps.synthetic_trials import BIAS, NOISE, RATE, make_trials

OBSERVERS = ("linear", "ltv")


def error(point: dict[str, Any], name: str, world: int) -> float | None:
    """Linear is better below a noise of 200, surely at 100; ltv falls in 3 of 4 worlds at 1 degree, both at 2."""
    if point[BIAS] == 2 or (name == "ltv" and point[BIAS] == 1 and world < 3):
        return None
    noise = 100.0 if name == "linear" and point[NOISE] == 100 else 200.0
    chance = (-1.0) ** world if name == "linear" and point[NOISE] == 400 else 0.0
    better = 0.1 * (point[NOISE] > 100) * (name == "ltv")
    return 1e-3 * (noise - better + 10.0 * chance)


def make_grid_trials() -> Trials:
    """The values of the second field fall: the map's rise."""
    return make_trials({BIAS: "0,1,2", NOISE: "400,200,100"}, OBSERVERS, 4, error)


def the_map(picture: Picture) -> Map:
    result = picture.panels[0].map
    assert result is not None
    return result


def test_a_map_has_the_best_of_every_cell() -> None:
    velocity, fall_picture = pictures_of(make_grid_trials())
    error_map = the_map(velocity)
    assert error_map.x.tolist() == [0.0, 1.0, 2.0]
    assert error_map.y.tolist() == [100.0, 200.0, 400.0]
    assert error_map.best.tolist() == [[0, 0, -1], [1, 0, -1], [1, 0, -1]]
    assert error_map.values[0, 0] == pytest.approx(0.1)
    assert error_map.values[2, 0] == pytest.approx(0.1999)
    assert np.isnan(error_map.values[:, 2]).all()
    assert error_map.sure[:, 0].tolist() == [True, True, False]  # at 400 the worlds pull apart
    assert error_map.boundaries["ltv"].tolist() == [[0.0, 0.75, 1.0]] * 3
    assert error_map.boundaries["linear"].tolist() == [[0.0, 0.0, 1.0]] * 3
    assert all(error_map.values[0, 0] < level < 0.2 for level in error_map.levels)
    assert error_map.levels
    fall_map = the_map(fall_picture)
    assert fall_map.best.tolist() == [[-1, 0, -1]] * 3
    assert not fall_map.sure.any()  # none of 4 beside 3 of 4
    assert (velocity.panels[0].x_scale, velocity.panels[0].y_scale) == ("linear", "log")
    assert {f"{picture.name}.png" for picture in (velocity, fall_picture)} <= set(PICTURES)


def test_a_panel_an_observer_stands_below_the_map() -> None:
    velocity, falls = pictures_of(make_grid_trials())
    linear, ltv = (panel.surface for panel in velocity.panels[1:])
    assert linear is not None
    assert ltv is not None
    np.testing.assert_allclose(linear.values[:, 0], [0.1, 0.2, 0.2])
    np.testing.assert_allclose(ltv.values[:, 0], [0.2, 0.1999, 0.1999])
    assert np.isnan(ltv.values[:, 1:]).all()  # it fell in some world
    assert linear.limits == ltv.limits == pytest.approx((0.1, 0.2))
    assert [panel.title for panel in velocity.panels[1:]] == list(OBSERVERS)
    shares = falls.panels[2].surface
    assert shares is not None
    assert shares.values.tolist() == [[0.0, 0.75, 1.0]] * 3
    assert {(panel.x_label, panel.y_label) for panel in (*velocity.panels, *falls.panels)} == {
        ("equilibrium bias [deg]", "accelerometer noise density [ug/rtHz]")
    }


@pytest.mark.parametrize(
    ("field", "words"),
    [
        ("push.0.torque_n_m", "push torque [N m]"),
        ("push.1.start_s", "push 2 start [s]"),
        ("observer.k1", "k1"),
        ("axes.roll.plant.initial_tilt_deg", "roll initial tilt [deg]"),
        ("duration_s", "duration [s]"),
    ],
)
def test_a_field_in_words(field: str, words: str) -> None:
    assert in_words(field) == words


def test_a_stop_is_no_share_of_falls() -> None:
    """A world that stopped neither fell nor stood: the share is that of the others, and of none there is none."""
    trials = make_grid_trials()
    trials.outcome[0, 0, :] = "stopped"
    trials.outcome[3, 1, 0] = "stopped"  # one of the three of four that fell at 1 degree and 400
    trials.stood = trials.outcome == "done"
    error_map = the_map(pictures_of(trials)[0])
    assert math.isnan(error_map.boundaries["linear"][2, 0])
    assert error_map.best[2, 0] == 1
    assert error_map.boundaries["ltv"][2, 1] == pytest.approx(2.0 / 3.0)


def test_one_field_makes_curves() -> None:
    trials = make_trials({NOISE: "400,100,200"}, OBSERVERS, 4, lambda p, name, w: error({BIAS: 1, **p}, name, w))
    (picture,) = pictures_of(trials)
    errors, fall_panel = picture.panels
    assert [line.label for line in errors.lines if line.label] == list(OBSERVERS)
    first = errors.lines[0]
    assert list(first.x) == [100.0, 200.0, 400.0]
    assert list(first.y) == pytest.approx([0.1, 0.2, 0.2])
    assert first.spread is not None
    lower = np.asarray(first.spread)[0]
    assert lower[:2] == pytest.approx([0.0, 0.0], abs=1e-12)
    half_width = 3.1824 * np.std([1, -1, 1, -1], ddof=1) * 0.01 / 2.0
    assert lower[2] == pytest.approx(0.2 * (1.0 - math.exp(-half_width / 0.2)), rel=1e-3)
    missing_points = [line for line in errors.lines if line.style == "x"]
    assert [(line.color, len(line.x)) for line in missing_points] == [("ltv", 3)]
    assert errors.x_scale == "log"
    assert np.asarray(fall_panel.lines[1].y).tolist() == [0.75] * 3
    spread = np.asarray(fall_panel.lines[1].spread)
    assert (0.75 - spread[0, 0], 0.75 + spread[1, 0]) == pytest.approx((0.3006, 0.9544), abs=1e-4)


@pytest.mark.parametrize(
    "axes", [{BIAS: "0,1", NOISE: "100,200", RATE: "100,200"}, {BIAS: "0,1", "plant.integrator": "RK4,implicit"}]
)
def test_other_sweeps_have_the_table_only(axes: dict[str, str]) -> None:
    assert pictures_of(make_trials(axes, OBSERVERS, 2, lambda *_: 0.1)) == []


@pytest.mark.slow
@pytest.mark.parametrize("worlds", [1, 4])
def test_they_can_be_drawn(tmp_path: Path, worlds: int) -> None:
    one_field = make_trials({BIAS: "0,1,2"}, OBSERVERS, worlds, lambda p, name, w: error({NOISE: 100, **p}, name, w))
    all_fell = make_trials({BIAS: "0,1", NOISE: "1,2"}, OBSERVERS, worlds, lambda *_: None)
    for trials in (make_trials({BIAS: "0,1,2", NOISE: "400,200,100"}, OBSERVERS, worlds, error), one_field, all_fell):
        pictures = pictures_of(trials)
        assert pictures
        for picture in pictures:
            draw(tmp_path / f"{picture.name}.png", picture)
            assert (tmp_path / f"{picture.name}.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("values", "logarithmic"),
    [((100, 200, 400, 800), True), ((50, 100, 200, 500, 1000), True), ((1, 2, 3, 4), False), ((0, 1, 10), False)],
)
def test_logarithmic_values(values: tuple[float, ...], logarithmic: bool) -> None:
    assert is_logarithmic(values) == logarithmic


@pytest.mark.parametrize("ends", [(0.01, 3.0), (0.1, 0.2), (0.1, 0.11)])
def test_levels_are_round_and_between(ends: tuple[float, float]) -> None:
    levels = round_values(np.array(ends))
    assert 1 <= len(levels) <= 7
    assert all(ends[0] < level < ends[1] for level in levels)
    assert round_values(np.array([0.1, 0.1])) == ()

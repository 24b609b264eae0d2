"""One colour an observer, told apart by everybody; the best few observers; thinned signals."""

from __future__ import annotations

import numpy as np
import pytest

from cmg_mj.observers import OBSERVERS
from cmg_mj.view.plots import style
from cmg_mj.view.plots.style import (
    BASELINE_COLOURS,
    COLOURS,
    USER_COLOURS,
    Colour,
    Summary,
    colour,
    colours,
    observers_to_draw,
    short_names,
    thinned,
)

SIGHT = {
    "all three cones": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
"""The rest of linear red, green, blue: Machado, Oliveira, Fernandes 2009, severity 1."""

LMS = [[0.4122214708, 0.5363325363, 0.0514459929], [0.2119034982, 0.6806995451, 0.1073969566]]
LMS += [[0.0883024619, 0.2817188376, 0.6299787005]]
LAB = [[0.2104542553, 0.7936177850, -0.0040720468], [1.9779984951, -2.4285922050, 0.4505937099]]
LAB += [[0.0259040371, 0.7827717662, -0.8086757660]]
"""Oklab (Ottosson 2020): distances in it are about those that are seen; black and white are 1 apart."""


def linear(colours: list[Colour]) -> np.ndarray:
    """Linear light, (n, 3), of sRGB."""
    c = np.array(colours) / 255.0
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def least_distance(colours: list[Colour], sight: str) -> float:
    """Return the distance of the two most alike for one kind of sight."""
    response = np.clip(linear(colours) @ np.transpose(SIGHT[sight]), 0.0, 1.0)
    lab = np.cbrt(response @ np.transpose(LMS)) @ np.transpose(LAB)
    distances = np.linalg.norm(lab[:, None] - lab, axis=-1)
    return float(distances[np.triu_indices(len(colours), 1)].min())


@pytest.mark.parametrize(
    ("sight", "least"), [("all three cones", 0.13), ("protanopia", 0.1), ("deuteranopia", 0.1), ("tritanopia", 0.045)]
)
def test_the_bundled_observers_can_be_distinguished(sight: str, least: float) -> None:
    assert least_distance(list(COLOURS.values()), sight) > least


@pytest.mark.parametrize("sight", SIGHT)
def test_the_others_are_not_taken_for_them(sight: str) -> None:
    assert least_distance([*COLOURS.values(), *BASELINE_COLOURS.values(), *USER_COLOURS], sight) > 0.032


def test_every_bundled_observer_has_one() -> None:
    assert COLOURS.keys() == OBSERVERS.keys()


def test_an_observer_keeps_its_colour_whatever_it_is_shown_with() -> None:
    names = ["mine:Kalman", "zero", *OBSERVERS, "mems_gyro"]
    assert colours(names) == {name: colour(name) for name in names}
    assert list(colours(names)) == names


def summary(error: float | None, *, push: float | None = None, fell: bool = False) -> Summary:
    return {"velocity_rms_error_rad_s": error, "velocity_rms_error_push_rad_s": push, "fell": fell}


def test_the_best_in_the_order_given() -> None:
    errors = {"a": 0.4, "b": 0.1, "c": 0.3, "d": 0.2, "e": None, "f": float("nan")}
    summaries = {name: summary(error) for name, error in errors.items()}
    assert observers_to_draw(summaries) == ["b", "c", "d"]
    assert observers_to_draw(summaries, ["e"]) == ["b", "d", "e"]
    assert observers_to_draw({**summaries, "b": summary(0.1, fell=True)}) == ["a", "c", "d"]
    assert observers_to_draw({"zero": summary(0.01), **summaries}) == ["b", "c", "d"]
    by_push = {name: summary(error, push=1.0 - error) for name, error in zip("abcd", (0.1, 0.2, 0.3, 0.4), strict=True)}
    assert observers_to_draw(by_push) == ["b", "c", "d"]


def test_names_are_shortened_where_they_stay_apart() -> None:
    names = ["linear", "mine:Kalman", "lab.a:Other", "lab.b:Other", "odd:"]
    assert list(short_names(names).values()) == ["linear", "Kalman", "lab.a:Other", "lab.b:Other", "odd:"]
    assert list(short_names(["mine:linear", "linear"]).values()) == ["mine:linear", "linear"]


def test_a_long_signal_keeps_its_outline(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(style, "LONG", 1000)
    monkeypatch.setattr(style, "DRAWN", 200)
    time = np.arange(12345) / 100.0
    values = np.random.default_rng(0).normal(size=len(time))
    values[[0, 777, 5000]] = [9.0, np.nan, -30.0]
    x, y = thinned(time, values)
    assert len(x) <= 200 + 130
    assert np.all(np.diff(x) > 0.0)
    assert (x[0], x[-1]) == (time[0], time[-1])
    assert np.array_equal(values[np.searchsorted(time, x)], y, equal_nan=True)
    assert np.nanmax(y) == 9.0
    assert np.nanmin(y) == -30.0

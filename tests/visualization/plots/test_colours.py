"""One colour an observer, told apart by everybody."""

from __future__ import annotations

import numpy as np
import pytest
from cmg_mj.visualization.plots.colours import (
    BASELINE_COLOURS,
    BOUND_COLOURS,
    COLOURS,
    USER_COLOURS,
    Colour,
    colour,
    colours,
    hexadecimal,
)

from cmg_mj.observers import OBSERVERS
from cmg_mj.visualization.recording.signals import CONTROLLER

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


def luminance(colours: list[Colour]) -> np.ndarray:
    return linear(colours) @ [0.2126, 0.7152, 0.0722]


@pytest.mark.parametrize(
    ("sight", "least"), [("all three cones", 0.13), ("protanopia", 0.1), ("deuteranopia", 0.1), ("tritanopia", 0.045)]
)
def test_the_bundled_observers_can_be_distinguished(sight: str, least: float) -> None:
    assert least_distance(list(COLOURS.values()), sight) > least


@pytest.mark.parametrize("sight", SIGHT)
def test_the_others_are_not_taken_for_them(sight: str) -> None:
    assert least_distance([*COLOURS.values(), *BASELINE_COLOURS.values(), *USER_COLOURS], sight) > 0.032


def test_they_are_seen_on_white_and_on_the_viewers_ground() -> None:
    """Contrast as WCAG counts it; 3 is what it asks of lines, which yellow and pink miss on white."""
    light = luminance([*COLOURS.values(), *BASELINE_COLOURS.values(), *USER_COLOURS]) + 0.05
    ground = float(luminance([(13, 16, 17)])[0]) + 0.05
    assert (1.05 / light).min() > 1.85
    assert (light / ground).min() > 2.7


def test_every_bundled_observer_has_one() -> None:
    assert COLOURS.keys() == OBSERVERS.keys()


def test_an_observer_keeps_its_colour_whatever_it_is_shown_with() -> None:
    names = ["mine:Kalman", "zero", *OBSERVERS, "mems_gyro"]
    assert colours(names) == {name: colour(name) for name in names}
    assert list(colours(names)) == names


def test_users_own_differ_from_each_other() -> None:
    names = [f"mine:Observer{i}" for i in range(len(USER_COLOURS))]
    assert set(colours(names).values()) == set(USER_COLOURS)
    assert set(colours([*names, "mine:OneMore"])) == {*names, "mine:OneMore"}


def test_as_matplotlib_takes_it() -> None:
    assert hexadecimal((6, 109, 61)) == "#066d3d"


@pytest.mark.parametrize("sight", SIGHT)
def test_bounds_are_not_taken_for_what_they_bound(sight: str) -> None:
    assert least_distance([BOUND_COLOURS["settle band"], BASELINE_COLOURS["true"]], sight) > 0.1
    assert least_distance([BOUND_COLOURS["rate limit"], CONTROLLER], sight) > 0.1

"""Settle time and estimation RMS of every observer, on seeds that did not set the bounds."""

from __future__ import annotations

import json
import math
import statistics
from pathlib import Path

import pytest

from tests.acceptance.cases import (
    FALLING,
    GROUP,
    STANDING,
    closed_loop,
    closed_loop_figures,
    ride_along,
    ride_along_figures,
)

SEED = 7
BOUNDS = json.loads((Path(__file__).parent / "bounds.json").read_text())


@pytest.mark.parametrize("observer", STANDING)
def test_closed_loop_figures(observer: str) -> None:
    result = closed_loop(observer, STANDING[observer], SEED, GROUP)
    assert [outcome.kind for outcome in result.outcomes] == ["done"] * GROUP
    for name, value in closed_loop_figures(result).items():
        low, high = BOUNDS["closed_loop"][observer][name]
        assert low <= value <= high, f"{observer}: {name} = {value:.4g} not in [{low}, {high}]"


def test_ride_along_figures() -> None:
    for name, value in ride_along_figures(ride_along(SEED, GROUP)).items():
        low, high = BOUNDS["ride_along"][name]
        assert low <= value <= high, f"{name}: {value:.4g} not in [{low}, {high}]"


@pytest.mark.parametrize("observer", FALLING)
def test_falls(observer: str) -> None:
    """aranovskiy2020, end of section V: a time-invariant observer does not stabilise the rig."""
    result = closed_loop(observer, (), SEED, GROUP)
    assert all(outcome.fell for outcome in result.outcomes)


def test_order_of_the_paper() -> None:
    """Velocity RMS error orders homogeneous < ltv < linear at e = 0.5 degrees, world by world and beyond its error."""
    errors = {
        name: [s["velocity_rms_error_rad_s"] for s in closed_loop(name, (), SEED, GROUP).summaries]
        for name in ("homogeneous", "ltv", "linear")
    }
    for smaller, larger in (("homogeneous", "ltv"), ("ltv", "linear")):
        differences = [b - a for a, b in zip(errors[smaller], errors[larger], strict=True)]
        standard_error = statistics.stdev(differences) / math.sqrt(GROUP)
        assert statistics.fmean(differences) > 5.0 * standard_error, (smaller, larger)

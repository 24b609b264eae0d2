"""Long signals thinned for a plot."""

from __future__ import annotations

import numpy as np
import pytest
from cmg_mj.visualization.plots.thinning import thinned

from cmg_mj.visualization.plots import thinning


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(thinning, "STRETCH", 1000)
    monkeypatch.setattr(thinning, "DRAWN", 200)


def test_a_short_signal_stays_as_it_is() -> None:
    time = np.arange(1000.0)
    x, y = thinned(time, time**2)
    assert x is time
    assert len(y) == 1000


def test_a_long_one_keeps_its_outline() -> None:
    time = np.arange(12345) / 100.0
    values = np.random.default_rng(0).normal(size=len(time))
    values[[0, 777, 5000]] = [9.0, np.nan, -30.0]
    x, y = thinned(time, values)
    assert len(x) <= 200 + 130
    assert np.all(np.diff(x) > 0.0)
    assert (x[0], x[-1]) == (time[0], time[-1])
    assert np.array_equal(values[np.searchsorted(time, x)], y, equal_nan=True)
    for start in range(0, 12000, 500):  # each of these spans has its highest and its lowest
        inside = (x >= time[start] - 1.3) & (x <= time[start + 499] + 1.3)
        assert np.nanmax(y[inside]) >= np.nanmax(values[start : start + 500])
        assert np.nanmin(y[inside]) <= np.nanmin(values[start : start + 500])

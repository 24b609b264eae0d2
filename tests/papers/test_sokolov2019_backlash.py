"""sokolov2019, Figs 4 to 6: the gap behind the servo's motor, and the cycles that it makes."""

from __future__ import annotations

import numpy as np
import pytest

from cmg_mj.papers.sokolov2019 import backlash
from cmg_mj.papers.sokolov2019.backlash import cycles, describing_function
from cmg_mj.papers.sokolov2019.rig import experiment
from cmg_mj.stages.backlash import Backlash
from tests.core.test_backlash import behind


@pytest.mark.parametrize("c", [-0.9, -0.3, 0.0, 0.6])
def test_share_is_the_fundamental_of_what_a_gap_passes(c: float) -> None:
    """By running the gap over whole turns."""
    dt = experiment().law.dt
    gap = 1.0 + c
    phase = np.linspace(0.0, 6.0 * np.pi, 6001)
    rates = np.diff(np.sin(phase)) / dt
    angle = np.cumsum(dt * behind(Backlash(gap, dt), rates))
    last = angle[3999:5999]
    fundamental = 2.0 * np.mean(last * np.exp(-1j * phase[4000:6000])) * 1j
    assert complex(fundamental) == pytest.approx(describing_function(c), abs=2e-3)


def test_cycles_on_mujoco_are_those_of_the_linear_loop() -> None:
    """All three oscillate behind the gap, (8) and (9) as the describing function foresees; nothing does without."""
    result = cycles()
    assert all(cycle.sustained for cycle in result.ends.values())
    for name in ("linear", "luenberger"):
        prediction = result.predicted[name]
        assert prediction is not None
        assert result.ends[name].amplitude_deg == pytest.approx(prediction.amplitude_deg, rel=0.15)
        assert result.ends[name].frequency_hz == pytest.approx(prediction.frequency_hz, rel=0.25)
    releases = [
        backlash.make_release(name, gap) for name, gap in (("linear", 0.0), ("luenberger", 0.0), ("linear", 10.0))
    ]
    *small_gaps, half = backlash.find_cycles(releases)
    assert not any(cycle.sustained for cycle in small_gaps)
    assert half.amplitude_deg == pytest.approx(result.ends["linear"].amplitude_deg / 2.0, rel=0.05)

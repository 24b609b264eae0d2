"""A log of a motion in closed form gives the errors in closed form."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from cmg_mj.features.replay import replay
from cmg_mj.features.replay.log_replay import ReplayResult, replay_log
from cmg_mj.observers import make_observer
from cmg_mj.results.trajectory import Trajectory
from tests.features.replay.motion import AMPLITUDE, DT, OMEGA, read, sine
from tests.observers.reference import PAPER

PEAK = AMPLITUDE * OMEGA
GAIN = math.sin(OMEGA * DT / 2.0) / (OMEGA * DT / 2.0)
"""A difference over DT is the rate in the middle of it, by that much smaller."""


@pytest.fixture(scope="module")
def sine_replay(tmp_path_factory: pytest.TempPathFactory) -> ReplayResult:
    return replay_log(read(tmp_path_factory.mktemp("sine"), sine()), settle_s=1.0)


def test_the_difference_of_a_sine(sine_replay: ReplayResult) -> None:
    """Error |1 - GAIN exp(-i w dt/2)| of the motion, lag half a sample, noise gain sqrt(2)/dt."""
    result = sine_replay.summaries["finite_difference"]
    off = abs(1.0 - GAIN * np.exp(-0.5j * OMEGA * DT))
    assert result["velocity_rms_rad_s"] == pytest.approx(PEAK / math.sqrt(2.0), rel=1e-9)
    assert result["velocity_rms_error_rad_s"] == pytest.approx(off * PEAK / math.sqrt(2.0), rel=1e-9)
    assert result["velocity_fit"] == pytest.approx(1.0 - off, rel=1e-9)
    assert result["lag_s"] == pytest.approx(DT / 2.0, rel=1e-3)
    assert result["noise_gain_1_s"] == pytest.approx(math.sqrt(2.0) / DT, rel=0.03)


def test_the_linear_differentiator_of_a_sine(sine_replay: ReplayResult) -> None:
    """s/(tau s + 1)^2 at i w; of white noise the root of the sum of its impulse response's squares."""
    result = sine_replay.summaries["linear"]
    response = 1.0 / (1.0 + 0.02j * OMEGA) ** 2
    assert result["lag_s"] == pytest.approx(-np.angle(response) / OMEGA, rel=2e-3)
    assert result["velocity_fit"] == pytest.approx(1.0 - abs(1.0 - response), abs=2e-3)
    nothing = dict.fromkeys(("y2_rad", "u_rad_s"), np.zeros(400))
    impulse = Trajectory({"time_s": np.arange(400) * DT, **nothing, "y1_rad": np.eye(1, 400, 1)[0]})
    response = replay(make_observer("linear", DT, PAPER), impulse).x2
    assert result["noise_gain_1_s"] == pytest.approx(math.sqrt(np.sum(response**2)), rel=0.03)


def test_zero_has_a_fit_of_zero_and_no_lag(sine_replay: ReplayResult) -> None:
    result = sine_replay.summaries["zero"]
    assert result["velocity_rms_error_rad_s"] == result["velocity_rms_rad_s"]
    assert (result["velocity_fit"], result["lag_s"], result["noise_gain_1_s"]) == (0.0, None, 0.0)


def test_without_a_reference(tmp_path: Path) -> None:
    """The difference's integral is the mean of two measured tilts: half a step behind."""
    result = replay_log(read(tmp_path, sine(), {"time": "t_s", "tilt": "tilt_rad"})).summaries
    assert set(result["finite_difference"]) == {"reconstruction_rms_deg", "roughness_rad_s", "noise_gain_1_s"}
    step = 2.0 * AMPLITUDE * math.sin(OMEGA * DT / 2.0) / math.sqrt(2.0)
    assert result["finite_difference"]["reconstruction_rms_deg"] == pytest.approx(math.degrees(step / 2.0), rel=5e-3)
    second = GAIN * PEAK / math.sqrt(2.0) * (2.0 - 2.0 * math.cos(OMEGA * DT))
    assert result["finite_difference"]["roughness_rad_s"] == pytest.approx(second / math.sqrt(6.0), rel=1e-3)
    whole_periods = math.degrees(AMPLITUDE / math.sqrt(2.0))
    assert result["zero"]["reconstruction_rms_deg"] == pytest.approx(whole_periods, rel=0.01)
    assert result["zero"]["roughness_rad_s"] == 0.0

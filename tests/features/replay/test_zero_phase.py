"""The row of a smoother that sees the future."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from cmg_mj.features.replay.log import REFERENCE, Log
from cmg_mj.features.replay.log_replay import replay_log
from cmg_mj.features.replay.report import log_figures, remarks, replay_markdown
from cmg_mj.features.replay.scores import ZeroPhase, noise_gain_of, smoothed_rate, zero_phase
from tests.features.replay.motion import DT, read

CUTOFF = 4.0


def noisy_log(folder: Path, seed: int = 0, n: int = 4000, sigma: float = 0.01) -> Log:
    """Five sines from 0.3 to 2 Hz and white noise."""
    random = np.random.default_rng(seed)
    t = DT * np.arange(n)
    y, w = np.zeros(n), np.zeros(n)
    for frequency in (0.3, 0.5, 0.9, 1.4, 2.0):
        phase, omega = random.uniform(0.0, 2.0 * np.pi), 2.0 * np.pi * frequency
        y += 0.03 * np.sin(omega * t + phase)
        w += 0.03 * omega * np.cos(omega * t + phase)
    columns = {"t_s": t, "tilt_rad": y + sigma * random.standard_normal(n), "gyro_rad_s": w}
    return read(folder, columns)


def scored_smoother(log: Log) -> ZeroPhase:
    result = zero_phase(log, log.scored(1.0))
    assert result is not None
    return result


@pytest.mark.parametrize("frequency", [0.7, 4.0, 9.0])
def test_a_sine_comes_out_in_phase_and_as_large_as_the_response(frequency: float) -> None:
    """Its amplitude is that by 1 + (f/cutoff)^6: half at the cut-off."""
    t, omega = DT * np.arange(4000), 2.0 * np.pi * frequency
    rate = smoothed_rate(0.1 * np.sin(omega * t + 0.4), DT, CUTOFF)
    expected = 0.1 * omega * np.cos(omega * t + 0.4) / (1.0 + (frequency / CUTOFF) ** 6)
    np.testing.assert_allclose(rate[400:-400], expected[400:-400], atol=2e-4)


def test_a_straight_line_has_its_slope_everywhere() -> None:
    np.testing.assert_allclose(smoothed_rate(0.3 - 2.0 * DT * np.arange(300), DT, CUTOFF), -2.0, rtol=1e-9)


def test_what_white_noise_becomes() -> None:
    noise = np.random.default_rng(0).standard_normal(50_000)
    assert np.std(smoothed_rate(noise, DT, CUTOFF)) == pytest.approx(noise_gain_of(CUTOFF, DT), rel=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_the_width_is_nearly_the_best_and_does_not_know_the_reference(seed: int, tmp_path: Path) -> None:
    log = noisy_log(tmp_path, seed)
    result = scored_smoother(log)
    error, best = result.figures["velocity_rms_error_rad_s"], result.best_rms_error_rad_s
    assert error is not None
    assert best is not None
    assert best <= error < 1.2 * best
    assert 2.0 < result.cutoff_hz < 8.0
    other = scored_smoother(dataclasses.replace(log, columns={**log.columns, REFERENCE: np.sin(np.arange(len(log)))}))
    assert result.cutoff_hz == other.cutoff_hz
    assert result.best_cutoff_hz != other.best_cutoff_hz


def test_the_row_is_said_to_be_no_observer(tmp_path: Path) -> None:
    log = noisy_log(tmp_path, n=1500)
    replayed = replay_log(log, ["linear"])
    figures = log_figures(replayed)
    assert set(figures["observers"]) == {"linear", "zero"}  # type: ignore[arg-type]
    assert json.dumps(figures["zero_phase"])
    assert any(line.startswith("zero_phase is no observer: it sees the future.") for line in remarks(replayed))
    assert replay_markdown([replayed, replayed]).count("`zero_phase`") == 3
    unreferred = dataclasses.replace(log, has=frozenset())
    assert replay_log(unreferred, ["linear"]).zero_phase is None


def test_parts_too_short_have_no_row(tmp_path: Path) -> None:
    log = noisy_log(tmp_path, n=60)
    short = dataclasses.replace(log, parts=[slice(start, start + 3) for start in range(0, 60, 3)])
    assert zero_phase(short, short.scored(0.0)) is None

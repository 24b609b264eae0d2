"""The accelerations of a pivot: exact means, noise of the size and the corner it is told, tracks from files."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.core.noise import NoiseStream
from cmg_mj.features.pivot import Pivot
from cmg_mj.features.pivot.pivot_signals import BandLimitedNoise, PivotSignals, pivot_signal
from cmg_mj.features.pivot.pivot_track import read_track

H = 0.005
STREAM = NoiseStream.PIVOT


def held(pivot: Pivot, n: int, h: float = H, worlds: int | list[int] = 0, seed: int = 0) -> np.ndarray:
    """The means over n intervals."""
    mean = pivot_signal(pivot, 0, seed, worlds)
    return np.array([mean(k * h, (k + 1) * h) for k in range(n)])


def midpoints(pivot: Pivot, slope, n: int, parts: int = 400) -> np.ndarray:
    """Integrate by the midpoint rule."""
    t = (np.arange(n * parts) + 0.5) * H / parts
    last = math.inf if pivot.duration_s is None else pivot.start_s + pivot.duration_s
    values = np.where((t >= pivot.start_s) & (t < last), slope(t - pivot.start_s), 0.0)
    return values.reshape(n, parts).mean(axis=1)


# --- means -----------------------------------------------------------------------------------------------------


def test_a_sine_is_held_at_its_mean() -> None:
    """Also where it begins and ends within an interval."""
    sine = Pivot("sine", "across", 0.7, frequency_hz=12.0, phase_deg=30.0, start_s=0.0123, duration_s=0.0511)
    expected = midpoints(sine, lambda t: 0.7 * np.sin(2.0 * np.pi * 12.0 * t + math.radians(30.0)), 20, 20000)
    np.testing.assert_allclose(held(sine, 20), expected, atol=2e-5)
    assert np.count_nonzero(expected) == 11


def test_a_step_is_itself_between_its_edges() -> None:
    step = Pivot("step", "across", -0.4, start_s=0.01, duration_s=0.0125)
    np.testing.assert_allclose(held(step, 6), [0.0, 0.0, -0.4, -0.4, -0.2, 0.0], atol=1e-15)


def test_a_track_runs_straight_between_its_samples(tmp_path: Path) -> None:
    path = tmp_path / "track.csv"
    path.write_text("time_s,up,side\n10.0,0,1.0\n10.013,1,3.0\n10.05,2,-1.0\n", encoding="utf-8")
    track = Pivot("track", file=str(path), column="side", scale=0.5, start_s=0.004)
    points = [0.0, 0.013, 0.05], [0.5, 1.5, -0.5]
    expected = midpoints(track, lambda t: np.where(t < 0.05, np.interp(t, *points), 0.0), 14, 20000)
    np.testing.assert_allclose(held(track, 14), expected, atol=2e-5)


def test_shorter_intervals_add_up_to_longer_ones() -> None:
    """So a figure's motion does not depend on how often it is asked for: noise too."""
    for pivot in (Pivot("noise", "across", 0.3, corner_hz=5.0), Pivot("sine", "across", 0.3, frequency_hz=7.0)):
        fine = held(pivot, 400, H / 4.0).reshape(100, 4).mean(axis=1)
        np.testing.assert_allclose(held(pivot, 100), fine, atol=1e-12)


def test_the_sum_of_all_motions_has_their_directions() -> None:
    pivots = [Pivot("step", "across", 1.0), Pivot("step", "vertical", 0.5, start_s=0.005)]
    signals = PivotSignals(pivots, [[0.0, -1.0, 0.0], [0.0, 0.0, 1.0]], 0, 0)
    assert signals.mean(0.0, 0.005) == [0.0, -1.0, 0.0]
    assert signals.mean(0.005, 0.01) == [0.0, -1.0, 0.5]


# --- noise -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("corner_hz", [1.0, 5.0, 15.0])
def test_noise_has_its_rms_and_its_corner(corner_hz: float) -> None:
    """Power by a spectrum of its own: 78 % of a second-order Butterworth's lies below its corner, 16/17 below twice."""
    worlds, n = 64, round(60.0 / corner_hz / H)
    noise = held(Pivot("noise", "across", 0.3, corner_hz=corner_hz), n, worlds=list(range(worlds)))
    power = np.abs(np.fft.rfft(noise - 0.0, axis=0)) ** 2
    frequencies = np.fft.rfftfreq(n, H)
    below = power[frequencies < corner_hz].sum() / power.sum()
    rms = math.sqrt(float((noise**2).mean()))
    x = np.linspace(0.0, 1.0, 2001)
    share = float(np.trapezoid(1.0 / (1.0 + x**4), x)) / (math.pi / (2.0 * math.sqrt(2.0)))
    print(f"corner {corner_hz:g} Hz: rms {rms:.4f}, {below:.3f} of the power below it, {share:.3f} expected")
    assert rms == pytest.approx(0.3, rel=0.03)
    assert below == pytest.approx(share, abs=0.03)


def test_noise_begins_as_if_it_had_been_on_for_ever() -> None:
    first = np.array([held(Pivot("noise", "across", 1.0, corner_hz=5.0), 1, worlds=list(range(2000)))])
    assert float(first.std()) == pytest.approx(1.0, rel=0.06)


def test_the_noise_of_a_world_is_its_own() -> None:
    """Whatever the number and the order of the worlds, bit for bit; and of no other seed, world or motion."""
    pivot = Pivot("noise", "across", 0.3, corner_hz=5.0)
    alone, many = held(pivot, 50, worlds=3), held(pivot, 50, worlds=[7, 3, 0, 3])
    np.testing.assert_array_equal(many[:, 1], alone)
    np.testing.assert_array_equal(many[:, 3], alone)
    second = pivot_signal(pivot, 1, 0, 3)
    others = [held(pivot, 1, worlds=3, seed=1)[0], many[0, 0], second(0.0, H)]
    assert len({float(value) for value in [*others, alone[0]]}) == 4


def test_going_back_in_time_gives_the_same_noise() -> None:
    noise = BandLimitedNoise(5.0, 0, 0, STREAM)
    there = [noise.velocity(t) for t in (0.1, 0.3, 1.7)]
    assert [noise.velocity(t) for t in (0.1, 0.3, 1.7)] == there


# --- files -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "column", "message"),
    [
        ("", None, "Empty CSV file"),
        ("0.0,1.0\n1.0,2.0\n", None, "line 1: must be a heading"),
        ("t,a,b\n0,1,2\n1,1,2\n", None, "has the columns 'a, b'; name that of the acceleration with column"),
        ("t,a,b\n0,1,2\n1,1,2\n", "bb", "no column 'bb'; did you mean 'b'"),
        ("t,a\n0,1\n", None, "too few samples (1); a track has at least two"),
        ("t,a\n0,1\n\n1,x\n", None, "column 'a': must hold numbers alone"),
        ("t,a\n0,1\n1,nan\n", None, "sample 2: nan m/s2 at 1 s: must be finite"),
        ("t,a\n0,1\n1\n", None, "Expected 2 columns, got 1"),
        ("t,a\n0,1\n0,2\n", None, "sample 2: the time 0 s does not follow 0 s"),
        (
            "t,a\n0,1\n1,9810\n",
            None,
            "sample 2: 9810 m/s2 at 1 s: must be finite numbers, accelerations in m/s2 and at most 1000",
        ),
    ],
)
def test_what_is_no_track_is_refused(text: str, column: str | None, message: str, tmp_path: Path) -> None:
    path = tmp_path / "track.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as refused:
        read_track(str(path), column)
    assert message in str(refused.value)
    assert str(path) in str(refused.value)


def test_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "track.csv"
    path.write_bytes(b"t,a\n0,\xff\xfe\n")
    with pytest.raises(InputError, match="column 'a': must hold numbers"):
        read_track(str(path), None)


def test_a_track_that_changes_is_read_anew(tmp_path: Path) -> None:
    path = tmp_path / "track.csv"
    path.write_text("t,a\n0,1\n1,1\n", encoding="utf-8")
    assert read_track(str(path), None).velocity(1.0) == 1.0
    path.write_text("t,a\n0,10\n1,10\n", encoding="utf-8")
    assert read_track(str(path), None).velocity(1.0) == 10.0

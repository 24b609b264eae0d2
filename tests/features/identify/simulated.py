"""Logs of simulated motions, by accelerometers at odd places, with sensors that have errors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from cmg_mj.features.replay.log import Channels, ReadOptions
from cmg_mj.scenario.rig_file import PlacedAccelerometer, Rig

G = 9.80665
ACCELEROMETER_NOISE = 400e-6 * G * np.sqrt(100.0)
GYRO_NOISE = np.radians(0.005) * np.sqrt(100.0)
TILT_NOISE, COUNT = 0.001, 2.0 * np.pi / 4096.0
PARTS = ("across", "up", "angle", "scale 1", "scale 2", "offset 1", "offset 2", "delay")


class SimulatedLog(NamedTuple):
    """A log, and what is true."""

    channels: Channels
    values: dict[str, np.ndarray]
    """The channels' columns, which may be changed."""
    truth: dict[str, float]


def simulated_log(
    time: np.ndarray, tilt: np.ndarray, seed: int, *, angle: bool = True, gyro: bool = True, n_accelerometers: int = 2
) -> SimulatedLog:
    """Make a log of a motion by the derivatives of a curve through the tilt.

    Errors are drawn from what datasheets allow, delays up to two samples.
    """
    rng, curve, t, dt = np.random.default_rng(seed), CubicSpline(time, tilt), time[5:-5], float(time[1] - time[0])
    of_tilt, of_rate = 1.0 + 0.02 * rng.normal(size=2)
    offset, late = 0.02 * rng.normal(), dt * rng.uniform(-2.0, 2.0)
    values: dict[str, np.ndarray] = {}
    truth = {"gyro scale": of_rate, "gyro offset": offset}
    if angle:
        truth |= {"tilt scale": of_tilt, "gyro delay": late}
        values["tilt"] = COUNT * np.round(of_tilt * (curve(t) + TILT_NOISE * rng.normal(size=len(t))) / COUNT)
    if gyro:
        rate = curve(t - late * angle, 1)
        values["rate"] = of_rate * rate + offset + GYRO_NOISE * rng.normal(size=len(t))
    placed = []
    for number in range(1, n_accelerometers + 1):
        place, turned = complex(rng.uniform(-0.1, 0.1), rng.uniform(0.1, 0.4)), rng.uniform(-3.0, 3.0)
        s1, s2 = (1.0 + 0.02 * rng.normal(size=2)) * [1.0, rng.choice([-1.0, 1.0])]
        (o1, o2), late = 0.3 * rng.normal(size=2), dt * rng.uniform(-2.0, 2.0)
        y, rate, alpha = (curve(t - late, order) for order in range(3))
        f = (1j * G * np.exp(1j * y) - (1j * alpha + rate**2) * place) * np.exp(-1j * turned)
        x, z = [s1 * f.real + o1, s2 * f.imag + o2] + ACCELEROMETER_NOISE * rng.normal(size=(2, len(t)))
        columns = (f"x{number}", f"y{number}")
        values |= dict(zip(columns, (x, z), strict=True))
        its = (place.real, place.imag, turned, s1, s2, o1, o2, late)
        truth |= {f"accelerometer {number} {part}": float(value) for part, value in zip(PARTS, its, strict=True)}
        placed.append(PlacedAccelerometer(columns=columns, place_m=(0.0, 0.0)))
    options = ReadOptions(units={"torque": "n_m"}, rig=Rig(accelerometer=tuple(placed)))
    return SimulatedLog(Channels("simulated", dt, values, options, ()), values, truth)


def swaying(duration: float, dt: float = 0.01) -> tuple[np.ndarray, np.ndarray]:
    """Make a motion of several tones, as under a hand: times and tilts, (n,) [s, rad]."""
    time = np.arange(0.0, duration, dt)
    tones = ((0.09, 0.4), (0.05, 1.1), (0.012, 2.3), (0.003, 4.1))
    return time, sum((size * np.sin(2.0 * np.pi * f * time + f) for size, f in tones), np.zeros(len(time)))


def off(number: float, true: float, name: str) -> float:
    """Return an error; of an angle, without whole turns."""
    error = number - true
    return (error + np.pi) % (2.0 * np.pi) - np.pi if name.endswith("angle") else error

"""Logs of simulated motions, by accelerometers at odd places, with sensors that have errors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from cmg_mj.features.replay.log import Channels, ReadOptions
from cmg_mj.features.replay.rig import PlacedAccelerometer, Rig

G = 9.81
ACCELEROMETER_NOISE = 400e-6 * G * np.sqrt(100.0)
GYRO_NOISE = np.radians(0.005) * np.sqrt(100.0)
COUNT = 2.0 * np.pi / 4096.0


class SimulatedLog(NamedTuple):
    """A log, and what is true."""

    channels: Channels
    truth: dict[str, float]


def simulated_log(
    time: np.ndarray, tilt: np.ndarray, seed: int, *, angle: bool = True, gyro: bool = True
) -> SimulatedLog:
    """Make a log of a motion: tilt sensor, gyro and two accelerometers, by the derivatives of a curve through the tilt.

    Errors are drawn from what datasheets allow, delays up to two samples.
    """
    rng = np.random.default_rng(seed)
    curve = CubicSpline(time, tilt)
    dt = float(time[1] - time[0])
    t = time[5:-5]
    scale = 1.0 + 0.02 * rng.normal(size=2)
    truth = {"tilt scale": scale[0], "gyro scale": scale[1], "gyro offset": 0.02 * rng.normal()}
    truth["gyro delay"] = dt * rng.uniform(-2.0, 2.0) if angle else 0.0
    values: dict[str, np.ndarray] = {}
    if angle:
        shown = truth["tilt scale"] * (curve(t) + 0.001 * rng.normal(size=len(t)))
        values["tilt"] = COUNT * np.round(shown / COUNT)
    if gyro:
        rate = curve(t - truth["gyro delay"], 1)
        values["rate"] = truth["gyro scale"] * rate + truth["gyro offset"] + GYRO_NOISE * rng.normal(size=len(t))
    placed = []
    for name in ("1", "2"):
        columns, side = (f"x{name}", f"y{name}"), rng.choice([-1.0, 1.0])
        across, up, delay = rng.uniform(-0.1, 0.1), rng.uniform(0.1, 0.4), dt * rng.uniform(-2.0, 2.0)
        turned, (s1, s2), (o1, o2) = rng.uniform(-3.0, 3.0), 1.0 + 0.02 * rng.normal(size=2), 0.3 * rng.normal(size=2)
        s2 *= side
        y, rate, alpha = (curve(t - delay, order) for order in range(3))
        f = (1j * G * np.exp(1j * y) + (-1j * alpha - rate**2) * complex(across, up)) * np.exp(-1j * turned)
        noise = ACCELEROMETER_NOISE * rng.normal(size=(2, len(t)))
        values[columns[0]], values[columns[1]] = s1 * f.real + o1 + noise[0], s2 * f.imag + o2 + noise[1]
        parts = ("across", "up", "angle", "scale 1", "scale 2", "offset 1", "offset 2", "delay")
        its = (across, up, turned, s1, s2, o1, o2, delay)
        truth |= {f"accelerometer {name} {part}": float(value) for part, value in zip(parts, its, strict=True)}
        placed.append(PlacedAccelerometer(columns=columns, place_m=(0.0, 0.0)))
    return SimulatedLog(Channels("simulated", dt, values, ReadOptions(rig=Rig(accelerometer=tuple(placed))), ()), truth)

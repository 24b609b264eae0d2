"""`free_pivot` on 26 motions of the pivot, beside a bank of eleven filters that each know one kind of pivot.

    python docs/studies/free_pivot_motions.py [--worlds 40] [--seed 900000] [--only walk]

About four minutes on one core. The rig is that of push_recovery (400 ug/rtHz, e = 0.5 deg, a push of 1 N m for 0.1 s),
as the reduced model with perfect servos; the law is fed the true rate, so that all estimates are of the same motion.
The table has RMS errors over 15 s, the means of all worlds [1e-3 rad/s], `free_pivot` by the bank, and the worlds that
fall with each in its own loop. The last rows are no such motions: a pivot at rest, stronger knocks, and noise.

`free_pivot` was tuned on seed 700000, with 900000 to 960000 in sight (docs/assumptions.md).

The bank is an interacting multiple model estimator (H. A. P. Blom, Y. Bar-Shalom, "The interacting multiple model
algorithm for systems with Markovian switching coefficients", IEEE Trans. Automatic Control 33(8), 1988): Kalman filters
for noise of the first order in a_p/g, of given strength and corner, weighed by how well each has foretold y1. It is not
tuned to these motions, and costs about eleven times the arithmetic.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.tilt import MeasurementNoise, PairTilt
from cmg_mj.core.types import Estimate, Measurement, Observer
from cmg_mj.observers.free_pivot import FreePivot
from cmg_mj.observers.gyro_free import GyroFree
from cmg_mj.results.tables import markdown_table
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario

DT, DURATION = 0.005, 15.0
TIME = DT * np.arange(round(DURATION / DT))
SIGMA = 400e-6 * 9.81 * math.sqrt(100.0)
"""Standard deviation of a sample of an accelerometer [m/s^2]."""
BIAS, START, FALLEN, RATE_LIMIT = math.radians(0.5), math.radians(1.0), math.radians(30.0), 4.7
SHARES = [(s, 5.0) for s in (1e-3, 4e-3, 12e-3, 40e-3, 100e-3)]
SHARES += [(s, 0.7) for s in (12e-3, 40e-3, 100e-3)] + [(s, 0.15) for s in (20e-3, 60e-3, 150e-3)]
"""The bank's models: standard deviation of a_p/g [rad] and corner [Hz]."""
SWITCH = 0.002
"""How likely the pivot's model is to be another one a sample later."""

Rng = np.random.Generator
Signal = Callable[[Rng], np.ndarray]
"""Draws an acceleration in time [m/s^2], (n_ticks,), or (2, n_ticks) with a vertical one."""


def low_passed(rng: Rng, corner_hz: float) -> np.ndarray:
    """Noise of RMS 1 behind a second-order Butterworth low-pass, as if it had been on for ever."""
    from scipy.signal import bilinear, lfilter

    w, early = 2.0 * math.pi * corner_hz, round(3.0 / corner_hz / DT)
    b, a = bilinear([w * w], [1.0, math.sqrt(2.0) * w, w * w], 1.0 / DT)
    n = 20 * early + 4000
    impulse = np.asarray(lfilter(b, a, np.eye(1, n)[0]))
    noise = np.asarray(lfilter(b, a, rng.standard_normal(early + len(TIME))))
    return noise[early:] / math.sqrt((impulse * impulse).sum())


def tone(hz: float, phase: float) -> np.ndarray:
    """Oscillation of amplitude 1."""
    return np.sin(2.0 * math.pi * hz * TIME + phase)


def between(start: float, end: float) -> np.ndarray:
    """1 in an interval [s], 0 outside."""
    inside = np.zeros(len(TIME))
    inside[round(start / DT) : round(end / DT)] = 1.0
    return inside


def walk(peak: float, strikes: bool = True) -> Signal:
    """Steps of 1.6 Hz: sway at half of it, the steps and their double; each step strikes the heel."""

    def signal(rng: Rng) -> np.ndarray:
        phase = rng.uniform(0.0, 2.0 * math.pi, 3)
        across = 0.4 * tone(0.8, phase[0]) + tone(1.6, phase[1]) + 0.5 * tone(3.2, phase[2])
        across, up = peak * across / np.abs(across).max(), 0.0 * TIME
        for start in np.arange(rng.uniform(0.0, 0.625), DURATION, 0.625) if strikes else ():
            since = TIME - start
            ring = np.where(since >= 0.0, np.exp(-np.maximum(since, 0.0) / 0.04), 0.0)
            ring = ring * np.sin(2.0 * math.pi * 15.0 * since)
            across, up = across - 3.3 * peak * ring, up + 2.0 * ring
        return np.array([across, up])

    return signal


def turn(a: float) -> Signal:
    """A curve from 4 to 10 s."""
    return lambda rng: a * between(4.0, 10.0)


def brake(a: float) -> Signal:
    """Braking for 0.8 s."""
    return lambda rng: a * between(5.0, 5.8)


def swell(rms: float) -> Signal:
    """Six tones of 0.1 to 0.3 Hz."""

    def signal(rng: Rng) -> np.ndarray:
        tones = [tone(hz, rng.uniform(0.0, 2.0 * math.pi)) for hz in np.linspace(0.1, 0.3, 6)]
        return rms / math.sqrt(3.0) * np.sum(tones, axis=0)

    return signal


def hand(rms: float) -> Signal:
    """A hand that carries: slow noise and a tremor."""
    return lambda rng: rms * (low_passed(rng, 1.5) + 0.5 * tone(9.0, rng.uniform(0.0, 6.3)))


def half_sine(start: float, seconds: float) -> np.ndarray:
    """A jerk [s]."""
    return between(start, start + seconds) * np.sin(math.pi * (TIME + 0.5 * DT - start) / seconds)


def crane(a: float) -> Signal:
    """A load that swings ever less, with jerks."""

    def signal(rng: Rng) -> np.ndarray:
        swing = a * np.exp(-TIME / 8.0) * tone(0.25, rng.uniform(0.0, 6.3))
        return swing + 1.5 * a * np.sum([half_sine(t, 0.15) for t in (4.0, 8.0, 12.0)], axis=0)

    return signal


def burst(rms: float) -> Signal:
    """Noise that comes and goes."""
    return lambda rng: rms * low_passed(rng, 5.0) * (between(3.0, 6.0) + between(10.0, 11.0))


def knocks(a: float, seconds: float) -> Signal:
    """Three knocks."""
    return lambda rng: a * np.sum([between(t, t + seconds) for t in (3.0, 7.0, 11.0)], axis=0)


def impact(a: float) -> Signal:
    """Three half sines of 30 ms."""
    return lambda rng: a * np.sum([half_sine(t, 0.03) for t in (3.0, 7.0, 11.0)], axis=0)


def bus(a: float) -> Signal:
    """It speeds up and slows down by ramps of 3 s, and shakes."""

    def signal(rng: Rng) -> np.ndarray:
        levels = a * rng.uniform(-1.0, 1.0, 6)
        return np.interp(TIME, 3.0 * np.arange(6), levels) + 0.3 * a * low_passed(rng, 12.0)

    return signal


def sine(hz: float, rms: float) -> Signal:
    """One tone."""
    return lambda rng: math.sqrt(2.0) * rms * tone(hz, rng.uniform(0.0, 6.3))


def noise(rms: float, corner_hz: float) -> Signal:
    """Noise of the bench's sort."""
    return lambda rng: rms * low_passed(rng, corner_hz)


MOTIONS: dict[str, Signal] = {
    **{f"walk {a:g}": walk(a) for a in (0.25, 0.5, 1.0, 2.0)},
    "walk 1, no strikes": walk(1.0, strikes=False),
    **{f"turn {a:g}": turn(a) for a in (0.1, 0.25, 0.5)},
    "brake 1": brake(1.0),
    **{f"swell {a:g}": swell(a) for a in (0.2, 0.5)},
    **{f"hand {a:g}": hand(a) for a in (0.2, 0.5)},
    **{f"crane {a:g}": crane(a) for a in (0.1, 0.2, 0.4)},
    **{f"burst {a:g}": burst(a) for a in (0.5, 1.0)},
    **{f"impact {a:g}": impact(a) for a in (2.0, 10.0)},
    **{f"bus {a:g}": bus(a) for a in (0.2, 0.4)},
    **{f"sine 0.3 Hz, {a:g}": sine(0.3, a) for a in (0.2, 0.5)},
    "sine 2 Hz, 0.5": sine(2.0, 0.5),
    "knocks 10, 10 ms": knocks(10.0, 0.01),
}
BESIDE: dict[str, Signal] = {
    "rest": noise(0.0, 1.0),
    "knocks 20, 20 ms": knocks(20.0, 0.02),
    **{f"noise {a:g} to {hz:g} Hz": noise(a, hz) for a in (0.05, 0.2, 0.5) for hz in (0.5, 1.0, 5.0, 15.0)},
}


class Recording(NamedTuple):
    """Readings of the sensors and the true rate, each (n_ticks, n_worlds), of the worlds that stood."""

    y1: np.ndarray
    acceleration: np.ndarray
    rate: np.ndarray


class Rig(NamedTuple):
    """Known data of the rig."""

    model: ReducedModel
    noise: MeasurementNoise
    tilt: PairTilt
    gravity: float


def recorded(rig: Rig, motions: list[np.ndarray], rng: Rng, observer: Observer | None = None) -> Recording:
    """Run the reduced model, a motion (2, n_ticks) each world, in the loop on an observer or on the true rate."""
    across, up = np.transpose(motions, (1, 2, 0))
    worlds = across.shape[1]
    x1, x2, x3, x_e, u = np.full(worlds, START), *np.zeros((4, worlds))
    state: Any = None
    model, tilt, h = rig.model, rig.tilt, DT
    rows = []

    def f2(x1: np.ndarray, x2: np.ndarray, x3: np.ndarray) -> np.ndarray:
        """Tilt acceleration: gravity pulls at x1 + e, turned and stretched by the pivot's motion."""
        # m h a = gravity_torque a/g, a gimbal's share
        pulled = (1.0 + v / rig.gravity) * np.sin(x1 + BIAS) - a / rig.gravity * np.cos(x1 + BIAS)
        _, gain, damping = model.terms(0.0 * x1, x3)
        return (model.gravity_torque * pulled + torque / model.gimbals) / model.inertia(x3) + u * (gain - damping * x2)

    for k, time in enumerate(TIME):
        a, v = across[k], up[k]
        torque = 1.0 if 2.0 <= time < 2.1 else 0.0
        shaken = SIGMA * rng.standard_normal((4, worlds))
        alpha, s, c = f2(x1, x2, x3), np.sin(x1), np.cos(x1)
        tangential, radial = a * c - (rig.gravity + v) * s, a * s + (rig.gravity + v) * c
        inner, outer = tilt.r_inner, tilt.r_outer
        inner_x, outer_x = inner * alpha + tangential + shaken[0], outer * alpha + tangential + shaken[1]
        inner_z, outer_z = radial - inner * x2 * x2 + shaken[2], radial - outer * x2 * x2 + shaken[3]
        y1 = np.asarray(tilt(inner_x, inner_z, outer_x, outer_z))
        rows.append((y1, tilt.acceleration(inner_x, 0.0, outer_x, 0.0), x2, x1))

        rate = x2
        if observer is not None:
            y = Measurement(y1, x3, rows[-1][1])
            state, rate = (observer.init(y), 0.0 * x2) if k == 0 else observed(observer, state, y)
        u = np.clip(-(35.0 * y1 + 4.0 * rate - x3 + 0.3 * x_e), -RATE_LIMIT, RATE_LIMIT)
        x_e = x_e - h * x3
        half = x3 + 0.5 * h * u  # Runge and Kutta's, u held
        k1 = f2(x1, x2, x3)
        k2 = f2(x1 + 0.5 * h * x2, x2 + 0.5 * h * k1, half)
        k3 = f2(x1 + 0.5 * h * (x2 + 0.5 * h * k1), x2 + 0.5 * h * k2, half)
        k4 = f2(x1 + h * (x2 + 0.5 * h * k2), x2 + h * k3, x3 + h * u)
        x1, x2 = x1 + h * x2 + h * h / 6.0 * (k1 + k2 + k3), x2 + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        x3 = x3 + h * u
    y1, acceleration, rate, tilted = (np.array(column) for column in zip(*rows, strict=True))
    stood = (np.abs(tilted) < FALLEN).all(axis=0)
    return Recording(y1[:, stood], acceleration[:, stood], rate[:, stood])


def observed(observer: Observer, state: Any, y: Measurement) -> tuple[Any, np.ndarray]:
    """The observer's next state and its rate."""
    state, estimate = observer.step(state, y, 0.0)
    return state, estimate.x2


def estimated(observer: Observer, recording: Recording) -> np.ndarray:
    """Rates (n_ticks, n_worlds) that an observer estimates of a recording."""
    rest = 0.0 * recording.y1[0]
    samples = [Measurement(y1, rest, a) for y1, a in zip(recording.y1, recording.acceleration, strict=True)]
    state, rates = observer.init(samples[0]), [rest]
    for y in samples[1:]:
        state, rate = observed(observer, state, y)
        rates.append(rate)
    return np.array(rates)


class BankState(NamedTuple):
    """Predictions of all filters: means (worlds, models, 5), covariances (worlds, models, 5, 5), and their weights."""

    x: np.ndarray
    P: np.ndarray
    weights: np.ndarray


class Bank:
    """The bank as an observer of many worlds.

    States of each filter are p, z, b, w and the sample's n, as `FreePivot` has them, in rad, s and textbook matrices.
    """

    def __init__(self, rig: Rig) -> None:
        like, noise, h = FreePivot(DT, rig.model, rig.noise), rig.noise, DT
        n, strengths = len(SHARES), np.array([s for s, _ in SHARES])
        fade = np.exp([-2.0 * math.pi * hz * h for _, hz in SHARES])
        self.F = np.zeros((n, 5, 5))
        self.F[:] = np.diag([1.0, 1.0, 1.0, 0.0, 0.0])
        self.F[:, :2, 1:] = [[h, -h * h, 0.0, -h * h], [1.0, -h, 0.0, -h]]
        self.F[:, 3, 3] = fade
        self.drive = np.array([h * h, h, 0.0, 0.0, 0.0])
        c = noise.correlation * noise.tilt / noise.acceleration
        self.H = np.array([1.0, 0.0, -h * h / 6.0, 1.0, c - h * h / 6.0])
        self.Q = np.zeros((n, 5, 5))
        self.Q[:] = like.jerk**2 * np.outer(self.drive, self.drive)
        self.Q[:, 2, 2] += like.bias_walk**2 * h
        self.Q[:, 3, 3], self.Q[:, 4, 4] = (1.0 - fade * fade) * strengths**2, noise.acceleration**2
        self.R = noise.tilt**2 * (1.0 - noise.correlation**2)
        self.stay = (1.0 - SWITCH) * np.eye(n) + SWITCH / (n - 1) * (1.0 - np.eye(n))
        self.start = np.zeros((n, 5, 5))
        self.start[:] = np.diag([1.0, like.rate_start**2, like.bias_start**2, 0.0, noise.acceleration**2])
        self.start[:, 3, 3] = strengths**2

    def init(self, y: Measurement) -> BankState:
        """Start at rest, all models alike."""
        worlds, n = len(y.y1), len(SHARES)
        x = np.zeros((worlds, n, 5))
        x[..., 0] = (y.y1 - DT * DT / 6.0 * y.acceleration)[:, None]
        start = BankState(x, np.tile(self.start, (worlds, 1, 1, 1)), np.full((worlds, n), 1.0 / n))
        return self.step(start, y, 0.0)[0]

    def step(self, state: BankState, y: Measurement, u: Scalar) -> tuple[BankState, Estimate]:
        """Correct each filter, weigh and mix them, and advance."""
        x, P, weights = state
        y1, a = y.y1[:, None], y.acceleration[:, None]
        e = y1 - DT * DT / 6.0 * a - x @ self.H
        PH = P @ self.H
        ee = PH @ self.H + self.R
        x = x + PH * (e / ee)[..., None]
        P = P - PH[..., :, None] * (PH / ee[..., None])[..., None, :]
        log = np.log(weights) - 0.5 * (e * e / ee + np.log(ee))
        weights = np.exp(log - log.max(axis=1, keepdims=True))
        weights = np.maximum(weights / weights.sum(axis=1, keepdims=True), 1e-12)
        rate = (weights * (x[..., 1] + 0.5 * DT * (a - x[..., 2] - x[..., 4]))).sum(axis=1)

        ahead = weights @ self.stay
        mix = np.swapaxes(weights[:, :, None] * self.stay / ahead[:, None, :], 1, 2)  # of the models in the next one
        mixed = mix @ x
        second = (P + x[..., :, None] * x[..., None, :]).reshape(*weights.shape, 25)
        P = (mix @ second).reshape(P.shape) - mixed[..., :, None] * mixed[..., None, :]
        x = (self.F @ mixed[..., None])[..., 0] + self.drive * a[..., None]
        return BankState(x, self.F @ P @ np.swapaxes(self.F, 1, 2) + self.Q, ahead), Estimate(y.y1, rate, y.y2)


def known_rig() -> Rig:
    """The rig of push_recovery."""
    setup = prepare(load_scenario("push_recovery", [], "gyro_free"))
    _, model, noise = setup.design.constructor_arguments
    return Rig(model, noise, setup.plant.pair_tilt, setup.plant.gravity)


def record(rig: Rig, name: str, worlds: int, seed: int, observer: Observer | None = None) -> Recording:
    """Record a motion of `MOTIONS` or `BESIDE`."""
    signals = MOTIONS | BESIDE
    rng = np.random.default_rng([seed, list(signals).index(name)])
    drawn = [np.atleast_2d(signals[name](rng)) for _ in range(worlds)]
    return recorded(rig, [np.vstack([each, 0.0 * TIME])[:2] for each in drawn], rng, observer)


def row(name: str, worlds: int, seed: int) -> list[str]:
    """The errors on a motion."""
    rig = known_rig()
    observers = FreePivot(DT, rig.model, rig.noise), GyroFree(DT, rig.model, rig.noise), Bank(rig)
    recording = record(rig, name, worlds, seed)
    estimates = [estimated(observer, recording) for observer in observers]
    errors = [np.sqrt(np.square(estimate - recording.rate).mean(axis=0)) for estimate in [*estimates, 0.0]]
    means = [1e3 * float(error.mean()) for error in errors]
    falls = [worlds - record(rig, name, worlds, seed, observer).rate.shape[1] for observer in observers]
    return [name, *(f"{mean:.1f}" for mean in means), f"{means[0] / means[2]:.2f}", *map(str, falls)]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=40)
    parser.add_argument("--seed", type=int, default=900_000)
    parser.add_argument("--only", default="", help="only motions whose name contains this")
    options = parser.parse_args()
    names = [name for name in MOTIONS | BESIDE if options.only in name]
    rows = [row(name, options.worlds, options.seed) for name in names]
    names = ["`free_pivot`", "`gyro_free`", "bank"]
    print(markdown_table(["motion [m/s2]", *names, "`zero`", "by the bank", *(f"{name} fell" for name in names)], rows))


if __name__ == "__main__":
    main()

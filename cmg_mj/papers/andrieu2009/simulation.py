"""Section 3.1: the bioreactor simulated, and three observers that follow it, a column a seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.signal import detrend

from cmg_mj.papers.andrieu2009.bioreactor import (
    HBAR,
    HBAR_OF_OBSERVERS,
    L1,
    L2,
    NOISE,
    PHI1,
    PHI2,
    PHI3,
    B,
    Bioreactor,
    P,
    dilution,
)
from cmg_mj.papers.andrieu2009.observer import BiLimitCorrection, Signals, UpdatedHighGain
from cmg_mj.papers.claim import Assumption

Array = np.ndarray
NOISE_PERIOD = 0.01
DURATION = 50.0
LOUD = 0.0986
"""10 % of the domain of eta1, which the paper takes for 0.05."""

CONSTANT, UPDATED, HOMOGENEOUS = "constant gain", "updated gain", "updated gain, homogeneous"
KINDS = (CONSTANT, UPDATED, HOMOGENEOUS)
TIME = "time [normalised]"
WINDOWS = ((5.0, 10.0), (15.0, 20.0), (28.0, 35.0), (42.0, 50.0))
"""The later part of each of the four inputs."""

ASSUMED: Mapping[Assumption, str] = {
    "initial values": "drawn from M_eta for each seed",
    "noise": "a new value every 10 ms, straight in between",
}
"""Data of Figs 1 and 2 that the paper does not give."""


class Run(NamedTuple):
    """The plant with hbar = 1 and what is measured of it, one column a seed."""

    t: Array
    """Time, (n,)."""
    u: Array
    """Input held from each sample on, (n, 1)."""
    eta: Array
    """State, (2, n, seeds)."""
    y: Array
    """Measured eta_1, (n, seeds)."""
    start: Array
    """State from which the observers start, (2, seeds)."""


class Replay(NamedTuple):
    """An observer's estimates along a run, each (n, seeds)."""

    eta2_error: Array
    """eta_2 less its estimate."""
    rate: Array
    """The estimate of the local incremental rate that its gain uses."""
    L: Array
    """The gain."""
    argument: Array
    """|l1 (x1_hat - y)/L^b|, what q1 is taken of."""


Replays = dict[str, Replay]
"""Observer -> its replay."""


def run_plant(seeds: Sequence[int], noise: float | Sequence[float] = NOISE, dt: float = NOISE_PERIOD) -> Run:
    """Simulate the bioreactor. The paper gives no initial values: they are drawn from M_eta, as the observers' are.

    Args:
        seeds: One run each.
        noise: Standard deviation of the Gaussian measurement disturbance, one for all or one a run; drawn every 10 ms,
            straight in between.
        dt: Sample period; it divides 10 ms.

    Returns:
        The run.
    """
    plant = Bioreactor(HBAR)
    n = round(DURATION / dt)
    coarse = round(DURATION / NOISE_PERIOD)
    t = np.arange(n + 1) * dt
    u = np.array([dilution(time) for time in t])[:, None]
    starts, disturbances = [], []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        room = 1.0 - plant.eps1 - plant.eps2
        starts.append([np.array([plant.eps1, plant.eps2]) + room * rng.dirichlet((1.0, 1.0, 1.0))[:2] for _ in "ab"])
        disturbances.append(np.interp(t, np.arange(coarse + 1) * NOISE_PERIOD, rng.normal(size=coarse + 1)))
    start, estimate = np.moveaxis(np.array(starts), 0, -1)
    eta = integrate(plant, start, u, dt)
    return Run(t, u, eta, eta[0] + noise * np.array(disturbances).T, estimate)


def integrate(model: Bioreactor, start: Array, u: Array, dt: float) -> Array:
    """Integrate (14) from a start (2, runs) by classical steps with inputs held, (2, n, runs)."""
    eta = np.empty((2, len(u), start.shape[1]))
    eta[:, 0] = state = start

    def slope(z: Array, u_k: Array) -> Array:
        return np.array(model.slope(z[0], z[1], u_k))

    for k, u_k in enumerate(u[:-1]):
        p = slope(state, u_k)
        q = slope(state + 0.5 * dt * p, u_k)
        r = slope(state + 0.5 * dt * q, u_k)
        eta[:, k + 1] = state = state + dt / 6.0 * (p + 2.0 * (q + r) + slope(state + dt * r, u_k))
    return eta


def replay(kind: str, run: Run, model: Bioreactor, *, p: float = P, b: float = B) -> Replay:
    """Let one of the three observers, with the paper's parameters, estimate a run.

    Args:
        kind: CONSTANT, UPDATED or HOMOGENEOUS.
        run: The run.
        model: The bioreactor as the observer knows it.
        p: d_inf of the homogeneous one; with 0 its correction is linear, while its gain keeps Omega_2.
        b: Exponent of its scaling.

    Returns:
        Its estimates.
    """

    def saturate(y: Signals, x: Signals) -> tuple[Signals, Signals]:
        x1, x2 = model.limit(y[0], x[0])
        return (x1,), (x2,)

    def Omega(u: Any, y: Signals, x: Signals) -> Any:
        if kind == CONSTANT:
            return 0.0 * y[0]
        if kind == UPDATED:
            return model.Omega1(u, y[0], x[0])
        return model.Omega2(u, y[0], x[0], P)

    f = (lambda u, y, x: -u * y[0], lambda u, y, x: model.f2(u, y[0], x[0]))
    phi1, phi2, phi3 = PHI1, PHI2, PHI3
    if kind == CONSTANT:  # L stays at the gain to which (8) tends with df2_max for Omega
        phi1, phi2, phi3 = 1.0, PHI2 + PHI3 / PHI1 * model.df2_max, 1.0
    if kind != HOMOGENEOUS:
        p, b = 0.0, 1.0  # a linear correction
    observer = UpdatedHighGain(
        dt=run.t[1],
        f=f,
        correction=BiLimitCorrection((L1, L2), p),
        Omega=Omega,
        b=b,
        phi1=phi1,
        phi2=phi2,
        phi3=phi3,
        saturate=saturate,
    )
    _, x2 = model.limit(run.start[0], model.to_x2(*run.start))
    x, L = observer.follow((run.y,), (run.y[0], x2), run.u[:, 0].tolist())
    eta2_error = run.eta[1] - model.to_eta2(*model.limit(*x))
    rate = np.full_like(run.y, model.df2_max) if kind == CONSTANT else Omega(run.u, *saturate((run.y,), (x[1],)))
    return Replay(eta2_error, rate, L, np.abs(L1 * (x[0] - run.y)) / L**b)


def replays(run: Run, model: Bioreactor) -> Replays:
    """Replay all three observers on one run."""
    return {kind: replay(kind, run, model) for kind in KINDS}


def _windows(run: Run, values: Array) -> list[Array]:
    """Return the samples in each window, (samples, seeds)."""
    return [values[(run.t >= start) & (run.t < end)] for start, end in WINDOWS]


def window_means(run: Run, values: Array) -> Array:
    """Return the mean over each window and all seeds, (4,)."""
    return np.array([part.mean(axis=0) for part in _windows(run, values)]).mean(axis=1)


def window_spreads(run: Run, values: Array) -> Array:
    """Return the standard deviation over each window about a straight line through it, mean over seeds, (4,)."""
    return np.array([detrend(part, axis=0).std(axis=0) for part in _windows(run, values)]).mean(axis=1)


def rms_late(run: Run, values: Array) -> Array:
    """Return the RMS after 5, one number a seed."""
    return np.sqrt(np.mean(values[run.t > 5.0] ** 2, axis=0))


class Study(NamedTuple):
    """All simulations of the bioreactor: columns are seeds."""

    run: Run
    nominal: Replays
    """Runs with the paper's noise and error of hbar."""
    loud: Replays
    """Runs with noise of 10 % of the domain."""
    quiet: Replays
    """Replays without noise, of one run."""
    exact: Replays
    """Runs with noise, without error of hbar."""
    rate: Array
    """df2/dx2 of the f2 that the observers bound, at the true state, (n, seeds)."""


def study(seeds: int, seed: int = 0) -> Study:
    """Simulate. All noise levels are columns of the same arrays, which costs no time."""
    t, u, *whole_run = run_plant([*range(seed, seed + seeds)] * 2 + [seed], [NOISE] * seeds + [LOUD] * seeds + [0.0])
    model = Bioreactor(HBAR_OF_OBSERVERS)
    whole_replays = replays(Run(t, u, *whole_run), model)

    def columns(part: slice) -> Replays:
        return {kind: Replay(*(a[..., part] for a in whole)) for kind, whole in whole_replays.items()}

    nominal, loud, quiet = columns(slice(seeds)), columns(slice(seeds, 2 * seeds)), columns(slice(2 * seeds, None))
    run = Run(t, u, *(a[..., :seeds] for a in whole_run))
    rate = model.f2_slope(u, *model.limit(run.eta[0], Bioreactor(HBAR).to_x2(*run.eta)))
    return Study(run, nominal, loud, quiet, replays(run, Bioreactor(HBAR)), rate)


def rms_by_kind(run: Run, by_kind: Replays) -> Array:
    """Return the RMS error of eta2 after t = 5, (3 observers, seeds)."""
    return np.array([rms_late(run, by_kind[kind].eta2_error) for kind in KINDS])

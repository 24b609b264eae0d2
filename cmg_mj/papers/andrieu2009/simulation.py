"""Section 3.1: the bioreactor simulated, and three observers that follow it, a column a seed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
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

# --- Section 3.1: the bioreactor simulated, and three observers that follow it, a column a seed ---

NOISE_PERIOD = 0.01
DURATION = 50.0

CONSTANT, UPDATED, HOMOGENEOUS = "constant gain", "updated gain", "updated gain, homogeneous"
KINDS = (CONSTANT, UPDATED, HOMOGENEOUS)
TIME = "time [normalised]"
WINDOWS = ((5.0, 10.0), (15.0, 20.0), (28.0, 35.0), (42.0, 50.0))
"""The later part of each of the four inputs."""


@dataclass(frozen=True)
class Run:
    """The plant with hbar = 1 and what is measured of it, one column a seed.

    Attributes:
        t: Time, (n,).
        u: Input held from each sample on, (n, 1).
        eta: State, (2, n, seeds).
        y: Measured eta_1, (n, seeds).
        start: State from which the observers start, (2, seeds).
    """

    t: np.ndarray
    u: np.ndarray
    eta: np.ndarray
    y: np.ndarray
    start: np.ndarray


@dataclass(frozen=True)
class Replay:
    """An observer's estimates along a run.

    Attributes:
        x2: Estimate of x2, (n, seeds).
        eta2_error: eta_2 less its estimate, (n, seeds).
        rate: The estimate of the local incremental rate that its gain uses, (n, seeds).
        L: The gain, (n, seeds).
        argument: |l1 (x1_hat - y)/L^b|, what q1 is taken of, (n, seeds).
    """

    x2: np.ndarray
    eta2_error: np.ndarray
    rate: np.ndarray
    L: np.ndarray
    argument: np.ndarray


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
    eta = _integrate(plant, start, u, dt)
    return Run(t, u, eta, eta[0] + noise * np.array(disturbances).T, estimate)


def _integrate(model: Bioreactor, start: np.ndarray, u: np.ndarray, dt: float) -> np.ndarray:
    """Integrate (14) from a start (2, runs) with inputs held from sample to sample, (2, n, runs)."""
    eta = np.empty((2, len(u), start.shape[1]))
    eta[:, 0] = state = start
    for k in range(len(u) - 1):
        eta[:, k + 1] = state = runge_kutta(lambda z, u_k=u[k]: np.array(model.slope(z[0], z[1], u_k)), state, dt)
    return eta


def copy_errors(run: Run, model: Bioreactor) -> np.ndarray:
    """Return the error of a copy of (14) without correction, from the observers' start, (2, n, seeds)."""
    return run.eta - _integrate(model, run.start, run.u, float(run.t[1]))


def runge_kutta(slope: Callable[[np.ndarray], np.ndarray], state: np.ndarray, dt: float) -> np.ndarray:
    """Take one classical step."""
    p = slope(state)
    q = slope(state + 0.5 * dt * p)
    r = slope(state + 0.5 * dt * q)
    return state + dt / 6.0 * (p + 2.0 * (q + r) + slope(state + dt * r))


def make_observer(kind: str, model: Bioreactor, dt: float, *, p: float = P, b: float = B) -> UpdatedHighGain:
    """Make one of the three observers with the paper's parameters.

    Args:
        kind: CONSTANT, UPDATED or HOMOGENEOUS.
        model: The bioreactor as the observer knows it.
        dt: Sample period.
        p: d_inf of the homogeneous one; with 0 its correction is linear, while its gain keeps Omega_2.
        b: Exponent of its scaling.

    Returns:
        The observer.
    """

    def saturate(y: Signals, x: Signals) -> tuple[Signals, Signals]:
        x1 = model.limit_x1(y[0])
        return (x1,), tuple(model.limit_x2(x1, x2) for x2 in x[:1])

    f = (lambda u, y, x: -u * y[0], lambda u, y, x: model.f2(y[0], x[0], u))
    if kind == CONSTANT:  # the gain to which (8) tends with df2_max for Omega
        L = PHI2 + PHI3 / PHI1 * model.df2_max
        return UpdatedHighGain.plain(dt=dt, f=f, l=(L1, L2), L=L, saturate=saturate)
    if kind == UPDATED:
        return UpdatedHighGain.updated(
            dt=dt,
            f=f,
            l=(L1, L2),
            Omega=lambda u, y, x: model.Omega1(u, y[0], x[0]),
            phi1=PHI1,
            phi2=PHI2,
            phi3=PHI3,
            saturate=saturate,
        )
    return UpdatedHighGain(
        dt=dt,
        f=f,
        correction=BiLimitCorrection((L1, L2), p),
        Omega=lambda u, y, x: model.Omega2(u, y[0], x[0], P),
        b=b,
        phi1=PHI1,
        phi2=PHI2,
        phi3=PHI3,
        saturate=saturate,
    )


def replay(kind: str, run: Run, model: Bioreactor, *, p: float = P, b: float = B) -> Replay:
    """Let an observer estimate a run. Arguments as of `make_observer`."""
    observer = make_observer(kind, model, float(run.t[1]), p=p, b=b)
    x1 = model.limit_x1(run.start[0])
    state = observer.init((run.y[0],), (run.y[0], model.limit_x2(x1, model.to_x2(x1, run.start[1]))))
    x, L = np.empty_like(run.eta), np.empty_like(run.y)
    x[:, 0], L[0] = state.x, state.L
    for k in range(1, len(run.t)):
        state, x[:, k] = observer.step(state, (run.y[k],), float(run.u[k - 1, 0]))
        L[k] = state.L
    x1 = model.limit_x1(x[0])
    eta2 = model.to_eta2(x1, model.limit_x2(x1, x[1]))
    y = model.limit_x1(run.y)
    x2 = model.limit_x2(y, x[1])
    rate = {
        CONSTANT: lambda: np.full_like(run.y, model.df2_max),
        UPDATED: lambda: model.Omega1(run.u, y, x2),
        HOMOGENEOUS: lambda: model.Omega2(run.u, y, x2, P),
    }[kind]()
    argument = np.abs(L1 * (x[0] - run.y)) / L ** (b if kind == HOMOGENEOUS else observer.b)
    return Replay(x[1], run.eta[1] - eta2, rate, L, argument)


def select_seeds(part: Run | Replay, columns: slice) -> Any:
    """Return a part of some of the seeds."""
    common = ("t", "u")
    return replace(part, **{f.name: getattr(part, f.name)[..., columns] for f in fields(part) if f.name not in common})


def replays(run: Run, model: Bioreactor) -> dict[str, Replay]:
    """Replay all three observers on one run."""
    return {kind: replay(kind, run, model) for kind in KINDS}


def incremental_rate(run: Run, model: Bioreactor) -> np.ndarray:
    """Return df2/dx2 of the f2 that the observers bound, at the true state, (n, seeds)."""
    x1 = model.limit_x1(run.eta[0])
    x2 = model.limit_x2(x1, Bioreactor(HBAR).to_x2(*run.eta))
    return model.f2_slope(x1, x2, run.u)


def split_windows(run: Run, values: np.ndarray) -> list[np.ndarray]:
    """Return the samples in each window, (samples, seeds)."""
    return [values[(run.t >= start) & (run.t < end)] for start, end in WINDOWS]


def window_means(run: Run, values: np.ndarray) -> np.ndarray:
    """Return the mean over each window, (4, seeds)."""
    return np.array([part.mean(axis=0) for part in split_windows(run, values)])


def window_spreads(run: Run, values: np.ndarray) -> np.ndarray:
    """Return the standard deviation over each window about a straight line through it, (4, seeds)."""
    return np.array([detrend(part, axis=0).std(axis=0) for part in split_windows(run, values)])


def rms_late(run: Run, values: np.ndarray) -> np.ndarray:
    """Return the RMS after 5, one number a seed."""
    return np.sqrt(np.mean(values[run.t > 5.0] ** 2, axis=0))


# --- The simulations behind Figs 1 and 2: the bioreactor and its three observers, many seeds at once ---

LOUD = 0.0986
"""10 % of the domain of eta1, which the paper takes for 0.05."""


class Study(NamedTuple):
    """All simulations of the bioreactor: columns are seeds."""

    run: Run
    nominal: dict[str, Replay]
    """Runs with the paper's noise and error of hbar."""
    loud: dict[str, Replay]
    """Runs with noise of 10 % of the domain."""
    quiet_run: Run
    quiet: dict[str, Replay]
    """Replays without noise, on one run."""
    exact: dict[str, Replay]
    """Runs with noise, without error of hbar."""
    rate: np.ndarray
    """df2/dx2, (n, seeds)."""


ASSUMED: Mapping[Assumption, str] = {
    "initial values": "drawn from M_eta for each seed",
    "noise": "a new value every 10 ms, straight in between",
}
"""Data of Figs 1 and 2 that the paper does not give."""


def study(seeds: int, seed: int = 0, dt: float = 0.01) -> Study:
    """Simulate. All noise levels are columns of the same arrays, which costs no time."""
    numbers = [*range(seed, seed + seeds)] * 2 + [seed]
    noise = [NOISE] * seeds + [LOUD] * seeds + [0.0]
    whole_run = run_plant(numbers, noise, dt)
    model = Bioreactor(HBAR_OF_OBSERVERS)
    whole_replays = replays(whole_run, model)
    first, second, last = slice(0, seeds), slice(seeds, 2 * seeds), slice(2 * seeds, None)
    run, quiet_run = select_seeds(whole_run, first), select_seeds(whole_run, last)

    def columns(selection: slice) -> dict[str, Replay]:
        return {kind: select_seeds(part, selection) for kind, part in whole_replays.items()}

    exact = replays(run, Bioreactor(HBAR))
    return Study(run, columns(first), columns(second), quiet_run, columns(last), exact, incremental_rate(run, model))


def rms_by_kind(run: Run, by_kind: dict[str, Replay]) -> np.ndarray:
    """Return the RMS error of eta2 after t = 5, (3 observers, seeds)."""
    return np.array([rms_late(run, by_kind[kind].eta2_error) for kind in KINDS])

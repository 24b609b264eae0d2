"""The pendulum robot's motions and what its observers make of them, many initial conditions at once."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from cmg_mj.papers.claim import Assumption, OnShare
from cmg_mj.papers.dao2023 import paper
from cmg_mj.papers.dao2023.observer import FriedlandTacker, System

# --- The pendulum robot's motions and what its observers make of them, many initial conditions at once ---


def make_proposed(dt: float, sigmas: Sequence[float] = (10.0,)) -> FriedlandTacker:
    """Make the paper's observer; its leading dimensions are the weights sigma, then one for the motions."""
    return FriedlandTacker(dt, paper.A_M, paper.C_M, paper.L, paper.GAMMA, np.reshape(sigmas, (-1, 1, 1, 1)))


def make_conventional(dt: float, sigmas: Sequence[float] = (10.0,)) -> FriedlandTacker:
    """Make the observer compared with it, which knows of no disturbance; leading dimensions as above."""
    return FriedlandTacker.conventional(dt, paper.L, paper.GAMMA[:2, :2], np.reshape(sigmas, (-1, 1, 1, 1)))


def make_single(dt: float, sigma: float) -> FriedlandTacker:
    """Make the paper's observer without leading dimensions."""
    return FriedlandTacker(dt, paper.A_M, paper.C_M, paper.L, paper.GAMMA, np.array([[sigma]]))


def starts(seed: int, n: int) -> np.ndarray:
    """Return the initial angles within half a turn and rates within 2 rad/s, (n, 2) [rad, rad/s]."""
    rng = np.random.default_rng(seed)
    return np.stack([rng.uniform(-np.pi, np.pi, n), rng.uniform(-2.0, 2.0, n)], axis=-1)


def motion(start: np.ndarray, t: np.ndarray, coefficient: float = 1.0) -> np.ndarray:
    """Integrate the arm's own motion.

    It is chaotic: after some time two integrators no longer agree. Each computed motion is still, to the tolerance,
    one that the arm can make, and that is what an observer is given.

    Args:
        start: q and its rate at t[0], (n, 2) [rad, rad/s].
        t: Times, (n_times,) [s].
        coefficient: Factor of d in q'': 1 as in (14); (10) would have theta2.

    Returns:
        q and its rate, (n_times, n, 2).
    """
    n = len(start)

    def slope(time: float, x: np.ndarray) -> np.ndarray:
        return np.concatenate([x[n:], paper.acceleration(x[:n], time, coefficient)])

    solution = solve_ivp(slope, (t[0], t[-1]), start.T.ravel(), "DOP853", t, rtol=1e-10, atol=1e-10)
    return np.stack([solution.y[:n].T, solution.y[n:].T], axis=-1)


@dataclass(frozen=True)
class Errors:
    """An observer's errors along the motions.

    Attributes:
        t: Times, (n_times,) [s].
        state: Errors of q and its rate, (n_times, n_sigmas, n, 2) [rad, rad/s].
        exogenous: Errors of theta1, theta2 and, if it is estimated, d, (n_times, n_sigmas, n, 2 or 3).
    """

    t: np.ndarray
    state: np.ndarray
    exogenous: np.ndarray

    def tail_rms(self) -> np.ndarray:
        """Return the RMS of the state error's norm over the last fifth, (n_sigmas, n)."""
        tail = self.t >= self.t[0] + 0.8 * (self.t[-1] - self.t[0])
        return np.sqrt(np.mean(np.sum(self.state[tail] ** 2, axis=-1), axis=0))


def follow(
    observer: FriedlandTacker, t: np.ndarray, x: np.ndarray, on_share: Callable[[float], None] = lambda share: None
) -> Errors:
    """Let observers, from zero, follow all motions.

    Args:
        observer: One of the two above.
        t: Sample times, one observer.dt apart, (n_times,) [s].
        x: The motions at these times, (n_times, n, 2).
        on_share: Called with the share done.

    Returns:
        Their errors.
    """
    r, n_sigmas = observer.Cm.shape[0], len(observer.Sigma)
    y = x[..., :1]
    inputs = paper.torque((t[1:] + t[:-1]) / 2.0)
    all_times = paper.system((y[1:, :, 0] + y[:-1, :, 0]) / 2.0, inputs[:, None], with_disturbance=r == 3)
    truth = paper.exosystem_state(t) @ paper.C_M.T
    state = observer.init(y[0])
    state_errors = np.zeros((len(t), n_sigmas, *x.shape[1:]))
    exogenous = np.zeros((len(t), n_sigmas, x.shape[1], r))
    state_errors[0], exogenous[0] = -x[0], -truth[0, :r]
    for k in range(1, len(t)):
        system = System(all_times.A, all_times.B0[k - 1], all_times.B2, all_times.C2, all_times.D20)
        state = observer.step(state, system, inputs[k - 1 : k], y[k])
        state_errors[k] = state.x - x[k]
        exogenous[k] = state.xm @ observer.Cm.T - truth[k, :r]
        if k % 1000 == 0:
            on_share(k / len(t))
    return Errors(t, state_errors, exogenous)


def settle_times(size: np.ndarray, t: np.ndarray, band: float) -> np.ndarray:
    """Find the time from which a quantity stays inside a band: infinite if it is outside at the end.

    Args:
        size: Its absolute value, (n_times, ...).
        t: Times, (n_times,) [s].
        band: The band, in the quantity's unit.

    Returns:
        The times, (...) [s].
    """
    is_outside = size > band
    index = len(t) - np.argmax(is_outside[::-1], axis=0)  # the sample after the last one outside
    times = np.append(t, np.inf)[index]
    return np.where(is_outside.any(axis=0), times, t[0])


# --- The simulations behind Figs 2 and 3: some motions of the pendulum robot, followed by both observers ---

SIGMAS = (*paper.SIGMAS, 10_000.0)
"""The paper's three weights, in the order of Fig. 3, and one beyond."""

SETTLED = 0.1
"""Settled: the errors of theta1, theta2 and d, as a vector of their numbers in the units of Fig. 3, stay below this."""

ASSUMED: Mapping[Assumption, str] = {"initial values": "ten motions", "duration": "200 s"}
UNSTATED = (
    "The paper gives neither time span nor initial values: ten motions with angles within half a turn and rates within "
    "2 rad/s, observers started from zero, 200 s, with the corrected L = -[1; 1]."
)


@dataclass(frozen=True)
class Study:
    """The arm's motions and what the observers made of them.

    Attributes:
        proposed: Errors with each of `SIGMAS`.
        conventional: Errors at Sigma = 10.
        largest_angle: The largest |q| [rad].
    """

    proposed: Errors
    conventional: Errors
    largest_angle: float


def study(
    seed: int = 0,
    motions: int = 10,
    duration_s: float = 200.0,
    rates_hz: tuple[float, float] = (400.0, 200.0),
    on_share: OnShare = lambda share: None,
) -> Study:
    """Let both observers follow the arm.

    Args:
        seed: Seed of the initial values.
        motions: Number of motions.
        duration_s: Simulated time [s].
        rates_hz: Sample rates of the proposed and of the conventional observer, the former a multiple of the latter
            [Hz].
        on_share: Called with the share done.

    Returns:
        All errors.
    """
    rate, every = rates_hz[0], round(rates_hz[0] / rates_hz[1])
    t = np.arange(round(duration_s * rate) + 1) / rate
    x = motion(starts(seed, motions), t)
    proposed = follow(make_proposed(1.0 / rate, SIGMAS), t, x, lambda s: on_share(0.1 + 0.65 * s))
    t_plain, x_plain = t[::every], x[::every]
    plain = follow(make_conventional(every / rate), t_plain, x_plain, lambda s: on_share(0.75 + 0.25 * s))
    return Study(proposed, plain, float(np.abs(x[..., 0]).max()))


def exogenous_settle_times(errors: Errors, band: float = SETTLED) -> np.ndarray:
    """Find when the errors of theta1, theta2 and d settle, (n_sigmas, n) [s]; infinite if they do not."""
    return settle_times(np.linalg.norm(errors.exogenous, axis=-1), errors.t, band)


def finite_times(times: np.ndarray) -> list[float | None]:
    """Return settling times as JSON can hold them."""
    return [float(time) if math.isfinite(time) else None for time in times]

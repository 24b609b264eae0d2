"""The pendulum robot's motions and what its observers make of them, many initial conditions at once."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from cmg_mj.papers.claim import Assumption, OnShare
from cmg_mj.papers.dao2023 import paper
from cmg_mj.papers.dao2023.observer import Array, FriedlandTacker

SIGMAS = (*paper.SIGMAS, 10_000.0)
"""The paper's three weights, in the order of Fig. 3, and one beyond."""

SETTLED = 0.1
"""Settled: the errors of theta1, theta2 and d, as a vector of their numbers in the units of Fig. 3, stay below this."""

ASSUMED: Mapping[Assumption, str] = {"initial values": "ten motions", "duration": "200 s"}
UNSTATED = (
    "The paper gives neither time span nor initial values: ten motions with angles within half a turn and rates within "
    "2 rad/s, observers started from zero, 200 s, with the corrected L = -[1; 1]."
)


def make_proposed(dt: float, *sigmas: float) -> FriedlandTacker:
    """Make the paper's observer; its leading dimensions are the weights sigma, then one for the motions."""
    return FriedlandTacker(dt, paper.A_M, paper.C_M, paper.L, paper.GAMMA, np.reshape(sigmas, (-1, 1, 1, 1)))


def make_single(dt: float, sigma: float) -> FriedlandTacker:
    """Make the paper's observer without leading dimensions."""
    return FriedlandTacker(dt, paper.A_M, paper.C_M, paper.L, paper.GAMMA, np.array([[sigma]]))


def starts(seed: int, n: int) -> Array:
    """Return the initial angles within half a turn and rates within 2 rad/s, (n, 2) [rad, rad/s]."""
    rng = np.random.default_rng(seed)
    return np.stack([rng.uniform(-np.pi, np.pi, n), rng.uniform(-2.0, 2.0, n)], axis=-1)


def motion(start: Array, t: Array, coefficient: float = 1.0) -> Array:
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

    def slope(time: float, x: Array) -> Array:
        return np.concatenate([x[n:], paper.acceleration(x[:n], time, coefficient)])

    solution = solve_ivp(slope, (t[0], t[-1]), start.T.ravel(), "DOP853", t, rtol=1e-10, atol=1e-10)
    return np.stack([solution.y[:n].T, solution.y[n:].T], axis=-1)


class Errors(NamedTuple):
    """An observer's errors along the motions."""

    t: Array
    """Times, (n_times,) [s]."""
    state: Array
    """Errors of q and its rate, (n_times, n_sigmas, n, 2) [rad, rad/s]."""
    exogenous: Array
    """Errors of theta1, theta2 and, if it is estimated, d, (n_times, n_sigmas, n, 2 or 3)."""

    def tail_rms(self) -> Array:
        """Return the RMS of the state error's norm over the last fifth, (n_sigmas, n)."""
        tail = self.t >= self.t[0] + 0.8 * (self.t[-1] - self.t[0])
        return np.sqrt(np.mean(np.sum(self.state[tail] ** 2, axis=-1), axis=0))


def follow(observer: FriedlandTacker, t: Array, x: Array) -> Errors:
    """Let observers, from zero, follow all motions.

    Args:
        observer: The paper's, or the conventional one, which knows of no disturbance.
        t: Sample times, one observer.dt apart, (n_times,) [s].
        x: The motions at these times, (n_times, n, 2).

    Returns:
        Their errors.
    """
    r, nm = observer.Cm.shape
    y = x[..., :1]
    inputs = paper.torque((t[1:] + t[:-1]) / 2.0)
    system = paper.system((y[1:, :, 0] + y[:-1, :, 0]) / 2.0, inputs[:, None])
    all_B0, system = system.B0[..., :r], system._replace(D20=system.D20[:, :r])
    start = np.zeros((len(observer.Sigma), x.shape[1], 2 + nm))
    state = observer.init(y[0], start[..., :2], start[..., 2:])
    estimates, exosystem = [state.x], [state.xm]
    for k in range(1, len(t)):
        state = observer.step(state, system._replace(B0=all_B0[k - 1]), inputs[k - 1 : k], y[k])
        estimates.append(state.x)
        exosystem.append(state.xm)
    truth = (paper.exosystem_state(t) @ paper.C_M.T)[:, None, None, :r]
    return Errors(t, np.array(estimates) - x[:, None], np.array(exosystem) @ observer.Cm.T - truth)


def settle_times(size: Array, t: Array, band: float) -> Array:
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


class Study(NamedTuple):
    """The arm's motions and what the observers made of them."""

    proposed: Errors
    """Errors with each of `SIGMAS`."""
    conventional: Errors
    """Errors at Sigma = 10."""
    largest_angle: float
    """The largest |q| [rad]."""


def study(seed: int = 0, on_share: OnShare = lambda share: None) -> Study:
    """Let both observers follow ten motions of 200 s, the proposed one at 400 Hz, the conventional one at 200 Hz."""
    rate = 400.0
    t = np.arange(round(200.0 * rate) + 1) / rate
    x = motion(starts(seed, 10), t)
    on_share(0.1)
    proposed = follow(make_proposed(1.0 / rate, *SIGMAS), t, x)
    on_share(0.75)
    plain = FriedlandTacker.conventional(2.0 / rate, paper.L, paper.GAMMA[:2, :2], np.array([[[[10.0]]]]))
    return Study(proposed, follow(plain, t[::2], x[::2]), float(np.abs(x[..., 0]).max()))


def exogenous_settle_times(errors: Errors, band: float = SETTLED) -> Array:
    """Find when the errors of theta1, theta2 and d settle, (n_sigmas, n) [s]; infinite if they do not."""
    return settle_times(np.linalg.norm(errors.exogenous, axis=-1), errors.t, band)


def finite_times(times: Sequence[float] | Array) -> list[float | None]:
    """Return settling times as JSON can hold them."""
    return [float(time) if math.isfinite(time) else None for time in times]

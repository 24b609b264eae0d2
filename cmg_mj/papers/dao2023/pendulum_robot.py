"""The pendulum robot of dao2023, section 3, with its adaptive observers, many initial conditions at once."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from cmg_mj.papers.dao2023.friedland_tacker import FriedlandTacker, System

MASS, LENGTH, INERTIA, GRAVITY = 1.0, 1.0, 0.5, 9.81  # kg, m, kg m^2, m/s^2
OMEGA = 3.0
"""Angular frequency of the disturbance [rad/s]."""
THETA = np.array([MASS * GRAVITY * LENGTH / (2.0 * INERTIA), 1.0 / INERTIA])
"""theta1 [1/s^2], theta2 [1/(kg m^2)]: (9.81, 2)."""

L = -np.array([[1.0], [1.0]])
A_M = np.array([[0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, -OMEGA], [0.0, 0.0, OMEGA, 0.0]])
C_M = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
GAMMA = np.diag([2.0, 2.0, 1.0, 1.0])


def torque(t: np.ndarray | float) -> np.ndarray:
    """The arm's torque u(t) [N m]."""
    return 5.0 * (np.sin(2.0 * np.asarray(t)) + np.cos(20.0 * np.asarray(t)))


def disturbance(t: np.ndarray | float) -> np.ndarray:
    """d(t) as (14) has it, an acceleration [rad/s^2]."""
    return np.sin(OMEGA * np.asarray(t))


def exosystem_state(t: np.ndarray | float) -> np.ndarray:
    """The true xm(t), (..., 4): theta1, theta2 and the two states of the sinusoid."""
    t = np.asarray(t)
    constant = np.broadcast_to(THETA, (*t.shape, 2))
    return np.concatenate([constant, np.cos(OMEGA * t)[..., None], np.sin(OMEGA * t)[..., None]], axis=-1)


def system(q: np.ndarray | float, u: np.ndarray | float, *, with_disturbance: bool = True) -> System:
    """The matrices of (14), (15) at a measured angle and a torque.

    Args:
        q: Angle of the arm, (...,) [rad].
        u: Torque, (...,) [N m].
        with_disturbance: Whether r is (theta1, theta2, d) or, as the conventional observer has it, (theta1, theta2).

    Returns:
        The matrices; B0 has the leading dimensions of q.
    """
    q, u = np.broadcast_arrays(np.asarray(q, dtype=float), np.asarray(u, dtype=float))
    lower = [-np.sin(q), u, np.ones_like(q)] if with_disturbance else [-np.sin(q), u]
    B0 = np.zeros((*q.shape, 2, len(lower)))
    B0[..., 1, :] = np.stack(lower, axis=-1)
    A = np.array([[0.0, 1.0], [0.0, 0.0]])
    return System(A, B0, np.zeros((2, 1)), np.array([[1.0, 0.0]]), np.zeros((1, len(lower))))


def proposed(dt: float, sigmas: Sequence[float] = (10.0,)) -> FriedlandTacker:
    """The paper's observer; its leading dimensions are those of the weights sigma, then one for the motions."""
    return FriedlandTacker(dt, A_M, C_M, L, GAMMA, np.reshape(sigmas, (-1, 1, 1, 1)))


def conventional(dt: float, sigmas: Sequence[float] = (10.0,)) -> FriedlandTacker:
    """The observer it is compared with, which knows of no disturbance; leading dimensions as above."""
    return FriedlandTacker.conventional(dt, L, GAMMA[:2, :2], np.reshape(sigmas, (-1, 1, 1, 1)))


def starts(seed: int, n: int) -> np.ndarray:
    """Initial angles within half a turn and rates within 2 rad/s, (n, 2) [rad, rad/s]."""
    rng = np.random.default_rng(seed)
    return np.stack([rng.uniform(-np.pi, np.pi, n), rng.uniform(-2.0, 2.0, n)], axis=-1)


def motion(start: np.ndarray, t: np.ndarray, coefficient: float = 1.0) -> np.ndarray:
    """The arm's own motion.

    It is chaotic: after some time two integrators no longer agree. Each computed motion is still, to the tolerance,
    one that the arm can make, and that is what an observer is given.

    Args:
        start: q and its rate at t[0], (n, 2) [rad, rad/s].
        t: Times, (n_times,) [s].
        coefficient: What d is multiplied by in q'': 1 as in (14); (10) would have theta2.

    Returns:
        q and its rate, (n_times, n, 2).
    """
    n = len(start)

    def slope(time: float, x: np.ndarray) -> np.ndarray:
        forced = THETA[1] * float(torque(time)) + coefficient * float(disturbance(time))
        return np.concatenate([x[n:], forced - THETA[0] * np.sin(x[:n])])

    solution = solve_ivp(slope, (t[0], t[-1]), start.T.ravel(), "DOP853", t, rtol=1e-10, atol=1e-10)
    return np.stack([solution.y[:n].T, solution.y[n:].T], axis=-1)


@dataclass(frozen=True)
class Errors:
    """What an observer made of the motions.

    Attributes:
        t: Times, (n_times,) [s].
        state: Errors of q and its rate, (n_times, n_sigmas, n, 2) [rad, rad/s].
        exogenous: Errors of theta1, theta2 and, if it is estimated, d, (n_times, n_sigmas, n, 2 or 3).
    """

    t: np.ndarray
    state: np.ndarray
    exogenous: np.ndarray


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
    inputs = torque((t[1:] + t[:-1]) / 2.0)
    matrices = system((y[1:, :, 0] + y[:-1, :, 0]) / 2.0, inputs[:, None], with_disturbance=r == 3)
    truth = exosystem_state(t) @ C_M.T
    state = observer.init(y[0])
    state_errors = np.zeros((len(t), n_sigmas, *x.shape[1:]))
    exogenous = np.zeros((len(t), n_sigmas, x.shape[1], r))
    state_errors[0], exogenous[0] = -x[0], -truth[0, :r]
    for k in range(1, len(t)):
        here = replace(matrices, B0=matrices.B0[k - 1])
        state = observer.step(state, here, inputs[k - 1 : k], y[k])
        state_errors[k] = state.x - x[k]
        exogenous[k] = state.xm @ observer.Cm.T - truth[k, :r]
        if k % 1000 == 0:
            on_share(k / len(t))
    return Errors(t, state_errors, exogenous)


def settle_times(size: np.ndarray, t: np.ndarray, band: float) -> np.ndarray:
    """From when on a quantity stays inside a band: infinite if it is outside at the end.

    Args:
        size: Its absolute value, (n_times, ...).
        t: Times, (n_times,) [s].
        band: The band, in the quantity's unit.

    Returns:
        The times, (...) [s].
    """
    outside = size > band
    after_last = len(t) - np.argmax(outside[::-1], axis=0)  # the sample after the last one outside
    found = np.append(t, np.inf)[after_last]
    return np.where(outside.any(axis=0), found, t[0])


def continuous_run(
    sigma: float, start: np.ndarray, state: np.ndarray, t: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The arm and (7) to (9) in continuous time, integrated as one.

    Args:
        sigma: The weight Sigma.
        start: q and its rate, (2,).
        state: The observer's x and xm, (6,); T starts at zero.
        t: Times, (n_times,) [s].
        tolerance: Of the integrator, relative and absolute.

    Returns:
        The arm's x (n_times, 2), the observer's x (n_times, 2), xm (n_times, 4) and T (n_times, 2, 4).
    """
    observer = FriedlandTacker(1.0, A_M, C_M, L, GAMMA, np.array([[sigma]]))
    no_input = np.zeros(1)

    def slope(time: float, s: np.ndarray) -> np.ndarray:
        here = system(s[0], torque(time))
        accelerated = -THETA[0] * np.sin(s[0]) + THETA[1] * torque(time) + disturbance(time)
        parts = observer.slope(time, s[2:4], s[4:8], s[8:].reshape(2, 4), here, no_input, s[:1])
        return np.concatenate([[s[1], accelerated], *(part.ravel() for part in parts)])

    begin = np.concatenate([start, state, np.zeros(8)])
    s = solve_ivp(slope, (t[0], t[-1]), begin, "DOP853", t, rtol=tolerance, atol=tolerance).y.T
    return s[:, :2], s[:, 2:4], s[:, 4:8], s[:, 8:].reshape(-1, 2, 4)


def identity_error(sigma: float, duration: float, seed: int = 0, tolerance: float = 1e-11) -> tuple[float, float]:
    """How far z = (x^ - x) - T (xm^ - xm) is from exp((A + L C2) t) z(0), in continuous time along the chaotic arm.

    Args:
        sigma: The weight Sigma.
        duration: How long [s].
        seed: Of the initial values.
        tolerance: Of the integrator.

    Returns:
        The largest deviation, and the largest |z| for comparison.
    """
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, duration, 21)
    x, guessed, xm, T = continuous_run(sigma, starts(seed, 1)[0], rng.normal(0.0, 1.0, 6), t, tolerance)
    z = guessed - x - np.einsum("kij,kj->ki", T, xm - exosystem_state(t))
    here = system(0.0, 0.0)
    expected = np.array([expm((here.A + L @ here.C2) * time) @ z[0] for time in t])
    return float(np.abs(z - expected).max()), float(np.abs(z).max())


def discrete_identity_error(sigma: float, dt: float, duration: float, seed: int = 0) -> tuple[float, float]:
    """The same in discrete time: z+ = (I - h/2 M)^-1 (I + h/2 M) z for the arm by the implicit midpoint rule.

    Args:
        sigma: The weight Sigma.
        dt: Sample period [s].
        duration: How long [s].
        seed: Of the initial values.

    Returns:
        The largest deviation, and the largest |z| for comparison.
    """
    rng = np.random.default_rng(seed)
    observer = FriedlandTacker(dt, A_M, C_M, L, GAMMA, np.array([[sigma]]))
    q, rate = starts(seed, 1)[0].tolist()
    state = observer.init(np.array([q]), x=rng.normal(0.0, 1.0, 2), xm=rng.normal(0.0, 1.0, 4))
    F, M = expm(A_M * dt), system(0.0, 0.0).A + L @ system(0.0, 0.0).C2
    onward = np.linalg.solve(np.eye(2) - dt / 2.0 * M, np.eye(2) + dt / 2.0 * M)
    xm = exosystem_state(0.0)
    z = state.x - [q, rate] - state.T @ (state.xm - xm)
    worst, size = 0.0, float(np.abs(z).max())
    for k in range(round(duration / dt)):
        u = float(torque((k + 0.5) * dt))
        pushed = THETA[1] * u + float((C_M @ (xm + F @ xm))[2]) / 2.0
        q_next, rate_next = q, rate
        for _ in range(12):  # a contraction by h^2 theta1/4 each time
            rate_next = rate + dt * (pushed - THETA[0] * math.sin((q + q_next) / 2.0))
            q_next = q + dt * (rate + rate_next) / 2.0
        state = observer.step(state, system((q + q_next) / 2.0, u), np.zeros(1), np.array([q_next]))
        q, rate, xm = q_next, rate_next, F @ xm
        z = onward @ z
        worst = max(worst, float(np.abs(state.x - [q, rate] - state.T @ (state.xm - xm) - z).max()))
    return worst, size


def upsilon_errors(sigma: float, dt: float, duration: float, seed: int = 0) -> tuple[float, float]:
    """The proposed observer beside the conventional one of the constant xm(0), whose regressor is B0 Cm exp(Am t).

    Args:
        sigma: The weight Sigma.
        dt: Sample period [s].
        duration: How long [s].
        seed: Of the initial values.

    Returns:
        The largest |Upsilon - T exp(Am t)| and the largest difference of the estimates of x.
    """
    t = dt * np.arange(round(duration / dt) + 1)
    y = motion(starts(seed, 1), t)[:, 0, :1]
    weight = np.array([[sigma]])
    ours = FriedlandTacker(dt, A_M, C_M, L, GAMMA, weight)
    plain = FriedlandTacker.conventional(dt, L, GAMMA, weight)
    a, b = ours.init(y[0]), plain.init(y[0])
    mean = C_M @ (expm(A_M * dt) + np.eye(4)) / 2.0
    worst = [0.0, 0.0]
    for k in range(1, len(t)):
        here = system((y[k - 1, 0] + y[k, 0]) / 2.0, torque(t[k] - dt / 2.0))
        turned = replace(here, B0=here.B0 @ mean @ expm(A_M * t[k - 1]), D20=np.zeros((1, 4)))
        a, b = ours.step(a, here, np.zeros(1), y[k]), plain.step(b, turned, np.zeros(1), y[k])
        gaps = np.abs(b.T - a.T @ expm(A_M * t[k])).max(), np.abs(a.x - b.x).max()
        worst = [max(old, float(new)) for old, new in zip(worst, gaps, strict=True)]
    return worst[0], worst[1]


def explicit_escape(sigma: float, dt: float, duration: float, seed: int = 0) -> float:
    """When a classical Runge-Kutta step of (7) to (9) at a sample rate has left every bound: infinite if never [s].

    Args:
        sigma: The weight Sigma.
        dt: Sample period [s].
        duration: How long to try [s].
        seed: Of the initial values.

    Returns:
        The time at which an estimate passes 1e9.
    """
    observer = FriedlandTacker(dt, A_M, C_M, L, GAMMA, np.array([[sigma]]))
    t = dt * np.arange(round(duration / dt) + 1)
    q = motion(starts(seed, 1), t)[:, 0, 0]

    def slope(time: float, s: np.ndarray, y: float) -> np.ndarray:
        here = system(y, torque(time))
        parts = observer.slope(time, s[:2], s[2:6], s[6:].reshape(2, 4), here, np.zeros(1), np.array([y]))
        return np.concatenate([part.ravel() for part in parts])

    s = np.zeros(14)
    for k, time in enumerate(t[:-1].tolist()):
        middle = (q[k] + q[k + 1]) / 2.0
        k1 = slope(time, s, q[k])
        k2 = slope(time + dt / 2.0, s + dt / 2.0 * k1, middle)
        k3 = slope(time + dt / 2.0, s + dt / 2.0 * k2, middle)
        s = s + dt / 6.0 * (k1 + 2.0 * (k2 + k3) + slope(time + dt, s + dt * k3, q[k + 1]))
        if not np.abs(s).max() < 1e9:
            return time + dt
    return math.inf

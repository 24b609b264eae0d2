"""The general adaptive disturbance observer against dao2023 (7) to (9), and what they imply."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from cmg_mj.papers.dao2023.observer import FriedlandTacker, System

N, NM, R, M, P = 3, 4, 2, 2, 2
"""n, nm, r, m, p of the random plants."""

AM = np.array([[0.0, 0.0, 0.0, 0.0], [0.0, -0.3, 0.0, 0.0], [0.0, 0.0, 0.0, -4.0], [0.0, 0.0, 4.0, 0.0]])
CM = np.array([[1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.5, 1.0]])


def random_matrix(rng: np.random.Generator, *shape: int) -> np.ndarray:
    return rng.normal(0.0, 1.0, shape)


def definite(rng: np.random.Generator, size: int, scale: float = 1.0) -> np.ndarray:
    root = random_matrix(rng, size, size)
    return scale * (root @ root.T + 0.1 * np.eye(size))


def plant(rng: np.random.Generator) -> tuple[Callable[[float], System], np.ndarray]:
    """A smooth time-varying plant with constant C2 and D20, and a gain that keeps A + L C2 well damped."""
    C2, D20, B2 = random_matrix(rng, P, N), random_matrix(rng, P, R), random_matrix(rng, N, M)
    L = -C2.T
    A = -2.0 * np.eye(N) + 0.5 * random_matrix(rng, N, N)
    B0, swing = random_matrix(rng, N, R), random_matrix(rng, N, R)
    turn = 0.3 * random_matrix(rng, N, N)

    def matrices(t: float) -> System:
        return System(A + np.sin(2.0 * t) * turn, B0 + np.cos(3.0 * t) * swing, B2, C2, D20)

    return matrices, L


def build(rng: np.random.Generator, L: np.ndarray, dt: float, sigma: float = 1.0) -> FriedlandTacker:
    return FriedlandTacker(dt, AM, CM, L, definite(rng, NM), definite(rng, P, sigma))


# --- the identity that no chaos can blur ---------------------------------------------------------------


@pytest.mark.parametrize("sigma", [0.1, 1.0, 1e3, 1e6])
@pytest.mark.parametrize("seed", range(3))
def test_discrete_identity_whatever_the_weights(seed: int, sigma: float) -> None:
    """z = (x^ - x) - T (xm^ - xm) goes its own way, z+ = (I - h/2 M)^-1 (I + h/2 M) z: no Gamma, no Sigma in it."""
    rng = np.random.default_rng(seed)
    matrices, L = plant(rng)
    h = 0.02
    observer = build(rng, L, h, sigma)
    F = expm(AM * h)
    x, xm = random_matrix(rng, N), random_matrix(rng, NM)
    system = matrices(0.0)
    y = system.C2 @ x + system.D20 @ CM @ xm
    state = observer.init(y, x=random_matrix(rng, N), xm=random_matrix(rng, NM))._replace(T=random_matrix(rng, N, NM))
    z = (state.x - x) - state.T @ (state.xm - xm)
    largest = 0.0
    for k in range(300):
        system, u = matrices((k + 0.5) * h), random_matrix(rng, M)
        # The plant by the implicit midpoint rule, its exosystem's mean over the step driving it.
        driven = system.B0 @ CM @ (xm + F @ xm) / 2.0 + system.B2 @ u
        x = np.linalg.solve(np.eye(N) - h / 2.0 * system.A, x + h / 2.0 * system.A @ x + h * driven)
        xm = F @ xm
        y = system.C2 @ x + system.D20 @ CM @ xm
        state = observer.step(state, system, u, y)
        closed = h / 2.0 * (system.A + L @ system.C2)
        z = np.linalg.solve(np.eye(N) - closed, z + closed @ z)
        largest = max(largest, np.abs((state.x - x) - state.T @ (state.xm - xm) - z).max())
    print(f"sigma {sigma:g}: identity held to {largest:.1e}")
    assert largest < 1e-8


# --- against the continuous observer -------------------------------------------------------------------


def measurement(t: float) -> np.ndarray:
    """A smooth measurement and, whatever the plant, a fair input to an observer."""
    return np.array([np.sin(2.0 * t + 0.3), np.cos(1.3 * t)])


def test_converges_to_the_continuous_observer() -> None:
    """T with the square of the period; the estimates, whose correction is implicit, with the period."""
    rng = np.random.default_rng(5)
    matrices, L = plant(rng)
    coarse = build(rng, L, 0.02)
    duration, u = 2.0, np.array([0.3, -0.2])

    def slope(t: float, s: np.ndarray) -> np.ndarray:
        parts = coarse.slope(t, s[:N], s[N : N + NM], s[N + NM :].reshape(N, NM), matrices(t), u, measurement(t))
        return np.concatenate([part.ravel() for part in parts])

    reference = solve_ivp(slope, (0.0, duration), np.zeros(N + NM + N * NM), "DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    errors = []
    for n in (200, 400, 800, 1600):
        h = duration / n
        observer = FriedlandTacker(h, AM, CM, L, coarse.Gamma, coarse.Sigma)
        state = observer.init(measurement(0.0))
        for k in range(n):
            state = observer.step(state, matrices((k + 0.5) * h), u, measurement((k + 1) * h))
        results = (state.x, state.xm, state.T.ravel())
        references = np.split(reference, [N, N + NM])
        errors.append([np.abs(a - b).max() for a, b in zip(results, references, strict=True)])
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    print(f"orders of x, xm, T: {np.round(orders, 2).tolist()}; errors at {n} steps {errors[-1]}")
    np.testing.assert_allclose(orders[-1], [1.0, 1.0, 2.0], atol=0.1)


# --- the conventional observer, and what the proposed one has to do with it ----------------------------


def test_conventional_is_zhangs_observer() -> None:
    """Zhang 2002, Liu, Zhang, Su 2011: K = -L, theta' = Gamma (C Upsilon + D)^T Sigma (y - C x - D theta)."""
    rng = np.random.default_rng(3)
    matrices, L = plant(rng)
    system, K = matrices(0.7), -L
    Gamma, Sigma = definite(rng, R), definite(rng, P)
    observer = FriedlandTacker.conventional(0.01, L, Gamma, Sigma)
    x, theta, Upsilon = random_matrix(rng, N), random_matrix(rng, R), random_matrix(rng, N, R)
    u, y = random_matrix(rng, M), random_matrix(rng, P)
    slopes = observer.slope(1.3, x, theta, Upsilon, system, u, y)

    innovation = y - system.C2 @ x - system.D20 @ theta
    dUpsilon = (system.A - K @ system.C2) @ Upsilon + system.B0 - K @ system.D20
    dtheta = Gamma @ (system.C2 @ Upsilon + system.D20).T @ Sigma @ innovation
    dx = system.A @ x + system.B0 @ theta + system.B2 @ u + K @ innovation + Upsilon @ dtheta
    for a, b in zip(slopes, (dx, dtheta, dUpsilon), strict=True):
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-12)


def test_proposed_is_the_conventional_one_of_the_exosystems_start() -> None:
    """Upsilon = T exp(Am t), if Upsilon's equation has (B0 + L D20) Cm exp(Am t); then xm^ = exp(Am t) theta^."""
    rng = np.random.default_rng(4)
    matrices, L = plant(rng)
    h = 0.02
    proposed = build(rng, L, h, 100.0)
    plain = FriedlandTacker.conventional(h, L, proposed.Gamma, proposed.Sigma)
    a, b = proposed.init(measurement(0.0)), plain.init(measurement(0.0))
    mean = (expm(AM * h) + np.eye(NM)) / 2.0
    for k in range(200):
        system, u, y = matrices((k + 0.5) * h), random_matrix(rng, M), measurement((k + 1) * h)
        turn = CM @ mean @ expm(AM * k * h)
        system = system._replace(D20=0.0 * system.D20)
        a = proposed.step(a, system, u, y)
        b = plain.step(b, system._replace(B0=system.B0 @ turn, D20=np.zeros((P, NM))), u, y)
        whole = expm(AM * (k + 1) * h)
        np.testing.assert_allclose(a.T @ whole, b.T, rtol=0.0, atol=1e-10)
        np.testing.assert_allclose(a.xm, whole @ b.xm, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(a.x, b.x, rtol=0.0, atol=1e-9)


# --- many at once --------------------------------------------------------------------------------------


def test_leading_dimensions_are_observers_side_by_side() -> None:
    rng = np.random.default_rng(6)
    matrices, L = plant(rng)
    Sigma = np.stack([definite(rng, P, scale) for scale in (0.1, 10.0)])[:, None]
    gains = np.stack([L, 1.5 * L, 2.0 * L])
    Gamma = definite(rng, NM)
    many = FriedlandTacker(0.02, AM, CM, gains, Gamma, Sigma)
    starts = random_matrix(rng, 3, N)
    inputs, outputs = random_matrix(rng, 40, 2, 3, M), random_matrix(rng, 41, 2, 3, P)
    state = many.init(outputs[0], x=starts)
    for k in range(40):
        state = many.step(state, matrices(0.02 * k), inputs[k], outputs[k + 1])
    for i in range(2):
        for j in range(3):
            single = FriedlandTacker(0.02, AM, CM, gains[j], Gamma, Sigma[i, 0])
            single_state = single.init(outputs[0, i, j], x=starts[j])
            for k in range(40):
                single_state = single.step(single_state, matrices(0.02 * k), inputs[k, i, j], outputs[k + 1, i, j])
            np.testing.assert_allclose(state.x[i, j], single_state.x, rtol=0.0, atol=1e-11)
            np.testing.assert_allclose(state.xm[i, j], single_state.xm, rtol=0.0, atol=1e-11)

"""The general observer of andrieu2009 against its printed equations (7), (8), integrated by scipy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cmg_mj.observers.high_gain import updated_gain
from cmg_mj.papers.andrieu2009.observer import BiLimitCorrection, UpdatedHighGain

PHI: dict[str, Any] = {"phi1": 0.4, "phi2": 1.5, "phi3": 0.8}


def power(x: float, a: float) -> float:
    return math.copysign(abs(x) ** a, x)


# --- the gain -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("L", [1.5, 3.0, 200.0])
@pytest.mark.parametrize("Omega", [0.0, 0.7, 40.0])
def test_gain_solves_8_for_a_held_rate(L: float, Omega: float) -> None:
    span = 0.3
    expected = solve_ivp(
        lambda t, z: z * (0.4 * (1.5 - z) + 0.8 * Omega), (0.0, span), [L], "DOP853", rtol=1e-12, atol=1e-12
    ).y[0, -1]
    assert updated_gain(L, Omega, span, **PHI) == pytest.approx(expected, rel=1e-10)


def test_gain_stays_at_or_above_phi2_at_any_step() -> None:
    rng = np.random.default_rng(3)
    for phi1, phi2, phi3 in 10.0 ** rng.uniform(-3.0, 3.0, (20, 3)):
        L = phi2
        for _ in range(200):
            L = updated_gain(
                L, rng.choice([0.0, 10.0 ** rng.uniform(-4.0, 4.0)]), 10.0 ** rng.uniform(-5.0, 3.0), phi1, phi2, phi3
            )
            assert phi2 <= L < math.inf


# --- the observer -------------------------------------------------------------------------------------------


def example(n: int, dt: float = 0.01, **changes: Any) -> UpdatedHighGain:
    """A system of dimension n with f_i and an Omega that moves."""
    d_inf = {1: 0.4, 2: 0.5, 3: 0.3}[n]
    f = (
        lambda u, y, x: -u * y[0],
        lambda u, y, x: np.sin(x[0]) + u * y[0],
        lambda u, y, x: 0.5 * x[0] - np.cos(x[1]) + u,
    )[:n]
    fields: dict[str, Any] = {
        "dt": dt,
        "f": f,
        "correction": BiLimitCorrection((4.0, 2.0, 1.0)[3 - n :], d_inf),
        "Omega": (lambda u, y, x: (1.0 + y[0] ** 2) * (1.0 + sum(abs(v) ** 0.4 for v in x))),
        "b": 0.3,
        **PHI,
    }
    return UpdatedHighGain(**(fields | changes))


def printed_slope(n: int, y: float, u: float, z: np.ndarray) -> np.ndarray:
    """(7), (8) of the same system, written from the paper with its own K."""
    x, L, b = z[:n], z[n], 0.3
    d = {1: 0.4, 2: 0.5, 3: 0.3}[n]
    l = (4.0, 2.0, 1.0)[3 - n :]  # noqa: E741
    r = [1.0 - d * (n - i) for i in range(1, n + 2)]
    s, K = (x[0] - y) / L**b, []
    for i in range(n):
        s = l[i] * s
        s = s + power(s, r[i + 1] / r[i])
        K.append(-s)
    f = [-u * y]
    if n > 1:
        f.append(math.sin(x[1]) + u * y)
    if n > 2:
        f.append(0.5 * x[1] - math.cos(x[2]) + u)
    Omega = (1.0 + y**2) * (1.0 + sum(abs(v) ** 0.4 for v in x[1:]))
    following = [*x[1:], 0.0]
    slope = [following[i] + f[i] + L * L ** (i + b) * K[i] for i in range(n)]
    return np.array([*slope, L * (0.4 * (1.5 - L) + 0.8 * Omega)])


@pytest.mark.parametrize("n", [1, 2, 3])
def test_converges_to_the_printed_observer(n: int) -> None:
    """With the period, at least in first order: Omega is held over a step, all else is better."""

    def y(t: float) -> float:
        return 0.4 * math.sin(2.0 * t) + 0.1 * math.sin(7.0 * t)

    start = [0.3, -0.5, 0.8][:n]
    reference = solve_ivp(
        lambda t, z: printed_slope(n, y(t), 0.7, z), (0.0, 1.5), [*start, 2.0], "LSODA", rtol=1e-10, atol=1e-11
    ).y[:, -1]
    errors = []
    for steps in (800, 3200):
        dt = 1.5 / steps
        samples = np.array([y(k * dt) for k in range(steps + 1)])
        x, L = example(n, dt).follow((samples,), tuple(start), [0.7] * steps, 2.0 / PHI["phi2"])
        errors.append(np.abs(np.array([*x[:, -1], L[-1]]) - reference).max())
    print(f"n = {n}: errors {errors}")
    assert errors[1] < 1e-3 * np.abs(reference).max()
    assert errors[0] > 3.0 * errors[1]


def test_arguments_are_limited_where_the_paper_limits_them() -> None:
    """f_2 on and Omega get the limited arguments; f_1 and the innovation the measurement as it is."""
    arguments: dict[str, Any] = {}

    def note(name: str, value: float) -> Any:
        def function(u: Any, y: Any, x: Any) -> float:
            arguments[name] = (u, tuple(y), tuple(x))
            return value

        return function

    observer = example(
        3,
        0.01,
        f=(note("f1", 0.0), note("f2", 0.0), note("f3", 0.0)),
        Omega=note("Omega", 1.0),
        saturate=lambda y, x: ((min(y[0], 0.5),), tuple(min(v, 2.0) for v in x)),
    )
    observer.slope((1.0, 5.0, -3.0), 2.0, (0.9,), "u")
    observer.step(np.array([1.0, 5.0, -3.0]), 2.0, (0.9,), (0.9,), "u")
    assert arguments["f1"] == ("u", (0.9,), ())
    observer.slope((1.0, 5.0, -3.0), 2.0, (0.9,), "u")
    assert arguments["f2"] == ("u", (0.5,), (2.0,))
    assert arguments["f3"] == ("u", (0.5,), (2.0, -3.0))
    assert arguments["Omega"] == ("u", (0.5,), (2.0, -3.0))
    slope = observer.slope((1.0, 5.0, -3.0), 2.0, (0.9,), "u")
    unlimited_slope = example(3, 0.01, f=observer.f).slope((1.0, 5.0, -3.0), 2.0, (0.9,), "u")
    assert slope == unlimited_slope


@pytest.mark.parametrize("n", [1, 2, 3])
def test_runs_side_by_side_are_each_its_own(n: int) -> None:
    """Bit by bit, with f and Omega that are (arithmetic alone)."""
    f = [lambda u, y, x: -u * y[0], lambda u, y, x: u * y[0] - x[0], lambda u, y, x: 0.5 * x[0] - x[1] * u][:n]
    observer = UpdatedHighGain(
        0.01, tuple(f), BiLimitCorrection((4.0, 2.0, 1.0)[3 - n :], 0.3), lambda u, y, x: abs(y[0]) + abs(u), 0.3, **PHI
    )
    rng = np.random.default_rng(0)
    y, u = rng.normal(0.0, 1.0, (40, 5)), rng.normal(0.0, 1.0, 40).tolist()
    x, L = observer.follow((y,), (0.5,) * n, u)
    for i in range(5):
        single_x, single_L = observer.follow((y[:, i : i + 1],), (0.5,) * n, u)
        assert np.array_equal(x[..., i : i + 1], single_x)
        assert np.array_equal(L[:, i : i + 1], single_L)


@pytest.mark.parametrize("error", [1.0, 100.0])
def test_finds_the_state_of_a_third_order_system(error: float) -> None:
    """x1 = sin t, and f3 = [x3]^1.3 grows as (6) allows for d_inf = 0.3: increments of power (1 + 0.3)/1."""
    d, dt = 0.3, 2e-4
    observer = UpdatedHighGain(
        dt,
        (lambda u, y, x: 0.0 * y[0], lambda u, y, x: 0.0 * y[0], lambda u, y, x: power(x[1], 1.0 + d) + y[1]),
        BiLimitCorrection((4.0, 2.0, 1.0), d),
        lambda u, y, x: 1.3 * (1.0 + abs(x[1]) ** d),
        0.3,
        0.5,
        3.0,
        2.0,
    )
    t = np.arange(0.0, 6.0 + 0.5 * dt, dt).tolist()
    y = [math.sin(time) for time in t], [-math.cos(time) - power(-math.sin(time), 1.0 + d) for time in t]
    x, _ = observer.follow(y, (0.0, 1.0 + error, -error))
    assert x[:, -1] == pytest.approx((math.sin(6.0), math.cos(6.0), -math.sin(6.0)), abs=1e-3)

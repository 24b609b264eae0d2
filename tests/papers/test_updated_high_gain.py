"""The general observer of andrieu2009 against its printed equations (7), (8), integrated by scipy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from cmg_mj.core.errors import InputError
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


def test_gain_at_rest_does_not_move() -> None:
    L = 0.3
    for _ in range(1000):
        L = updated_gain(L, 0.0, 0.01, 0.7, 0.3, 2.0)
    assert L == 0.3


def test_gain_tracks_as_13_says() -> None:
    """(L - L*)' = -(phi3/phi1) Omega' - phi1 L (L - L*), L* = phi2 + (phi3/phi1) Omega, for Omega = 2 + sin t."""
    dt, phi1, phi2, phi3 = 1e-3, 0.4, 1.5, 0.8
    t = np.arange(0.0, 10.0, dt)
    L, gains = 4.0, []
    for time in t:
        gains.append(L)
        L = updated_gain(L, 2.0 + math.sin(time + 0.5 * dt), dt, phi1, phi2, phi3)
    gains = np.array(gains)
    behind = gains - (phi2 + phi3 / phi1 * (2.0 + np.sin(t)))
    slope = np.gradient(behind, dt)
    expected = -phi3 / phi1 * np.cos(t) - phi1 * gains * behind
    assert slope[1:-1] == pytest.approx(expected[1:-1], abs=1e-5)


# --- the observer -------------------------------------------------------------------------------------------


def example(n: int, dt: float = 0.01, **changes: Any) -> UpdatedHighGain:
    """A system of dimension n with every part of (4): a_i(y), f_i, an Omega that moves."""
    d_inf = {1: 0.4, 2: 0.5, 3: 0.3}[n]
    f = (
        lambda u, y, x: -u * y[0],
        lambda u, y, x: np.sin(x[0]) + u * y[0],
        lambda u, y, x: 0.5 * x[0] - np.cos(x[1]) + u,
    )[:n]
    a = (lambda y: 1.0 + 0.3 * y[0] ** 2, lambda y: 2.0 - 0.2 * np.tanh(y[0]), lambda y: 1.5 + 0.0 * y[0])[:n]
    fields: dict[str, Any] = {
        "dt": dt,
        "f": f,
        "correction": BiLimitCorrection((4.0, 2.0, 1.0)[3 - n :], d_inf),
        "Omega": (lambda u, y, x: (1.0 + y[0] ** 2) * (1.0 + sum(abs(v) ** 0.4 for v in x))),
        "b": 0.3,
        **PHI,
        "a": a,
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
    a = [1.0 + 0.3 * y**2, 2.0 - 0.2 * math.tanh(y), 1.5]
    f = [-u * y]
    if n > 1:
        f.append(math.sin(x[1]) + u * y)
    if n > 2:
        f.append(0.5 * x[1] - math.cos(x[2]) + u)
    Omega = (1.0 + y**2) * (1.0 + sum(abs(v) ** 0.4 for v in x[1:]))
    following = [*x[1:], 0.0]
    slope = [a[i] * following[i] + f[i] + L * L ** (i + b) * a[i] * K[i] for i in range(n)]
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
        observer = example(n, dt, L0=2.0)
        state = observer.init((y(0.0),), tuple(start))
        for k in range(1, steps + 1):
            state, _ = observer.step(state, (y(k * dt),), 0.7)
        errors.append(np.abs(np.array([*state.x, state.L]) - reference).max())
    print(f"n = {n}: errors {errors}")
    assert errors[1] < 1e-3 * np.abs(reference).max()
    assert errors[0] > 3.0 * errors[1]


def test_with_a_constant_gain_it_is_of_second_order_at_least() -> None:
    """Then only the straight measurement is not exact."""
    l, L = (4.0, 2.0, 1.0), 2.0  # noqa: E741
    A = np.array([[-l[0] * L, 1.0, 0.0], [-l[0] * l[1] * L**2, 0.0, 1.0], [-l[0] * l[1] * l[2] * L**3, 0.0, 0.0]])
    start = np.array([0.2, -1.0, 3.0])
    observer = UpdatedHighGain.plain(dt=0.005, f=[lambda u, y, x: 0.0 * y[0]] * 3, l=l, L=L)
    state = observer.init((0.0,), tuple(start))
    for _ in range(100):
        state, _ = observer.step(state, (0.0,), None)
    assert state.x == pytest.approx(expm(0.5 * A) @ start, abs=1e-6)
    assert state.L == L


def test_with_a_linear_correction_b_is_without_effect() -> None:
    ends = []
    for b in (0.1, 2.0):
        observer = example(3, 0.01, correction=BiLimitCorrection((4.0, 2.0, 1.0)), b=b)
        state = observer.init((0.1,))
        for k in range(50):
            state, _ = observer.step(state, (math.sin(0.1 * k),), 0.3)
        ends.append(state.x)
    assert ends[0] == pytest.approx(ends[1], rel=1e-12)


def test_updated_is_the_general_form_without_degree() -> None:
    general = example(2, 0.01, correction=BiLimitCorrection((2.0, 1.0)))
    updated = UpdatedHighGain.updated(
        dt=0.01, f=general.f, a=general.a, l=(2.0, 1.0), Omega=general.Omega, **PHI, v=(0.4,)
    )
    assert updated.list_violations() == []
    states = [observer.init((0.1,)) for observer in (general, updated)]
    for k in range(50):
        states = [
            observer.step(state, (math.sin(0.1 * k),), 0.3)[0]
            for observer, state in zip((general, updated), states, strict=True)
        ]
    assert (*states[0].x, states[0].L) == pytest.approx((*states[1].x, states[1].L), rel=1e-12)
    assert states[0].L > 1.65


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
        a=(),
        saturate=lambda y, x: ((min(y[0], 0.5),), tuple(min(v, 2.0) for v in x)),
    )
    observer.slope((1.0, 5.0, -3.0), 2.0, (0.9,), "u")
    observer.step(observer.init((0.9,), (1.0, 5.0, -3.0)), (0.9,), "u")
    assert arguments["f1"] == ("u", (0.9,), ())
    observer.slope((1.0, 5.0, -3.0), 2.0, (0.9,), "u")
    assert arguments["f2"] == ("u", (0.5,), (2.0,))
    assert arguments["f3"] == ("u", (0.5,), (2.0, -3.0))
    assert arguments["Omega"] == ("u", (0.5,), (2.0, -3.0))
    slope = observer.slope((1.0, 5.0, -3.0), 2.0, (0.9,), "u")
    unlimited_slope = example(3, 0.01, f=observer.f, a=()).slope((1.0, 5.0, -3.0), 2.0, (0.9,), "u")
    assert slope == unlimited_slope


@pytest.mark.parametrize("n", [1, 2, 3])
def test_arrays_equal_floats_bit_by_bit(n: int) -> None:
    """With f, a and Omega that do (arithmetic alone)."""
    f = [lambda u, y, x: -u * y[0], lambda u, y, x: u * y[0] - x[0], lambda u, y, x: 0.5 * x[0] - x[1] * u][:n]
    observer = UpdatedHighGain(
        0.01, tuple(f), BiLimitCorrection((4.0, 2.0, 1.0)[3 - n :], 0.3), lambda u, y, x: abs(y[0]) + abs(u), 0.3, **PHI
    )
    rng = np.random.default_rng(0)
    y, u = rng.normal(0.0, 1.0, (40, 5)), rng.normal(0.0, 1.0, (40, 5))

    def walk(column: Any) -> Any:
        def column_of(values: np.ndarray) -> Any:
            return values if column is None else float(values[column])

        state = observer.init((column_of(y[0]),))
        for k in range(1, 40):
            state, _ = observer.step(state, (column_of(y[k]),), column_of(u[k - 1]))
        return state

    many = walk(None)
    for i in range(5):
        single = walk(i)
        assert [float(x[i]) for x in many.x] == list(single.x)
        assert float(many.L[i]) == single.L
        assert all(type(number) is float for number in (*single.x, single.L))


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
        v=(0.0, d),
    )
    assert observer.list_violations() == []

    def measurement(t: float) -> tuple[float, float]:
        return math.sin(t), -math.cos(t) - power(-math.sin(t), 1.0 + d)

    state, x = observer.init(measurement(0.0), (0.0, 1.0 + error, -error)), (0.0, 0.0, 0.0)
    for k in range(1, round(6.0 / dt) + 1):
        state, x = observer.step(state, measurement(k * dt), None)
    assert x == pytest.approx((math.sin(6.0), math.cos(6.0), -math.sin(6.0)), abs=1e-3)


def test_a_plain_observer_runs_away_where_the_homogeneous_one_does_not() -> None:
    """The error of (1), p = 0.5, from 1000, by scipy: that the plain one escapes is not its discretisation's doing."""

    def slope(t: float, z: np.ndarray) -> list[float]:
        x1, x2 = math.sin(t), math.cos(t)
        e1, e2 = z
        f = (x1 - 1.0) * e2 + power(x2 + e2, 1.5) - power(x2, 1.5)
        return [e2 - 12.0 * 2.0 * e1, f - 144.0 * 2.0 * e1]

    def escaped(t: float, z: np.ndarray) -> float:
        return abs(z[1]) - 1e7

    setattr(escaped, "terminal", True)  # noqa: B010 - how solve_ivp wants it
    large_error = solve_ivp(slope, (0.0, 1.0), [0.0, 1e3], "DOP853", rtol=1e-8, events=[escaped]).y
    small_error = solve_ivp(slope, (0.0, 3.0), [0.0, 1e2], "DOP853", rtol=1e-8, atol=1e-8).y
    assert abs(large_error[1, -1]) > 1e6
    assert abs(small_error[1, -1]) < 1e-3


def test_starts_where_it_is_told() -> None:
    observer = example(3, 0.01)
    state = observer.init((0.2,))
    assert state.x == (0.2, 0.0, 0.0)
    assert state.L == 1.5
    assert example(3, 0.01, L0=9.0).init((0.2,), (1.0, 2.0, 3.0))[:2] == ((1.0, 2.0, 3.0), 9.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"dt": 0.0}, r"^dt = 0\.0: must be a number greater than 0"),
        ({"b": -0.1}, r"^b = -0\.1"),
        ({"phi1": 0.0}, r"^phi1 = 0\.0"),
        ({"phi2": math.inf}, r"^phi2 = inf"),
        ({"phi3": math.nan}, r"^phi3 = nan"),
        ({"L0": 1.4}, r"^L0 = 1\.4: must be at least phi2 = 1\.5 \(Theorem 1\)"),
        ({"L0": math.nan}, r"^L0 = nan: must be at least phi2"),
        ({"f": (lambda u, y, x: 0.0,)}, r"^f: has 1 elements, but l says n = 3"),
        ({"a": (lambda y: 1.0,)}, r"^a: has 1 elements"),
        ({"v": (0.1,)}, r"^v: has 1 elements, but l says n = 3: must have 2"),
        ({"dt": "a"}, r"^dt = 'a': must be a number greater than 0$"),
        ({"L0": "a"}, r"^L0 = 'a': must be a number$"),
        ({"correction": (4.0, 2.0, 1.0)}, r"^correction = \[4\.0, 2\.0, 1\.0\]: must be a BiLimitCorrection$"),
        ({"f": abs}, r"^f = .*: must be a tuple of 3 functions$"),
        ({"f": (abs, abs, 1.0)}, r"^f_3 = 1\.0: must be a function$"),
        ({"a": (abs, "a", abs)}, r"^a_2 = 'a': must be a function$"),
        ({"Omega": 2.0}, r"^Omega = 2\.0: must be a function$"),
        ({"saturate": None}, r"^saturate = None: must be a function$"),
        ({"v": 0.1}, r"^v = 0\.1: must be a tuple of 2 numbers$"),
        ({"v": (0.1, "x")}, r"^v_3 = 'x': must be a number$"),
        ({"a": (), "dt": 1.0}, r"^l, phi2: too fast for the sample period: .* Runge-Kutta step of 1 s$"),
        ({"a": (), "L0": 900.0}, r"^l, L0: too fast for the sample period"),
        ({"b": 40.0, "strict": True}, r"^b = 40: \(21\) for i = 1, j = 1: .*\(Theorem 1\)$"),
        ({"v": (0.1, 0.5)}, r"^v_3 = 0\.5: must be in \[0, 1/\(j - 1\)\) = \[0, 0\.5\) \(Theorem 1\)"),
    ],
)
def test_what_the_theorem_does_not_allow_is_refused(changes: dict, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        example(3, **changes)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("y", "x", "message"),
    [
        (0.1, None, r"^y = 0\.1: must be a tuple of signals, such as \(0\.1,\)$"),
        ((), None, r"^y = \[\]: must be a tuple of signals"),
        ((0.1,), 0.1, r"^x = 0\.1: must be a tuple of signals"),
        ((0.1,), (1.0, 2.0, 3.0), r"^x: has 3 elements, but l says n = 2$"),
    ],
)
def test_what_does_not_fit_is_refused_at_the_start(y: Any, x: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        example(2).init(y, x)


def test_numpys_numbers_are_taken() -> None:
    period: Any = np.float32(0.01)
    observer = example(2, period, b=np.int64(1), correction=BiLimitCorrection((2.0, 1.0)), L0=np.float64(3.0))
    assert [type(number) for number in (observer.dt, observer.b, observer.L0)] == [float] * 3
    assert observer.b == 1.0


def test_the_step_is_stable_up_to_where_it_is_refused() -> None:
    """A linear observer by its own steps, on either side of the largest L that is taken."""

    def make_observer(L: float) -> UpdatedHighGain:
        return UpdatedHighGain.plain(dt=0.01, f=[lambda u, y, x: 0.0 * y[0]] * 2, l=(2.0, 1.0), L=L)

    low, high = 1.0, 1e4
    while high - low > 1e-6 * low:
        middle = 0.5 * (low + high)
        try:
            make_observer(middle)
            low = middle
        except InputError:
            high = middle

    def end_error(L: float) -> float:
        observer = make_observer(0.9 * low)
        object.__setattr__(observer, "phi2", L)  # past the check
        state = observer.init((0.0,), (1e-3, 0.0))
        for _ in range(2000):
            state, _ = observer.step(state, (0.0,), None)
        return abs(state.x[0])

    assert end_error(0.99 * low) < 1e-6
    assert end_error(1.01 * low) > 1.0


def test_violated_conditions_are_reported_not_refused() -> None:
    observer = example(2, 0.01, correction=BiLimitCorrection((1.0, 1.0), 0.9), b=0.41, v=(0.9,))
    assert len(observer.list_violations()) == 4
    assert example(2, 0.01, b=0.3).list_violations() == []

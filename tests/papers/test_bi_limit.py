"""The correction term of andrieu2009 against its definitions, for several dimensions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cmg_mj.papers.andrieu2009.observer import BiLimitCorrection, largest_b, list_violations, weights

E1 = (-3.0, -0.4, -1e-3, 0.0, 1e-3, 0.7, 20.0)


def power(x: float, a: float) -> float:
    return math.copysign(abs(x) ** a, x)


@pytest.mark.parametrize("p", [0.1, 0.5, 0.9])
@pytest.mark.parametrize("e1", E1)
def test_for_n_2_it_is_the_papers_example(p: float, e1: float) -> None:
    """q1(s) = s + s^(1/(1-p)), q2(s) = s + s^(1+p), section 3."""
    l1, l2 = 0.3, 1.7
    q1 = l1 * e1 + power(l1 * e1, 1.0 / (1.0 - p))
    q2 = l2 * q1 + power(l2 * q1, 1.0 + p)
    assert BiLimitCorrection((l1, l2), p)(e1) == pytest.approx((-q1, -q2), rel=1e-13)


@pytest.mark.parametrize("e1", E1)
def test_for_n_3_it_is_the_recursion(e1: float) -> None:
    """K_i(e) = (-q_i(l_i e), K_i+1(q_i(l_i e))), from the last dimension up; r_inf = 0.4, 0.7, 1, 1.3."""
    l = (4.0, 2.0, 1.0)  # noqa: E741
    r = (0.4, 0.7, 1.0, 1.3)

    def K(i: int, e: float) -> list[float]:
        if i == 3:
            return []
        s = l[i] * e
        q = s + power(s, r[i + 1] / r[i])
        return [-q, *K(i + 1, q)]

    assert BiLimitCorrection(l, 0.3)(e1) == pytest.approx(K(0, e1), rel=1e-12)


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_weights_are_those_of_18(n: int) -> None:
    """The chain x_i' = x_i+1 has the degree d_inf in them: r_i+1 = r_i + d_inf, and r_n = 1."""
    r = weights(n, 0.2)
    assert len(r) == n + 1
    assert r[n - 1] == 1.0
    assert np.diff(r) == pytest.approx(0.2)


@pytest.mark.parametrize(("n", "d_inf"), [(1, 0.7), (2, 0.5), (2, 0.9), (3, 0.25), (3, 0.45), (4, 0.2)])
def test_is_homogeneous_in_the_bi_limit(n: int, d_inf: float) -> None:
    """Definition 1: K_i(lambda^r1 e)/lambda^(r_i + d) tends to pure powers at infinity, to linear terms at 0."""
    l = tuple(1.8 ** (n - i) for i in range(1, n + 1))  # noqa: E741
    K = BiLimitCorrection(l, d_inf)
    e1 = np.linspace(-1.0, 1.0, 21)
    r = [1.0 - d_inf * (n - i) for i in range(1, n + 2)]
    pure, far = e1, []
    for i in range(n):
        pure = np.sign(pure) * np.abs(l[i] * pure) ** (r[i + 1] / r[i])
        far.append(-pure)
    near = [-np.prod(l[: i + 1]) * e1 for i in range(n)]

    def distances(scale: float) -> tuple[float, float]:
        large, small = K(scale ** r[0] * e1), K(e1 / scale)
        return (
            max(np.abs(large[i] / scale ** (r[i] + d_inf) - far[i]).max() / np.abs(far[i]).max() for i in range(n)),
            max(np.abs(small[i] * scale - near[i]).max() / np.abs(near[i]).max() for i in range(n)),
        )

    previous = distances(1e2)
    for scale in (1e4, 1e8, 1e12):
        now = distances(scale)
        assert now[0] < 0.7 * previous[0]
        assert now[1] < 0.7 * previous[1]
        previous = now
    assert max(distances(1e30)) < 1e-3


def chain(K: BiLimitCorrection, start: np.ndarray, span: float) -> np.ndarray:
    """E of dE/dtau = S E + K(e1) after a span."""

    def slope(_: float, E: np.ndarray) -> np.ndarray:
        correction = np.array(K(float(E[0])))
        assert np.isfinite(correction).all()
        return np.append(E[1:], 0.0) + correction

    solution = solve_ivp(slope, (0.0, span), start, "LSODA", rtol=1e-7, atol=1e-10 * np.linalg.norm(start))
    assert solution.success
    return solution.y[:, -1]


def directions(n: int, count: int) -> np.ndarray:
    E = np.random.default_rng(n).normal(size=(count, n))
    return E / np.linalg.norm(E, axis=1, keepdims=True)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 0.9])
@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_error_of_a_chain_converges(n: int, share: float, size: float) -> None:
    """With l_i = 2^(n-i), d_inf a share of its limit (of 1 for n = 1)."""
    if n == 4 and share == 0.9 and size >= 1.0:
        pytest.skip("too stiff to integrate: K grows with e1 to the power 13")
    K = BiLimitCorrection(tuple(2.0 ** (n - i) for i in range(1, n + 1)), share / max(n - 1, 1))
    for E in directions(n, 2):
        assert np.linalg.norm(chain(K, size * E, 40.0)) < 1e-5 * size


@pytest.mark.parametrize("l", [(0.01, 0.01), (0.1, 5.0), (7.0, 0.3)])
def test_for_n_2_every_positive_l_converges(l: tuple[float, float]) -> None:  # noqa: E741
    """A Lienard equation with damping and a restoring force; slow for small l."""
    slowest = -np.roots([1.0, l[0], l[0] * l[1]]).real.max()
    for E in directions(2, 3):
        assert np.linalg.norm(chain(BiLimitCorrection(l, 0.5), E, 20.0 / slowest)) < 1e-4


def test_a_hurwitz_linear_part_is_not_enough_for_n_3() -> None:
    """The same l converges with d_inf = 0 and not with 0.2."""
    l, E = (1.0, 2.0, 0.9), directions(3, 3)  # noqa: E741
    ends = [
        [np.linalg.norm(chain(BiLimitCorrection(l, d), e, 300.0 if d == 0.0 else 20.0)) for e in E] for d in (0.0, 0.2)
    ]
    assert max(ends[0]) < 0.1
    assert max(ends[1]) > 3.0


@pytest.mark.parametrize("p", [0.1, 0.5, 0.9])
def test_for_n_2_both_conditions_ask_for_the_same_b(p: float) -> None:
    """b < (1 - p)/p."""
    assert largest_b(2, p) == pytest.approx((1.0 - p) / p)
    assert largest_b(2, p, (p,)) == pytest.approx((1.0 - p) / p)
    assert largest_b(2, 0.0, (p,)) == pytest.approx((1.0 - p) / p)
    assert largest_b(2, 0.0) == math.inf


@pytest.mark.parametrize(
    ("n", "d_inf", "v"), [(2, 0.5, ()), (3, 0.3, ()), (3, 0.1, (0.6, 0.4)), (4, 0.2, (0.9, 0.1, 0.1))]
)
def test_largest_b_is_where_the_printed_inequalities_begin_to_fail(n: int, d_inf: float, v: tuple[float, ...]) -> None:
    bound = largest_b(n, d_inf, v)
    assert list_violations(n, d_inf, 0.999 * bound, v) == []
    assert list_violations(n, d_inf, 1.001 * bound, v)


def test_the_papers_own_parameters_violate_21_and_22() -> None:
    lines = list_violations(2, 0.9, 0.410, (0.9,))
    assert lines == [*(f"(21) for i = {i}, j = {j}" for i, j in ((1, 1), (2, 1), (2, 2))), "(22) for j = 2"]
    assert list_violations(2, 0.9, 0.11, (0.9,)) == []

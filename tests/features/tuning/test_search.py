"""Which numbers can be tuned, and how the best ones are found."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from cmg_mj.features.tuning.search import TunedScalar, crossing, numbers_of, parameters_of, replaced, search
from cmg_mj.observers import make_observer
from tests.features.tuning.user_observer import USER_OBSERVER
from tests.observers.reference import DT, PAPER


def numbers(kind: str, *names: str) -> list[TunedScalar]:
    def make(**parameters: Any) -> Any:
        return make_observer(kind, DT, PAPER, **parameters)

    return numbers_of(kind, parameters_of(kind, make(), {}), make, names, {})


def test_every_number_is_found_also_in_tuples() -> None:
    assert [n.name for n in numbers("linear")] == ["tau"]
    assert [n.name for n in numbers("ltv")] == ["Q[0]", "Q[1]", "Q[2]", "H0[0]", "H0[1]", "H0[2]"]
    assert [n.name for n in numbers("luenberger")] == ["L[0][0]", "L[1][0]", "L[2][1]"]  # zeros stay zero
    assert [n.name for n in numbers("ltv", "Q[1]", "H0")] == ["Q[1]", "H0[0]", "H0[1]", "H0[2]"]


def test_limits_are_where_the_observer_refuses() -> None:
    (alpha,) = numbers("homogeneous", "alpha")
    assert alpha.low == pytest.approx(0.5, abs=1e-9)
    assert alpha.low > 0.5  # open there
    assert alpha.high == pytest.approx(1.0, abs=1e-12)
    (tau,) = numbers("linear")
    assert (tau.low, tau.high) == pytest.approx((0.02 / 1000.0, 0.02 * 1000.0))


@pytest.mark.parametrize("kind", ["linear", "ltv", "homogeneous", "luenberger", "super_twisting", "linear_high_gain"])
def test_the_observer_takes_each_number_at_its_limits(kind: str) -> None:
    parameters = parameters_of(kind, make_observer(kind, DT, PAPER), {})
    for number in numbers(kind):
        for size in (number.low, number.high):
            make_observer(kind, DT, PAPER, **replaced(parameters, {number.name: size}))


def test_a_sign_stays() -> None:
    assert replaced({"L": ((1.0, -3.0), (0.0, 2.0))}, {"L[0][1]": 5.0}) == {"L": ((1.0, -5.0), (0.0, 2.0))}


def test_a_users_own_observer_is_read_as_well() -> None:
    (gain,) = numbers(USER_OBSERVER)
    assert gain.name == "gain"
    assert gain.start == 2.0
    assert gain.high == pytest.approx(10.0)


def number(name: str, start: float, low: float = 1e-3, high: float = 1e3) -> TunedScalar:
    return TunedScalar(name, start, low, high)


@pytest.mark.parametrize("best", [0.0021, 0.3, 4.0, 700.0])
def test_one_number_is_found_wherever_it_is(best: float) -> None:
    sizes, loss = search(lambda s: 1.0 + math.log(s[0] / best) ** 2, [number("a", 1.0)])
    assert sizes == pytest.approx([best], rel=5e-3)
    assert loss == pytest.approx(1.0, abs=1e-4)


def test_the_deeper_of_two_valleys_is_taken() -> None:
    def loss(s: Any) -> float:
        x = math.log(s[0])
        return 2.0 - math.exp(-((x + 4.0) ** 2)) - 1.5 * math.exp(-((x - 4.0) ** 2))

    sizes, _ = search(loss, [number("a", math.exp(-4.0))])
    assert math.log(sizes[0]) == pytest.approx(4.0, abs=0.02)


def test_several_numbers_in_a_bent_valley() -> None:
    def loss(s: Any) -> float:
        a, b, c = np.log(s)
        return 1.0 + (a - 0.5) ** 2 + 10.0 * (b - a**2) ** 2 + (c + a) ** 2

    sizes, _ = search(loss, [number(name, 1.0) for name in "abc"], starts=1)
    np.testing.assert_allclose(np.log(sizes), [0.5, 0.25, -0.5], atol=0.02)


def test_a_minimum_on_a_limit_and_a_region_without_loss() -> None:
    def loss(s: Any) -> float:
        a, b = np.log(s)
        return math.inf if b > 1.0 else 2.0 - 0.1 * a + (b - 0.8) ** 2

    sizes, _ = search(loss, [number("a", 1.0, 0.1, 2.0), number("b", 1.0)])
    assert sizes[0] == pytest.approx(2.0, rel=1e-3)
    assert math.log(sizes[1]) == pytest.approx(0.8, abs=0.02)


def test_where_nothing_works_the_loss_is_infinite() -> None:
    assert search(lambda s: math.inf, [number("a", 1.0)])[1] == math.inf


def test_crossing() -> None:
    assert crossing([1.0, 2.0, 4.0], [-3.0, -1.0, 1.0]) == pytest.approx(3.0)
    assert crossing([1.0, 2.0], [0.0, 1.0]) == 1.0
    assert crossing([1.0, 2.0], [1.0, 2.0]) is None

"""Symbols in the place of numbers: what `elementwise` makes of them, and what a state may be made of."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.core.tape import Symbol, Tape
from cmg_mj.core.tree import form, numbers, rebuild
from cmg_mj.features.export.check import in_floats
from cmg_mj.features.export.formula import formula
from cmg_mj.features.export.names import identifiers, name_of
from cmg_mj.features.export.pipeline import generate_code
from cmg_mj.observers import Measurement
from tests.features.export import own
from tests.features.export.compiled import control
from tests.test_elementwise import FUNCTIONS, SPECIAL


def symbol() -> Any:
    return Tape().input("x")


def traced(function: Callable) -> Callable[[float], float]:
    """The function of a number, by its recorded operations."""
    x = symbol()
    computed = in_floats(formula(x.tape, [x], [function(x)]))
    return lambda value: computed(value)[0]


@pytest.mark.parametrize("function", FUNCTIONS)
def test_a_symbol_equals_floats_bit_by_bit(function: Callable) -> None:
    """But for the sign of a zero, as with arrays."""
    values = [*SPECIAL, *np.random.default_rng(3).normal(0.0, 1.0, 200).tolist()]
    assert list(map(traced(function), values)) == list(map(function, values))


@pytest.mark.parametrize(
    ("function", "value", "expected"),
    [
        (lambda x: 1.0 / x, -0.0, -math.inf),
        (lambda x: x / x, 0.0, math.nan),
        (np.sqrt, -1.0, math.nan),
        (np.log, 0.0, -math.inf),
        (np.exp, 1e3, math.inf),
        (np.sinh, -1e3, -math.inf),
        (lambda x: x**0.5, -2.0, math.nan),
        (lambda x: np.float_power(x, 3.0), -1e200, -math.inf),
        (np.floor, -math.inf, -math.inf),
        (np.rint, math.nan, math.nan),
    ],
)
def test_where_python_raises_a_formula_has_what_c_has(function: Callable, value: float, expected: float) -> None:
    with np.errstate(all="ignore"):
        np.testing.assert_array_equal(traced(function)(value), expected)


def test_numpys_numbers_and_arrays_on_the_left() -> None:
    x = symbol()
    for left in (np.float64(2.0), np.array(2.0), 2, 2.0, np.int64(2), True):
        assert isinstance(left * x, Symbol)
        assert isinstance(x < left, Symbol)
    column = np.array([1.0, 2.0]) * x + np.array([x, 1.0], dtype=object)
    assert [type(part) for part in column] == [Symbol, Symbol]
    assert isinstance((np.eye(2) @ column)[0], Symbol)
    assert isinstance(np.sin(column)[1], Symbol)


def test_nothing_is_simplified() -> None:
    """What is equal on paper may round otherwise."""
    x = symbol()
    results = {"add": x + 0.0, "multiply": 1.0 * x, "subtract": x - x, "power": x**2, "negative": np.negative(-x)}
    for name, result in results.items():
        assert x.tape.operations[result.place].name == name
    assert (x + 0.0).place == results["add"].place  # but equal ones are one


def test_what_is_remembered_in_a_global_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A symbol of an earlier export has a place that means another number now."""
    monkeypatch.setattr("cmg_mj.features.export.check.TICKS", 40)
    observer = "tests.features.export.own:RemembersInAGlobal"
    with pytest.raises(InputError, match="remembers something outside of its state"):
        generate_code(control(observer), "double")
    with pytest.raises(InputError, match=r"remembered from an earlier recording \(.*own.py, line \d+: rate = "):
        generate_code(control(observer), "double")


def test_what_is_remembered_and_not_used_is_no_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cmg_mj.features.export.check.TICKS", 40)
    code = generate_code(control("tests.features.export.own:RemembersForNothing"), "double")
    assert code.figures["trace_off_by"] == 0.0


def test_a_state_is_taken_apart_and_put_together() -> None:
    state = own.Elaborate(0.005, None).init(Measurement(0.1, 0.2, 0.3))
    result = list(numbers(state))
    assert [leaf.value for leaf in result] == [0, False, 0.1, 0.0, 0.0, 0.1, 0.2, 0.3, 0.0]
    rerun = rebuild(state, iter(range(9)))
    assert form(rerun) == form(state)
    assert (rerun.last.acceleration, rerun.parts["π"].other, rerun.label) == (7, [3, 4], "a constant")
    assert form(state._replace(label="another")) != form(state)


def test_names_in_c() -> None:
    paths = [("x", "1"), ("x_1",), ("double",), ("0",), ("π", "a"), (), ("__x",), ("x", "1"), ("速度",), ("this",)]
    names = identifiers(paths, reserved=("value",))
    assert names == ["x_1", "x_1_2", "double_", "s0", "pi_a", "value_", "s__x", "x_1_3", "value__2", "this_"]


@pytest.mark.parametrize(
    ("name", "c_name"),
    [
        ("WithBias", "with_bias"),
        ("Größe", "grosse"),
        ("ØreÆgir", "ore_aegir"),
        ("Ωmega", "omegamega"),
        ("__Own__", "own"),
        ("Double", "double_observer"),
    ],
)
def test_a_class_is_called_by_its_name(name: str, c_name: str) -> None:
    assert name_of(type(name, (own.Plain,), {})(0.005, None)) == c_name


@pytest.mark.parametrize("name", ["观测器", "_", "A" * 41])
def test_a_name_that_c_cannot_spell_is_asked_for(name: str) -> None:
    observer = type(name, (own.Plain,), {})(0.005, None)
    with pytest.raises(InputError, match=r"^the class's name .* give one with --name$"):
        name_of(observer)
    assert name_of(observer, "mine_2") == "mine_2"


@pytest.mark.parametrize("name", ["", "2x", "größe", "../x", "x" * 41, "double", "x\n"])
def test_a_name_asked_for_is_one_of_c(name: str) -> None:
    with pytest.raises(InputError, match=r"^--name "):
        name_of(own.Plain(0.005, None), name)


def test_a_symbol_has_no_value() -> None:
    for conversion in (bool, float, int, complex, round, math.sin, math.floor):
        with pytest.raises(InputError):
            conversion(symbol())
    with pytest.raises(TypeError):
        hash(symbol())
    assert repr(symbol()) == "Symbol(0)"

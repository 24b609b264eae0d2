"""Symbols in the place of numbers: what `elementwise` makes of them, and what a state may be made of."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.core.tree import form, numbers, rebuild
from cmg_mj.observers import Measurement
from tests.features.export import own
from tests.features.export.compiled import controller
from tests.test_elementwise import FUNCTIONS, SPECIAL

import casadi  # isort: skip  (skipped above where it is missing)

from cmg_mj.features.export.symbol import Symbol  # isort: skip
from cmg_mj.features.export.symbol import as_written  # isort: skip
from cmg_mj.features.export.names import name_of  # isort: skip
from cmg_mj.features.export.names import identifiers  # isort: skip
from cmg_mj.features.export.pipeline import generate_code  # isort: skip


def symbol(name: str = "x") -> Any:
    return Symbol(casadi.SX.sym(name))


TRACEABLE = [function for function in FUNCTIONS if function.id not in ("round", "digitise")]
"""All but those that only sensors need."""


@pytest.mark.parametrize("function", TRACEABLE)
def test_a_symbol_equals_floats_bit_by_bit(function: Callable) -> None:
    """But for the sign of a zero, as with arrays."""
    x = symbol()
    with as_written():
        graph = casadi.Function("f", [x.sx], [function(x).sx])
    values = [*SPECIAL, *np.random.default_rng(3).normal(0.0, 1.0, 200).tolist()]
    assert [float(graph(value)) for value in values] == [function(value) for value in values]  # type: ignore[arg-type]


def test_numpys_numbers_and_arrays_on_the_left() -> None:
    x = symbol()
    for left in (np.float64(2.0), np.array(2.0), 2, 2.0, np.int64(2), True):
        assert isinstance(left * x, Symbol)
        assert isinstance(x < left, Symbol)
    column = np.array([1.0, 2.0]) * x + np.array([x, 1.0], dtype=object)
    assert [type(part) for part in column] == [Symbol, Symbol]
    assert isinstance((np.eye(2) @ column)[0], Symbol)
    assert isinstance(np.sin(column)[1], Symbol)


@pytest.mark.parametrize("name", ["Elaborate", "Branches"])
def test_casadi_is_left_as_it_was(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cmg_mj.features.export.check.TICKS", 40)
    for before in (True, False):
        casadi.GlobalOptions.setSimplificationOnTheFly(before)
        try:
            generate_code(controller(f"tests.features.export.own:{name}"), "double")
        except InputError:
            assert name == "Branches"
        assert casadi.GlobalOptions.getSimplificationOnTheFly() is before
    casadi.GlobalOptions.setSimplificationOnTheFly(True)


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
    assert repr(symbol("tilt")) == "Symbol(tilt)"

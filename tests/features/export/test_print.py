"""The printed C: literals, brackets, operations."""

from __future__ import annotations

import ctypes
import math
import re
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmg_mj.core.tape import RECORDED, Tape
from cmg_mj.features.export.c_code import body, literal
from cmg_mj.features.export.check import in_floats
from cmg_mj.features.export.formula import Formula, formula, symbols
from tests.features.export.compiled import compile_c, needs_compiler

FUNCTIONS = [getattr(np, name) for name in sorted(RECORDED)]


@pytest.mark.parametrize("value", [0.1, -1.0 / 3.0, 1e-200, 5e-324, 1.7976931348623157e308, 35.0, 0.0, -0.0, 1e22])
def test_a_double_is_read_back_as_it_was(value: float) -> None:
    text = literal(value, "double")
    assert struct.pack("d", float(text)) == struct.pack("d", value)
    assert re.fullmatch(r"-?\d+(\.\d+)?(e[+-]?\d+)?", text)
    assert "." in text or "e" in text


@pytest.mark.parametrize(
    ("value", "expected"),
    [(0.1, np.float32(0.1)), (-35.0, -35.0), (0.0, 0.0), (1e10, 1e10), (1.0 / 3.0, np.float32(1.0 / 3.0))],
)
def test_a_float_is_the_nearest_one(value: float, expected: float) -> None:
    text = literal(value, "single")
    assert text.endswith("f")
    assert np.float32(text[:-1]) == expected


def test_what_is_nearly_zero_or_very_large_stays_so() -> None:
    """1e-200, below which `elementwise` divides by nothing, would be 0 as a float, and 0/0 is NaN."""
    tiny, largest = float(np.finfo(np.float32).tiny), float(np.finfo(np.float32).max)
    assert [float(literal(x, "single")[:-1]) for x in (1e-200, -1e-300, 1e300)] == pytest.approx([tiny, -tiny, largest])
    assert np.float32(literal(1e-200, "single")[:-1]) > 0.0
    assert [literal(x, "single") for x in (math.inf, -math.inf, math.nan)] == ["INFINITY", "-INFINITY", "NAN"]
    literals = ["(double)INFINITY", "-(double)INFINITY", "(double)NAN"]
    assert [literal(x, "double") for x in (math.inf, -math.inf, math.nan)] == literals


@needs_compiler
@pytest.mark.parametrize("precision", ["double", "single"])
def test_every_operation_does_what_numpy_does(precision: Any, tmp_path: Path) -> None:
    logical = {np.bitwise_and: np.logical_and, np.bitwise_or: np.logical_or, np.invert: np.logical_not}
    traced = trace(lambda a, b: [f(*(a, b)[: f.nin]) for f in FUNCTIONS] + formulas(a, b))
    run, in_python = compile_function(traced, precision, tmp_path), in_floats(traced)
    rng, kind = np.random.default_rng(1), np.float64 if precision == "double" else np.float32
    pairs = [*rng.uniform(-1.5, 1.5, (50, 2)), (0.0, 0.0), (0.7, 0.7), (1.0, 0.0), (0.0, -1.0), (1.0, 1.0)]
    with np.errstate(all="ignore"):
        for pair in pairs:
            a, b = map(kind, pair)
            expected = [logical.get(f, f)(*(a, b)[: f.nin]) for f in FUNCTIONS] + formulas(a, b)
            np.testing.assert_allclose(
                run(a, b), np.array(expected, dtype=float), rtol=1e-15 if kind is np.float64 else 5e-7
            )
            if kind is np.float64:
                np.testing.assert_array_equal(run(a, b), in_python(float(a), float(b)))


def formulas(a: Any, b: Any) -> list[Any]:
    return [
        *(np.where(a < b, a, 2.0 * b), np.clip(a, -0.5, 0.5), a - (b - (a - b)), a / (b / (a * b))),
        *(np.negative(np.negative(a)), a - -1.5, (a + b) * (a - b), (a < b) + (b < a) * 2.0),
    ]


@needs_compiler
def test_what_is_nan_does_not_become_a_limit(tmp_path: Path) -> None:
    """As fmax would have it: a board would go on with the largest rate."""
    limited = trace(lambda a, b: [np.clip(a, -4.7, 4.7), np.maximum(0.0, a), np.minimum(a, 1.0)])
    assert np.isnan(compile_function(limited, "double", tmp_path)(math.nan, 0.0)).all()
    assert np.isnan(in_floats(limited)(math.nan, 0.0)).all()


@needs_compiler
def test_an_output_may_take_the_place_of_an_input(tmp_path: Path) -> None:
    lines = body(trace(lambda a, b: [b, a]), ["x[0]", "x[1]"], ["x[0]", "x[1]"], "double", "double")
    source = tmp_path / "swap.c"
    source.write_text(f"void f(double x[2]);\nvoid f(double x[2])\n{{\n{chr(10).join(lines)}\n}}\n")
    compile_c("-shared", "-fPIC", source, "-o", tmp_path / "swap.so")
    x = np.array([1.0, 2.0])
    ctypes.CDLL(str(tmp_path / "swap.so")).f(x.ctypes.data_as(ctypes.c_void_p))
    assert x.tolist() == [2.0, 1.0]


def trace(function: Callable[[Any, Any], list[Any]]) -> Formula:
    """The formula of a function of two numbers."""
    tape = Tape()
    a, b = symbols(tape, 2)
    return formula(tape, [a, b], function(a, b))


def compile_function(formula: Formula, precision: Any, folder: Path) -> Any:
    """A function of a and b as C, called with two numbers."""
    n, real = len(formula.outputs), "double" if precision == "double" else "float"
    lines = body(formula, ["a", "b"], [f"x[{i}]" for i in range(n)], real, precision)
    head = f"void f({real} a, {real} b, {real} x[{n}])"
    text = f"#include <math.h>\n{head};\n{head}\n{{\n(void)b;\n{chr(10).join(lines)}\n}}\n"
    (folder / "f.c").write_text(text)
    compile_c("-shared", "-fPIC", folder / "f.c", "-o", folder / "f.so", "-lm")
    library = ctypes.CDLL(str(folder / "f.so"))
    kind, number = (np.float64, ctypes.c_double) if precision == "double" else (np.float32, ctypes.c_float)

    def call(a: float, b: float) -> np.ndarray:
        x = np.full(n, 77.0, kind)
        library.f(number(a), number(b), x.ctypes.data_as(ctypes.c_void_p))
        return x.astype(float)

    return call

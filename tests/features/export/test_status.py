"""The status of an update: a number that is not finite, in or out, holds u at 0 until `start`."""

from __future__ import annotations

import math
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmg_mj.core.errors import InputError, RunStopped
from cmg_mj.features.export import c_files, check, export, pipeline
from cmg_mj.features.export.names import estimate_places
from cmg_mj.observers import OBSERVERS
from tests.features.export.compiled import (
    COMPILER,
    STRICT,
    TYPES,
    Compiled,
    compile_c,
    control,
    controller,
    needs_compiler,
)

OK, INPUT, RESULT = range(3)
NOT_FINITE = (math.nan, math.inf, -math.inf)
BROKEN_AT = (0, 1, 30)
TICKS = 60
OWN, OWN_LAW = "tests.features.export.own:", "controller.kind=tests.features.export.own_laws:"


@pytest.fixture(autouse=True)
def few_signals(monkeypatch: pytest.MonkeyPatch) -> None:
    """On which an export compares C with Python; the other tests of the export have all."""
    monkeypatch.setattr("cmg_mj.features.export.check.TICKS", TICKS)


def samples(kind: str, precision: Any) -> np.ndarray:
    return check.signals(control(kind), 0, precision)


def broken(readings: np.ndarray, tick: int, place: int, value: float) -> np.ndarray:
    """The readings with one of them replaced."""
    copy = readings.copy()
    copy[tick, place] = value
    return copy


@needs_compiler
@pytest.mark.parametrize("precision", ["double", pytest.param("single", marks=pytest.mark.slow)])
def test_an_infinite_reading_holds_u_at_0_until_start(precision: Any, tmp_path: Path) -> None:
    """`adaptive` had 4.7 rad/s for ticks, which equals itself."""
    compiled, readings = Compiled("adaptive", precision, tmp_path), samples("adaptive", precision)
    fresh = compiled.run(readings)
    assert fresh.any(axis=0).all()
    for value in NOT_FINITE:
        statuses, results = compiled.statuses(broken(readings, 30, 2, value))
        assert statuses.tolist() == [OK] * 30 + [INPUT] * (TICKS - 30)
        np.testing.assert_array_equal(results[:30], fresh[:30])
        assert not results[30:].any()
        statuses, results = compiled.go_on(readings)  # good readings alone do not start it
        assert set(statuses) == {INPUT}
        assert not results.any()
        np.testing.assert_array_equal(compiled.run(readings), fresh)


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("kind", [*OBSERVERS, f"{OWN}Elaborate", f"{OWN}Stateless"])
def test_whatever_comes_in_what_comes_out_is_finite(kind: str, precision: Any, tmp_path: Path) -> None:
    """NaN, infinite, huge and denormal readings at every place, at the first update and later."""
    compiled, readings = Compiled(kind, precision, tmp_path), samples(kind, precision)
    fresh, kinds = compiled.run(readings), np.finfo(TYPES[precision])
    limit = float(TYPES[precision](4.7))
    for place in range(readings.shape[1]):
        for tick in BROKEN_AT:
            for value in NOT_FINITE:
                statuses, results = compiled.statuses(broken(readings, tick, place, value))
                assert statuses.tolist() == [OK] * tick + [INPUT] * (TICKS - tick)
                np.testing.assert_array_equal(results[:tick], fresh[:tick])
                assert not results[tick:].any()
            huge = (float(kinds.max), float(kinds.max) ** 0.5, float(kinds.max) ** 0.25)
            for value in (*huge, *(-size for size in huge)):
                statuses, results = compiled.statuses(broken(readings, tick, place, value))
                np.testing.assert_array_equal(results[:tick], fresh[:tick])
                assert np.isfinite(results).all()
                assert np.abs(results[:, -1]).max() <= limit
                stopped = np.flatnonzero(statuses)
                assert not stopped.size or set(statuses[stopped[0] :]) == {RESULT}
                assert not results[statuses != OK].any()
            zero, _ = compiled.statuses(broken(readings, tick, place, 0.0))  # `high_gain` overflows at such a jump
            for value in (float(kinds.smallest_subnormal), -float(kinds.smallest_subnormal), -0.0):
                statuses, results = compiled.statuses(broken(readings, tick, place, value))
                np.testing.assert_array_equal(statuses, zero)
                assert np.isfinite(results).all()
    np.testing.assert_array_equal(compiled.run(readings), fresh)


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("law", [(), (f"{OWN_LAW}Elaborate",)], ids=["(8)", "a law with a state"])
@pytest.mark.parametrize("kind", [*OBSERVERS, f"{OWN}Stateless"])
def test_a_number_of_the_controller_that_is_not_finite_stops_it(
    kind: str, law: tuple[str, ...], tmp_path: Path
) -> None:
    """As a cosmic ray, or an observer that diverges: whatever member it is, unless it is not read again."""
    compiled, readings = Compiled(kind, "double", tmp_path, *law), samples(kind, "double")
    traced, _, _ = pipeline._traced(control(kind, *law))
    stateless = not traced.state  # then the first number is a place that nothing uses
    members = stateless + len(traced.state) + len(traced.law.state) + 2
    seen = 0
    for member in range(stateless, members):
        compiled.statuses(readings[:30])
        compiled.numbers(members)[member] = math.nan
        statuses, results = compiled.go_on(readings[30:])
        assert np.isfinite(results).all()
        assert set(statuses) in ({OK}, {RESULT})
        if statuses[0] == OK:  # it was not read
            assert np.isfinite(compiled.numbers(members)[stateless:]).all()
        else:
            assert not results.any()
            seen += 1
    assert seen >= 1 + 3 * len(law)  # the integrator, and the law's numbers that its command divides by or adds
    assert not compiled.statuses(readings)[0].any()


@needs_compiler
@pytest.mark.slow
def test_an_infinite_command_stops_it_as_python(tmp_path: Path) -> None:
    """It is not taken for one beyond the limit."""
    law = f"{OWN_LAW}Overflows"
    compiled, loop = Compiled("linear", "double", tmp_path, law), controller("linear", law)
    upright, overturned = [0.0, 9.81, 0.0, 9.81, 0.0, 0.0], [-1.0, -9.81, -1.0, -9.81, 0.0, 0.0]
    statuses, results = compiled.statuses(np.array([upright, overturned]))
    assert statuses.tolist() == [0, RESULT]
    assert np.all(np.isfinite(results))
    loop.decide(0, upright[:4], upright[4:], 0.0, 0.0)
    with pytest.raises(RunStopped, match="law Overflows returned -inf for u"):
        loop.decide(loop.period, overturned[:4], overturned[4:], 0.0, 0.0)


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("kind", ["linear", "adaptive", "homogeneous"])
@pytest.mark.parametrize("flags", [("-O3", "-ffast-math"), ("-Os",), ("-O0", "-fsanitize=undefined,address")])
def test_no_flag_takes_the_check_away(kind: str, flags: tuple[str, ...], tmp_path: Path) -> None:
    """Compilers that are told that all numbers are finite drop `x == x` and `isfinite`."""
    source, example = (export(controller(kind), tmp_path)[i] for i in (1, 2))
    assert COMPILER is not None
    subprocess.run(
        [COMPILER, "-std=c99", *flags, str(source), str(example), "-lm", "-o", str(tmp_path / "example")], check=True
    )
    process = subprocess.run([tmp_path / "example"], capture_output=True, text=True, check=False)
    assert process.stderr == ""
    assert "NOT held" not in process.stdout
    assert "is not finite" not in process.stdout


@needs_compiler
def test_the_example_sees_a_check_that_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """So every export is refused whose C would give an infinite reading on."""
    monkeypatch.setitem(c_files.BITS, "double", ("uint64_t", "UINT64_C(0xffffffffffffffff)"))
    with pytest.raises(InputError, match=r"u is NOT held at 0 after a reading that is not finite"):
        export(controller("linear"), tmp_path / "board")


@pytest.mark.daily_cases("single-False")
@needs_compiler
@pytest.mark.parametrize(("precision", "refused"), [("double", True), ("single", False)])
def test_a_compiler_whose_double_has_32_bits(precision: Any, refused: bool, tmp_path: Path) -> None:
    """As AVR's. It is seen where a user includes the header, too."""
    header = export(controller("linear"), tmp_path / "board", precision=precision)[0]
    (tmp_path / "float.h").write_text(
        "#include_next <float.h>\n#undef DBL_MANT_DIG\n#undef DBL_MAX_EXP\n"
        "#define DBL_MANT_DIG 24\n#define DBL_MAX_EXP 128\n"
    )
    (tmp_path / "user.c").write_text(f'#include "{header.name}"\nint main(void) {{ return 0; }}\n')
    assert COMPILER is not None
    command = [COMPILER, *STRICT, "-fsyntax-only", "-I", tmp_path / "board", tmp_path / "user.c"]
    assert subprocess.run(command, check=False).returncode == 0
    process = subprocess.run([*command, "-isystem", tmp_path], capture_output=True, text=True, check=False)
    assert (process.returncode != 0) is refused
    assert ("fewer than 53 bits" in process.stderr) is refused
    assert ("export with --precision single" in process.stderr) is refused


def test_names_of_statuses_are_taken() -> None:
    places = estimate_places(("ok", "input_not_finite", "result_not_finite", "status"))
    assert places[3:] == ["OK_", "INPUT_NOT_FINITE_", "RESULT_NOT_FINITE_", "STATUS"]


@needs_compiler
@pytest.mark.slow
def test_cpp_reads_the_header_and_calls_it(tmp_path: Path) -> None:
    export(controller("linear"), tmp_path)
    (tmp_path / "user.cpp").write_text(
        '#include "linear.h"\n#include <limits>\nint main() {\n'
        "    linear_controller c; double a[4] = {0, 9.81, 0, 9.81}, e[2] = {1.5, 1.5}, x[LINEAR_ESTIMATES], u = 7;\n"
        "    linear_start(&c);\n    linear_status status = linear_update(&c, a, e, x, &u);\n"
        "    if (status != LINEAR_OK) return 1;\n    e[0] = std::numeric_limits<double>::infinity();\n"
        "    return linear_update(&c, a, e, x, &u) == LINEAR_INPUT_NOT_FINITE && u == 0 ? 0 : 2;\n}\n"
    )
    compile_c("-c", tmp_path / "linear.c", "-o", tmp_path / "linear.o")
    command = ["g++", "-Wall", "-Wextra", "-Werror", "user.cpp", "linear.o", "-lm", "-o", "user"]
    subprocess.run(command, cwd=tmp_path, check=True)
    assert subprocess.run([tmp_path / "user"], check=False).returncode == 0

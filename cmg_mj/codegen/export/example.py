"""Prints the files beside an export's code: a test vector, and an example that runs it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from cmg_mj.codegen.export.c_code import Precision, literal

Table = Sequence[Sequence[float]]


def format_test_vector(
    name: str, precision: Precision, inputs: Table, expected: Table, allowed: Sequence[float]
) -> str:
    """Format NAME_test_vector.h.

    Args:
        name: Name of the export.
        precision: Precision of its numbers.
        inputs: Raw accelerations and encoders, a row for each update.
        expected: The estimate and u by Python, a row for each update.
        allowed: The allowed difference of each column of `expected`.

    Returns:
        The text.
    """
    n, N, real = name, name.upper(), f"{name}_real"
    return f"""/* What {n}.c was compared on when it was written. */
#ifndef {N}_TEST_VECTOR_H
#define {N}_TEST_VECTOR_H

#include "{n}.h"

#define {N}_TICKS {len(inputs)}

/* A row an update: raw accelerations, inner x, inner z, outer x, outer z [m/s^2]; encoders [rad]. */
static const {real} {n}_inputs[{N}_TICKS][4 + {N}_ENCODERS] = {{
{_rows(inputs, precision)}}};

/* What cmg_mj makes of them: the estimate, then u [rad/s]. */
static const {real} {n}_expected[{N}_TICKS][{N}_ESTIMATES + 1] = {{
{_rows(expected, precision)}}};

/* How far each of these may be off: rounding, and what the observer makes of it. */
static const {real} {n}_allowed[{N}_ESTIMATES + 1] = {_row(allowed, precision)};

#endif
"""


def format_example(name: str, precision: Precision, parts: Sequence[str]) -> str:
    """Format NAME_example.c.

    Args:
        name: Name of the export.
        precision: Precision of its numbers.
        parts: Names of the compared columns: the parts of an estimate, and u.

    Returns:
        The text.
    """
    n, N, real = name, name.upper(), f"{name}_real"
    listed = ", ".join(f'"{part}"' for part in parts)
    return f"""/* How {n}.c is used, and whether it does here what it does in cmg_mj:
 *
 *     cc -std=c99 -O2 {n}.c {n}_example.c -lm -o {n}_example && ./{n}_example */
#include "{n}_test_vector.h"

#include <math.h>
#include <stdio.h>

int main(void)
{{
    static const char *const names[{N}_ESTIMATES + 1] = {{{listed}}};
    {real} largest[{N}_ESTIMATES + 1] = {{0}};
    {n}_controller controller;
    {real} broken[4 + {N}_ENCODERS] = {{0}}, estimate[{N}_ESTIMATES], u;
    int tick, i, wrong = 0;

    {n}_start(&controller);
    for (tick = 0; tick < {N}_TICKS; ++tick) {{
        /* On a board: read the sensors here, and give u to the gimbals. */
        {real} difference;
        if ({n}_update(&controller, {n}_inputs[tick], {n}_inputs[tick] + 4, estimate, &u) != {N}_OK) {{
            printf("update %d: a number is not finite\\n", tick);
            return 1; /* On a board: u is 0 until {n}_start is called. */
        }}

        for (i = 0; i <= {N}_ESTIMATES; ++i) {{
            difference = (i < {N}_ESTIMATES ? estimate[i] : u) - {n}_expected[tick][i];
            if (difference < 0) difference = -difference;
            if (!(difference <= largest[i])) largest[i] = difference; /* what is NaN as well */
        }}
    }}
    broken[0] = {literal(math.inf, precision)}; /* a sensor that is broken */
    if ({n}_update(&controller, broken, broken + 4, estimate, &u) != {N}_INPUT_NOT_FINITE || u < 0 || u > 0) {{
        puts("u is NOT held at 0 after a reading that is not finite");
        wrong = 1;
    }}
    for (i = 0; i <= {N}_ESTIMATES; ++i) {{
        printf("%s: off by at most %g, allowed %g\\n", names[i], (double)largest[i], (double){n}_allowed[i]);
        if (!(largest[i] <= {n}_allowed[i])) wrong = 1;
    }}
    puts(wrong ? "NOT as in cmg_mj" : "as in cmg_mj");
    return wrong;
}}
"""


def _row(numbers: Sequence[float], precision: Precision) -> str:
    return f"{{{', '.join(literal(x, precision) for x in numbers)}}}"


def _rows(table: Table, precision: Precision) -> str:
    return "".join(f"    {_row(row, precision)},\n" for row in table)

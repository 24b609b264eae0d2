"""Prints the code of an export: NAME.h and NAME.c."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from cmg_mj.core.axis import AxisControl
from cmg_mj.features.export.c_code import Precision, body, literal
from cmg_mj.features.export.constants import Constant, Constants, class_path, format_header_comment
from cmg_mj.features.export.formula import Formula
from cmg_mj.features.export.names import estimate_places
from cmg_mj.features.export.trace import MEASURED, Traced, TracedLaw

TYPES = {"double": "double", "single": "float"}

REQUIRED_FORMATS = {
    "double": (
        "DBL_MANT_DIG != 53 || DBL_MAX_EXP != 1024",
        "double has fewer than 53 bits for this compiler, or is not IEEE 754's: export with --precision single",
    ),
    "single": ("FLT_MANT_DIG != 24 || FLT_MAX_EXP != 128", "float is not IEEE 754's for this compiler"),
}
"""Precision -> the preprocessor's condition under which a type is not of this precision, and its complaint."""

BITS = {"double": ("uint64_t", "UINT64_C(0x7ff0000000000000)"), "single": ("uint32_t", "UINT32_C(0x7f800000)")}
"""Precision -> an integer as wide as a number, and the bits of the number's exponent."""


LIMIT = """\
        else if (controller->u < -rate_limit)
            controller->u = -rate_limit;
        else if (controller->u > rate_limit)
            controller->u = rate_limit;
"""
"""Limits the command, behind the check that it is finite; (8) has done so."""


@dataclass(frozen=True)
class CodePrinter:
    """Prints the code of a controller.

    Attributes:
        controller: The controller.
        traced: The controller's formulas.
        constants: The controller's constants.
        precision: Precision of every number in C.
        name: Prefix of everything in C.
    """

    controller: AxisControl
    traced: Traced
    constants: Constants
    precision: Precision
    name: str

    @cached_property
    def places(self) -> list[str]:
        """Names in C of an estimate's parts."""
        return estimate_places(self.controller.extra_signals[0])

    @cached_property
    def law(self) -> LawPrinter:
        """The printer of the law's part."""
        law = self.traced.law
        names = _names(self.constants.of_law) if law.is_state_feedback else []
        return LawPrinter(law, self.name, class_path(self.controller.law), names)

    def header(self) -> str:
        """Print NAME.h."""
        n, N, real = self.name, self.name.upper(), f"{self.name}_real"
        members = "".join(f"    {real} {member};\n" for member in self.traced.state or ("unused",))
        places = "".join(f"    {N}_{place},\n" for place in self.places)
        count = "    long updates; /* so far, while the integrator is trimmed */\n" if self.constants.trimmed else ""
        wrong_format, complaint = REQUIRED_FORMATS[self.precision]
        law = self.traced.law
        gyro = " * gyro: what it shows, offset included [rad/s]\n" if len(self.traced.measured) > 3 else ""
        integrator = "integrator [rad s]" if law.has_integrator else "NaN: the law has no integrator"
        return f"""{format_header_comment(n, self.controller, self.precision)}
#ifndef {N}_H
#define {N}_H

#include <float.h>

#if {wrong_format}
#error "{n}.h: {complaint}"
#endif

typedef {TYPES[self.precision]} {real};

#define {N}_ENCODERS {self.constants.gimbals} /* one a gimbal */

/* Places in an estimate: tilt, tilt rate, gimbal angle, and what else the observer estimates. */
enum {{
{places}    {N}_ESTIMATES
}};

/* What an update returns. */
typedef enum {{
    {N}_OK = 0,
    {N}_INPUT_NOT_FINITE = 1, /* a reading was NaN or infinite: u is 0 until start */
    {N}_RESULT_NOT_FINITE = 2 /* state, estimate or command became so: u is 0 until start */
}} {n}_status;

/* The observer's state. */
typedef struct {{
{members}}} {n}_state;

{self.law.state_type}/* The whole controller's state. */
typedef struct {{
    {n}_state observer;
{f"    {n}_law_state law;" + chr(10) if law.state else ""}    {real} x_e; /* {integrator} */
    {real} u; /* last command [rad/s] */
    int started;
    {n}_status status; /* of the last update */
{count}}} {n}_controller;

#ifdef __cplusplus
extern "C" {{
#endif

/* The whole controller: start once, then update every {self.controller.law.dt:g} s.
 * accelerations: specific force as the two accelerometers show it, inner x, inner z, outer x, outer z [m/s^2];
 *     x along the tilt's motion, z outward
 * encoders: the gimbals' angles [rad]
{gyro} * estimate: what the observer makes of it
 * u: gimbal rate to hold until the next update, each gimbal with its direction's sign [rad/s]
 * update returns {N}_OK; or, once a number was not finite, in or out, and until start is called again, which:
 *     then u and the estimate are 0 */
{self._declaration("start")};
{self._declaration("update")};

/* The observer alone: its state at the first sample, and a sample further.
 * y1: tilt [rad]
 * y2: gimbal angle [rad]
 * acceleration: of the tilt [rad/s^2]
{gyro} * u: gimbal rate held since the sample before [rad/s] */
{self._declaration("init")};
{self._declaration("step")};

#ifdef __cplusplus
}}
#endif

#endif
"""

    def source(self) -> str:
        """Print NAME.c."""
        n, N, real, traced = self.name, self.name.upper(), f"{self.name}_real", self.traced
        constants, measured = self.constants, traced.measured
        raw = [f"accelerations[{i}]" for i in range(4)] + [f"encoders[{i}]" for i in range(constants.gimbals)]
        taken, gyro = [*raw, *measured[3:]], "".join(f", {name}" for name in measured[3:])
        state = [f"state->{member}" for member in traced.state]
        estimate = [f"estimate[{i}]" for i in range(len(self.places))]
        results = [
            f"controller->{x}"
            for x in (*(f"observer.{member}" for member in traced.state), *self.law.memory("law.", "x_e"), "u")
        ] + estimate
        x1, x3 = ("y1", "y2") if self.controller.angle_source == "measured" else (estimate[0], estimate[2])
        here = {name: name for name in (*MEASURED, "estimate")}
        here |= {"x1": x1, "x2": estimate[1], "x3": x3, "held": "controller->u"}
        law_state = ("&controller->law", "&controller->x_e")
        law_call = self.law.step_call(here, *law_state, "&controller->u")
        init_call = self.law.init_call(here, *law_state)
        start = ["0", "y2", *["0"] * (len(estimate) - 3)]
        first = "".join(f"            {place} = {x};\n" for place, x in zip(estimate, ["y1", *start], strict=True))
        trim = f"""        if (controller->updates < {constants.trimmed}) {{ /* while the bias is still being found */
            controller->x_e = trim_gain * {estimate[constants.trim_part]};
            ++controller->updates;
        }}
"""
        bits, exponent = BITS[self.precision]
        return f"""#include "{n}.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

{self._numbers()}
/* Whether a number is finite, by the bits of its exponent: -ffast-math drops what looks at the number itself. */
static int is_finite({real} x)
{{
    {bits} bits;
    memcpy(&bits, &x, sizeof bits);
    return (~bits & {exponent}) != 0;
}}

/* Tilt, gimbal angle and the tilt's acceleration from what the sensors show. */
{self._declaration("measure")}
{{
{self._body(traced.measure, raw + _names(constants.of_measure), [f"*{name}" for name in MEASURED])}}}

{self.law.functions(self._body)}
{self._declaration("init")}
{{
    (void)state, {self._void(measured)};
{self._body(traced.init, measured, state)}}}

{self._declaration("step")}
{{
    (void)state, {self._void(measured)}, (void)u;
{self._body(traced.step, [*state, *measured, "u"], [*state, *estimate])}}}

{self._declaration("start")}
{{
    controller->x_e = {"0" if traced.law.has_integrator else "NAN"};
    controller->u = 0;
    controller->started = 0;
    controller->status = {N}_OK;
{"    controller->updates = 0;" + chr(10) if constants.trimmed else ""}}}

{self._declaration("update")}
{{
    {real} y1, y2, acceleration;
    int i;

    if (controller->status == {N}_OK) {{
        if (!({_are_finite(taken)}))
            controller->status = {N}_INPUT_NOT_FINITE;
    }}
    if (controller->status == {N}_OK) {{
        measure(accelerations, encoders, &y1, &y2, &acceleration);
        if (controller->started) {{
            {n}_step(&controller->observer, y1, y2, acceleration{gyro}, controller->u, estimate);
        }} else {{
            {n}_init(&controller->observer, y1, y2, acceleration{gyro});
{f"            {init_call}" + chr(10) if init_call else ""}{first}            controller->started = 1;
        }}
{trim if constants.trimmed else ""}        {law_call}
        if (!({_are_finite(results)}))
            controller->status = {N}_RESULT_NOT_FINITE;
{"" if traced.law.is_state_feedback else LIMIT}    }}
    if (controller->status != {N}_OK) {{
        for (i = 0; i < {N}_ESTIMATES; ++i) estimate[i] = 0;
        controller->u = 0;
    }}
    *u = controller->u;
    return controller->status;
}}
"""

    def _declaration(self, function: str) -> str:
        """Print a function's name and parameters, on as many lines as they need."""
        n, N, real = self.name, self.name.upper(), f"{self.name}_real"
        controller, state, estimate = (
            f"{n}_controller *controller",
            f"{n}_state *state",
            f"{real} estimate[{N}_ESTIMATES]",
        )
        raw = (f"const {real} accelerations[4]", f"const {real} encoders[{N}_ENCODERS]")
        y = tuple(f"{real} {name}" for name in self.traced.measured)
        head, parameters = {
            "start": (f"void {n}_start", (controller,)),
            "update": (f"{n}_status {n}_update", (controller, *raw, *y[3:], estimate, f"{real} *u")),
            "init": (f"void {n}_init", (state, *y)),
            "step": (f"void {n}_step", (state, *y, f"{real} u", estimate)),
            "measure": ("static void measure", (*raw, *(f"{real} *{name}" for name in MEASURED))),
        }[function]
        return function_head(head, parameters)

    @staticmethod
    def _void(names: Sequence[str]) -> str:
        """Print what tells a compiler that parameters may be unused."""
        return ", ".join(f"(void){name}" for name in names)

    def _numbers(self) -> str:
        """Print the constants with their meanings."""
        constants = self.constants
        shown = [*constants.of_measure, *constants.of_law, *([constants.trim_gain] if constants.trimmed else [])]
        lines = [(f"{c.name} = {literal(c.value, self.precision)};", c.meaning) for c in shown]
        width = max(len(text) for text, _ in lines)
        return "".join(f"static const {self.name}_real {text:<{width}} /* {words} */\n" for text, words in lines)

    def _body(self, formula: Formula, inputs: Sequence[str], outputs: Sequence[str]) -> str:
        lines = body(formula, inputs, outputs, f"{self.name}_real", self.precision)
        return "".join(f"    {line}\n" for line in lines)


def _names(constants: Sequence[Constant]) -> list[str]:
    return [constant.name for constant in constants]


def _are_finite(places: Sequence[str]) -> str:
    """Print the condition that all these numbers are finite."""
    return " &&\n              ".join(f"is_finite({place})" for place in places)


Table = Sequence[Sequence[float]]


def format_test_vector(
    name: str, precision: Precision, inputs: Table, expected: Table, allowed: Sequence[float], gyro: bool
) -> str:
    """Format NAME_test_vector.h.

    Args:
        name: Name of the export.
        precision: Precision of its numbers.
        inputs: Raw accelerations, encoders and, if it is read, the gyro, a row for each update.
        expected: The estimate and u by Python, a row for each update.
        allowed: The allowed difference of each column of `expected`.
        gyro: Whether the gyro is read.

    Returns:
        The text.
    """
    n, N, real = name, name.upper(), f"{name}_real"
    more, unit = (" + 1", "; gyro [rad/s]") if gyro else ("", "")
    return f"""/* What {n}.c was compared on when it was written. */
#ifndef {N}_TEST_VECTOR_H
#define {N}_TEST_VECTOR_H

#include "{n}.h"

#define {N}_TICKS {len(inputs)}

/* A row an update: raw accelerations, inner x, inner z, outer x, outer z [m/s^2]; encoders [rad]{unit}. */
static const {real} {n}_inputs[{N}_TICKS][4 + {N}_ENCODERS{more}] = {{
{_rows(inputs, precision)}}};

/* What cmg_mj makes of them: the estimate, then u [rad/s]. */
static const {real} {n}_expected[{N}_TICKS][{N}_ESTIMATES + 1] = {{
{_rows(expected, precision)}}};

/* How far each of these may be off: rounding, and what the observer makes of it. */
static const {real} {n}_allowed[{N}_ESTIMATES + 1] = {_row(allowed, precision)};

#endif
"""


def format_example(name: str, precision: Precision, parts: Sequence[str], gyro: bool) -> str:
    """Format NAME_example.c.

    Args:
        name: Name of the export.
        precision: Precision of its numbers.
        parts: Names of the compared columns: the parts of an estimate, and u.
        gyro: Whether the gyro is read.

    Returns:
        The text.
    """
    n, N, real = name, name.upper(), f"{name}_real"
    reading, none = (f", {n}_inputs[tick][4 + {N}_ENCODERS]", ", 0") if gyro else ("", "")
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
        if ({n}_update(&controller, {n}_inputs[tick], {n}_inputs[tick] + 4{reading}, estimate, &u) != {N}_OK) {{
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
    if ({n}_update(&controller, broken, broken + 4{none}, estimate, &u) != {N}_INPUT_NOT_FINITE || u < 0 || u > 0) {{
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


MAX_WIDTH = 110
"""Longest line [characters]."""

PrintBody = Callable[[Formula, Sequence[str], Sequence[str]], str]
"""(formula, places of its inputs, places of its outputs) -> its body in C."""


def function_head(head: str, parameters: Sequence[str]) -> str:
    """Print a function's name and parameters, on as many lines as they need."""
    text = f"{head}({', '.join(parameters)})"
    return text if len(text) <= MAX_WIDTH else f"{head}(\n    {(',' + chr(10) + '    ').join(parameters)})"


class LawPrinter(NamedTuple):
    """Prints a law's part of an export.

    Attributes:
        law: The law's formulas.
        name: Prefix of everything in C.
        described: The law, for a comment.
        constants: Names of the law's constants.
    """

    law: TracedLaw
    name: str
    described: str
    constants: Sequence[str]

    @property
    def state_type(self) -> str:
        """The type of its state, with the comment above it; nothing without a state beside the integrator."""
        if not self.law.state:
            return ""
        members = "".join(f"    {self.name}_real {member};\n" for member in self.law.state)
        beside = ", without its integrator" if self.law.has_integrator else ""
        return f"/* The law's state{beside}. */\ntypedef struct {{\n{members}}} {self.name}_law_state;\n\n"

    def functions(self, print_body: PrintBody) -> str:
        """Print `law`, and `init_law` if it has one."""
        law, memory = self.law, self.memory("state->", "*x_e")
        inputs, outputs = [*law.arguments, *memory, *self.constants], ["*u", *memory]
        real, estimates = f"{self.name}_real", f"{self.name.upper()}_ESTIMATES"
        texts = {"estimate": f"const {real} estimate[{estimates}]"}
        parameters = [texts.get(name, f"{real} {name}") for name in self._parameters()]
        head = function_head("static void law", [*parameters, *self._pointers(), f"{real} *u"])
        step = f"{head}\n{{\n{print_body(law.step, inputs, outputs)}}}\n"
        if law.is_state_feedback:
            words = "u = -K_e [x1, x2, x3, x_e], limited; then a step of the integrator, unless it would wind up."
            return f"/* {words} */\n{step}"
        step = f"/* {self.described}: u, not yet limited, and the next state. */\n{step}"
        if law.init is None or not memory:
            return step
        init = function_head("static void init_law", [*(f"{real} {name}" for name in law.measured), *self._pointers()])
        start = f"{init}\n{{\n{print_body(law.init, MEASURED, memory)}}}\n"
        return f"/* {self.described}: the state before the first decision. */\n{start}\n{step}"

    def init_call(self, measured: Mapping[str, str], state: str, x_e: str) -> str:
        """Print the call of `init_law`; nothing if it has none.

        Args:
            measured: Name of a measurement -> where it is.
            state: Address of the state.
            x_e: Address of the integrator.
        """
        if self.law.init is None or not self.law.numbers:
            return ""
        return f"init_law({', '.join([*(measured[name] for name in self.law.measured), *self._passed(state, x_e)])});"

    def step_call(self, values: Mapping[str, str], state: str, x_e: str, u: str) -> str:
        """Print the call of `law`.

        Args:
            values: Name of a parameter -> where it is.
            state: Address of the state.
            x_e: Address of the integrator.
            u: Address of the command.
        """
        return f"law({', '.join([*(values[name] for name in self._parameters()), *self._passed(state, x_e), u])});"

    def _parameters(self) -> list[str]:
        """Name the parameters of `law` before its pointers; extra signals come as the whole estimate."""
        return list(dict.fromkeys(name.partition("[")[0] for name in self.law.arguments))

    def memory(self, member: str, x_e: str) -> list[str]:
        """Place the numbers of the state, the integrator last."""
        return [*(f"{member}{name}" for name in self.law.state), *([x_e] if self.law.has_integrator else [])]

    def _pointers(self) -> list[str]:
        return self._passed(f"{self.name}_law_state *state", f"{self.name}_real *x_e")

    def _passed(self, state: str, x_e: str) -> list[str]:
        """Select those of the two that the law has."""
        return [*([state] if self.law.state else []), *([x_e] if self.law.has_integrator else [])]

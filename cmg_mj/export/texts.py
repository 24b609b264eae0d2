"""The files of an export."""

from __future__ import annotations

import inspect
import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version

import casadi

from cmg_mj.controller import Controller
from cmg_mj.export.c_code import Precision, body, literal
from cmg_mj.export.constants import Constants
from cmg_mj.export.names import WIDTH, name_of, places_of, settings_of
from cmg_mj.export.trace import MEASURED, Traced
from cmg_mj.observers.registry import GIVEN

TYPES = {"double": "double", "single": "float"}


@dataclass(frozen=True)
class Texts:
    """The texts of one controller's export.

    Attributes:
        controller: The controller.
        traced: Its formulas.
        constants: Its numbers.
        precision: Of every number in C.
    """

    controller: Controller
    traced: Traced
    constants: Constants
    precision: Precision

    @cached_property
    def name(self) -> str:
        """What everything in C begins with."""
        return name_of(self.controller.observer)

    @cached_property
    def places(self) -> list[str]:
        """Of an estimate's parts."""
        return places_of(self.controller.extra_signals[0])

    def header(self) -> str:
        """NAME.h."""
        n, N, real = self.name, self.name.upper(), f"{self.name}_real"
        members = "".join(f"    {real} {member};\n" for member in self.traced.state or ("unused",))
        places = "".join(f"    {N}_{place},\n" for place in self.places)
        count = "    long updates; /* so far, while the integrator is trimmed */\n" if self.constants.trimmed else ""
        return f"""{self._about()}
#ifndef {N}_H
#define {N}_H

typedef {TYPES[self.precision]} {real};

#define {N}_ENCODERS {self.constants.gimbals} /* one a gimbal */

/* Places in an estimate: tilt, tilt rate, gimbal angle, and what else the observer estimates. */
enum {{
{places}    {N}_ESTIMATES
}};

/* The observer's state. */
typedef struct {{
{members}}} {n}_state;

/* The whole controller's state. */
typedef struct {{
    {n}_state observer;
    {real} x_e; /* integrator [rad s] */
    {real} u; /* last command [rad/s] */
    int started;
{count}}} {n}_controller;

#ifdef __cplusplus
extern "C" {{
#endif

/* The whole controller: start once, then update every {self.controller.law.dt:g} s.
 * accelerations: specific force as the two accelerometers show it, inner x, inner z, outer x, outer z [m/s^2];
 *     x along the tilt's motion, z outward
 * encoders: the gimbals' angles [rad]
 * estimate: what the observer makes of it
 * u: gimbal rate to hold until the next update, each gimbal with its direction's sign [rad/s] */
void {n}_start({n}_controller *controller);
void {n}_update({n}_controller *controller, const {real} accelerations[4], const {real} encoders[{N}_ENCODERS],
                {" " * len(n)}{real} estimate[{N}_ESTIMATES], {real} *u);

/* The observer alone: its state at the first sample, and a sample further.
 * y1: tilt [rad]
 * y2: gimbal angle [rad]
 * acceleration: of the tilt [rad/s^2]
 * u: gimbal rate held since the sample before [rad/s] */
void {n}_init({n}_state *state, {real} y1, {real} y2, {real} acceleration);
void {n}_step({n}_state *state, {real} y1, {real} y2, {real} acceleration, {real} u,
              {" " * len(n)}{real} estimate[{N}_ESTIMATES]);

#ifdef __cplusplus
}}
#endif

#endif
"""

    def source(self) -> str:
        """NAME.c."""
        n, N, real, traced = self.name, self.name.upper(), f"{self.name}_real", self.traced
        constants, measured = self.constants, list(MEASURED)
        raw = [f"accelerations[{i}]" for i in range(4)] + [f"encoders[{i}]" for i in range(constants.gimbals)]
        state = [f"state->{member}" for member in traced.state]
        estimate = [f"estimate[{i}]" for i in range(len(self.places))]
        x1, x3 = ("y1", "y2") if self.controller.angles == "measured" else (estimate[0], estimate[2])
        start = ["0", "y2", *["0"] * (len(estimate) - 3)]
        first = "".join(f"        {place} = {x};\n" for place, x in zip(estimate, ["y1", *start], strict=True))
        trim = f"""    if (controller->updates < {constants.trimmed}) {{ /* while the bias is still being found */
        controller->x_e = trim_gain * {estimate[constants.trim_part]};
        ++controller->updates;
    }}
"""
        return f"""#include "{n}.h"

#include <math.h>

{self._numbers()}
/* Tilt, gimbal angle and the tilt's acceleration from what the sensors show. */
static void measure(const {real} accelerations[4], const {real} encoders[{N}_ENCODERS], {real} *y1, {real} *y2,
                    {real} *acceleration)
{{
{self._body(traced.measure, raw + _names(constants.of_measure), [f"*{name}" for name in measured])}}}

/* u = -K_e [x1, x2, x3, x_e], limited; then a step of the integrator, unless it would wind up. */
static void law({real} x1, {real} x2, {real} x3, {real} *x_e, {real} *u)
{{
{self._body(traced.law, ["x1", "x2", "x3", "*x_e", *_names(constants.of_law)], ["*u", "*x_e"])}}}

void {n}_init({n}_state *state, {real} y1, {real} y2, {real} acceleration)
{{
    (void)state, (void)y1, (void)y2, (void)acceleration;
{self._body(traced.init, measured, state)}}}

void {n}_step({n}_state *state, {real} y1, {real} y2, {real} acceleration, {real} u,
              {" " * len(n)}{real} estimate[{N}_ESTIMATES])
{{
    (void)state, (void)y1, (void)y2, (void)acceleration, (void)u;
{self._body(traced.step, [*state, *measured, "u"], [*state, *estimate])}}}

void {n}_start({n}_controller *controller)
{{
    controller->x_e = 0;
    controller->u = 0;
    controller->started = 0;
{"    controller->updates = 0;" + chr(10) if constants.trimmed else ""}}}

void {n}_update({n}_controller *controller, const {real} accelerations[4], const {real} encoders[{N}_ENCODERS],
                {" " * len(n)}{real} estimate[{N}_ESTIMATES], {real} *u)
{{
    {real} y1, y2, acceleration;
    measure(accelerations, encoders, &y1, &y2, &acceleration);
    if (controller->started) {{
        {n}_step(&controller->observer, y1, y2, acceleration, controller->u, estimate);
    }} else {{
        {n}_init(&controller->observer, y1, y2, acceleration);
{first}        controller->started = 1;
    }}
{trim if constants.trimmed else ""}    law({x1}, {estimate[1]}, {x3}, &controller->x_e, &controller->u);
    *u = controller->u;
}}
"""

    def vector(
        self, inputs: Sequence[Sequence[float]], expected: Sequence[Sequence[float]], allowed: Sequence[float]
    ) -> str:
        """NAME_test_vector.h.

        Args:
            inputs: Raw accelerations and encoders, a row an update.
            expected: What Python makes of them: the estimate and u.
            allowed: How far each of these may be off.
        """
        n, N, real = self.name, self.name.upper(), f"{self.name}_real"
        return f"""/* What {n}.c was compared on when it was written. */
#ifndef {N}_TEST_VECTOR_H
#define {N}_TEST_VECTOR_H

#include "{n}.h"

#define {N}_TICKS {len(inputs)}

/* A row an update: raw accelerations, inner x, inner z, outer x, outer z [m/s^2]; encoders [rad]. */
static const {real} {n}_inputs[{N}_TICKS][4 + {N}_ENCODERS] = {{
{self._rows(inputs)}}};

/* What cmg_mj makes of them: the estimate, then u [rad/s]. */
static const {real} {n}_expected[{N}_TICKS][{N}_ESTIMATES + 1] = {{
{self._rows(expected)}}};

/* How far each of these may be off: rounding, as far as the observer hangs on it. */
static const {real} {n}_allowed[{N}_ESTIMATES + 1] = {self._rows([allowed]).strip().rstrip(",")};

#endif
"""

    def example(self) -> str:
        """NAME_example.c."""
        n, N, real = self.name, self.name.upper(), f"{self.name}_real"
        names = ", ".join(f'"{name}"' for name in ("x1_rad", "x2_rad_s", "x3_rad", *self.controller.extra_signals[0]))
        return f"""/* How {n}.c is used, and whether it does here what it does in cmg_mj:
 *
 *     cc -std=c99 -O2 {n}.c {n}_example.c -lm -o {n}_example && ./{n}_example */
#include "{n}_test_vector.h"

#include <stdio.h>

int main(void)
{{
    static const char *const names[{N}_ESTIMATES + 1] = {{{names}, "u_rad_s"}};
    {real} largest[{N}_ESTIMATES + 1] = {{0}};
    {n}_controller controller;
    int tick, i, wrong = 0;

    {n}_start(&controller);
    for (tick = 0; tick < {N}_TICKS; ++tick) {{
        /* On a board: read the sensors here, and give u to the gimbals. */
        {real} estimate[{N}_ESTIMATES], u, difference;
        {n}_update(&controller, {n}_inputs[tick], {n}_inputs[tick] + 4, estimate, &u);

        for (i = 0; i <= {N}_ESTIMATES; ++i) {{
            difference = (i < {N}_ESTIMATES ? estimate[i] : u) - {n}_expected[tick][i];
            if (difference < 0) difference = -difference;
            if (!(difference <= largest[i])) largest[i] = difference; /* what is NaN as well */
        }}
    }}
    for (i = 0; i <= {N}_ESTIMATES; ++i) {{
        printf("%s: off by at most %g, allowed %g\\n", names[i], (double)largest[i], (double){n}_allowed[i]);
        if (!(largest[i] <= {n}_allowed[i])) wrong = 1;
    }}
    puts(wrong ? "NOT as in cmg_mj" : "as in cmg_mj");
    return wrong;
}}
"""

    def _about(self) -> str:
        """A comment: what this is and what it was made with."""
        controller, given = self.controller, self.controller.observer
        cls = type(given)
        first = (inspect.getdoc(cls) or "").split("\n\n")[0]
        model = getattr(given, "model", None)
        own = [name for name in inspect.signature(cls).parameters if name not in GIVEN]
        lines = [
            f"{self.name}: observer and control law, {self.precision} precision; by cmg_mj {version('cmg_mj')}.",
            "",
            f"{cls.__module__}:{cls.__qualname__}",
            *textwrap.wrap(first, WIDTH),
            "",
            f"Made for a period of {controller.law.dt:g} s with these parameters of the observer:",
            *(f"    {line}" for line in (settings_of(given, own) if own else ["none"])),
        ]
        if model is not None:
            lines += ["and this reduced model of the rig:", *(f"    {line}" for line in settings_of(model))]
        lines += ["What belongs to the law and the sensors stands at the top of the .c file."]
        # What would end a comment, open another or continue a line, in a user's words.
        safe = [
            re.sub(r"\\$", "", line.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?")) for line in lines
        ]
        return "/* " + "\n".join(f" * {line}".rstrip() for line in safe)[3:] + "\n */"

    def _numbers(self) -> str:
        """The constants, with what they are."""
        lines = [(f"{c.name} = {literal(c.value, self.precision)};", c.meaning) for c in self.constants.all]
        width = max(len(text) for text, _ in lines)
        return "".join(f"static const {self.name}_real {text:<{width}} /* {words} */\n" for text, words in lines)

    def _body(self, function: casadi.Function, inputs: Sequence[str], outputs: Sequence[str]) -> str:
        lines = body(function, inputs, outputs, f"{self.name}_real", self.precision)
        return "".join(f"    {line}\n" for line in lines)

    def _rows(self, table: Sequence[Sequence[float]]) -> str:
        return "".join(f"    {{{', '.join(literal(x, self.precision) for x in row)}}},\n" for row in table)


def _names(constants: Sequence) -> list[str]:
    return [constant.name for constant in constants]

"""The files of an export."""

from __future__ import annotations

from collections.abc import Sequence

from cmg_mj.controller import Controller
from cmg_mj.export.c_code import Precision, body, literal
from cmg_mj.export.constants import Constants
from cmg_mj.export.trace import Traced


class Texts:
    """The texts of one export."""

    def __init__(self, name: str, controller: Controller, traced: Traced, constants: Constants, precision: Precision):
        self.name, self.NAME = name, name.upper()
        self.controller, self.traced, self.constants, self.precision = controller, traced, constants, precision
        self.real = f"{name}_real"
        self.parts = ["x1_rad", "x2_rad_s", "x3_rad", *controller.extra_signals[0]]

    def header(self) -> str:
        """NAME.h."""
        n, N, real = self.name, self.NAME, self.real
        members = "".join(f"    {real} {leaf};\n" for leaf in self.traced.state) or f"    {real} unused;\n"
        places = "".join(f"    {N}_{part.upper()},\n" for part in self.parts)
        return f"""#ifndef {N}_H
#define {N}_H

typedef {"double" if self.precision == "double" else "float"} {real};

#define {N}_ENCODERS {self.constants.encoders}

/* Places in an estimate. */
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
}} {n}_controller;

/* The observer alone: its state at the first sample, and one sample period further. */
void {n}_init({n}_state *state, {real} y1, {real} y2, {real} acceleration);
void {n}_step({n}_state *state, {real} y1, {real} y2, {real} acceleration, {real} u,
    {real} estimate[{N}_ESTIMATES]);

/* The whole controller: call start once, then update once a period. */
void {n}_start({n}_controller *controller);
void {n}_update({n}_controller *controller, const {real} accelerations[4],
    const {real} encoders[{N}_ENCODERS], {real} estimate[{N}_ESTIMATES], {real} *u);

#endif
"""

    def source(self) -> str:
        """NAME.c."""
        n, N, real, t = self.name, self.NAME, self.real, self.traced
        y = ["y1", "y2", "acceleration"][: t.init.n_in()]
        state = [f"state->{leaf}" for leaf in t.state]
        estimate = [f"estimate[{i}]" for i in range(len(self.parts))]
        raw = [f"accelerations[{i}]" for i in range(4)] + [f"encoders[{i}]" for i in range(self.constants.encoders)]
        measure = self._body(t.measure, [*raw, *self.constants.measure], [f"*{name}" for name in y])
        if len(y) < 3:
            measure += "    (void)acceleration;\n"
        init = self._body(t.init, y, state)
        step = self._body(t.step, [*state, *y, "u"], [*state, *estimate])
        law = self._body(t.law, ["x1", "x2", "x3", "*x_e", *self.constants.law], ["*u", "*x_e"])
        x1, x3 = ("y1", "y2") if self.controller.angles == "measured" else ("estimate[0]", "estimate[2]")
        zeros = "".join(f"        estimate[{i}] = 0;\n" for i in range(3, len(self.parts)))
        return f"""#include "{n}.h"

#include <math.h>

{self._constants()}
static void measure(const {real} accelerations[4], const {real} encoders[{N}_ENCODERS],
    {real} *y1, {real} *y2, {real} *acceleration)
{{
{measure}}}

static void law({real} x1, {real} x2, {real} x3, {real} *x_e, {real} *u)
{{
{law}}}

void {n}_init({n}_state *state, {real} y1, {real} y2, {real} acceleration)
{{
    (void)state, (void)y1, (void)y2, (void)acceleration;
{init}}}

void {n}_step({n}_state *state, {real} y1, {real} y2, {real} acceleration, {real} u,
    {real} estimate[{N}_ESTIMATES])
{{
    (void)state, (void)y1, (void)y2, (void)acceleration, (void)u;
{step}}}

void {n}_start({n}_controller *controller)
{{
    controller->x_e = 0;
    controller->u = 0;
    controller->started = 0;
}}

void {n}_update({n}_controller *controller, const {real} accelerations[4],
    const {real} encoders[{N}_ENCODERS], {real} estimate[{N}_ESTIMATES], {real} *u)
{{
    {real} y1, y2, acceleration = 0;
    measure(accelerations, encoders, &y1, &y2, &acceleration);
    if (controller->started) {{
        {n}_step(&controller->observer, y1, y2, acceleration, controller->u, estimate);
    }} else {{
        {n}_init(&controller->observer, y1, y2, acceleration);
        estimate[0] = y1;
        estimate[1] = 0;
        estimate[2] = y2;
{zeros}        controller->started = 1;
    }}
    law({x1}, estimate[1], {x3}, &controller->x_e, &controller->u);
    *u = controller->u;
}}
"""

    def _body(self, function, inputs: Sequence[str], outputs: Sequence[str]) -> str:
        lines = body(function, inputs, outputs, real=self.real, precision=self.precision)
        return "".join(f"    {line}\n" for line in lines)

    def _constants(self) -> str:
        return "".join(
            f"static const {self.real} {c.name} = {literal(c.value, self.precision)}; /* {c.meaning} [{c.unit}] */\n"
            for c in [*self.constants.of_measure, *self.constants.of_law]
        )

    def vector(self, inputs: Sequence[Sequence[float]], expected: Sequence[Sequence[float]]) -> str:
        """NAME_test_vector.h."""
        n, N, real = self.name, self.NAME, self.real

        def rows(table: Sequence[Sequence[float]]) -> str:
            return "".join(f"    {{{', '.join(literal(x, self.precision) for x in row)}}},\n" for row in table)

        return f"""#ifndef {N}_TEST_VECTOR_H
#define {N}_TEST_VECTOR_H

#include "{n}.h"

#define {N}_TICKS {len(inputs)}

/* Raw accelerations: inner x, inner z, outer x, outer z [m/s^2]; encoders [rad]. */
static const {real} {n}_inputs[{N}_TICKS][4 + {N}_ENCODERS] = {{
{rows(inputs)}}};

/* What cmg_mj makes of them: the estimate, then u [rad/s]. */
static const {real} {n}_expected[{N}_TICKS][{N}_ESTIMATES + 1] = {{
{rows(expected)}}};

#endif
"""

    def example(self) -> str:
        """NAME_example.c."""
        n, N, real = self.name, self.NAME, self.real
        return f"""/* How {n}.c is used, and whether it does here what it does in cmg_mj. */
#include "{n}_test_vector.h"

#include <stdio.h>

int main(void)
{{
    {n}_controller controller;
    {real} largest[{N}_ESTIMATES + 1] = {{0}};
    int tick, i, wrong = 0;
    {n}_start(&controller);
    for (tick = 0; tick < {N}_TICKS; ++tick) {{
        {real} result[{N}_ESTIMATES + 1];
        {n}_update(&controller, {n}_inputs[tick], {n}_inputs[tick] + 4, result, &result[{N}_ESTIMATES]);
        for (i = 0; i <= {N}_ESTIMATES; ++i) {{
            const {real} difference = result[i] - {n}_expected[tick][i];
            const {real} size = difference < 0 ? -difference : difference;
            if (!(size <= largest[i])) largest[i] = size;
        }}
    }}
    for (i = 0; i <= {N}_ESTIMATES; ++i) {{
        printf("%d %g\\n", i, (double)largest[i]);
        if (!(largest[i] <= {literal(1e-9 if self.precision == "double" else 1e-3, self.precision)})) wrong = 1;
    }}
    return wrong;
}}
"""

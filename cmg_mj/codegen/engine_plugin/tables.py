"""Prints a plugin's own C: rig.c with its numbers, and a file a controller that joins the exported code to it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from cmg_mj.codegen.engine_plugin.files import c_text
from cmg_mj.codegen.engine_plugin.rig import PluginAxis, PluginRig
from cmg_mj.codegen.engine_plugin.sensor_numbers import (
    Delivery,
    Encoders,
    FogNumbers,
    Pair,
    Settings,
    TurnGyro,
    describe_encoders,
    describe_fog,
    describe_pair,
    describe_settings,
    describe_turn_gyro,
)
from cmg_mj.stages.backlash import Backlash
from cmg_mj.stages.trim import trim_of

if TYPE_CHECKING:
    from cmg_mj.codegen.export.law_code import LawPrinter

Number = int | float
Struct = Delivery | Pair | Encoders | FogNumbers | TurnGyro | Settings
Value = Number | str | Sequence[Number]

FEEDBACK = {"observer": "FEEDBACK_OBSERVER", "fog": "FEEDBACK_FOG", "truth": "FEEDBACK_TRUTH"}


def format_controller(name: str, axis: PluginAxis, observer_numbers: int, law: LawPrinter) -> str:
    """Print NAME_controller.c, which joins an exported controller to the plugin.

    Args:
        name: Name of the export.
        axis: The axis with the controller.
        observer_numbers: Numbers in the exported observer's state.
        law: The printer of its law.

    Returns:
        The text.
    """
    controller = axis.controller
    n, trim, formulas = name, trim_of(controller), law.law
    gap = sum(stage.gap for stage in controller.servo_stages if isinstance(stage, Backlash))
    whose = f", axis '{_comment(axis.prefix.removesuffix('/'))}'," if axis.prefix else ""
    trimmed = -(-trim.until // controller.period)
    fields = {
        "estimates": 3 + len(controller.extra_signals[0]),
        "observer": max(1, observer_numbers),
        "law": max(1, formulas.numbers),
        "integrator": formulas.numbers - 1 if formulas.has_integrator else -1,
        "trimmed": trimmed,
        "trim_part": trim.part if trimmed else 0,
        "trim_gain": trim.gain if trimmed else 0.0,
        "angles_are_estimated": int(controller.angle_source == "estimated"),
        "rate_limit": controller.law.rate_limit,
        "has_backlash": int(gap > 0.0),
        "half_gap": gap / 2.0,
        "period": controller.law.dt,
    }
    numbers = "".join(f"    .{field} = {_value(value)},\n" for field, value in fields.items())
    numbers += f"    .feedback = {FEEDBACK[controller.feedback]},\n"
    return f"""/* {n}{whose} as the plugin calls it. The exported code is included: its functions are static. */
#include "{n}.c"

#include "controller.h"

#include <string.h>

static void controller_measure(const double *forces, const double *encoders, double y[3])
{{
    measure(forces, encoders, &y[0], &y[1], &y[2]);
}}

static void observer_init(double *memory, const double y[3])
{{
    {n}_state state = {{0}};
    {n}_init(&state, y[0], y[1], y[2]);
    memcpy(memory, &state, sizeof state);
}}

static void observer_step(double *memory, const double y[3], double u, double *estimate)
{{
    {n}_state state;
    memcpy(&state, memory, sizeof state);
    {n}_step(&state, y[0], y[1], y[2], u, estimate);
    memcpy(memory, &state, sizeof state);
}}

{_law_functions(law)}
extern const controller_type {n}_controller_type;
const controller_type {n}_controller_type = {{
{numbers}    .measure = controller_measure,
    .observer_init = observer_init,
    .observer_step = observer_step,
    .law_init = law_init,
    .law_step = law_step,
}};
"""


def _law_functions(law: LawPrinter) -> str:
    """Print law_init and law_step, which call the exported law."""
    formulas, memory = law.law, "memory"
    if formulas.state:
        memory = f"&memory[{len(formulas.state)}]"
    places = {name: f"y[{i}]" for i, name in enumerate(("y1", "y2", "acceleration"))}
    init = "memory[0] = 0.0 * y[0];" if formulas.is_state_feedback else law.init_call(places, "&state", memory)
    places |= {name: f"x[{i}]" for i, name in enumerate(("x1", "x2", "x3"))} | {"estimate": "x", "held": "held"}
    step = law.step_call(places, "&state", memory, "u")
    state, load, store = f"{law.name}_law_state state", "memcpy(&state, memory, sizeof state);", ""
    if formulas.state:
        store = "    memcpy(memory, &state, sizeof state);\n"
        init, step = f"{state} = {{0}};\n    {init}", f"{state};\n    {load}\n    {step}"
    return f"""static void law_init(double *memory, const double y[3])
{{
    (void)memory, (void)y;
    {init}
{store}}}

static void law_step(double *memory, const double y[3], const double *x, double held, double *u)
{{
    (void)memory, (void)y, (void)x, (void)held;
    {step}
{store}}}
"""


def format_rig(rig: PluginRig, names: Sequence[str], build: str) -> str:
    """Print rig.c.

    Args:
        rig: The rig.
        names: Name of the export of each axis' controller.
        build: Fingerprint of the code.

    Returns:
        The text.
    """
    clock, first = rig.clock, rig.axes[0].controller
    axes = "".join(_axis(rig, i, name) for i, name in enumerate(names))
    declarations = "".join(f"extern const controller_type {name}_controller_type;\n" for name in dict.fromkeys(names))
    return f"""/* The rig's numbers. */
#include "rig.h"

{declarations}
{axes}{_turning(rig)}static const axis_type *const axes[] = {{{", ".join(f"&axis_{i}" for i in range(len(names)))}}};

const rig_type rig = {{
    .plugin = {_value(rig.plugin)},
    .build = {_value(build)},
    .seed = {_value(float(first.seed))},
    .world = {_value(float(first.worlds if isinstance(first.worlds, int) else 0))},
    .instant = {_value(rig.instant)},
    .period = {clock.period // clock.steps},
    .axes = {len(rig.axes)},
    .axis = axes,
    .turning = {"&turning" if rig.turning else "0"},
}};
"""


def _turning(rig: PluginRig) -> str:
    """Print how the axes couple in a turn, if that is compensated."""
    if rig.turning is None:
        return ""
    coupling, gyro = rig.turning
    described = describe_turn_gyro(gyro, rig.axes[0].controller.law.dt)
    matrices = "".join(
        f"    .{name} = {{{', '.join(map(_value, matrix.tolist()))}}},\n" for name, matrix in coupling._asdict().items()
    )
    return f"static const turning_type turning = {{\n    .gyro = {_struct(described, 4)},\n{matrices}}};\n\n"


def _axis(rig: PluginRig, number: int, name: str) -> str:
    """Print the numbers of one axis."""
    axis, clock = rig.axes[number], rig.clock
    sensors = axis.controller.sensors
    pair, encoder = sensors.accelerometer, sensors.encoder
    modules = "".join(f"        {{{', '.join(map(_value, module))}}},\n" for module in axis.modules)
    parts: dict[str, Struct] = {
        "pair": describe_pair(pair, axis.controller.axis, clock),
        "encoder": describe_encoders(encoder, len(axis.modules), clock),
        "settings": describe_settings(pair, encoder),
    }
    if axis.controller.feedback == "fog":
        parts["fog"] = describe_fog(sensors.fog, axis.controller.axis, clock)
    structs = "".join(f"    .{field} = {_struct(value, 4)},\n" for field, value in parts.items())
    return f"""static const axis_type axis_{number} = {{
    .prefix = {_value(axis.prefix)},
    .gimbals = {len(axis.modules)},
    .modules = {{
{modules}    }},
{structs}    .raw_rate = {_value(pair.raw_rate_hz)},
    .joint = {_value(axis.joint)},
    .dofs = {len(axis.shares)},
    .shares = {_value(axis.shares)},
    .controller = &{name}_controller_type,
}};

"""


def _struct(value: Struct, indent: int) -> str:
    space = " " * indent
    fields = vars(value).items()
    lines = [
        f"{space}    .{name} = {_struct(part, indent + 4) if isinstance(part, Delivery) else _value(part)},\n"
        for name, part in fields
    ]
    return f"{{\n{''.join(lines)}{space}}}"


def _value(value: Value) -> str:
    """Print a number, a text or a row of numbers; every number as C reads it exactly."""
    if isinstance(value, str):
        return c_text(value)
    if isinstance(value, int):
        return str(int(value))
    if isinstance(value, float):
        return repr(float(value))
    return f"{{{', '.join(_value(part) for part in value)}}}"


def _comment(text: str) -> str:
    """Print a text within a comment in C, which neither ends nor begins one."""
    return " ".join(text.split()).replace("*/", "* /").replace("/*", "/ *")

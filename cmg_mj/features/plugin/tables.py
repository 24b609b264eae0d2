"""Generates a plugin's C: exported controllers, what joins them to the plugin, the rig's numbers, the common files.

Compiles it, and prints what stands beside it.
"""

from __future__ import annotations

import hashlib
import json
import platform
import shlex
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from cmg_mj.core.errors import InputError
from cmg_mj.core.noise import NoiseStream
from cmg_mj.core.types import reads_gyro
from cmg_mj.features.export import compiler as c_compiler
from cmg_mj.features.export import generate_code
from cmg_mj.features.plugin.sensors import (
    PluginAxis,
    PluginRig,
    Value,
    clock_of,
    describe_axis,
    describe_mems_gyro,
    refuse_unsupported,
)
from cmg_mj.stages.trim import trim_of

if TYPE_CHECKING:
    from cmg_mj.features.export.c_files import LawPrinter


COMMON_SOURCES = ("noise.c", "sensors.c", "gyros.c", "controller.c", "state.c", "setup.c", "plugin.c")
COMMON_HEADERS = ("ziggurat.h", "noise.h", "sensors.h", "gyros.h", "controller.h", "rig.h", "state.h", "setup.h")
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden")
TESTED_PLATFORM = ("Linux", "glibc")
FOLDER = files("cmg_mj.features.plugin")


def find_mujoco() -> Path:
    """Find the library of MuJoCo's Python package, which has the folder `include` beside it, without importing it.

    Raises:
        InputError: It is not where the wheel of this version has it.
    """
    spec, number = find_spec("mujoco"), version("mujoco")
    library = Path((spec and spec.origin) or "").with_name(f"libmujoco.so.{number}")
    if not library.is_file():
        raise InputError(f"plugin: {library} is missing: a plugin is made for the MuJoCo of the wheel {number}")
    return library


def common_files() -> dict[str, str]:
    """Read the C that all plugins have in common: name -> text."""
    return {name: (FOLDER / "c" / name).read_text(encoding="utf-8") for name in (*COMMON_HEADERS, *COMMON_SOURCES)}


def check_platform() -> None:
    """Refuse platforms on which no plugin has been tested.

    Raises:
        InputError: No plugin has been tested on this platform.
    """
    here = platform.system(), platform.libc_ver()[0]
    if here != TESTED_PLATFORM:
        raise InputError(f"plugin: made and tested on Linux with glibc, not on {' with '.join(filter(None, here))}")


def compile_plugin(folder: Path, compiler: Sequence[str], sources: Sequence[str], library: str) -> None:
    """Compile a plugin in its folder.

    Raises:
        InputError: The compiler cannot be run, or refuses.
    """
    mujoco = find_mujoco()
    link = [f"-L{mujoco.parent}", f"-l:{mujoco.name}", f"-Wl,-rpath,{mujoco.parent}", "-lm"]
    command = [*compiler, *FLAGS, "-isystem", str(mujoco.parent / "include"), *sources, "-o", library, *link]
    c_compiler.build(command, f"plugin: the C compiler {shlex.join(compiler)}", folder)


def library_name(name: str) -> str:
    """Name the library of a plugin."""
    return f"libcmg_mj_{name}.so"


def extra_files(name: str, code: Collection[str], sources: Sequence[str], prefix: str) -> dict[str, str]:
    """Print the Makefile and the examples.

    Args:
        name: The plugin's name behind `cmg_mj.`.
        code: The files of the C.
        sources: Those of them that are compiled.
        prefix: What the first axis' sensors are named with: empty, or `AXIS/`.

    Returns:
        Name -> text.
    """
    mujoco, tilt = find_mujoco(), f"balance/{prefix}tilt"
    words = {
        "NAME": name,
        "LIBRARY": library_name(name),
        "TILT_IN_C": c_text(tilt),
        "TILT_IN_PYTHON": json.dumps(tilt, ensure_ascii=False),
        "MUJOCO": shlex.quote(str(mujoco.parent)).replace("$", "$$"),
        "LIBMUJOCO": mujoco.name,
        "SOURCES": " ".join(sources),
        "INCLUDED": " ".join(file for file in code if file not in sources),
        "FLAGS": " ".join(FLAGS),
    }
    result = {}
    for file, template in (("example.c", "example.c"), ("example.py", "example.py.txt"), ("Makefile", "Makefile")):
        text = (FOLDER / "templates" / template).read_text(encoding="utf-8")
        for word, value in words.items():
            text = text.replace(f"@{word}@", value)
        result[file if file == "Makefile" else f"{name}_{file}"] = text
    return result


def c_text(text: str) -> str:
    """Print a text as C reads it; in octal whatever is no plain letter, and ?, which begins trigraphs."""
    letters = (chr(byte) if 32 <= byte < 127 and byte not in b'"\\?' else f"\\{byte:03o}" for byte in text.encode())
    return f'"{"".join(letters)}"'


NAMES_IN_USE = frozenset(
    """
    axis controller decision delivery encoder fog gyros law measure module noise observer pair plugin rig sensor sensors
    setup show spin state mems_gyro turning ziggurat
    """.split()  # noqa: SIM905
)
"""Names that would clash with the C that all plugins have in common."""


class PluginCode(NamedTuple):
    """A plugin before it is compiled.

    Attributes:
        name: The plugin's name behind `cmg_mj.`.
        files: Name -> text; of the C, then of all that stands beside it.
        sources: The files that are compiled.
        build: Fingerprint of the C, by which a model knows its library.
    """

    name: str
    files: dict[str, str]
    sources: list[str]
    build: str


def generate_plugin(rig: PluginRig, name: str) -> PluginCode:
    """Generate a plugin's C.

    Args:
        rig: The rig with its controllers.
        name: Prefix of the exported controllers in C; of several axes the axis' number follows.

    Returns:
        The code.

    Raises:
        InputError: Something in use cannot be exported, or the name is none for a plugin.
    """
    refuse_unsupported(rig)
    if name in NAMES_IN_USE:
        raise InputError(f"--name {name}: is a name in every plugin's C; take another, such as {name}_of_mine")
    files, names = common_files(), []
    for number, axis in enumerate(rig.axes):
        suffix = f"_{number}" if len(rig.axes) > 1 else ""
        own = name + suffix
        controller = replace(axis.controller, feedback="observer")  # the plugin's own C chooses the rate
        code = generate_code(controller, "double", name, suffix)
        files |= {file: code.files[file] for file in (f"{own}.h", f"{own}.c")}
        files[f"{own}_controller.c"] = format_controller(own, axis, code.figures["numbers_in_state"], code.law)
        names.append(own)
    files["rig.c"] = format_rig(rig, names, "")
    build = hashlib.sha256("".join(files.values()).encode()).hexdigest()[:16]
    files["rig.c"] = format_rig(rig, names, build)
    sources = [*COMMON_SOURCES, *(f"{own}_controller.c" for own in names), "rig.c"]
    return PluginCode(name, files | extra_files(name, files, sources, rig.axes[0].prefix), sources, build)


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
    y = "y[0], y[1], y[2], y[3]" if reads_gyro(controller.observer) else "y[0], y[1], y[2]"
    n, trim, formulas = name, trim_of(controller), law.law
    gap = controller.plant.backlash
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
        "reads_gyro": int(reads_gyro(controller.observer)),
        "rate_limit": controller.law.rate_limit,
        "has_backlash": int(gap > 0.0),
        "half_gap": gap / 2.0,
        "period": controller.law.dt,
    }
    return f"""/* {n} as the plugin calls it. The exported code is included: its functions are static. */
#include "{n}.c"

#include "controller.h"

#include <string.h>

static void controller_measure(const double *forces, const double *encoders, double y[3])
{{
    measure(forces, encoders, &y[0], &y[1], &y[2]);
}}

static void observer_init(double *memory, const double y[4])
{{
    {n}_state state = {{0}};
    {n}_init(&state, {y});
    memcpy(memory, &state, sizeof state);
}}

static void observer_step(double *memory, const double y[4], double u, double *estimate)
{{
    {n}_state state;
    memcpy(&state, memory, sizeof state);
    {n}_step(&state, {y}, u, estimate);
    memcpy(memory, &state, sizeof state);
}}

{_law_functions(law)}
extern const controller_type {n}_controller_type;
const controller_type {n}_controller_type = {{
{_fields(fields)}    .feedback = FEEDBACK_{controller.feedback.upper()},
    .measure = controller_measure,
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
    clock, first = clock_of(rig), rig.axes[0].controller
    declarations = "".join(f"extern const controller_type {name}_controller_type;\n" for name in names)
    axes = "".join(
        f"static const axis_type axis_{i} = {{\n{_fields(describe_axis(rig.axes[i], clock))}"
        f"    .controller = &{name}_controller_type,\n}};\n\n"
        for i, name in enumerate(names)
    )
    turning = ""
    if rig.turning is not None:
        coupling, gyro = rig.turning
        matrices = coupling._asdict()
        calibrated = replace(gyro, reading="calibrated")
        described = {"gyro": describe_mems_gyro(calibrated, first.law.dt, NoiseStream.TURN_GYRO), **matrices}
        turning = f"static const turning_type turning = {{\n{_fields(described)}}};\n\n"
    fields = {
        "plugin": rig.plugin,
        "build": build,
        "seed": float(rig.seed),
        "world": float(rig.world),
        "instant": clock.instant,
        "period": clock.period // clock.steps,
        "axes": len(rig.axes),
    }
    return f"""/* The rig's numbers. */
#include "rig.h"

{declarations}
{axes}{turning}static const axis_type *const axes[] = {{{", ".join(f"&axis_{i}" for i in range(len(names)))}}};

const rig_type rig = {{
{_fields(fields)}    .axis = axes,
    .turning = {"&turning" if turning else "0"},
}};
"""


def _fields(struct: Mapping[str, Value], indent: str = "    ") -> str:
    """Print the fields of a struct, a line each."""
    return "".join(f"{indent}.{name} = {_value(value, indent)},\n" for name, value in struct.items())


def _value(value: Value, indent: str = "") -> str:
    """Print a number, a text, a struct, or a row of numbers; every number as C reads it exactly."""
    if isinstance(value, str):
        return c_text(value)
    if isinstance(value, int):
        return str(int(value))
    if isinstance(value, float):
        return repr(float(value))
    if isinstance(value, Mapping):
        return f"{{\n{_fields(value, indent + '    ')}{indent}}}"
    return f"{{{', '.join(_value(part) for part in value)}}}"

"""Prints a plugin's C and what stands beside it: the recorded rig, the common files; and compiles it."""

from __future__ import annotations

import hashlib
import json
import math
import platform
import shlex
from collections.abc import Collection, Mapping, Sequence
from importlib.metadata import version
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.core.rig import RigControl
from cmg_mj.features.export import compiler as c_compiler
from cmg_mj.features.plugin.driver import check_noise
from cmg_mj.features.plugin.model import QUANTITIES
from cmg_mj.features.plugin.recording import (
    SETTINGS,
    RecordedRig,
    RecordedSensor,
    delivered_names,
    generator,
    record,
)
from cmg_mj.plant.plant import Plant

MAX_AXES = 4
MAX_GIMBALS = 8
MAX_ESTIMATES = 64
MAX_CHANNELS = 32
MAX_WIDTH = 64
"""Sizes of the C's arrays."""
HEAD = (
    *("SEED", "WORLD", "STATUS", "STEPS", "PER_INSTANT", "TIMESTEP"),
    *("IS_PENDING", "STARTS_SPINNING", "IS_SPINNING_UP", "CHECK"),
)
"""The state's first numbers, as rig.h names them."""
SHOWN = 5
"""Numbers that are shown of an axis before its estimate."""
NOISE_WORDS = 8
"""Numbers of a noise stream's generator."""

Value = int | float | str | Sequence["Value"] | Mapping[str, "Value"]
"""A value in C; a mapping is a struct, by its fields."""
Struct = dict[str, Value]


class Name(str):
    """A name in C, which is no text."""


class PluginRig(NamedTuple):
    """A rig with its controllers.

    Attributes:
        plant: The plant.
        control: The controllers of its axes, and what stands between them.
        plugin: Name under which MuJoCo knows the plugin.
        seed: Seed of its noise.
        world: The world whose noise it has.
    """

    plant: Plant
    control: RigControl
    plugin: str
    seed: int
    world: int


COMMON_SOURCES = ("noise.c", "state.c", "setup.c", "plugin.c")
COMMON_HEADERS = ("ziggurat.h", "noise.h", "rig.h", "setup.h")
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
        name: The plugin's name behind `cmg_mj.`.

    Returns:
        The code.

    Raises:
        InputError: Something in use cannot be recorded.
    """
    recorded = record(rig.control, rig.plant)
    refuse_unsupported(rig, recorded)
    files = common_files()
    files["rig.c"] = format_rig(rig, recorded, "")
    build = hashlib.sha256("".join(files.values()).encode()).hexdigest()[:16]
    files["rig.c"] = format_rig(rig, recorded, build)
    sources = [*COMMON_SOURCES, "rig.c"]
    prefix = rig.plant.axes[0].prefix
    return PluginCode(name, files | extra_files(name, files, sources, prefix), sources, build)


def refuse_unsupported(rig: PluginRig, recorded: RecordedRig) -> None:
    """Refuse what is more than the C has room for.

    Raises:
        InputError: Something is.
    """
    counts = [(len(rig.plant.axes), "axes", MAX_AXES)]
    for axis, control in zip(rig.plant.axes, rig.control.axes, strict=True):
        counts.append((len(axis.modules), "modules on an axis", MAX_GIMBALS))
        counts.append((3 + len(control.extra_signals[0]), "estimates", MAX_ESTIMATES))
    for one in recorded.all_sensors:
        counts.append((max(len(one.ideal.results), one.width), "numbers of a sensor", MAX_CHANNELS))
    counts += [(width, "numbers of a noise stream", MAX_WIDTH) for width in rig.control.draws.values()]
    for count, what, most in counts:
        if count > most:
            raise InputError(f"{count} {what}: a plugin takes at most {most}")
    check_noise(rig.seed, rig.world)


class Layout:
    """Counts places in the state, and remembers those of names."""

    def __init__(self, places: dict[str, int]) -> None:
        self._places = places
        self.next = len(HEAD)

    def block(self, count: int) -> int:
        """Return the first place of a block of so many numbers."""
        self.next += count
        return self.next - count

    def named(self, names: Sequence[str]) -> int:
        """Return the first place of numbers with names."""
        first = self.block(len(names))
        self._places |= {name: first + i for i, name in enumerate(names)}
        return first


def format_rig(rig: PluginRig, recorded: RecordedRig, build: str) -> str:
    """Print rig.c: the places of all numbers, the recorded functions, and the rig's tables.

    Args:
        rig: The rig.
        recorded: Its functions.
        build: Fingerprint of the code.

    Returns:
        The text.
    """
    axes, controls, places = rig.plant.axes, rig.control.axes, recorded.recorder.places
    steps = math.gcd(rig.control.period, *(one.sensor.steps_per_sample for one in recorded.all_sensors))
    layout = Layout(places)
    fields: Struct = {
        "plugin": rig.plugin,
        "build": build,
        "seed": float(rig.seed),
        "world": float(rig.world),
        "instant": steps * controls[0].timestep,
        "period": rig.control.period // steps,
        "settled": -(-max(axis.settled for axis in controls) // steps),
        "from": layout.block(len(recorded.inputs)),
    }
    of_axes: list[Struct] = [
        {
            "prefix": axis.prefix,
            "gimbals": len(axis.modules),
            "modules": [(one.name, one.direction, one.speed, one.gimbal_zero) for one in axis.modules],
            "rate_limit": control.law.rate_limit,
            "raw_rate": control.sensors.accelerometer.raw_rate_hz,
            "settings_at_first": recorded.settings[i],
            "servos": layout.block(len(axis.modules)),
            "motors": layout.block(len(axis.modules)),
            "shows": layout.block(len(QUANTITIES)),
            "settings": layout.named([f"setting {i} {k}" for k in range(SETTINGS)]),
        }
        for i, (axis, control) in enumerate(zip(axes, controls, strict=True))
    ]
    fields["held"] = layout.block(len(axes))
    fields["rate"] = layout.named([f"rate {i}" for i in range(len(axes))])
    fields["taken"] = layout.named(recorded.inputs)
    of_sensors = [_describe_sensor(one, steps, layout, recorded.memory[one.name]) for one in recorded.all_sensors]
    fields["shown"] = layout.next
    for i, struct in enumerate(of_axes):
        estimates = 3 + len(controls[i].extra_signals[0])
        struct["shown"] = layout.named([f"shown {i} {k}" for k in range(SHOWN + estimates)])
        struct["estimates"] = estimates
    fields["memory"] = layout.named(recorded.memory["rig"])
    streams = sorted({stream for function in recorded.functions for stream in function.streams})
    fields["noise"] = layout.next
    generators = [f"{generator(stream)} = {layout.block(NOISE_WORDS)}" for stream in streams]
    fields["size"] = layout.next
    rows = {
        "axis": ("axis_type", list(map(_value, of_axes))),
        "sensor": ("sensor_type", list(map(_value, of_sensors))),
        "input": ("input_type", [_value(_input(rig, name)) for name in recorded.inputs]),
        "stream": ("int", [str(stream) for stream in streams]),
    }
    tables = "".join(
        f"static const {kind} {name}_table[] = {{\n{''.join(f'    {one},{chr(10)}' for one in values or ['0'])}}};\n\n"
        for name, (kind, values) in rows.items()
    )
    counted = {"axes": "axis", "sensors": "sensor", "inputs": "input", "streams": "stream"}
    fields |= {count: len(rows[name][1]) for count, name in counted.items()}
    names = {name: f"{name}_table" for name in rows}
    names |= {name: getattr(recorded, name).name for name in ("first", "trimmed", "later")}
    linked = "".join(f"    .{name} = {value},\n" for name, value in names.items())
    places_of_noise = f"enum {{ {', '.join(generators)} }};\n\n" if generators else ""
    functions = "".join(map(recorded.recorder.printed, recorded.functions))
    return f"""/* The rig: its sensors and decisions, recorded as functions of the state, and its numbers. */
#include "rig.h"

#include "noise.h"

#include <math.h>

{places_of_noise}{functions}{tables}const rig_type rig = {{
{_fields(fields)}{linked}}};
"""


def _describe_sensor(one: RecordedSensor, steps: int, layout: Layout, memory: Sequence[str]) -> Struct:
    """Describe a sensor: `sensor_type` in C, its times in instants of so many physics steps."""
    sensor, channels = one.sensor, len(one.ideal.results)
    layout.named(memory)
    delivered = layout.named(delivered_names(one))
    on_the_way = layout.block(sensor.kept * one.width) if sensor.latency else delivered
    return {
        "channels": channels,
        "width": one.width,
        "period": sensor.period // steps,
        "raw": sensor.raw // steps,
        "skew": sensor.skew // steps,
        "latency": -(-sensor.latency // steps),
        "settling": sensor.settle,
        "kept": sensor.kept,
        "older_kept": sensor.older_kept,
        "delivered": delivered,
        "readings": on_the_way,
        "older": layout.block(sensor.older_kept * channels),
        "ideal": Name(one.ideal.name),
        "init": Name(one.init.name),
        "take": Name(one.take.name),
    }


def _input(rig: PluginRig, name: str) -> Struct:
    """Describe a number that MuJoCo gives: `input_type` in C."""
    model, (row, number) = rig.plant.model, name.split()
    place = int(number)
    if row == "qvel":
        joint = int(model.dof_jntid[place])
        first, kind = int(model.jnt_dofadr[joint]), int(model.jnt_type[joint])
        return {"name": model.joint(joint).name, "is_rate": 1, "kind": kind, "offset": place - first}
    sensor = int(np.searchsorted(model.sensor_adr, place, side="right")) - 1
    offset, kind = place - int(model.sensor_adr[sensor]), int(model.sensor_type[sensor])
    return {"name": model.sensor(sensor).name, "is_rate": 0, "kind": kind, "offset": offset}


def _fields(struct: Mapping[str, Value], indent: str = "    ") -> str:
    """Print the fields of a struct, a line each."""
    return "".join(f"{indent}.{name} = {_value(value, indent)},\n" for name, value in struct.items())


def _value(value: Value, indent: str = "") -> str:
    """Print a number, a text, a struct, or a row of numbers; every number as C reads it exactly."""
    if isinstance(value, Name):
        return value
    if isinstance(value, str):
        return c_text(value)
    if isinstance(value, int):
        return str(int(value))
    if isinstance(value, float):
        return repr(float(value))
    if isinstance(value, Mapping):
        return f"{{\n{_fields(value, indent + '    ')}{indent}}}"
    return f"{{{', '.join(_value(part) for part in value)}}}"

"""Prints a plugin's C and what stands beside it: the recorded rig, the common files; and compiles it."""

from __future__ import annotations

import hashlib
import json
import math
import platform
import shlex
from collections.abc import Collection, Sequence
from importlib.metadata import version
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from cmg_mj.core.axis import AxisControl
from cmg_mj.core.errors import InputError
from cmg_mj.core.rig import RigControl
from cmg_mj.core.sensor import all_draws
from cmg_mj.features.export import compiler as c_compiler
from cmg_mj.features.plugin.driver import check_noise
from cmg_mj.features.plugin.model import QUANTITIES
from cmg_mj.features.plugin.recording import (
    RecordedRig,
    RecordedSensor,
    Recorder,
    c_text,
    generator,
    record,
    settings_of,
)
from cmg_mj.plant.plant import Plant

SHOWN = 5
"""Numbers that are shown of an axis before its estimate."""
NOISE_WORDS = 8
"""Numbers of a noise stream's generator."""
BUILD = "@BUILD@"
"""Stands for the code's fingerprint until that is known."""


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
    check_noise(rig.seed, rig.world)
    recorded = record(rig.control, rig.plant)
    files = common_files()
    files["rig.c"] = format_rig(rig, recorded)
    build = hashlib.sha256("".join(files.values()).encode()).hexdigest()[:16]
    files["rig.c"] = files["rig.c"].replace(BUILD, build)
    sources = [*COMMON_SOURCES, "rig.c"]
    prefix = rig.plant.axes[0].prefix
    return PluginCode(name, files | extra_files(name, files, sources, prefix), sources, build)


def format_rig(rig: PluginRig, recorded: RecordedRig) -> str:
    """Print rig.c: the recorded functions, and the rig's tables.

    Args:
        rig: The rig.
        recorded: Its functions.

    Returns:
        The text, with `BUILD` where the code's fingerprint belongs.
    """
    controls, sensors, recorder = rig.control.axes, recorded.sensors, recorded.recorder
    steps = math.gcd(rig.control.period, *(one.sensor.steps_per_sample for one in sensors))

    def locate(name: str, count: int) -> int:
        return recorder.locate([f"{name} {i}" for i in range(count)])

    inputs = locate("input", len(recorded.inputs))
    rows, modules = [], []
    for i, (axis, control) in enumerate(zip(rig.plant.axes, controls, strict=True)):
        gimbals, settings = len(axis.modules), settings_of(control)
        numbers = control.law.rate_limit, control.sensors.accelerometer.raw_rate_hz, _struct(settings)
        counts = {"servo": gimbals, "motor": gimbals, "show": len(QUANTITIES), "setting": len(settings)}
        places = [locate(f"{name} {i}", count) for name, count in counts.items()]
        own = f"modules + {len(modules)}"
        rows.append([c_text(axis.prefix), gimbals, _estimates(control), own, *numbers, *places])
        modules += [_struct([c_text(one.name), one.direction, one.speed, one.gimbal_zero]) for one in axis.modules]
    held, rate = locate("held", len(controls)), locate("rate", len(controls))
    taken = recorder.locate(recorded.inputs)
    rows_of_sensors = [_describe_sensor(one, steps, recorder) for one in sensors]
    shown = [locate(f"shown {i}", SHOWN + _estimates(control)) for i, control in enumerate(controls)]
    memory = recorder.locate(recorded.memory)
    draws = all_draws([*(one.sensor for one in sensors), *rig.control.between])
    noise = recorder.locate([])
    generators = [f"{generator(stream)} = {locate(generator(stream), NOISE_WORDS)}" for stream in draws]
    tables = {
        "axis_type axes": [_struct([*row, place]) for row, place in zip(rows, shown, strict=True)],
        "sensor_type sensors": rows_of_sensors,
        "input_type inputs": recorded.inputs,
        "int streams": list(draws),
    }
    settled = -(-max(axis.settled for axis in controls) // steps)
    trimmed = "rig_trimmed" if "rig_trimmed" in recorder.functions else "rig_later"
    numbers = [
        *(c_text(rig.plugin), c_text(BUILD), float(rig.seed), float(rig.world), steps * controls[0].timestep),
        *(rig.control.period // steps, settled, *map(len, tables.values())),
        *(inputs, held, rate, taken, shown[0], memory, noise, recorder.locate([])),
        *("axes", "sensors", "inputs", "streams", "rig_first", trimmed, "rig_later"),
    ]
    printed = "".join(
        f"static const {name}[] = {{\n    {f',{chr(10)}    '.join(map(str, values or [0]))},\n}};\n\n"
        for name, values in {"module_type modules": modules, **tables}.items()
    )
    return f"""/* The rig: its sensors and decisions, recorded as functions of the state, and its numbers. */
#include "rig.h"

#include "noise.h"

#include <math.h>

enum {{ {", ".join(["NONE", *generators])} }};

{recorder.printed(recorded.parts)}{printed}const rig_type rig = {_struct(numbers)};
"""


def _struct(values: Sequence[object]) -> str:
    """Print a struct or a row, a float as C reads it exactly."""
    return f"{{{', '.join(map(str, values))}}}"


def _estimates(control: AxisControl) -> int:
    """Count the parts of an estimate."""
    return 3 + len(control.extra_signals[0])


def _describe_sensor(one: RecordedSensor, steps: int, recorder: Recorder) -> str:
    """Print a `sensor_type`, its times in instants of so many physics steps, and locate its numbers."""
    sensor, width = one.sensor, len(one.delivered)
    recorder.locate(one.memory)
    delivered = recorder.locate(one.delivered)
    on_the_way = [f"reading {one.name} {i}" for i in range(sensor.kept * width if sensor.latency else 0)]
    older = [f"older {one.name} {i}" for i in range(sensor.older_kept * one.channels)]
    numbers = [
        *(one.channels, width, sensor.period // steps, sensor.raw // steps, sensor.skew // steps),
        *(-(-sensor.latency // steps), sensor.settle, sensor.kept, sensor.older_kept),
        *(recorder.locate(on_the_way) if on_the_way else delivered, recorder.locate(older), delivered),
    ]
    functions = [f"{one.name}_{part}" for part in ("ideal", "init", "take")]
    return _struct([*numbers, *functions])

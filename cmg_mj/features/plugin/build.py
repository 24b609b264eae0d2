"""Compiles a plugin: the compiler, its flags, MuJoCo's headers and library; and what stands beside the C."""

from __future__ import annotations

import json
import platform
import shlex
from collections.abc import Collection, Sequence
from importlib.metadata import version
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path

from cmg_mj.core.errors import InputError
from cmg_mj.features.export.compiler import build

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
    build(command, f"plugin: the C compiler {shlex.join(compiler)}", folder)


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
        "MUJOCO": str(mujoco.parent),
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

"""Compiles a plugin: the compiler, its flags, and MuJoCo's headers and library."""

from __future__ import annotations

import platform
import shlex
import subprocess
from collections.abc import Sequence
from importlib.metadata import version
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from cmg_mj.errors import InputError

COMMON_SOURCES = ("noise.c", "sensors.c", "gyros.c", "controller.c", "state.c", "setup.c", "plugin.c")
COMMON_HEADERS = ("ziggurat.h", "noise.h", "sensors.h", "gyros.h", "controller.h", "rig.h", "state.h", "setup.h")
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden")
TESTED_PLATFORM = ("Linux", "glibc")


class MujocoFiles(NamedTuple):
    """MuJoCo as its Python package brings it."""

    include: Path
    library: Path
    version: str


def find_mujoco() -> MujocoFiles:
    """Find MuJoCo's headers and library, without importing it.

    Raises:
        InputError: They are not where the wheel of this version has them.
    """
    spec = find_spec("mujoco")
    number = version("mujoco")
    folder = Path((spec and spec.origin) or "").parent
    include, library = folder / "include", folder / f"libmujoco.so.{number}"
    for path in (include / "mujoco" / "mujoco.h", library):
        if not path.is_file():
            raise InputError(f"plugin: {path} is missing: a plugin is made for the MuJoCo of the wheel {number}")
    return MujocoFiles(include, library, number)


def common_files() -> dict[str, str]:
    """Read the C that all plugins have in common: name -> text."""
    folder = files("cmg_mj.codegen.engine_plugin") / "c"
    return {name: (folder / name).read_text(encoding="utf-8") for name in (*COMMON_HEADERS, *COMMON_SOURCES)}


def check_platform() -> None:
    """Refuse platforms on which no plugin has been tested.

    Raises:
        InputError: No plugin has been tested on this platform.
    """
    here = platform.system(), platform.libc_ver()[0]
    if here != TESTED_PLATFORM:
        raise InputError(f"plugin: made and tested on Linux with glibc, not on {' with '.join(filter(None, here))}")


def compile_command(compiler: Sequence[str], sources: Sequence[str], library: str) -> list[str]:
    """Make the command that compiles a plugin, to be run in its folder."""
    mujoco = find_mujoco()
    link = [f"-L{mujoco.library.parent}", f"-l:{mujoco.library.name}", f"-Wl,-rpath,{mujoco.library.parent}"]
    return [*compiler, *FLAGS, "-isystem", str(mujoco.include), *sources, "-o", library, *link, "-lm"]


def compile_plugin(folder: Path, compiler: Sequence[str], sources: Sequence[str], library: str) -> None:
    """Compile a plugin in its folder.

    Raises:
        InputError: The compiler cannot be run, or refuses.
    """
    command = compile_command(compiler, sources, library)
    try:
        process = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, errors="replace", timeout=300, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"plugin: the C compiler {shlex.join(compiler)} cannot be run: {reason}") from error
    if process.returncode:
        lines = process.stderr.splitlines()
        status = f"it ended with status {process.returncode} and without a message"
        first = next((line for line in lines if "error" in line), lines[0] if lines else status)
        raise InputError(f"plugin: the C does not compile with {compiler[0]}: {first}")

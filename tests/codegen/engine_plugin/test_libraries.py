"""Libraries that are not for this MuJoCo, or none: a line that names the file or the plugin, and no crash."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import mujoco
import pytest

from cmg_mj.codegen.engine_plugin import build
from tests.codegen.engine_plugin.made import Made, make, needs_compiler
from tests.codegen.export.compiled import COMPILER

pytestmark = [needs_compiler, pytest.mark.slow]

PROGRAM = """\
import sys, mujoco
mujoco.mj_loadPluginLibrary(sys.argv[1])
mujoco.MjModel.from_xml_path(sys.argv[2])
"""


def load(library: Path, made: Made, folder: Path) -> tuple[int, str]:
    """Load a library and a model in another process: its exit status and what it prints."""
    process = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(library), str(made.plugin.model)],
        capture_output=True,
        text=True,
        cwd=folder,
        timeout=100,
        check=False,
    )
    return process.returncode, (process.stdout + process.stderr).strip()


@pytest.mark.parametrize("number", ["3010005", "4000001", "5000000"])
def test_a_library_for_another_mujoco(number: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made, mujoco_files = make("gyro_free"), build.find_mujoco()
    include = shutil.copytree(mujoco_files.include, tmp_path / "include")
    header = include / "mujoco" / "mujoco.h"
    text, n = re.subn(
        r"(#define mjVERSION_HEADER) \d+", rf"\1 {number}", header.read_text(encoding="utf-8"), flags=re.MULTILINE
    )
    assert n == 1
    header.write_text(text, encoding="utf-8")
    monkeypatch.setattr(build, "find_mujoco", lambda: mujoco_files._replace(include=include))
    source = made.plugin.library.parent
    sources = [path.name for path in source.glob("*.c") if not path.name.endswith("_example.c")]
    parts = {name.replace("_controller.c", ".c") for name in sources if name.endswith("_controller.c")}
    folder = shutil.copytree(source, tmp_path / "source")
    build.compile_plugin(folder, [str(COMPILER)], sorted(set(sources) - parts), "other.so")
    status, message = load(folder / "other.so", made, tmp_path)
    assert status == 1
    assert f"{made.plugin.name}: made for MuJoCo {number}, and this is {mujoco.mj_version()}: not loaded" in message
    assert f"plugin {made.plugin.name} not found" in message


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda library: b"",
    "its header alone": lambda library: library[:64],
    "less than its header": lambda library: library[:40],
    "zeros": lambda library: bytes(len(library)),
    "another order of bytes": lambda library: library[::-1],
    "a text": lambda library: b"#!/bin/sh\n" * 100,
    "of 32 bits": lambda library: library[:4] + b"\x01" + library[5:],
    "of the other end first": lambda library: library[:5] + b"\x02" + library[6:],
    "of another processor": lambda library: library[:18] + b"\xb7\x00" + library[20:],
    "no library but a program": lambda library: library[:16] + b"\x02\x00" + library[18:],
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_library_that_is_none(damage: str, tmp_path: Path) -> None:
    made, library = make("gyro_free"), tmp_path / "damaged.so"
    library.write_bytes(DAMAGES[damage](made.plugin.library.read_bytes()))
    status, message = load(library, made, tmp_path)
    assert status == 1
    assert message.splitlines()[-1].startswith(f"mujoco.FatalError: Error loading plugin library '{library}': ")


def test_a_library_that_is_missing(tmp_path: Path) -> None:
    status, message = load(tmp_path / "none.so", make("gyro_free"), tmp_path)
    assert status == 1
    assert "none.so" in message.splitlines()[-1]


def test_the_library_as_it_was_written(tmp_path: Path) -> None:
    made = make("gyro_free")
    assert load(made.plugin.library, made, tmp_path) == (0, "")

"""docs/plugin.md's C program: compiled as it says, and without a warning; it prints what the document says."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

import cmg_mj
from cmg_mj import load_scenario, prepare
from cmg_mj.codegen.engine_plugin.build import find_mujoco
from tests.codegen.engine_plugin.made import needs_compiler
from tests.codegen.export.compiled import COMPILER
from tests.command import cmg_mj as command
from tests.command import environment

pytestmark = [needs_compiler, pytest.mark.slow]

DOCUMENT = (Path(cmg_mj.__file__).parents[1] / "docs" / "plugin.md").read_text(encoding="utf-8")
SECTION = DOCUMENT.partition("\n## In a C program\n")[2].partition("\n## ")[0]
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Werror")


def block(language: str) -> str:
    (text,) = re.findall(rf"```{language}\n(.*?)```", SECTION, re.DOTALL)
    return text


@pytest.mark.usefixtures("elsewhere")
def test_the_c_program() -> None:
    program, names = block("c"), re.findall(r"`(cmg-mj [^`]+)`", SECTION)
    assert len(program.splitlines()) <= 25
    assert command(*names[0].split()[1:]).status == 0
    Path("balance.c").write_text(program, encoding="utf-8")
    include = ["-isystem", str(find_mujoco().parent / "include")]
    subprocess.run([str(COMPILER), *WARNINGS, *include, "-c", "balance.c", "-o", "balance.o"], check=True, timeout=300)
    process = subprocess.run(
        ["bash", "-ec", block("sh")], env=environment(), capture_output=True, text=True, timeout=300, check=False
    )
    assert (process.returncode, process.stdout, process.stderr) == (0, block("text"), "")

    assert names[1] == "cmg-mj run push_recovery --observer gyro_free --set push=[]"
    trajectory = prepare(load_scenario("push_recovery", ["push=[]"], "gyro_free")).run().trajectory
    assert trajectory is not None
    assert process.stdout == f"after 15 s y1 is {trajectory['y1_rad'][-1]:.4f} rad\n"

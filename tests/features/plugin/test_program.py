"""A plugin in a C program: the runner's numbers, no error of memory, no undefined behaviour, no growth."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
import pytest

import cmg_mj
from cmg_mj import load_scenario, prepare
from cmg_mj.features.plugin.tables import find_mujoco
from tests.features.export.compiled import COMPILER
from tests.features.plugin.made import ALL_IMPERFECTIONS, Made, make, needs_compiler

pytestmark = [needs_compiler, pytest.mark.slow]

WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Wsign-conversion", "-Wshadow", "-pedantic")
STRICT = ("-std=c99", *WARNINGS, "-Werror", "-ffp-contract=off")
SANITIZERS = ("-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer")
STACK_SHIM = """\
void mj_markStack(void *d);
void mj__markStack(void *d);
void mj__markStack(void *d) { mj_markStack(d); }
void mj_freeStack(void *d);
void mj__freeStack(void *d);
void mj__freeStack(void *d) { mj_freeStack(d); }
"""
"""Under AddressSanitizer, MuJoCo's headers ask for functions that a library compiled without it does not have."""
PROGRAM = Path(__file__).with_name("program.c")
LEAKS_OF_OTHERS = "detect_leaks=0"
"""MuJoCo itself keeps its registry of plugins to the end."""


def compile_strictly(made: Made, folder: Path, *flags: str) -> tuple[Path, Path]:
    """The plugin and the program, without a warning."""
    mujoco_library = find_mujoco()
    place = mujoco_library.parent
    common = [str(COMPILER), *STRICT, *flags, "-isystem", str(place / "include")]
    link = [f"-L{place}", f"-l:{mujoco_library.name}", f"-Wl,-rpath,{place}", "-lm"]
    source = made.plugin.library.parent
    sources = [str(path) for path in source.glob("*.c") if not path.name.endswith("_example.c")]
    if flags == SANITIZERS:
        shim = folder / "stack.c"
        shim.write_text(STACK_SHIM, encoding="utf-8")
        sources.append(str(shim))
    library, program = folder / "plugin.so", folder / "program"
    subprocess.run([*common, "-fPIC", "-shared", *sources, "-o", str(library), *link], check=True, timeout=300)
    subprocess.run([*common, "-D_DEFAULT_SOURCE", str(PROGRAM), "-o", str(program), *link], check=True, timeout=300)
    return library, program


def run_program(
    model: Path, library: Path, program: Path, steps: int, cycles: int, *before: str
) -> tuple[np.ndarray, int]:
    """Return qpos after each step, and the growth [bytes]."""
    process = subprocess.run(
        [*before, str(program), str(library), str(model), str(steps), str(cycles)],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
        env={**os.environ, "ASAN_OPTIONS": LEAKS_OF_OTHERS},
    )
    assert process.returncode == 0, process.stderr
    rows = [[float.fromhex(word) for word in line.split()] for line in process.stdout.splitlines()]
    return np.array(rows), int(process.stderr.split()[-1])


def expected(made: Made, steps: int) -> np.ndarray:
    data, rows = made.start(), []
    for _ in range(steps):
        mujoco.mj_step(made.model, data)
        rows.append(data.qpos.copy())
    return np.array(rows)


@pytest.fixture
def readmes_observer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The class that README shows, letter by letter, in the file that it names there."""
    readme = (Path(cmg_mj.__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    code = re.search(r"```python\n(# my_observers\.py\n.*?)```", readme, re.DOTALL)
    assert code is not None
    (tmp_path / "my_observers.py").write_text(code[1], encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    sys.modules.pop("my_observers", None)
    yield f"my_observers:{re.findall(r'^class (.*):', code[1], re.MULTILINE)[0]}"
    del sys.modules["my_observers"]


def test_the_readmes_observer_without_python(readmes_observer: str, tmp_path: Path) -> None:
    """One library, linked with no Python; the model says seed and world."""
    made = make(readmes_observer, "push=[]")
    library, program = compile_strictly(made, tmp_path, "-O2")
    for path in (library, program):
        assert "libpython" not in subprocess.run(["ldd", path], check=True, capture_output=True, text=True).stdout
    model, ends = tmp_path / "model.xml", set()
    for seed, world in ((0, 0), (1, 0), (0, 1), (12345678901, 7)):
        experiment = prepare(load_scenario("push_recovery", ("push=[]", f"seed={seed}"), readmes_observer))
        trajectory = experiment.run(world=world).trajectory
        assert trajectory is not None
        config = f'<config key="seed" value="{seed}"/><config key="world" value="{world}"/></instance>'
        text = made.plugin.model.read_text(encoding="utf-8")
        model.write_text(text.replace("</instance>", config), encoding="utf-8")
        rows, growth = run_program(model, library, program, len(trajectory), 1000)
        assert growth < 900  # of 900 cycles
        positions = np.stack([trajectory[name] for name in trajectory.layout.positions()], axis=1)
        np.testing.assert_array_equal(rows[:-1], positions[1:])
        ends.add(tuple(rows[-1]))
    assert len(ends) == 4


@pytest.mark.parametrize(
    ("scenario", "settings"),
    [
        ("push_recovery", ALL_IMPERFECTIONS),
        ("two_axes", (*ALL_IMPERFECTIONS, "controller.feedback=fog")),
        ("push_recovery", ("controller.kind=lqg",)),
        ("push_recovery", ("controller.kind=tests.features.export.own_laws:Elaborate",)),
    ],
)
def test_sanitizers(scenario: str, settings: tuple[str, ...], tmp_path: Path) -> None:
    made = make("mems_fused", *settings, "push=[]", scenario=scenario)
    rows, _ = run_program(made.plugin.model, *compile_strictly(made, tmp_path, *SANITIZERS), 2000, 20)
    np.testing.assert_array_equal(rows, expected(made, 2000))


@pytest.mark.skipif(shutil.which("valgrind") is None, reason="valgrind is not installed")
def test_valgrind(tmp_path: Path) -> None:
    made = make("gyro_free", "push=[]")
    library, program = compile_strictly(made, tmp_path, "-g", "-O1")
    valgrind = ("valgrind", "-q", "--error-exitcode=9", "--track-origins=no")
    rows, _ = run_program(made.plugin.model, library, program, 100, 2, *valgrind)
    np.testing.assert_array_equal(rows, expected(made, 100))

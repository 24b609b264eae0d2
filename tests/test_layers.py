"""The house's one rule: a lower room may use a higher one, and nothing above the line imports MuJoCo."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import cmg_mj
from tests.observers.reference import PAPER

PACKAGE = Path(cmg_mj.__file__).parent

HOUSE = (PACKAGE.parent / "docs" / "architecture.md").read_text(encoding="utf-8")
ABOVE, BELOW = (
    re.findall(r"^\| `(\w+)(?:\.py|/)` \|", part, re.MULTILINE)
    for part in HOUSE.split("nothing above this line imports MuJoCo")
)
"""The rooms from top to bottom, as docs/architecture.md lists them."""
ORDER = [*ABOVE, *BELOW]

REAL_LOG = PACKAGE.parent / "examples" / "data" / "stepper_encoder_gyro.csv"

HEAVY = {
    "rerun": "recording",
    "matplotlib": "plots",
    "casadi": "export",
    "distributed": "sweeps",
    "mujoco.studio": "studio",
    "gymnasium": "environment",
}
"""Imported by one room each, because it costs time."""
AT_ONCE = ("recording", "environment")
"""Rooms that import theirs when they are imported; the others when they need it."""


@cache
def rooms() -> list[str]:
    """Modules and packages of cmg_mj."""
    return sorted(
        {path.stem for path in PACKAGE.iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()}
        - {"__init__"}
    )


def depth(room: str) -> int:
    return ORDER.index(room)


def files(room: str) -> list[Path]:
    one = PACKAGE / f"{room}.py"
    return [one] if one.exists() else sorted((PACKAGE / room).rglob("*.py"))


@cache
def imports(path: Path) -> list[tuple[int, str]]:
    """Line and full name of everything that a file imports, inside functions too."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [(node.lineno, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: write the whole name"
            found += [(node.lineno, f"{node.module}.{alias.name}") for alias in node.names]
    return found


def used_rooms(room: str) -> Iterator[tuple[str, str]]:
    """Where a room imports which other room."""
    for path in files(room):
        for line, name in imports(path):
            parts = name.split(".")
            if parts[0] == "cmg_mj" and len(parts) > 1 and parts[1] in rooms() and parts[1] != room:
                yield f"{path.name}:{line}", parts[1]


def in_a_fresh_interpreter(code: str) -> list[str]:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()


def test_every_room_is_in_the_list_once() -> None:
    assert sorted(ORDER) == rooms()


@pytest.mark.parametrize("room", rooms())
def test_imports_run_upward_only(room: str) -> None:
    below = [f"{where} imports {other}" for where, other in used_rooms(room) if depth(other) > depth(room)]
    assert not below


def test_a_downward_import_would_be_seen() -> None:
    """The order is not trivially held: the loop does use the controller, the command line the scenario."""
    assert "controller" in {other for _, other in used_rooms("simulate")}
    assert "scenario" in {other for _, other in used_rooms("cli")}
    assert depth("controller") < depth("scenario") < depth("simulate") < depth("cli")


def test_nothing_above_the_line_imports_mujoco() -> None:
    """One room after the other: the first that brings MuJoCo, or what is as heavy, is named."""
    code = "import importlib, sys\n"
    for room in ABOVE:
        code += f"importlib.import_module('cmg_mj.{room}')\n"
        for heavy in ("mujoco", "control", "pyarrow", *HEAVY):
            code += f"if {heavy!r} in sys.modules: print('{room}:{heavy}')\n"
    code += "print('done')"
    assert in_a_fresh_interpreter(code) == ["done"]


def test_a_bundled_scenario_is_checked_without_mujoco() -> None:
    code = "import sys; import cmg_mj.scenario.loading; print('mujoco' in sys.modules); "
    code += "from cmg_mj.cli import main; main(['check', 'push_recovery']); print('mujoco' in sys.modules)"
    first, *_, last = in_a_fresh_interpreter(code)
    assert (first, last) == ("False", "False")


def test_a_log_is_replayed_without_mujoco() -> None:
    code = f"""
import sys
from cmg_mj import read_log, replay_log
log = read_log({str(REAL_LOG)!r}, {{"time": "time_s", "tilt": "encoder_rad"}}, between_s=(0.0, 2.0))
replay_log(log, ["linear"], skip_s=0.5)
print("mujoco" in sys.modules)
"""
    assert in_a_fresh_interpreter(code) == ["False"]


def test_every_observer_works_without_mujoco() -> None:
    code = f"""
import sys
from cmg_mj.observers import OBSERVERS, Measurement, make_observer
from cmg_mj.observers.reduced_model import ReducedModel
from cmg_mj.sensors.tilt import TiltNoise
model = {PAPER!r}
for kind in OBSERVERS:
    observer = make_observer(kind, 0.005, model, TiltNoise(0.006, 0.4, 0.9))
    observer.step(observer.init(Measurement(0.0, 0.0, 0.0)), Measurement(0.01, 0.0, 1.0), 0.0)
print("mujoco" in sys.modules)
"""
    assert in_a_fresh_interpreter(code) == ["False"]


def test_heavy_packages_are_imported_where_they_are_used() -> None:
    """All rooms but two leave them out: nothing imports matplotlib before a plot is drawn."""
    code = "import importlib, sys\n"
    for room in rooms():
        if room not in AT_ONCE:
            code += f"importlib.import_module('cmg_mj.{room}')\n"
    code += f"print(*[name for name in {sorted(HEAVY)} if name in sys.modules], 'done')"
    assert in_a_fresh_interpreter(code) == ["done"]


@pytest.mark.parametrize("package", sorted(HEAVY))
def test_only_one_room_knows_a_heavy_package(package: str) -> None:
    users = {
        room
        for room in rooms()
        for path in files(room)
        for _, name in imports(path)
        if f"{name}.".startswith(f"{package}.")
    }
    assert users <= {HEAVY[package]}


@pytest.mark.parametrize("room", ABOVE)
def test_upper_rooms_do_not_name_mujoco(room: str) -> None:
    """Not even inside a function."""
    named = [f"{path.name}:{line}" for path in files(room) for line, name in imports(path) if name.startswith("mujoco")]
    assert not named


def test_public_names_are_what_they_say() -> None:
    """In a fresh process, after everything has been imported: a submodule must not hide a name."""
    code = "import cmg_mj, inspect; cmg_mj.prepare(cmg_mj.load_scenario('push_recovery')).run;"
    code += "bad = [n for n in cmg_mj.__all__ if inspect.ismodule(getattr(cmg_mj, n))]; assert not bad, bad"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_documents_named_in_the_sources_exist() -> None:
    root = PACKAGE.parent
    for path in [*PACKAGE.rglob("*.py"), root / "README.md", *(root / "docs").glob("*.md")]:
        for name in re.findall(r"docs/[\w/]+\.(?:md|py|png)", path.read_text(encoding="utf-8")):
            assert (root / name).is_file(), f"{path.name} names {name}"

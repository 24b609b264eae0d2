"""The rule of the packages: a lower one may use a higher one, and nothing above the line imports MuJoCo."""

from __future__ import annotations

import ast
import importlib
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
ROOT = PACKAGE.parent

ARCHITECTURE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
TABLE = ARCHITECTURE.split("## The packages")[1].split("\n\n| library |")[0]
UPPER_PACKAGES, LOWER_PACKAGES = (
    re.findall(r"^\| `(\w+)` \|", part, re.MULTILINE) for part in TABLE.split("nothing above this line imports MuJoCo")
)
"""The packages from top to bottom, as docs/architecture.md lists them."""
ORDER = [*UPPER_PACKAGES, *LOWER_PACKAGES]
MAX_ENTRIES = 18

HEAVY = dict(re.findall(r"^\| ([\w.]+) \| `([\w/, `]+)` \|$", ARCHITECTURE, re.MULTILINE))
"""Library -> the only sub-package or module that imports it, because it costs time."""
EAGER = ("cmg_mj.view.recording", "cmg_mj.runs.live", "cmg_mj.features.gymnasium")
"""These import theirs when they are imported; the others when they need it."""


@cache
def modules() -> dict[str, Path]:
    """Full name -> file of every module; a package's is its `__init__.py`."""
    paths = sorted(PACKAGE.rglob("*.py"))
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__") for path in paths]
    return dict(zip(names, paths, strict=True))


def package_of(module: str) -> str:
    return module.split(".")[1] if "." in module else ""


def modules_of(package: str) -> list[str]:
    return [name for name in modules() if package_of(name) == package]


def imported_names(tree: ast.AST, place: str) -> Iterator[tuple[int, str]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{place}:{node.lineno}: write the whole name"
            yield from ((node.lineno, f"{node.module}.{alias.name}") for alias in node.names)


@cache
def syntax_tree(module: str) -> ast.Module:
    return ast.parse(modules()[module].read_text(encoding="utf-8"))


@cache
def imports(module: str) -> list[tuple[int, str]]:
    """Line and full name of everything that a module imports, inside functions too."""
    return list(imported_names(syntax_tree(module), module))


def import_time_names(module: str) -> Iterator[str]:
    """Modules of the package that a module imports when it is imported itself."""
    outside = [node for node in syntax_tree(module).body if not _is_for_types(node)]
    for _, name in imported_names(ast.Module([node for node in outside if not _defines(node)], []), module):
        yield from _module_in(name)


def _is_for_types(node: ast.stmt) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def _defines(node: ast.stmt) -> bool:
    return isinstance(node, ast.FunctionDef | ast.ClassDef)


def _module_in(name: str) -> Iterator[str]:
    while name and name not in modules():
        name = name.rpartition(".")[0]
    if name:
        yield name


def run_in_a_fresh_interpreter(code: str) -> list[str]:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()


def test_the_top_is_small() -> None:
    entries = sorted(path.name for path in PACKAGE.iterdir() if path.name not in ("__pycache__", "models", "scenarios"))
    files = [name for name in entries if (PACKAGE / name).is_file()]
    assert files == ["__init__.py", "__init__.pyi", "py.typed"]
    assert len(entries) <= MAX_ENTRIES


def test_every_package_is_in_the_table_once() -> None:
    assert len(ORDER) == len(set(ORDER)) == 15
    assert {package_of(name) for name in modules()} - {""} <= set(ORDER)  # a package of its own may be deleted


@pytest.mark.parametrize("package", ORDER)
def test_imports_run_upward_only(package: str) -> None:
    depth = ORDER.index(package)
    downward_imports = [
        f"{module}:{line} imports {name}"
        for module in modules_of(package)
        for line, name in imports(module)
        if name.startswith("cmg_mj.") and (other := package_of(name)) in ORDER and ORDER.index(other) > depth
    ]
    assert not downward_imports


def test_the_loop_loads_the_core_alone() -> None:
    code = "import sys, cmg_mj.core.loop; print(*sys.modules)"
    loaded = run_in_a_fresh_interpreter(code)
    ours = {name for name in loaded if name.startswith("cmg_mj.") and not name.startswith("cmg_mj.core")}
    assert ours == set()
    assert sum(name.startswith("cmg_mj") for name in loaded) <= 16
    assert not {"pydantic", "mujoco", "scipy"} & set(loaded)


def test_no_circle_of_modules() -> None:
    """Among the imports that are made when a module is imported; those inside functions are made later."""
    graph = {module: set(import_time_names(module)) - {module} for module in modules()}
    finished: set[str] = set()
    while ready := {
        module
        for module, dependencies in graph.items()
        if module not in finished and dependencies <= finished | {module}
    }:
        finished |= ready
    assert not {module: dependencies - finished for module, dependencies in graph.items() if module not in finished}


@pytest.mark.slow
def test_nothing_above_the_line_imports_mujoco() -> None:
    """One package after the other: the first that brings MuJoCo, or what is as heavy, is named."""
    code = "import importlib, sys\n"
    for name in [name for package in UPPER_PACKAGES for name in modules_of(package)]:
        code += f"importlib.import_module({name!r})\n"
        for heavy in ("mujoco", "control", "pyarrow", *HEAVY):
            code += f"if {heavy!r} in sys.modules: print({name!r}, {heavy!r})\n"
    code += "print('done')"
    assert run_in_a_fresh_interpreter(code) == ["done"]


@pytest.mark.parametrize("package", UPPER_PACKAGES)
def test_upper_packages_do_not_name_mujoco(package: str) -> None:
    """Not even inside a function."""
    places = [
        f"{name}:{line}"
        for name in modules_of(package)
        for line, import_name in imports(name)
        if import_name.startswith("mujoco")
    ]
    assert not places


def test_every_observer_works_without_mujoco() -> None:
    code = f"""
import sys
from cmg_mj.observers import OBSERVERS, Measurement, make_observer
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.tilt import MeasurementNoise
model = {PAPER!r}
for kind in OBSERVERS:
    observer = make_observer(kind, 0.005, model, MeasurementNoise(0.006, 0.4, 0.9))
    observer.step(observer.init(Measurement(0.0, 0.0, 0.0)), Measurement(0.01, 0.0, 1.0), 0.0)
print("mujoco" in sys.modules)
"""
    assert run_in_a_fresh_interpreter(code) == ["False"]


@pytest.mark.parametrize("library", sorted(HEAVY))
def test_only_one_place_knows_a_heavy_library(library: str) -> None:
    places = [f"cmg_mj.{place.replace('/', '.')}." for place in HEAVY[library].split("`, `")]
    users = {
        name for name in modules() for _, import_name in imports(name) if f"{import_name}.".startswith(f"{library}.")
    }
    assert users
    assert {name for name in users if not f"{name}.".startswith(tuple(places))} == set()


@pytest.mark.slow
def test_heavy_libraries_are_imported_where_they_are_used() -> None:
    """All modules but these leave them out: nothing imports matplotlib before a plot is drawn."""
    inner = ("cmg_mj.features.studio.", "cmg_mj.features.sweeps.cluster", *EAGER)
    code = "import importlib, sys\n"
    for name in modules():
        if not name.startswith(inner):
            code += f"importlib.import_module({name!r})\n"
    code += f"print(*[name for name in {sorted(HEAVY)} if name in sys.modules], 'done')"
    assert run_in_a_fresh_interpreter(code) == ["done"]


@pytest.mark.slow
def test_public_names_are_what_they_say() -> None:
    """In a fresh process, after everything has been imported: a submodule must not hide a name."""
    code = "import cmg_mj, inspect; cmg_mj.prepare(cmg_mj.load_scenario('push_recovery')).run;"
    code += "bad = [n for n in cmg_mj.__all__ if inspect.ismodule(getattr(cmg_mj, n))]; assert not bad, bad"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_public_names_are_listed_once() -> None:
    _, _, *imports = ast.parse((PACKAGE / "__init__.pyi").read_text(encoding="utf-8")).body
    names = []
    for node in imports:
        assert isinstance(node, ast.ImportFrom)
        (alias,) = node.names
        assert alias.name == alias.asname
        assert getattr(cmg_mj, alias.name) is getattr(importlib.import_module(f"cmg_mj.{node.module}"), alias.name)
        names.append(alias.name)
    assert sorted(names) == cmg_mj.__all__
    assert set(names) <= set(dir(cmg_mj))


def test_documents_named_in_the_sources_exist() -> None:
    for path in [*PACKAGE.rglob("*.py"), ROOT / "README.md", *(ROOT / "docs").glob("*.md")]:
        for name in re.findall(r"docs/[\w/]+\.(?:md|py|png)", path.read_text(encoding="utf-8")):
            assert (ROOT / name).is_file(), f"{path.name} names {name}"

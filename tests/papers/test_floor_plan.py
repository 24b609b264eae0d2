"""The papers' floor: who may import whom, what every paper's folder has, and what it needs to be installed.

Read off the sources, without importing them. A rule is a function that takes the package's folder and gives its
breaches; on a small package of files made for it, each rule is seen to find one.
"""

from __future__ import annotations

import ast
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

import cmg_mj
from cmg_mj.papers import BEYOND, NEEDS, PAPERS
from tests.command import ROOT

PACKAGE = Path(cmg_mj.__file__).parent
NO_PAPER = frozenset(BEYOND)
"""Folders without printed constants and equations."""


class Import(NamedTuple):
    """An import: the full name, and the place."""

    name: str
    line: int
    in_a_function: bool


def imports(path: Path) -> Iterator[Import]:
    """Everything that a file imports."""

    def visit(node: ast.AST, in_a_function: bool) -> Iterator[Import]:
        if isinstance(node, ast.Import):
            yield from (Import(alias.name, node.lineno, in_a_function) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: write the whole name"
            yield from (Import(f"{node.module}.{alias.name}", node.lineno, in_a_function) for alias in node.names)
        in_a_function = in_a_function or isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda))
        for child in ast.iter_child_nodes(node):
            yield from visit(child, in_a_function)

    yield from visit(ast.parse(path.read_text(encoding="utf-8")), False)


def of_the_floor(name: str) -> bool:
    return f"{name}.".startswith("cmg_mj.papers.")


def folders(package: Path) -> list[str]:
    """The papers' folders."""
    return sorted(path.parent.name for path in (package / "papers").glob("*/__init__.py"))


def imported_folder(package: Path, name: str) -> str:
    """The paper's folder that an imported name lies in; empty for none."""
    parts = name.split(".")
    return parts[2] if of_the_floor(name) and len(parts) > 2 and parts[2] in folders(package) else ""


def position(package: Path, path: Path, line: int) -> str:
    return f"{path.relative_to(package)}:{line}"


# --- the rules ------------------------------------------------------------------------------------------------


def imported_from_outside(package: Path) -> list[str]:
    """Only the command imports the floor, and only where it needs it."""
    breaches = []
    for path in sorted(package.rglob("*.py")):
        room, *_ = path.relative_to(package).parts
        if room == "papers":
            continue
        breaches += [
            f"{position(package, path, line)} imports {name}"
            for name, line, in_a_function in imports(path)
            if of_the_floor(name) and not (room == "cli" and in_a_function)
        ]
        breaches += [
            f"{position(package, path, node.lineno)} names {node.value}"
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and of_the_floor(node.value)
        ]
    return breaches


def imported_from_another_paper(package: Path) -> list[str]:
    """No paper's folder imports another's, and what papers share imports none of them."""
    breaches = []
    for path in sorted((package / "papers").rglob("*.py")):
        folder, *_ = path.relative_to(package / "papers").parts
        for name, line, _ in imports(path):
            if imported_folder(package, name) not in ("", folder):
                breaches.append(f"{position(package, path, line)} imports {name}")
    return breaches


def incomplete(package: Path) -> list[str]:
    """Every paper has its `paper.py`; its `__init__.py` is a list of sections whose files export `claims`."""
    breaches = []
    for paper in folders(package):
        folder = package / "papers" / paper
        if paper not in NO_PAPER and not (folder / "paper.py").is_file():
            breaches.append(f"{paper} has no paper.py")
        docstring, *statements = ast.parse((folder / "__init__.py").read_text(encoding="utf-8")).body
        assignments = [node for node in statements if not isinstance(node, (ast.Import, ast.ImportFrom))]
        if not isinstance(docstring, ast.Expr) or [_target(node) for node in assignments] != ["SECTIONS"]:
            breaches.append(f"{paper}/__init__.py holds something else than a docstring and SECTIONS")
            continue
        files = [section_file(section) for section in ast.walk(assignments[0]) if is_section(section)]
        if not files:
            breaches.append(f"{paper}/__init__.py lists no section")
        for name in files:
            if not name:
                breaches.append(f"{paper}/__init__.py: a section's claims are not those of a file of the folder")
            elif not exports_claims(folder / f"{name}.py"):
                breaches.append(f"{paper}/{name}.py does not export claims")
    return breaches


def _target(node: ast.stmt) -> str:
    """The name that a statement assigns to; empty if it does something else."""
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
    return ", ".join(target.id if isinstance(target, ast.Name) else "" for target in targets)


def is_section(node: ast.AST) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Section"


def section_file(node: ast.AST) -> str:
    """`lag` of `Section("the lag", 3.0, lag.claims)`; empty if its claims come from elsewhere."""
    assert isinstance(node, ast.Call)
    argument = [*node.args, *(keyword.value for keyword in node.keywords)][-1]
    if isinstance(argument, ast.Attribute) and argument.attr == "claims" and isinstance(argument.value, ast.Name):
        return argument.value.id
    return ""


def exports_claims(path: Path) -> bool:
    """Return true if a file has a function `claims` that takes one argument."""
    if not path.is_file():
        return False
    functions = [node for node in ast.parse(path.read_text(encoding="utf-8")).body if isinstance(node, ast.FunctionDef)]
    return any(node.name == "claims" and [a.arg for a in node.args.args] == ["on_share"] for node in functions)


def needed(package: Path, paper: str) -> set[str]:
    """The packages that a paper's files import, or what they use of the floor does, and the bench does not."""
    floor = package / "papers"
    bench = {top(name) for path in package.rglob("*.py") if floor not in path.parents for name, *_ in imports(path)}
    queue, visited = list((floor / paper).glob("*.py")), set()
    packages: set[str] = set()
    while queue:
        path = queue.pop()
        if path in visited:
            continue
        visited.add(path)
        for name, *_ in imports(path):
            packages.add(top(name))
            if of_the_floor(name) and len(name.split(".")) > 2:
                queue += [file for file in [floor / f"{name.split('.')[2]}.py"] if file.is_file()]
    return packages - bench - set(sys.stdlib_module_names) - {"cmg_mj"}


def top(name: str) -> str:
    return name.split(".")[0]


# --- the floor ------------------------------------------------------------------------------------------------


def test_every_paper_has_a_folder() -> None:
    assert folders(PACKAGE) == sorted(PAPERS | BEYOND)


@pytest.mark.parametrize("rule", [imported_from_outside, imported_from_another_paper, incomplete])
def test_the_floor_keeps_its_rules(rule: Callable[[Path], list[str]]) -> None:
    assert not rule(PACKAGE)


@pytest.mark.parametrize("paper", [*PAPERS, *BEYOND])
def test_what_a_paper_needs_is_declared(paper: str) -> None:
    assert needed(PACKAGE, paper) == set(NEEDS.get(paper, ()))


def test_the_extra_has_what_the_papers_need() -> None:
    extra = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]["papers"]
    assert [requirement.partition(">")[0] for requirement in extra] == sorted({p for ps in NEEDS.values() for p in ps})


# --- the rules can fail ---------------------------------------------------------------------------------------

GOOD = {
    "bench.py": "import numpy\n",
    "cli/studies.py": "def reproduce():\n    from cmg_mj.papers import PAPERS\n",
    "papers/__init__.py": "",
    "papers/shared.py": "import numpy\n",
    "papers/a2020/__init__.py": (
        '"""A."""\nfrom cmg_mj.papers.a2020 import lag\nfrom cmg_mj.papers.claim import Section\n'
        'SECTIONS: list[Section] = [Section("the lag", 3.0, lag.claims)]\n'
    ),
    "papers/a2020/paper.py": "TAU_S = 0.02\n",
    "papers/a2020/lag.py": (
        "from cmg_mj.papers.a2020.paper import TAU_S\nfrom cmg_mj.papers import shared\n"
        "def claims(on_share):\n    return []\n"
    ),
    "papers/b2019/__init__.py": (
        '"""B."""\nfrom cmg_mj.papers.b2019 import x\nSECTIONS = [Section("x", 3.0, x.claims)]\n'
    ),
    "papers/b2019/paper.py": "",
    "papers/b2019/x.py": "def claims(on_share):\n    return []\n",
}
"""A small package that keeps the rules: file -> its text."""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    for name, text in GOOD.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path


def test_a_package_that_keeps_the_rules(package: Path) -> None:
    assert [*imported_from_outside(package), *imported_from_another_paper(package), *incomplete(package)] == []
    assert needed(package, "a2020") == set()


@pytest.mark.parametrize(
    ("rule", "file", "text", "breach"),
    [
        (imported_from_outside, "bench.py", "import cmg_mj.papers", "bench.py:1 imports cmg_mj.papers"),
        (imported_from_outside, "bench.py", "from cmg_mj import papers", "bench.py:1 imports cmg_mj.papers"),
        (
            imported_from_outside,
            "bench.py",
            "def f():\n    from cmg_mj.papers.words import g",
            "bench.py:2 imports cmg_mj.papers.words.g",
        ),
        (imported_from_outside, "bench.py", "HOME = 'cmg_mj.papers.words'", "bench.py:1 names cmg_mj.papers.words"),
        (imported_from_outside, "cli/x.py", "import cmg_mj.papers", "cli/x.py:1 imports cmg_mj.papers"),
        (
            imported_from_another_paper,
            "papers/b2019/x.py",
            "def f():\n    from cmg_mj.papers.a2020.lag import claims",
            "papers/b2019/x.py:2 imports cmg_mj.papers.a2020.lag.claims",
        ),
        (
            imported_from_another_paper,
            "papers/b2019/x.py",
            "from cmg_mj.papers import a2020",
            "papers/b2019/x.py:1 imports cmg_mj.papers.a2020",
        ),
        (
            imported_from_another_paper,
            "papers/shared.py",
            "import cmg_mj.papers.a2020.paper",
            "papers/shared.py:1 imports cmg_mj.papers.a2020.paper",
        ),
        (incomplete, "papers/a2020/lag.py", "def run(on_share): ...", "a2020/lag.py does not export claims"),
        (incomplete, "papers/a2020/lag.py", "def claims(): ...", "a2020/lag.py does not export claims"),
        (incomplete, "papers/a2020/paper.py", None, "a2020 has no paper.py"),
        (incomplete, "papers/a2020/lag.py", None, "a2020/lag.py does not export claims"),
        (incomplete, "papers/a2020/__init__.py", '"""A."""\nSECTIONS = []', "a2020/__init__.py lists no section"),
        (
            incomplete,
            "papers/a2020/__init__.py",
            '"""A."""\nSECTIONS = [Section("the lag", 3.0, lambda on_share: [])]',
            "a2020/__init__.py: a section's claims are not those of a file of the folder",
        ),
        (
            incomplete,
            "papers/a2020/__init__.py",
            GOOD["papers/a2020/__init__.py"] + "def helper(): ...",
            "a2020/__init__.py holds something else than a docstring and SECTIONS",
        ),
    ],
)
def test_a_breach_is_found(
    rule: Callable[[Path], list[str]], file: str, text: str | None, breach: str, package: Path
) -> None:
    if text is None:
        (package / file).unlink()
    else:
        (package / file).write_text(text)
    assert rule(package) == [breach]


@pytest.mark.parametrize("file", ["papers/a2020/lag.py", "papers/shared.py"])
def test_an_undeclared_need_is_found(file: str, package: Path) -> None:
    """In the paper's own files, and in what they use of the floor; the other paper does not need it."""
    path = package / file
    path.write_text(path.read_text() + "def prove():\n    import sympy.abc\n")
    assert needed(package, "a2020") == {"sympy"}
    assert needed(package, "b2019") == set()

"""The documents are complete, their links lead somewhere, their site builds, and what CONTRIBUTING adds works."""

from __future__ import annotations

import importlib
import importlib.util
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path
from types import ModuleType

import pytest

import cmg_mj
from cmg_mj.observers import OBSERVERS
from cmg_mj.results.trajectory import Trajectory
from tests.command import COMMAND, HANGS_AFTER_S, ROOT, environment
from tests.observers import test_contract

CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
REFERENCE = "\n".join(path.read_text(encoding="utf-8") for path in sorted((DOCS / "api").glob("*.md")))


@pytest.mark.parametrize("name", sorted(cmg_mj.__all__))
def test_every_public_name_is_in_the_reference(name: str) -> None:
    assert re.search(rf"^::: cmg_mj\.[\w.]+\.{name}$", REFERENCE, flags=re.MULTILINE)


@pytest.mark.parametrize("kind", OBSERVERS)
def test_every_observer_is_in_the_reference(kind: str) -> None:
    assert f"::: {OBSERVERS[kind].replace(':', '.')}\n" in REFERENCE


@pytest.mark.parametrize("dotted", re.findall(r"^::: (.+)$", REFERENCE, flags=re.MULTILINE))
def test_what_the_reference_names_exists(dotted: str) -> None:
    home, _, name = dotted.rpartition(".")
    assert hasattr(importlib.import_module(home), name) or importlib.util.find_spec(dotted)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(DOCS).as_posix())
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\((?!\w+:|#)([^)#]+)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), target


def module(name: str, code: str, folder: Path) -> ModuleType:
    path = folder / f"{name}.py"
    path.write_text(code, encoding="utf-8")
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec
    assert spec.loader
    module_object = importlib.util.module_from_spec(spec)
    sys.modules[name] = module_object
    spec.loader.exec_module(module_object)
    return module_object


def recipe(title: str) -> str:
    """A section of CONTRIBUTING."""
    return CONTRIBUTING.split(f"\n## {title}\n")[1].split("\n## ")[0]


def test_the_observer_of_contributing_is_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = recipe("Add an observer")
    observer, test = (textwrap.dedent(block) for block in re.findall(r" *```python\n(.*?)```", text, flags=re.DOTALL))
    kind, path = re.findall(r'`"(\w+)": "([\w.:]+)",`', text)[0]
    home, _, name = path.partition(":")
    observer_module = module("an_observer_of_contributing", observer, tmp_path)
    monkeypatch.setitem(OBSERVERS, kind, f"an_observer_of_contributing:{name}")
    assert home == f"cmg_mj.observers.{kind}"
    assert f"`cmg_mj/observers/{kind}.py`" in text
    assert observer_module.__doc__
    test_contract.test_every_parameter_is_documented(kind)
    test_contract.test_step_has_no_memory_but_the_state(kind)
    test_contract.test_arrays_equal_floats_bit_by_bit(kind, 5)
    module("a_test_of_contributing", test, tmp_path).test_equals_the_continuous_observer()


@pytest.mark.slow
def test_the_field_of_contributing_is_one(tmp_path: Path) -> None:
    """In a copy of the package: it runs, reruns, is switched off again, and the export refuses it."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    recipe = text.split("\n## Add a field of the scenario\n")[1].split("\n## ")[0]
    field, use, effect = re.findall(r" *```python\n(.*?)```", recipe, flags=re.DOTALL)
    for name in ("cmg_mj", "models", "scenarios"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))

    def insert(file: str, block: str, before: str, indent: int) -> None:
        path = tmp_path / "cmg_mj" / file
        content = path.read_text(encoding="utf-8")
        assert content.count(before) == 1, before
        lines = textwrap.indent(textwrap.dedent(block), indent * " ")
        path.write_text(content.replace(before, lines + before), encoding="utf-8")

    insert("scenario/schema.py", field, "    feedback: Feedback", 4)
    insert("scenario/schema.py", use, "        return make_law(", 8)
    (law_field,) = re.findall(r"`(dead_band_rad_s: float = 0\.0)`", recipe)
    insert("laws/state_feedback.py", law_field + "\n", "\n    @property\n    def trim_gain", 4)
    insert("laws/state_feedback.py", effect, "        if u is not demanded:", 8)

    def command(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [*COMMAND, *arguments],
            cwd=tmp_path,
            env=environment() | {"PYTHONPATH": str(tmp_path)},
            capture_output=True,
            text=True,
            timeout=HANGS_AFTER_S,
            check=False,
        )

    def commands(folder: str, *arguments: str) -> list[float]:
        run = command("run", *arguments, "--out", folder)
        assert run.returncode == 0, run.stderr
        return Trajectory.load(tmp_path / folder / "trajectory.parquet")["u_rad_s"].tolist()

    short = ("push_recovery", "--set", "duration_s=0.5", "--set", "push=[]")
    dead_band = ("--set", "controller.dead_band_rad_s=0.05")
    without, with_it = commands("without", *short), commands("with", *short, *dead_band)
    assert min(abs(u) for u in with_it if u) >= 0.05 > min(abs(u) for u in without if u)
    assert commands("again", "with/scenario.toml") == with_it
    assert commands("off", "with/scenario.toml", "--set", "controller.dead_band_rad_s=0.0") == without
    export = command("export", "linear", *dead_band)
    assert export.returncode == 2

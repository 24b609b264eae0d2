"""The pages of fields and commands are what their generator writes, and they are complete."""

from __future__ import annotations

import importlib.util
import re
import shlex
import tomllib
from pathlib import Path
from types import ModuleType
from typing import Any

import click
import pytest
from pydantic.dataclasses import dataclass

from cmg_mj.cli import cli
from cmg_mj.controllers.laws import LAW_CLASSES, LAWS
from cmg_mj.inputs.files import bundled
from cmg_mj.inputs.messages import fields_of
from cmg_mj.observers import OBSERVER_CLASSES, OBSERVERS
from cmg_mj.scenario.pivot import FIELDS_OF
from cmg_mj.scenario.schema import AxisSettings, ControllerSettings, Scenario, parse_scenario
from tests.command import ROOT

DOCS = ROOT / "docs"
LONGEST_PAGE = 3000
"""Words."""


def _generator() -> ModuleType:
    spec = importlib.util.spec_from_file_location("reference_pages", DOCS / "reference_pages.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


GENERATOR = _generator()
PAGES: dict[str, str] = GENERATOR.pages()
SECTIONS: dict[str, type] = GENERATOR.scenario_sections() | GENERATOR.SENSOR_SECTIONS


def leaves(cls: type, section: str = "") -> set[str]:
    """Return every field of a class and of the sections below it, dotted; a list's sections without a number."""
    found = set()
    for name, annotation in fields_of(cls).items():
        below = GENERATOR.section_class(annotation)
        path = f"{section}.{name}".lstrip(".")
        found |= leaves(below, path) if below and name != "axes" else {path}
    return found


def rows(text: str) -> dict[str, list[str]]:
    """Return the first cell of every table row, its backticks removed -> the other cells."""
    cells = [re.split(r"(?<!\\) \| ", line.strip("| ")) for line in text.splitlines() if line.startswith("| `")]
    return {first.strip("`"): [cell.strip() for cell in rest] for first, *rest in cells}


def section_of(page: str, heading: str) -> str:
    return PAGES[page].split(f"\n## {heading}\n")[1].split("\n## ")[0]


@pytest.mark.parametrize("page", PAGES)
def test_a_page_is_what_the_generator_writes(page: str) -> None:
    written = (DOCS / page).read_text(encoding="utf-8")
    assert written == PAGES[page], f"docs/{page} is not up to date: python docs/reference_pages.py"


@pytest.mark.parametrize("page", PAGES)
def test_no_placeholder_is_left(page: str) -> None:
    """A text that should have been formatted; TOML and figures in braces have more than a name in them."""
    assert re.findall(r"\{\w*\}", PAGES[page]) == []


@pytest.mark.parametrize("page", PAGES)
def test_a_page_can_be_read_in_one_go(page: str) -> None:
    assert len(PAGES[page].split()) < LONGEST_PAGE


def test_every_field_of_a_scenario_has_a_row() -> None:
    listed = {
        row.field
        for section, cls in SECTIONS.items()
        for row in GENERATOR.rows_of(section, cls)
        if row.field != "controller.lqr"
    }
    assert listed == leaves(Scenario) - {"axes"}
    assert set(GENERATOR.EXAMPLES) == listed | {"controller.lqr"}
    axes = rows(section_of("scenario.md", "`[axes.NAME]`"))
    assert [name.removeprefix("axes.NAME.") for name in axes] == list(AxisSettings.model_fields)


@pytest.mark.parametrize("section", SECTIONS)
def test_the_rows_of_a_section_are_complete(section: str) -> None:
    for row in GENERATOR.rows_of(section, SECTIONS[section]):
        assert row.meaning, row.field
        assert row.allowed, row.field
        assert row.example, row.field
        assert row.default, row.field
        name = row.field.rpartition(".")[2]
        assert (row.unit == "-") == (name not in WITH_A_UNIT and not re.search(UNIT_ENDS, name)), (row.field, row.unit)


WITH_A_UNIT = ("duration_s", "file")
UNIT_ENDS = "|".join(f"{end}$" for end in GENERATOR.UNITS)


def fields_with(path: str, value: Any) -> dict[str, Any]:
    """Return a scenario with one field, and those that this field needs."""
    *sections, name = path.split(".")
    need: dict[str, Any] = {}
    if sections == ["push"]:
        need = {"start_s": 1.0}
    elif sections == ["swing"]:
        need = {"frequency_hz": 1.0}
    elif sections == ["pivot"]:
        kind = next((kind for kind, names in FIELDS_OF.items() if name in names), "sine")
        need = {"kind": kind} | tomllib.loads(GENERATOR.PIVOT_EXAMPLES[kind].replace(", ", "\n"))
    elif path == "controller.lqr.input_cost":
        need = {"state_cost": [1.0, 1.0, 1.0, 1.0]}
    fields: Any = {**need, name: value}
    for section in reversed(sections):
        fields = {section: [fields] if section in ("push", "swing", "pivot") else fields}
    return fields


@pytest.mark.parametrize("path", [path for path in GENERATOR.EXAMPLES if path != "controller.lqr"])
def test_an_example_is_allowed_and_differs_from_the_default(path: str) -> None:
    value = tomllib.loads(f"value = {GENERATOR.EXAMPLES[path]}")["value"]
    scenario = parse_scenario(fields_with(path, value))
    taken: Any = scenario
    for name in path.split("."):
        taken = getattr(taken[0] if isinstance(taken, list) else taken, name)
    assert (list(taken) if isinstance(taken, tuple) else taken) == value
    default: Any = Scenario()
    for name in path.split("."):
        default = getattr(default, name, None)
    assert taken != default


def test_the_scenarios_of_the_page_are_valid() -> None:
    for page in ("scenario.md", "scenario_sensors.md", "scenario_observers.md"):
        blocks = re.findall(r"```toml\n(.*?)```", PAGES[page], flags=re.DOTALL)
        assert blocks
        for block in blocks:
            parse_scenario(tomllib.loads(block))
    for kind, text in GENERATOR.PIVOT_EXAMPLES.items():
        parse_scenario({"pivot": [tomllib.loads(text.replace(", ", "\n"))]})
        assert f'kind = "{kind}"' in text


def test_every_bundled_scenario_is_described() -> None:
    table = rows(section_of("scenario.md", "Bundled scenarios"))
    assert sorted(table) == sorted(bundled("scenarios"))
    assert all(title and what for title, what in table.values())


@pytest.mark.parametrize(
    ("kind", "classes"),
    [*((kind, OBSERVER_CLASSES) for kind in OBSERVERS), *((kind, LAW_CLASSES) for kind in LAWS)],
)
def test_every_parameter_of_an_observer_or_law_has_a_row(kind: str, classes: Any) -> None:
    noun = "Observer" if classes is OBSERVER_CLASSES else "Law"
    text = section_of("scenario_observers.md", f"{noun} `{kind}`")
    own = [name for name in classes.own(kind) if name not in ControllerSettings.model_fields]
    table = rows(text)
    assert list(table) == own
    for name, (_, default, allowed, meaning) in table.items():
        assert default != "-", name
        assert allowed != "-", name
        assert meaning != "-", name
    for example in re.findall(r"`(cmg-mj run .*)`", text):
        words = shlex.split(example)
        settings = dict(word.split("=", 1) for word in words if re.match(r"(observer|controller)\.\w+=", word))
        assert {name.partition(".")[2] for name in settings} <= {"kind", *own, *ControllerSettings.model_fields}
    assert ("Example:" in text) == bool(own or kind in GENERATOR.LAW_EXAMPLES)


COMMANDS: dict[str, click.Command] = GENERATOR.leaf_commands()


def test_every_command_is_on_the_pages() -> None:
    names = {words.split()[0] for words in COMMANDS}
    assert names == set(cli.commands)
    listed = re.findall(r"^## `cmg-mj ([\w -]+)`$", "".join(PAGES.values()), flags=re.MULTILINE)
    assert sorted(listed) == sorted(COMMANDS)
    index = re.findall(r"^\| \[`cmg-mj ([\w -]+)`\]", PAGES["commands.md"], flags=re.MULTILINE)
    assert sorted(index) == sorted(COMMANDS)


@pytest.mark.parametrize("words", COMMANDS)
def test_a_command_is_described_completely(words: str) -> None:
    page = next(page for page in ("commands.md", "commands_tools.md") if f"\n## `cmg-mj {words}`\n" in PAGES[page])
    text = section_of(page, f"`cmg-mj {words}`")
    common = rows(section_of("commands.md", "Common options"))
    own = rows(text)
    named = re.findall(r"`(--[\w-]+)`", text.partition("#common-options): ")[2].split("\n\n")[0])
    assert set(named) <= set(common)
    options = [parameter for parameter in COMMANDS[words].params if isinstance(parameter, click.Option)]
    expected = {", ".join(option.opts) for option in options}
    assert expected == {*own, *named}
    for option in options:
        value, default, meaning = {**common, **own}[", ".join(option.opts)]
        assert value != "-", option.name
        assert default, option.name
        assert meaning != "-", option.name
        if isinstance(option.type, click.Choice):
            assert all(f"`{choice}`" in value for choice in option.type.choices)
    assert re.search(r"second|minute", text)


@pytest.mark.parametrize("words", COMMANDS)
def test_the_examples_of_a_command_are_taken(words: str) -> None:
    """By click, with all its checks; nothing runs."""
    for line in GENERATOR.COMMANDS[words].examples:
        for part in line.split(" && "):
            name, *arguments = shlex.split(part)
            if name == "python":
                continue
            command: click.Command = cli
            while isinstance(command, click.Group):
                command = command.commands[arguments.pop(0)]
            parent = click.Context(cli, **cli.context_settings)  # click keeps the names of the help option of the first
            with command.make_context("cmg-mj", list(arguments), parent=parent):
                pass
            for argument in arguments:
                if argument.startswith("examples/"):
                    assert (ROOT / argument).exists()


def test_the_pages_of_notes_exist() -> None:
    for notes in GENERATOR.COMMANDS.values():
        assert not notes.more or (DOCS / notes.more).is_file()


@pytest.mark.parametrize(
    ("annotation", "words"),
    [(float, "a number"), (bool, "`true` or `false`"), (int, "a whole number"), (list[str], "a list of names")],
)
def test_allowed_values_in_words(annotation: Any, words: str) -> None:
    assert GENERATOR.allowed_values(annotation) == words


def test_writes_the_pages(tmp_path: Path) -> None:
    GENERATOR.write(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(PAGES)


@dataclass(frozen=True)
class Section:
    """A section.

    Attributes:
        length_m: How long it is [m].
    """

    length_m: float = 2.0


def test_a_row_is_read_off_a_class() -> None:
    (row,) = GENERATOR.rows_of("it", Section, {"it.length_m": "3.0"})
    assert row == ("it.length_m", "m", "`2.0`", "a number", "3.0", "How long it is.")

"""The reference pages are those that their program writes, and what they show is valid."""

from __future__ import annotations

import re
import shlex
import tomllib
from pathlib import Path

import click
import pytest

from cmg_mj import parse_scenario
from cmg_mj.cli import cli
from tests.command import ROOT

DOCS = ROOT / "docs"


@pytest.fixture
def generator(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(DOCS)
    import reference_pages  # type: ignore[import-not-found]

    return reference_pages


def test_the_pages_are_up_to_date(generator, tmp_path: Path) -> None:
    generator.write(tmp_path)
    for page in tmp_path.iterdir():
        assert page.read_text(encoding="utf-8") == (DOCS / page.name).read_text(encoding="utf-8"), page.name


def test_the_scenarios_of_the_pages_are_valid(generator, tmp_path: Path) -> None:
    generator.write(tmp_path)
    pages = [page.read_text(encoding="utf-8") for page in tmp_path.iterdir()]
    blocks = [block for page in pages for block in re.findall(r"```toml\n(.*?)```", page, flags=re.DOTALL)]
    assert blocks
    for block in blocks:
        parse_scenario(tomllib.loads(block))


def test_every_command_is_there_and_takes_its_examples(generator) -> None:
    """Taken by click, with all its checks; nothing runs."""
    assert {words.split()[0] for words in generator.COMMANDS} == set(generator.leaf_commands())
    for words, notes in generator.COMMANDS.items():
        for line in notes.examples:
            for part in line.split(" && "):
                name, *arguments = shlex.split(part)
                if name == "python":
                    continue
                command = generator.leaf_commands()[arguments.pop(0)]
                parent = click.Context(cli, **cli.context_settings)
                with command.make_context("cmg-mj", list(arguments), parent=parent):
                    assert words

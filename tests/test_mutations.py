"""The list of wrong parameters fits the sources, each number once; the tests that must catch it, or have, exist."""

from __future__ import annotations

import re

import pytest

from tests.mutations import MUTATIONS, ROOT, TESTS, mutated, parameters


@pytest.mark.parametrize("parameter", parameters())
def test_a_parameter_can_be_multiplied(parameter: str) -> None:
    file, text = mutated(parameter, 1.2)
    before = (ROOT / file).read_text(encoding="utf-8")
    assert text != before
    compile(text, file, "exec")


def test_parameters_and_tests_are_there() -> None:
    assert len({mutation.parameter for mutation in MUTATIONS}) == len(MUTATIONS) >= 40
    assert all((ROOT / test).exists() for test in TESTS)


def test_the_tests_of_the_tables_are_there() -> None:
    table = (ROOT / "docs" / "mutations.md").read_text(encoding="utf-8")
    names = set(re.findall(r"`([\w/]+\.py)::(\w+)", table))
    assert len(names) > 50
    missing = [
        f"{file}::{name}"
        for file, name in sorted(names)
        if not (path := ROOT / "tests" / file).is_file() or f"def {name}(" not in path.read_text(encoding="utf-8")
    ]
    assert missing == []

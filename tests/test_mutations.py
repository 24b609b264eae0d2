"""The list of wrong parameters fits the sources, each number once; the tests that must catch it, or have, exist."""

from __future__ import annotations

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

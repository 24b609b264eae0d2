"""Helpers and common messages of the tests of wrong input."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.command import CommandOutcome, cmg_mj

RATE = "must be a number greater than or equal to 0.1 and at most 1e+06"
OVER_0, FROM_0 = "must be a number greater than 0", "must be a number greater than or equal to 0"
WHOLE = "must be a whole number greater than or equal to 0"
GRID = "not a whole number of physics steps of 0.001 s"


def table(*rows: tuple) -> pytest.MarkDecorator:
    """Parametrise with rows (what, input, expected fragments...)."""
    return pytest.mark.parametrize(
        ("wrong_input", "fragments"),
        [pytest.param(wrong_input, fragments, id=case) for case, wrong_input, *fragments in rows],
    )


def check(text: str | bytes) -> CommandOutcome:
    Path("my.toml").write_bytes(text.encode() if isinstance(text, str) else text)
    return cmg_mj("check", "my.toml")


def assert_in_order(fragments: list[str], line: str) -> None:
    assert re.search(".*".join(map(re.escape, fragments)), line), (fragments, line)

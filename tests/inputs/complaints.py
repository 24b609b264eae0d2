"""Helpers and common messages of the tests of wrong input."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.command import CommandOutcome, cmg_mj


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

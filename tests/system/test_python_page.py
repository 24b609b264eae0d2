"""docs/python.md: every block runs, one after the other, and prints what the page says."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path

import pytest

from tests.command import ROOT

PAGE = ROOT / "docs/python.md"
TEXT = PAGE.read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```(?:\n\n```text\n(.*?)```)?", TEXT, flags=re.DOTALL)
"""The code of each block, and what the page says that it prints."""


def run_blocks(blocks: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """Run blocks in one session: what each should print, and what it printed."""
    session, printed = {"__name__": "__main__"}, []
    for i, (code, wanted) in enumerate(blocks):
        output = io.StringIO()
        with contextlib.redirect_stdout(output):
            exec(compile(code, f"{PAGE.name}, block {i + 1}", "exec", dont_inherit=True), session)
        printed.append((wanted, output.getvalue()))
    return printed


@pytest.mark.slow
def test_every_block_prints_what_the_page_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for wanted, printed in run_blocks(BLOCKS):
        assert printed == wanted
    assert list(tmp_path.iterdir()) == []

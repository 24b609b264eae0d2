"""docs/gains.md shows what its study prints, and the law of docs/laws.md is one."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import cmg_mj
from cmg_mj.controllers.dry_run import dry_run_law
from cmg_mj.controllers.laws.state_feedback import TABLE_2_GAINS, lqr_gains
from tests.command import ROOT, environment

PAGE = (ROOT / "docs/gains.md").read_text(encoding="utf-8")


def rows(text: str) -> list[list[str]]:
    """Cells of the tables' rows."""
    lines = [line for line in text.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


@pytest.mark.slow
def test_the_tables_are_those_of_the_study(tmp_path: Path) -> None:
    """But for what depends on how many worlds there are."""
    command = [sys.executable, ROOT / "docs/studies/gains.py", "--worlds", "1"]
    process = subprocess.run(command, cwd=tmp_path, env=environment(), capture_output=True, text=True, check=True)
    printed, shown = rows(process.stdout), rows(PAGE)
    assert len(printed) == 3 + 5 + 15 + 10
    fixed = {4: 4, 9: 6, 6: 3}
    for cells in printed:
        part = cells[: fixed[len(cells)]]
        assert any(other[: len(part)] == part for other in shown), part
    assert list(tmp_path.iterdir()) == []


def test_the_weights_have_nearly_the_gains_of_table_2() -> None:
    (weights,) = re.findall(r"^state_cost = \[([\d., ]+)\]", PAGE, flags=re.MULTILINE)
    model = cmg_mj.load_plant().reduced
    gains = lqr_gains(model, [float(weight) for weight in weights.split(",")], 1.0)
    assert gains == pytest.approx(TABLE_2_GAINS, abs=0.35)
    shown = ", ".join(f"{gain:.3g}" for gain in gains)
    assert f"| the papers'                             | `lqr`              | {shown} " in PAGE


def test_the_law_of_the_page_of_laws_is_one() -> None:
    text = (ROOT / "docs/laws.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    names: dict = {"__name__": __name__}
    exec(compile(code, "laws.md", "exec", dont_inherit=True), names)
    dry_run_law(names["TwoGains"](dt=0.005, rate_limit=4.7), 0, None)

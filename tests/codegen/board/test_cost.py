"""The cost of an update on the emulated board."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from cmg_mj.codegen.board import Board
from cmg_mj.codegen.board.cost import CostFigures, ObserverCost, cost_markdown, cost_of, cost_table
from cmg_mj.codegen.board.deploy import temporary_export
from cmg_mj.codegen.board.tools import available
from cmg_mj.papers.aranovskiy2020 import on_the_board
from tests.codegen.board.toy import short, toy

pytestmark = pytest.mark.skipif(not available(), reason="the cross-compiler, QEMU or CasADi is not installed")


@pytest.mark.slow
def test_what_they_cost() -> None:
    linear, homogeneous = (cost_of(run, run.axis_controller()) for run in map(short, ("linear", "homogeneous")))
    assert linear["step_instructions"] < 0.1 * homogeneous["step_instructions"]
    for row in (linear, homogeneous):
        assert row["step_instructions"] < row["update_instructions"] <= row["update_instructions_most"]
        assert row["update_us_at_216_mhz"] == pytest.approx(row["update_instructions"] / 216.0)
        assert 40 <= row["stack_bytes"] <= 1000
        assert 100 <= row["flash_bytes"] <= 20_000
    # Of the observer tilt, rate and last sample; integrator, last command, whether it has started, status.
    assert linear["state_bytes"] == 7 * 4
    rows: list[ObserverCost] = [{"observer": "linear", **linear}]
    figures: CostFigures = {"processor": "", "clock_mhz": 216.0, "cycles_an_instruction": 1.0, "figures": rows}
    assert cost_markdown(figures).splitlines()[2].startswith("| linear")
    assert cost_table(figures).row_count == 1


@pytest.mark.slow
def test_most_of_11_is_powers(tmp_path: Path) -> None:
    """Why (11) costs more than (10): four powers an update, which are more than half of it."""
    with temporary_export(short("homogeneous").axis_controller()) as files:
        powers = (files.folder / "homogeneous.c").read_text().count("powf(")
    steps = []
    for more in ("", "extern float powf(float, float); y1 = powf(y1, y2);"):
        with Board(toy(tmp_path, step=more), counting=True) as board:
            steps.append(board.step(0.013, 0.85, 0.0, 0.0)[1].instructions)
    assert powers == 4
    assert powers * (steps[1] - steps[0]) > 0.5 * json.loads(on_the_board.RECORDED.read_text())["homogeneous"]

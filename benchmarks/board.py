"""Measures the cost of an update on an emulated Cortex-M7: instructions, stack, memory, flash.

python benchmarks/board.py [--observers gyro_free] [--markdown] [--json] (three seconds an observer)
python benchmarks/board.py --paper    writes what papers/aranovskiy2020 reads
"""

from __future__ import annotations

import argparse
import json
import statistics
from collections.abc import Sequence
from typing import TypedDict

from rich import box
from rich.console import Console
from rich.table import Table

from cmg_mj.core.controller import Controller
from cmg_mj.features.board import Board, Cost, temporary_export
from cmg_mj.features.board.image import FIRMWARE, build, require
from cmg_mj.features.board.processor import run_on
from cmg_mj.observers import OBSERVERS
from cmg_mj.papers.aranovskiy2020.forms_of_10 import Plain
from cmg_mj.papers.aranovskiy2020.paper import OBSERVERS as PAPER_OBSERVERS
from cmg_mj.papers.aranovskiy2020.riccati import PLAIN, RECORDED
from cmg_mj.results.result import Result
from cmg_mj.results.tables import markdown_table
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario, parse_scenario
from cmg_mj.scenario.schema import Scenario

SECONDS = 2.5
"""Time of push_recovery over which costs are measured at every tick; its push begins at 2 s [s]."""

CLOCK_MHZ = 216.0
"""Clock of the papers' STM32F746 [MHz]."""

COLUMNS = {
    "observer": ("observer", "{}"),
    "instructions: observer": ("step_instructions", "{:.0f}"),
    "at most": ("step_instructions_most", "{:.0f}"),
    "whole update": ("update_instructions", "{:.0f}"),
    "at most ": ("update_instructions_most", "{:.0f}"),
    "[us]": ("update_us_at_216_mhz", "{:.1f}"),
    "stack [B]": ("stack_bytes", "{:.0f}"),
    "state [B]": ("state_bytes", "{:.0f}"),
    "flash [B]": ("flash_bytes", "{:.0f}"),
}
"""Heading -> the key of a figure and its format."""


class UpdateCost(TypedDict):
    """The cost of a controller on the board; instructions are a median and a largest number."""

    step_instructions: float
    step_instructions_most: int
    update_instructions: float
    update_instructions_most: int
    update_us_at_216_mhz: float
    stack_bytes: int
    state_bytes: int
    flash_bytes: int
    ticks: int


class ObserverCost(UpdateCost):
    """The cost of a controller with one of the observers."""

    observer: str


class CostFigures(TypedDict):
    """The costs of observers, as `--json` prints them."""

    processor: str
    clock_mhz: float
    cycles_an_instruction: float
    figures: list[ObserverCost]


def cost_scenario(observer: str) -> Scenario:
    """Load the scenario on which an observer's cost is measured."""
    return load_scenario("push_recovery", [f"duration_s={SECONDS}", "open_loop_observers=[]"], observer)


def measure(observers: Sequence[str]) -> CostFigures:
    """Measure the costs of observers, each in a run with the board.

    Args:
        observers: Names of the observers.

    Returns:
        The figures.

    Raises:
        InputError: A program is not installed, or an observer cannot be exported.
    """
    require()
    rows: list[ObserverCost] = []
    for run in [prepare(cost_scenario(observer)) for observer in observers]:
        rows.append({"observer": run.scenario.observer.kind, **cost_of(run, run.axis_controller())})
    return {
        "processor": "Cortex-M7, single precision, emulated",
        "clock_mhz": CLOCK_MHZ,
        "cycles_an_instruction": 1.0,
        "figures": rows,
    }


def cost_of(run: Experiment, controller: Controller) -> UpdateCost:
    """Measure the cost of a controller on the board.

    Args:
        run: The experiment; the controller on the board closes its loop, and all ticks count.
        controller: The controller of the experiment, or one that estimates the same signals.

    Returns:
        The cost.
    """
    with temporary_export(controller) as (observer, folder):
        empty = build(observer, folder, FIRMWARE / "empty.c")  # of the controller and its part of the C library
        flash = build(observer, folder).flash - empty.flash
        board = Board(build(observer, folder).path, counting=True)
    with board:
        result = run_on(run, board)
        updates = board.costs[1:]  # the first only starts the observer
        steps = _steps(board, result)
        sizes = board.sizes
    update, update_most = _instructions(updates)
    step, step_most = _instructions(steps)
    return {
        "step_instructions": step,
        "step_instructions_most": step_most,
        "update_instructions": update,
        "update_instructions_most": update_most,
        "update_us_at_216_mhz": update / CLOCK_MHZ,
        "stack_bytes": max(cost.stack for cost in updates),
        "state_bytes": sizes.controller,
        "flash_bytes": flash,
        "ticks": len(updates),
    }


def _steps(board: Board, result: Result) -> list[Cost]:
    """Measure the observer alone, on the measurements of a run of the whole controller."""
    if result.outcomes[0].kind == "interrupted":
        raise KeyboardInterrupt
    assert result.trajectory is not None
    names = ("y1_rad", "y2_rad", "acceleration_rad_s2", "u_rad_s")
    y1, y2, acceleration, u = (result.trajectory[name].tolist() for name in names)
    board.init(y1[0], y2[0], acceleration[0])
    ticks = zip(y1[1:], y2[1:], acceleration[1:], u, strict=False)  # u of the tick before
    return [board.step(*tick)[1] for tick in ticks]


def _instructions(costs: Sequence[Cost]) -> tuple[float, int]:
    """Return median and maximum."""
    counts = [cost.instructions for cost in costs]
    return statistics.median(counts), max(counts)


def cost_table(figures: CostFigures) -> Table:
    """Make the table that is printed."""
    printed = Table(
        title="An update on a Cortex-M7 in single precision: instructions counted by QEMU, median and most over "
        f"{SECONDS:g} s of push_recovery;\nmicroseconds at {CLOCK_MHZ:g} MHz are an estimate: one cycle an instruction",
        box=box.SIMPLE_HEAD,
        title_justify="left",
    )
    for heading in COLUMNS:
        printed.add_column(heading.strip(), justify="left" if heading == "observer" else "right")
    for row in _cells(figures):
        printed.add_row(*row)
    return printed


def cost_markdown(figures: CostFigures) -> str:
    """Write the table of costs in Markdown."""
    return markdown_table([heading.strip() for heading in COLUMNS], _cells(figures))


def _cells(figures: CostFigures) -> list[list[str]]:
    rows = [dict(row) for row in figures["figures"]]
    return [[pattern.format(row[key]) for key, pattern in COLUMNS.values()] for row in rows]


def count_for_paper() -> dict[str, float]:
    """Count aranovskiy2020's observers, along half a second in which the rig comes back from one degree."""
    runs = {
        name: prepare(
            parse_scenario({"duration_s": 0.5, "plant": {"initial_tilt_deg": 1.0}, "observer": {"kind": name}})
        )
        for name in PAPER_OBSERVERS
    }
    counts = {name: cost_of(run, run.axis_controller())["step_instructions"] for name, run in runs.items()}
    of_10 = runs["ltv"]
    for name, method in PLAIN.items():
        counts[name] = cost_of(of_10, of_10.axis_controller(observer=Plain(method)))["step_instructions"]
    return counts


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--observers", default=",".join(name for name in OBSERVERS if name != "mems_fused"), metavar="NAMES"
    )
    parser.add_argument("--markdown", action="store_true")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--paper", action="store_true")
    options = parser.parse_args()
    if options.paper:
        RECORDED.write_text(json.dumps(count_for_paper(), indent=2) + "\n", encoding="utf-8")
    else:
        figures = measure(options.observers.split(","))
        if options.json:
            print(json.dumps(figures, indent=2))
        elif options.markdown:
            print(cost_markdown(figures))
        else:
            Console().print(cost_table(figures))

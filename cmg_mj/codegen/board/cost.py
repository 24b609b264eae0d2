"""What an update of each observer costs on a Cortex-M7: instructions, stack, memory, flash."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from rich import box
from rich.table import Table

from cmg_mj.codegen.board.deploy import exported
from cmg_mj.codegen.board.image import build, flash_of
from cmg_mj.codegen.board.qemu import Board, Cost
from cmg_mj.codegen.board.tools import require
from cmg_mj.controllers.controller import Controller
from cmg_mj.controllers.processor import Processor
from cmg_mj.results.markdown import table
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.scenario.schema import Scenario

SECONDS = 2.5
"""Of push_recovery, whose push begins at 2 s: so long the costs are taken down, tick after tick."""

CLOCK_MHZ = 216.0
"""Of the papers' STM32F746."""

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
"""Heading -> the figure and how it is printed."""


class EndedRun(Protocol):
    """What is needed of a `simulate.Result`, whose room uses MuJoCo and lies below this one."""

    @property
    def outcomes(self) -> Sequence[Any]:
        """How each world ended."""
        ...

    @property
    def trajectory(self) -> Trajectory | None:
        """What is kept of it."""
        ...


class Run(Protocol):
    """What is needed of an `experiment.Experiment`, which closes its loop by a board and so lies below this room."""

    @property
    def scenario(self) -> Scenario:
        """What it was made from."""
        ...

    def axis_controller(self) -> Controller:
        """A fresh controller."""
        ...

    def run_on(self, processor: Processor, /) -> EndedRun:
        """One world, its control decisions taken by a processor."""
        ...


def counted_on(observer: str) -> Scenario:
    """What an observer's costs are taken down on."""
    return load_scenario("push_recovery", [f"duration_s={SECONDS}"], observer)


def measure(runs: Sequence[Run], on_progress: Callable[[float], None]) -> dict[str, Any]:
    """Count what observers cost, each along its own run on the board.

    Args:
        runs: An `Experiment` an observer, such as `prepare(counted_on("linear"))`.
        on_progress: Called with the share done.

    Returns:
        The figures, as `--json` prints them.

    Raises:
        InputError: What is needed is not installed, or an observer cannot be exported.
    """
    require()
    rows = []
    for i, run in enumerate(runs):
        rows.append({"observer": run.scenario.observer.kind} | cost_of(run, run.axis_controller()))
        on_progress((i + 1.0) / len(runs))
    return {
        "processor": "Cortex-M7, single precision, emulated",
        "clock_mhz": CLOCK_MHZ,
        "cycles_an_instruction": 1.0,
        "figures": rows,
    }


def cost_of(run: Run, controller: Controller) -> dict[str, Any]:
    """What a controller costs on the board.

    Args:
        run: An `Experiment`, along which it is counted, closed by the controller itself; all ticks count.
        controller: The controller, that of the experiment or one that estimates the same signals.

    Returns:
        Its figures.
    """
    with exported(controller) as files:
        flash = flash_of(files.observer, files.folder)
        board = Board(build(files.observer, files.folder).path, counting=True)
    with board:
        result = run.run_on(board)
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


def _steps(board: Board, result: EndedRun) -> list[Cost]:
    """What the observer alone takes, given what the controller around it has been given."""
    if result.outcomes[0].kind == "interrupted":
        raise KeyboardInterrupt
    assert result.trajectory is not None
    names = ("y1_rad", "y2_rad", "acceleration_rad_s2", "u_rad_s")
    y1, y2, acceleration, u = (result.trajectory[name].tolist() for name in names)
    board.init(y1[0], y2[0], acceleration[0])
    ticks = zip(y1[1:], y2[1:], acceleration[1:], u, strict=False)  # u of the tick before
    return [board.step(*tick)[1] for tick in ticks]


def _instructions(costs: Sequence[Cost]) -> tuple[float, int]:
    """Median and most."""
    counts = [cost.instructions for cost in costs]
    return statistics.median(counts), max(counts)


def cost_table(figures: dict[str, Any]) -> Table:
    """The table that `cmg-mj bench board` prints."""
    shown = Table(
        title="An update on a Cortex-M7 in single precision: instructions counted by QEMU, median and most over "
        f"{SECONDS:g} s of push_recovery;\nmicroseconds at {CLOCK_MHZ:g} MHz are an estimate: one cycle an instruction",
        box=box.SIMPLE_HEAD,
        title_justify="left",
    )
    for heading in COLUMNS:
        shown.add_column(heading.strip(), justify="left" if heading == "observer" else "right")
    for row in _cells(figures):
        shown.add_row(*row)
    return shown


def cost_markdown(figures: dict[str, Any]) -> str:
    """The same as Markdown."""
    return table([heading.strip() for heading in COLUMNS], _cells(figures))


def _cells(figures: dict[str, Any]) -> list[list[str]]:
    return [[pattern.format(row[key]) for key, pattern in COLUMNS.values()] for row in figures["figures"]]

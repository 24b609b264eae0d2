"""The options of a run on a real board."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from cmg_mj.cli.arguments import Command, RunArguments, all_of
from cmg_mj.cli.terminal import note
from cmg_mj.errors import InputError

if TYPE_CHECKING:
    from cmg_mj.codegen.board import WiredBoard
    from cmg_mj.simulation.experiment import Experiment

LONGEST_DEADLINE_MS = 60_000.0
"""Longest deadline of a tick [ms]."""
HIGHEST_BAUD = 12_000_000
"""Highest baud rate of the usual converters [1/s]."""

_OPTIONS = all_of(
    click.option(
        "--port",
        metavar="PORT",
        help="With --driver board: a real board on a serial port such as /dev/ttyACM0, or at tcp:HOST:PORT.",
    ),
    click.option("--baud", type=int, metavar="RATE", help="Baud rate of the serial port.  [default: 460800]"),
    click.option(
        "--deadline-ms",
        type=float,
        metavar="MS",
        help="Time for the board to answer; without an answer its last command is held.  [default: the control period]",
    ),
    click.option(
        "--max-lost", type=int, metavar="N", help="End the run when N ticks in a row are lost.  [default: 20]"
    ),
)


@dataclass(frozen=True)
class WireOptions:
    """The options `--port`, `--baud`, `--deadline-ms` and `--max-lost`.

    Attributes:
        port: The board's port; None for no real board.
        baud: Baud rate of a serial port [1/s].
        deadline_ms: Time for an answer [ms].
        max_lost: Number of ticks lost in a row that ends the run.
    """

    port: str | None
    baud: int | None
    deadline_ms: float | None
    max_lost: int | None

    def check(self, driver: str) -> None:
        """Refuse options that do not fit each other or the driver."""
        if self.port is None:
            for option, value in (
                ("--baud", self.baud),
                ("--deadline-ms", self.deadline_ms),
                ("--max-lost", self.max_lost),
            ):
                if value is not None:
                    raise InputError(f"{option}: goes with --port, the port of a real board")
            return
        if driver != "board":
            raise InputError(f"--port {self.port}: goes with --driver board, not {driver}")
        if not self.port:
            raise InputError("--port '': name a serial port such as /dev/ttyACM0, or tcp:HOST:PORT")
        if self.baud is not None and not 0 < self.baud <= HIGHEST_BAUD:
            raise InputError(f"--baud {self.baud}: must be 1 to {HIGHEST_BAUD}")
        if self.deadline_ms is not None and not 0.0 < self.deadline_ms <= LONGEST_DEADLINE_MS:
            raise InputError(
                f"--deadline-ms {self.deadline_ms:g}: must be above 0 and at most {LONGEST_DEADLINE_MS:g} ms"
            )
        if self.max_lost is not None:
            from cmg_mj.codegen.board.wired_board import LARGEST_MAX_LOST

            if not 0 < self.max_lost <= LARGEST_MAX_LOST:
                raise InputError(f"--max-lost {self.max_lost}: must be 1 to {LARGEST_MAX_LOST}")

    def connect(self, experiment: Experiment) -> WiredBoard | None:
        """Connect to the board until the command ends; None without a port."""
        if self.port is None:
            return None
        from cmg_mj.codegen.board import on_a_wire
        from cmg_mj.codegen.board.wired_board import MAX_LOST

        controller = experiment.axis_controller()
        connection = on_a_wire(
            controller,
            self.port,
            baud=self.baud,
            deadline_s=None if self.deadline_ms is None else 1e-3 * self.deadline_ms,
            max_lost=MAX_LOST if self.max_lost is None else self.max_lost,
        )
        board = click.get_current_context().with_resource(connection)
        if not board.checksum_compared:
            note("casadi is not installed: the board's numbers were not compared with the scenario's")
        return board


def wire_options(command: Command) -> Command:
    """Add the options of a run on a real board, which the command takes as one `WireOptions`."""

    @functools.wraps(command)
    def with_options(
        *arguments: RunArguments,
        port: str | None,
        baud: int | None,
        deadline_ms: float | None,
        max_lost: int | None,
        **others: Any,
    ) -> None:
        command(*arguments, wire=WireOptions(port, baud, deadline_ms, max_lost), **others)

    return _OPTIONS(with_options)

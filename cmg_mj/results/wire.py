"""The settings and records of a run over a wire."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from cmg_mj.results.summary_keys import Summary, SummaryValue

WIRE = "wire"
"""Key of a summary's part on the wire."""
BOARD_LOG = "board.frames"
"""File of the frames of a run, as `replay` takes it."""


class WireSettings(NamedTuple):
    """The settings of a wire; None for the default of one.

    Attributes:
        port: The board's port.
        baud: Baud rate of a serial port [1/s].
        deadline_ms: Time for an answer [ms].
        max_lost: Number of ticks lost in a row that ends a run.
    """

    port: str
    baud: int | None = None
    deadline_ms: float | None = None
    max_lost: int | None = None

    def options(self) -> list[str]:
        """Return the options with which a command runs over this wire."""
        numbers = (("--baud", self.baud), ("--deadline-ms", self.deadline_ms), ("--max-lost", self.max_lost))
        words = [word for option, value in numbers if value is not None for word in (option, f"{value:.12g}")]
        return ["--port", self.port, *words]


@dataclass(frozen=True)
class WireReport:
    """A run's exchange with a real board.

    Attributes:
        settings: The settings of the wire.
        figures: Deadlines, losses and round trips, as `--json` prints them.
        log: The frames, as `replay` takes them.
    """

    settings: WireSettings
    figures: Summary
    log: bytes


def wire_line(summary: Mapping[str, SummaryValue]) -> str:
    """Say in a sentence how the wire of a run did; empty if there was none."""
    wire = summary.get(WIRE)
    if not isinstance(wire, Mapping):
        return ""
    trip, update = wire.get("round_trip_ms"), wire.get("update_us")
    parts = [
        f"Wire {wire['port']} ({wire['board']}): {wire['ticks']:,} ticks",
        f"round trip median {trip['median']:.2f} ms, 99 % {trip['percentile_99']:.2f}, most {trip['most']:.2f}, "
        f"deadline {wire['deadline_ms']:g}"
        if isinstance(trip, Mapping)
        else "no answer in time",
        f"{wire['sent_again']:,} sent again, {wire['lost']:,} lost with the command held (at most "
        f"{wire['lost_in_a_row']:,} in a row)",
        f"{wire['late_or_doubled']:,} answers late or doubled, {wire['refused_by_board']:,} refusals by the board, "
        f"{wire['damaged_from_board']:,} frames damaged on the way back",
        *(
            [f"update on the board median {update['median']:.1f} us, most {update['most']:.1f}"]
            if isinstance(update, Mapping)
            else []
        ),
    ]
    return "; ".join(parts)

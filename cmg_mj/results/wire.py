"""What a run over a wire leaves beside its figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cmg_mj.results.summary_keys import Summary, SummaryValue

WIRE = "wire"
"""Key of a summary's part on the wire."""
BOARD_LOG = "board.frames"
"""File of the frames of a run, as `replay` takes it."""


@dataclass(frozen=True)
class WireReport:
    """A run's exchange with a real board.

    Attributes:
        port: The board's port.
        figures: Deadlines, losses and round trips, as `--json` prints them.
        log: The frames, as `replay` takes them.
    """

    port: str
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

"""A board's log, whose columns, rate and accelerometers are known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from cmg_mj.codegen.board.log_file import COLUMNS, BoardLog, is_board_log, read_board_log
from cmg_mj.replay.logs.log import ReadOptions
from cmg_mj.replay.logs.table import MOST_ROWS, head_of


def board_log_at(path: Path) -> BoardLog | None:
    """Read a board's log; None for any other file, and for none."""
    return read_board_log(path, MOST_ROWS) if path.is_file() and is_board_log(head_of(path)) else None


def board_log_options(log: BoardLog, options: ReadOptions) -> ReadOptions:
    """Return the options of a board's log with its columns and radii filled in."""
    columns = {role: heading for role, heading in COLUMNS.items() if heading in log.columns}
    return replace(options, columns=columns, radii_m=options.radii_m or log.identity.radii_m)

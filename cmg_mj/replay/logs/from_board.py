"""A board's log, whose columns, rate and accelerometers are known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from cmg_mj.codegen.board.log_file import COLUMNS, is_board_log, read_board_log
from cmg_mj.replay.logs.log import ReadOptions
from cmg_mj.replay.logs.table import MOST_ROWS, head_of


def board_log_options(path: Path, options: ReadOptions) -> ReadOptions | None:
    """Return the options of a board's log with its columns and radii filled in; None for any other file."""
    if not path.is_file() or not is_board_log(head_of(path)):
        return None
    log = read_board_log(path, MOST_ROWS)
    columns = {role: heading for role, heading in COLUMNS.items() if heading in log.columns}
    return replace(options, columns=columns, radii_m=options.radii_m or log.identity.radii_m)

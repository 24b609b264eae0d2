"""Runs an exported controller on an emulated Cortex-M7: a processor in the loop.

with on_a_board(controller) as board:
    decision = board.update(accelerations, encoders)
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from cmg_mj.core.controller import Controller
from cmg_mj.features.board.image import build, require
from cmg_mj.features.board.processor import refuse_gyro
from cmg_mj.features.board.qemu import Board, Cost
from cmg_mj.features.export import export

__all__ = ["Board", "Cost", "on_a_board", "temporary_export"]


@contextmanager
def temporary_export(controller: Controller) -> Iterator[tuple[str, Path]]:
    """Export a controller in single precision to a temporary folder.

    Args:
        controller: The controller.

    Yields:
        The controller's name in C, and the folder of the files, which is deleted at the end.

    Raises:
        InputError: The controller cannot be exported, or needs a gyro.
    """
    refuse_gyro(controller.observer)
    with TemporaryDirectory(prefix="cmg_mj-board-") as folder:
        export(controller, Path(folder), precision="single", name="on_board")
        yield "on_board", Path(folder)


@contextmanager
def on_a_board(controller: Controller) -> Iterator[Board]:
    """Export a controller, build it, and start an emulated board with it.

    Args:
        controller: The controller.

    Yields:
        The board, which stops at the end.

    Raises:
        InputError: A program is not installed, or the controller cannot be exported.
        RunStopped: The board does not start.
    """
    require()
    with temporary_export(controller) as (observer, folder):
        board = Board(build(observer, folder).path)
    with board:  # it has loaded its image: the files may go
        yield board

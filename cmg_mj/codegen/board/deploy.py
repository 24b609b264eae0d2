"""A controller put on an emulated board."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from cmg_mj.codegen.board.image import build
from cmg_mj.codegen.board.qemu import Board
from cmg_mj.codegen.board.tools import require
from cmg_mj.codegen.export import export
from cmg_mj.codegen.export.names import name_of
from cmg_mj.controllers.controller import Controller
from cmg_mj.errors import InputError


class Exported(NamedTuple):
    """A controller in C of single precision.

    Attributes:
        observer: The observer's name in C.
        folder: Where the files are.
    """

    observer: str
    folder: Path


@contextmanager
def exported(controller: Controller) -> Iterator[Exported]:
    """Export a controller to a folder that is gone at the end.

    Args:
        controller: What is exported: its observer and all around it.

    Yields:
        Where it is.

    Raises:
        InputError: It cannot be exported.
    """
    if controller.feedback != "observer":
        raise InputError(
            f"controller.feedback = {controller.feedback!r}: a board has no such sensor; it closes the loop on its own "
            "estimate, 'observer'"
        )
    with TemporaryDirectory(prefix="cmg_mj-board-") as folder:
        header = export(controller, Path(folder), precision="single", name=_name_of(controller))[0]
        yield Exported(header.stem, Path(folder))


def _name_of(controller: Controller) -> str:
    """Its observer's, or any where C cannot spell that: nobody is shown this C."""
    try:
        return name_of(controller.observer)
    except InputError:
        return "own"


@contextmanager
def on_a_board(controller: Controller, *, counting: bool = False) -> Iterator[Board]:
    """Export a controller, build it, and start an emulated board with it.

    Args:
        controller: What runs on the board: its observer and all around it.
        counting: Whether the board counts instructions, which makes it slower.

    Yields:
        The board, which ends with this.

    Raises:
        InputError: What is needed is not installed, or the controller cannot be exported.
        RunStopped: The board does not start.
    """
    require()
    with exported(controller) as files:
        board = Board(build(files.observer, files.folder).path, counting=counting)
    with board:  # it has its image by now
        yield board

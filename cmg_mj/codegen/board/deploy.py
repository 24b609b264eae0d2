"""Exports a controller, builds it, and starts a board with it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from cmg_mj.codegen.board.identity import identity_of, require_own_estimate
from cmg_mj.codegen.board.image import build
from cmg_mj.codegen.board.qemu import Board
from cmg_mj.codegen.board.tools import require
from cmg_mj.codegen.export import export
from cmg_mj.codegen.export.names import name_of
from cmg_mj.core.controller import Controller
from cmg_mj.errors import InputError


class ExportedFiles(NamedTuple):
    """The files of a controller in C of single precision.

    Attributes:
        observer: The observer's name in C.
        folder: Folder of the files.
        identity: The text with which a board that runs it introduces itself.
    """

    observer: str
    folder: Path
    identity: str


@contextmanager
def temporary_export(controller: Controller) -> Iterator[ExportedFiles]:
    """Export a controller to a temporary folder.

    Args:
        controller: The controller.

    Yields:
        The files, which are deleted at the end.

    Raises:
        InputError: The controller cannot be exported.
    """
    require_own_estimate(controller)
    with TemporaryDirectory(prefix="cmg_mj-board-") as folder:
        header, source, *_ = export(controller, Path(folder), precision="single", name=_name_of(controller))
        identity = identity_of(controller, header.stem, source.read_text(encoding="utf-8")).text()
        yield ExportedFiles(header.stem, Path(folder), identity)


def _name_of(controller: Controller) -> str:
    """Name the observer in C, with any name if C cannot spell its own: no user sees this C."""
    try:
        return name_of(controller.observer)
    except InputError:
        return "own"


@contextmanager
def on_a_board(controller: Controller, *, counting: bool = False) -> Iterator[Board]:
    """Export a controller, build it, and start an emulated board with it.

    Args:
        controller: The controller.
        counting: Whether the board counts instructions, which makes it slower.

    Yields:
        The board, which stops at the end.

    Raises:
        InputError: A program is not installed, or the controller cannot be exported.
        RunStopped: The board does not start.
    """
    require()
    with temporary_export(controller) as files:
        board = Board(build(files.observer, files.folder).path, counting=counting)
    with board:  # it has loaded its image: the files may go
        yield board

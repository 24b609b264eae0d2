"""A recording shown in a notebook's cell."""

from __future__ import annotations

import contextlib
import importlib
import io
import os
from pathlib import Path
from typing import Any

from cmg_mj.errors import InputError

SERVED_HERE = "serve-local"
"""Rerun's name for a server on localhost."""


def show_recording(path: Path | str, *, height: int = 600) -> Any:
    """Show a recording in the cell of a notebook: make this call the cell's last line.

    The viewer runs in the browser and holds the whole recording in memory. This process serves the viewer's code on a
    port of localhost. For a notebook on another computer set `RERUN_NOTEBOOK_ASSET=inline` before the first call: the
    code, 20 MB, is then part of the cell.

    Args:
        path: The file, `recording.rrd`, of a run or a comparison.
        height: Height of the viewer [px]. The viewer is as wide as the cell.

    Returns:
        The viewer: a Jupyter widget, `rerun_notebook.Viewer`.

    Raises:
        InputError: The file cannot be read, or rerun's notebook viewer is not installed.
    """
    try:
        recording = Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    os.environ.setdefault("RERUN_NOTEBOOK_ASSET", SERVED_HERE)  # by itself rerun fetches the code from its own site
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # it prints the port
            viewer = importlib.import_module("rerun_notebook").Viewer(width="auto", height=height)
    except ImportError as error:
        raise InputError(
            "show_recording: rerun's notebook viewer is not installed. Install it with `python -m pip install "
            f'"cmg_mj[notebook]"`, or run `rerun {path}`'
        ) from error
    viewer.send_rrd(recording)
    return viewer

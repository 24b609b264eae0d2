"""Writes a recording to its file, whole or not at all; rerun's warnings become errors."""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from cmg_mj.errors import InputError
from cmg_mj.results.files import whole_file
from cmg_mj.visualization.recording.signals import Lines

LONGEST_LIST = 120
"""Longest list of runs in an application's name [characters]."""


@contextmanager
def open_recording(path: Path, name: str, application: str, blueprint: rrb.Blueprint) -> Iterator[rr.RecordingStream]:
    """Open a recording to log to; write its file at the end.

    Args:
        path: The file.
        name: Name of the recording.
        application: Result of `application_name`.
        blueprint: Layout in which the recording opens.

    Yields:
        The recording.

    Raises:
        InputError: The environment turns rerun off.
        OSError: The file cannot be written.
    """
    with strict(), rr.RecordingStream(application) as rec:
        require_enabled(rec)
        # Rerun's own writing to a file hides a full disk, or waits for ever.
        memory = rec.memory_recording()
        try:
            rec.send_blueprint(blueprint, make_active=False, make_default=True)
            set_up(rec, name)
            yield rec
        finally:  # rerun would complain on standard error about data left in memory
            content = memory.drain_as_bytes()
    with whole_file(path) as temporary:
        temporary.write_bytes(content)


def require_enabled(rec: rr.RecordingStream) -> None:
    """Refuse to record where the environment turns rerun off.

    Raises:
        InputError: The environment variable RERUN turns rerun off.
    """
    if not rr.is_enabled(rec):
        raise InputError("the environment variable RERUN turns recording off: unset it")


def set_up(rec: rr.RecordingStream, name: str) -> None:
    """Name a recording, and make simulated time its only timeline."""
    rec.set_log_time_enabled(False)
    rec.set_log_tick_enabled(False)
    rec.send_recording_name(name)


def application_name(names: Sequence[str], branches: Sequence[Lines]) -> str:
    """Name the application of a recording.

    The viewer remembers a layout by application: recordings with other branches or lines must not share its name.
    The name may have about 180 characters, few of them punctuation.
    """
    run_names = " ".join(names)
    if len(run_names) > LONGEST_LIST:
        run_names = f"{len(names)} runs"
    lines = " ".join(f"{branch.path}/{path}" for branch in branches for path in branch.series)
    return re.sub(r"[^\w -]", "-", f"cmg-mj {run_names} {zlib.crc32(lines.encode()):08x}", flags=re.ASCII)


def log_page(rec: rr.RecordingStream, path: str, page: str) -> None:
    """Record a page of Markdown."""
    rec.log(path, rr.TextDocument(page, media_type=rr.MediaType.MARKDOWN), static=True)


@contextmanager
def strict() -> Iterator[None]:
    """Make rerun raise where it would only warn."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    finally:
        rr.set_strict_mode(before)

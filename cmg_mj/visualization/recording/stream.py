"""Writes a recording to its file, whole or not at all; rerun's warnings become errors."""

from __future__ import annotations

import os
import re
import threading
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import rerun as rr
import rerun.blueprint as rrb

from cmg_mj.errors import InputError
from cmg_mj.results.files import whole_file
from cmg_mj.visualization.recording.signals import Lines

PIPES = "/dev/fd"
"""Folder in which a process finds its pipes as files."""
PIPED = 1 << 20
"""Largest number of bytes read from a pipe at once."""

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
    with whole_file(path) as temporary, strict(), rr.RecordingStream(application) as rec:
        require_enabled(rec)
        with _written(rec, temporary):
            rec.send_blueprint(blueprint, make_active=False, make_default=True)
            set_up(rec, name)
            yield rec


@contextmanager
def _written(rec: rr.RecordingStream, path: Path) -> Iterator[None]:
    """Write what is logged to a file, while it is logged.

    Rerun's own writing to a file hides a full disk, or waits for ever: it writes to a pipe, whose other end is here.
    """
    with path.open("wb") as file:
        read_end, write_end = os.pipe()
        entry = f"{PIPES}/{write_end}"
        if not os.path.exists(entry):  # as on Windows: memory takes all of it
            os.close(read_end)
            os.close(write_end)
            memory = rec.memory_recording()
            try:
                yield
            finally:  # rerun would complain on standard error about data left in memory
                content = memory.drain_as_bytes()
            file.write(content)
            return
        pump = _Pump(read_end, file)
        try:
            try:
                rec.save(entry)
            finally:
                os.close(write_end)  # rerun has opened one of its own
            yield
        finally:
            rec.disconnect()
            pump.join()
    if pump.error is not None:
        raise pump.error


class _Pump(threading.Thread):
    """Copies a pipe to a file until its writers have closed it; what the file does not take is lost.

    Args:
        read_end: The pipe.
        file: The file.

    Attributes:
        error: The reason why the file is not whole.
    """

    def __init__(self, read_end: int, file: IO[bytes]) -> None:
        super().__init__(name="recording", daemon=True)
        self.error: OSError | ValueError | None = None
        self._read_end, self._file = read_end, file
        self.start()

    def run(self) -> None:
        """Copy."""
        with open(self._read_end, "rb", buffering=0) as pipe:
            while content := pipe.read(PIPED):
                if self.error is None:
                    try:
                        self._file.write(content)
                        self._file.flush()
                    except (OSError, ValueError) as error:  # of a full disk; of a file closed by a second Ctrl-C
                        self.error = error


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

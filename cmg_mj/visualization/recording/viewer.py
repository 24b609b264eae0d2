"""The viewer that a run is streamed to: one that is started, or one that is there already."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import IO
from urllib.parse import urlsplit

from cmg_mj.errors import InputError

LOOPBACK, PORT = "127.0.0.1", 9876
"""Nobody else's business: rerun would listen to all interfaces. The port is rerun's own."""
STARTS_WITHIN_S, STAYS_S = 30.0, 1.0
"""A viewer that has not come by then will not; one that has come and finds no screen goes within the second time."""
ANSWERS_WITHIN_S = 2.0

_started: list[Viewer] = []
"""Kept: a viewer stays when the run has ended, and nobody waits for it."""


@dataclass(frozen=True)
class Viewer:
    """A viewer of our own.

    Attributes:
        port: Where it listens, on this machine alone.
        process: It.
        errors: What it writes to standard error.
    """

    port: int
    process: subprocess.Popen
    errors: IO[bytes]

    @property
    def url(self) -> str:
        """Where runs are streamed to."""
        return url_of(str(self.port))

    def complaint(self) -> str:
        """The last it has said, in its words."""
        self.errors.seek(0)
        lines = re.sub(r"\x1b\[[\d;]*m", "", self.errors.read().decode(errors="replace")).split("\n")
        said = next((line.strip() for line in reversed(lines) if line.strip()), "it says nothing")
        return re.sub(r"^.*\.rs:\d+[:\d]*\s*", "", said).rstrip(".")  # not where in its sources


def url_of(address: str) -> str:
    """Where a viewer takes streams.

    Args:
        address: PORT, HOST:PORT, or as rerun writes it, rerun+http://HOST:PORT/proxy.

    Returns:
        The last.

    Raises:
        InputError: It is none of these.
    """
    host, port = parts_of(address)
    return f"rerun+http://{f'[{host}]' if ':' in host else host}:{port}/proxy"


def require_listening(address: str) -> None:
    """Refuse an address that nobody listens on.

    Raises:
        InputError: Nobody does, or it is no address.
    """
    host, port = parts_of(address)
    try:
        socket.create_connection((host, port), ANSWERS_WITHIN_S).close()
    except OSError as error:
        raise InputError(
            f"--connect {address!r}: no viewer listens there ({(error.strerror or str(error)).lower()}); "
            f"start one with: rerun --bind {LOOPBACK} --port {port}"
        ) from error


def parts_of(address: str) -> tuple[str, int]:
    """Host and port of an address that `url_of` takes."""
    plain = f"{LOOPBACK}:{address}" if address.isdigit() else address
    try:
        split = urlsplit(plain if "://" in plain else f"rerun+http://{plain}")
        host, port = split.hostname, split.port
    except ValueError:
        host, port, split = None, None, urlsplit("")
    if not host or not port or split.scheme != "rerun+http" or split.path not in ("", "/proxy"):
        raise InputError(
            f"--connect {address!r}: no address of a viewer; give PORT, HOST:PORT or rerun+http://HOST:PORT/proxy"
        )
    return host, port


def start_viewer(options: Sequence[str] = ()) -> Viewer:
    """Start a viewer that listens to this machine alone. It stays when this process has ended.

    Args:
        options: Of `rerun`, besides.

    Returns:
        The viewer, which listens.

    Raises:
        InputError: It does not start, for want of a screen for instance.
    """
    for port in (PORT, 0, 0):
        viewer = _start(_free_port(port), options)
        with viewer.errors:  # the viewer has an end of its own
            if _comes(viewer) and _stays(viewer):
                return viewer
            if viewer.process.poll() is None:
                os.killpg(viewer.process.pid, signal.SIGKILL)
            status = viewer.process.wait()
            complaint = viewer.complaint()
        if status != 0:  # 0: another viewer has been quicker to take the port
            break
    raise InputError(
        f"--live: no viewer could be started: {complaint}. Where there is no screen: "
        "start rerun where there is one and name its address with --connect, or leave --live out"
    )


def _start(port: int, options: Sequence[str]) -> Viewer:
    errors = tempfile.TemporaryFile()  # noqa: SIM115  (the viewer writes to it as long as it lives)
    process = subprocess.Popen(
        [sys.executable, "-m", "rerun_cli", "--bind", LOOPBACK, "--port", str(port), "--expect-data-soon", *options],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=errors,
        env={**os.environ, "RUST_LOG": "error", "RERUN_APP_ONLY": "true"},
        start_new_session=True,  # Ctrl-C is for the run
    )
    viewer = Viewer(port, process, errors)
    _started.append(viewer)
    return viewer


def _comes(viewer: Viewer) -> bool:
    until = time.monotonic() + STARTS_WITHIN_S
    while time.monotonic() < until and viewer.process.poll() is None:
        if _is_taken(viewer.port):
            return True
        time.sleep(0.05)
    return False


def _stays(viewer: Viewer) -> bool:
    """It listens first and opens its window then."""
    try:
        viewer.process.wait(STAYS_S)
    except subprocess.TimeoutExpired:
        return True
    return False


def _is_taken(port: int) -> bool:
    with socket.socket() as probe:
        probe.settimeout(ANSWERS_WITHIN_S)
        return probe.connect_ex((LOOPBACK, port)) == 0


def _free_port(rather: int) -> int:
    """This port, or another if it is taken."""
    with socket.socket() as probe:
        try:
            probe.bind((LOOPBACK, rather))
        except OSError:
            probe.bind((LOOPBACK, 0))
        return probe.getsockname()[1]

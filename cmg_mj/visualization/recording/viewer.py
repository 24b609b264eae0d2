"""Starts a viewer that a run is streamed to, or checks the address of one that runs already."""

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

from cmg_mj.errors import InputError, shortened

LOOPBACK, PORT = "127.0.0.1", 9876
"""Address of a started viewer: rerun would listen on all interfaces. The port is rerun's default."""
STARTS_WITHIN_S, STAYS_S = 30.0, 1.0
"""Time in which a viewer starts to listen, and time after which a listening viewer has found its screen."""
LONGEST_PART = 63
"""Most letters of a part of a computer's name, between dots."""
ANSWERS_WITHIN_S = 2.0
SCREENS = ("WAYLAND_DISPLAY", "WAYLAND_SOCKET", "DISPLAY")
"""Environment variables of which one names the screen, on Linux."""

_viewers: list[Viewer] = []
"""References to the viewers: a viewer outlives the run, and nobody waits for its end."""


@dataclass(frozen=True)
class Viewer:
    """A viewer that this process has started.

    Attributes:
        port: Port on which it listens, on this machine alone.
        process: The viewer's process.
        errors: The viewer's standard error.
    """

    port: int
    process: subprocess.Popen[bytes]
    errors: IO[bytes]

    @property
    def url(self) -> str:
        """The address that runs are streamed to."""
        return url_of(str(self.port))

    def complaint(self) -> str:
        """Return the last line of the viewer's standard error."""
        self.errors.seek(0)
        lines = re.sub(r"\x1b\[[\d;]*m", "", self.errors.read().decode(errors="replace")).split("\n")
        message = next((line.strip() for line in reversed(lines) if line.strip()), "it says nothing")
        return re.sub(r"^.*\.rs:\d+[:\d]*\s*", "", message).rstrip(".")  # without the place in rerun's sources


def url_of(address: str) -> str:
    """Complete the address of a viewer.

    Args:
        address: PORT, HOST:PORT, or rerun+http://HOST:PORT/proxy.

    Returns:
        The address in the last form.

    Raises:
        InputError: The address has none of these forms.
    """
    host, port = parts_of(address)
    return f"rerun+http://{f'[{host}]' if ':' in host else host}:{port}/proxy"


def require_listening(address: str) -> None:
    """Refuse an address that nobody listens on.

    Raises:
        InputError: Nobody listens, or the address has no valid form.
    """
    host, port = parts_of(address)
    try:
        socket.create_connection((host, port), ANSWERS_WITHIN_S).close()
    except UnicodeError as error:  # a part of the name is empty, or longer than 63 letters
        raise InputError(f"--connect {shortened(address)!r}: {_wrong_part(host)}") from error
    except OSError as error:
        raise InputError(
            f"--connect {shortened(address)!r}: no viewer listens there ({(error.strerror or str(error)).lower()}); "
            f"start one with: rerun --bind {LOOPBACK} --port {port}"
        ) from error


def parts_of(address: str) -> tuple[str, int]:
    """Split an address that `url_of` takes into host and port."""
    plain = f"{LOOPBACK}:{address}" if address.isdigit() else address
    try:
        split = urlsplit(plain if "://" in plain else f"rerun+http://{plain}")
        host, port = split.hostname, split.port
    except ValueError:
        host, port, split = None, None, urlsplit("")
    if not host or not port or split.scheme != "rerun+http" or split.path not in ("", "/proxy"):
        raise InputError(
            f"--connect {shortened(address)!r}: no address of a viewer; give PORT, HOST:PORT or "
            "rerun+http://HOST:PORT/proxy"
        )
    return host, port


def _wrong_part(host: str) -> str:
    """Say why a host cannot be the name of a computer."""
    longest = max(map(len, host.split(".")))
    if longest > LONGEST_PART:
        return f"no name of a computer before the port: a part of it has {longest} letters, at most {LONGEST_PART} may"
    return "no name of a computer before the port"


def start_viewer(options: Sequence[str] = ()) -> Viewer:
    """Start a viewer that listens on this machine alone and outlives this process.

    Args:
        options: More options of `rerun`, which make a viewer without a window.

    Returns:
        The viewer, which listens.

    Raises:
        InputError: The viewer does not start, for instance because there is no screen.
    """
    # A viewer listens before it looks for its screen: a busy machine may take longer over that than `STAYS_S`.
    no_screen = not options and sys.platform == "linux" and not any(map(os.environ.get, SCREENS))
    complaint = f"neither {' nor '.join(SCREENS)} is set"
    for port in () if no_screen else (PORT, 0, 0):
        viewer = _start(_free_port(port), options)
        with viewer.errors:  # the viewer has an end of its own
            if _starts_listening(viewer) and _stays(viewer):
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
    _viewers.append(viewer)
    return viewer


def _starts_listening(viewer: Viewer) -> bool:
    deadline = time.monotonic() + STARTS_WITHIN_S
    while time.monotonic() < deadline and viewer.process.poll() is None:
        if _is_taken(viewer.port):
            return True
        time.sleep(0.05)
    return False


def _stays(viewer: Viewer) -> bool:
    """Return whether a viewer survives the opening of its window, which follows the start of listening."""
    try:
        viewer.process.wait(STAYS_S)
    except subprocess.TimeoutExpired:
        return True
    return False


def _is_taken(port: int) -> bool:
    with socket.socket() as probe:
        probe.settimeout(ANSWERS_WITHIN_S)
        return probe.connect_ex((LOOPBACK, port)) == 0


def _free_port(preferred: int) -> int:
    """Return the preferred port, or another if that one is taken."""
    with socket.socket() as probe:
        try:
            probe.bind((LOOPBACK, preferred))
        except OSError:
            probe.bind((LOOPBACK, 0))
        return probe.getsockname()[1]

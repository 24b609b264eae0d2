"""A line to a viewer that can be cut: rerun itself waits without end for a viewer that stands still, even at exit."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from contextlib import suppress

LOOPBACK = "127.0.0.1"
BYTES = 1 << 16


class Relay:
    """Passes on what is said between rerun in this process and a viewer, until it is cut.

    Args:
        host: Of the viewer.
        port: Of the viewer.

    Attributes:
        port: Where rerun finds it, on this machine alone.
    """

    def __init__(self, host: str, port: int) -> None:
        self._viewer = (host, port)
        self._listener = socket.create_server((LOOPBACK, 0))
        self.port: int = self._listener.getsockname()[1]
        self._ends = [self._listener]
        self._start(self._accept)

    def cut(self) -> None:
        """Be a viewer that has gone."""
        for end in self._ends:
            _close(end)

    def _accept(self) -> None:
        with suppress(OSError):
            ours, _ = self._listener.accept()
            _close(self._listener)  # rerun comes once; nobody else is to come
            self._ends.append(ours)
            theirs = socket.create_connection(self._viewer)
            self._ends.append(theirs)
            self._start(lambda: self._pass_on(ours, theirs))
            self._pass_on(theirs, ours)
        self.cut()

    def _pass_on(self, source: socket.socket, sink: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(BYTES):
                sink.sendall(data)
        self.cut()

    def _start(self, target: Callable[[], None]) -> None:
        threading.Thread(target=target, name="line to the viewer", daemon=True).start()


def _close(end: socket.socket) -> None:
    """Also for whoever waits for it."""
    with suppress(OSError):
        end.shutdown(socket.SHUT_RDWR)
    end.close()

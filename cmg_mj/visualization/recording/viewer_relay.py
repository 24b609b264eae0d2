"""A connection to a viewer that can be cut: rerun waits without end for a viewer that stands still, even at exit."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from contextlib import suppress

LOOPBACK = "127.0.0.1"
BYTES = 1 << 16


class Relay:
    """Passes bytes between rerun in this process and a viewer, until it is cut.

    Args:
        host: Host of the viewer.
        port: Port of the viewer.

    Attributes:
        port: Port for rerun, on this machine alone.
    """

    def __init__(self, host: str, port: int) -> None:
        self._viewer = (host, port)
        self._listener = socket.create_server((LOOPBACK, 0))
        self.port: int = self._listener.getsockname()[1]
        self._sockets = [self._listener]
        self._start(self._accept)

    def cut(self) -> None:
        """Close all connections: to rerun the viewer is gone."""
        for connection in self._sockets:
            _close(connection)

    def _accept(self) -> None:
        with suppress(OSError):
            rerun, _ = self._listener.accept()
            _close(self._listener)  # rerun connects once; nobody else may
            self._sockets.append(rerun)
            viewer = socket.create_connection(self._viewer)
            self._sockets.append(viewer)
            self._start(lambda: self._pass_on(rerun, viewer))
            self._pass_on(viewer, rerun)
        self.cut()

    def _pass_on(self, source: socket.socket, sink: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(BYTES):
                sink.sendall(data)
        self.cut()

    def _start(self, target: Callable[[], None]) -> None:
        threading.Thread(target=target, name="line to the viewer", daemon=True).start()


def _close(connection: socket.socket) -> None:
    """Close a socket, also for threads that wait for it."""
    with suppress(OSError):
        connection.shutdown(socket.SHUT_RDWR)
    connection.close()

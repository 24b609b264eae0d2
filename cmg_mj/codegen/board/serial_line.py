"""Exchanges messages over the serial line, as firmware/board.c describes them."""

from __future__ import annotations

import socket
import struct

from cmg_mj.codegen.board.frames import Frame, FrameReader
from cmg_mj.errors import RunStopped


class Silent(RunStopped):
    """The board has not answered in time."""


class Closed(RunStopped):
    """The board has closed the line."""


class SerialLine:
    """A serial line to a board.

    Args:
        line: The line; a stream of bytes in both directions.
        patience_s: Longest wait for an answer [s].
    """

    def __init__(self, line: socket.socket, patience_s: float) -> None:
        self._line = line
        self._line.settimeout(patience_s)
        self._reader, self._waiting = FrameReader(), list[Frame]()
        self._number = 0
        self.patience_s = patience_s

    def ask(self, kind: str, payload: bytes, layout: str) -> tuple:
        """Send a message and wait for its answer.

        Args:
            kind: Kind of the message.
            payload: Payload of the message.
            layout: Layout of the answer's payload, in `struct`'s format.

        Returns:
            The numbers of the answer.

        Raises:
            RunStopped: No answer comes, or an answer to another message.
        """
        self._number = (self._number + 1) % 256
        try:
            self._line.sendall(Frame(kind, self._number, payload).encode())
        except OSError as error:
            raise Closed("the board is gone") from error
        answer_kind, number, answer = self._message()
        if answer_kind == "?":
            raise RunStopped(f"the board knows no message {kind!r} of {len(payload)} bytes, or it came damaged")
        if (answer_kind, number) != (kind, self._number) or len(answer) != struct.calcsize(layout):
            raise RunStopped(f"the board answered something else than what {kind!r} asked")
        return struct.unpack(layout, answer)

    def await_ready(self) -> None:
        """Wait until the board reports that it is ready.

        Raises:
            RunStopped: The board reports something else, or nothing.
        """
        if self._message() != ("!", 0, b""):
            raise RunStopped("the board says something else than that it is ready")

    def _message(self) -> Frame:
        """Receive the next message."""
        try:
            while not self._waiting:
                data = self._line.recv(4096)
                if not data:
                    raise Closed("the board is gone")
                self._waiting += self._reader.feed(data)
                if self._reader.damaged:
                    raise RunStopped("the board sent a message damaged on the line, or bytes that are no message")
        except TimeoutError as error:
            raise Silent(f"the board has not answered for {self.patience_s:g} s") from error
        except OSError as error:
            raise Closed("the board is gone") from error
        return self._waiting.pop(0)

"""Messages over the serial line, as firmware/board.c describes them."""

from __future__ import annotations

import binascii
import socket
import struct

from cmg_mj.errors import RunStopped

FIRST = b"\xa5"


class Silent(RunStopped):
    """The other end has not answered in time."""


class Closed(RunStopped):
    """The other end is no longer there."""


def framed(kind: str, number: int, carried: bytes) -> bytes:
    """A message as it goes over the line."""
    body = bytes((ord(kind), number, len(carried))) + carried
    return FIRST + body + struct.pack("<H", _crc(body))


class SerialLine:
    """A serial line with a board at its other end.

    Args:
        line: The line; a stream of bytes either way.
        patience_s: For how long an answer may fail to come [s].
    """

    def __init__(self, line: socket.socket, patience_s: float) -> None:
        self._line = line
        self._line.settimeout(patience_s)
        self._number = 0
        self.patience_s = patience_s

    def ask(self, kind: str, carried: bytes, layout: str) -> tuple:
        """Send a message and wait for its answer.

        Args:
            kind: Its kind.
            carried: What it carries.
            layout: What the answer carries, as `struct` calls it.

        Returns:
            The numbers of the answer.

        Raises:
            RunStopped: No answer came, or none to this message.
        """
        self._number = (self._number + 1) % 256
        try:
            self._line.sendall(framed(kind, self._number, carried))
        except OSError as error:
            raise Closed("the board is gone") from error
        its_kind, number, answer = self._message()
        if its_kind == "?":
            raise RunStopped(f"the board knows no message {kind!r} of {len(carried)} bytes, or it came damaged")
        if (its_kind, number) != (kind, self._number) or len(answer) != struct.calcsize(layout):
            raise RunStopped(f"the board answered something else than what {kind!r} asked")
        return struct.unpack(layout, answer)

    def await_ready(self) -> None:
        """Wait until the board says that it is ready.

        Raises:
            RunStopped: It says something else, or nothing.
        """
        if self._message() != ("!", 0, b""):
            raise RunStopped("the board says something else than that it is ready")

    def _message(self) -> tuple[str, int, bytes]:
        """The next message: its kind, number, and what it carries."""
        try:
            head = self._receive(4)
            if head[:1] != FIRST:
                raise RunStopped(f"the board sent the byte {head[0]:#04x} where a message should begin")
            rest = self._receive(head[3] + 2)
        except TimeoutError as error:
            raise Silent(f"the board has not answered for {self.patience_s:g} s") from error
        except OSError as error:
            raise Closed("the board is gone") from error
        if struct.pack("<H", _crc(head[1:] + rest[:-2])) != rest[-2:]:
            raise RunStopped("the board sent a message that was damaged on the line")
        return chr(head[1]), head[2], rest[:-2]

    def _receive(self, count: int) -> bytes:
        received = b""
        while len(received) < count:
            more = self._line.recv(count - len(received))
            if not more:
                raise Closed("the board is gone")
            received += more
        return received


def _crc(body: bytes) -> int:
    """CRC-16/CCITT."""
    return binascii.crc_hqx(body, 0xFFFF)

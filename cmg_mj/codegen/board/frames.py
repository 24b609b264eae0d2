"""The frames of the serial line and of a board's log, as firmware/board.c describes them."""

from __future__ import annotations

import binascii
import struct
from typing import NamedTuple

START_BYTE = b"\xa5"
OVERHEAD = 6
"""Bytes of a frame beside its payload."""
LONGEST = 255
"""Longest payload [bytes]."""


class Frame(NamedTuple):
    """A frame, either way.

    Attributes:
        kind: Kind of the message.
        number: Number of the message, modulo 256.
        payload: Payload of the message.
    """

    kind: str
    number: int
    payload: bytes

    def encode(self) -> bytes:
        """Encode it for the line."""
        body = bytes((ord(self.kind), self.number, len(self.payload))) + self.payload
        return START_BYTE + body + checksum(body)


def checksum(body: bytes | bytearray) -> bytes:
    """Compute the CRC-16/CCITT, low byte first."""
    return struct.pack("<H", binascii.crc_hqx(body, 0xFFFF))


class FrameReader:
    """Finds frames in a stream of bytes, also after bytes that were lost, damaged or doubled.

    Attributes:
        damaged: Number of places where the stream was no frame.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._out_of_step = False
        self.damaged = 0

    def feed(self, data: bytes) -> list[Frame]:
        """Take bytes and return the frames that have come whole with them."""
        buffer, frames, at = self._buffer, [], 0
        buffer += data
        while at < len(buffer):
            if buffer[at] == START_BYTE[0]:
                if len(buffer) - at < 4:
                    break
                end = at + buffer[at + 3] + OVERHEAD
                if len(buffer) < end:
                    break
                if checksum(buffer[at + 1 : end - 2]) == buffer[end - 2 : end]:
                    frames.append(Frame(chr(buffer[at + 1]), buffer[at + 2], bytes(buffer[at + 4 : end - 2])))
                    self._out_of_step = False
                    at = end
                    continue
            self.damaged += not self._out_of_step
            self._out_of_step = True
            start = buffer.find(START_BYTE, at + 1)
            at = len(buffer) if start < 0 else start
        del buffer[:at]
        return frames

    def resync(self, kind: str = "", size: int = 0) -> list[Frame]:
        """Give up the frame whose rest has not come, if any; return the frames that lie behind its first byte.

        Args:
            kind: Kind of a frame that may be slow, late answers included: one that begins so is not given up.
            size: Size of its payload [bytes].
        """
        buffer = self._buffer
        slow = START_BYTE + kind.encode() + buffer[2:3] + bytes((size,))
        if not buffer or (kind and slow.startswith(buffer[:4])):
            return []
        self.damaged += not self._out_of_step
        self._out_of_step = True
        del self._buffer[0]
        return self.feed(b"")

    def end(self) -> list[Frame]:
        """Return the frames behind the bytes at the end of the stream that are no frame."""
        frames = []
        while self._buffer:
            frames += self.resync()
        return frames

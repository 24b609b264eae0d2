"""The frames of the serial line and of a board's log, as firmware/board.c describes them."""

from __future__ import annotations

import binascii
import struct
from typing import NamedTuple

START_BYTE = b"\xa5"
AROUND = 6
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
        self._held = bytearray()
        self._lost_track = False
        self.damaged = 0

    def feed(self, received: bytes) -> list[Frame]:
        """Take bytes and return the frames that have come whole with them."""
        held, frames, at = self._held, [], 0
        held += received
        while at < len(held):
            if held[at] == START_BYTE[0]:
                if len(held) - at < 4:
                    break
                end = at + held[at + 3] + AROUND
                if len(held) < end:
                    break
                if checksum(held[at + 1 : end - 2]) == held[end - 2 : end]:
                    frames.append(Frame(chr(held[at + 1]), held[at + 2], bytes(held[at + 4 : end - 2])))
                    self._lost_track = False
                    at = end
                    continue
            self.damaged += not self._lost_track
            self._lost_track = True
            start = held.find(START_BYTE, at + 1)
            at = len(held) if start < 0 else start
        del held[:at]
        return frames

    def resync(self, awaited: bytes = b"") -> list[Frame]:
        """Give up the frame whose rest has not come, if any; return the frames that lie behind its first byte.

        Args:
            awaited: Beginning of a frame that may be slow: one that begins so is not given up.
        """
        held = self._held
        if not held or (awaited and awaited[: len(held)] == held[: len(awaited)]):
            return []
        self.damaged += not self._lost_track
        self._lost_track = True
        del self._held[0]
        return self.feed(b"")

    def end(self) -> list[Frame]:
        """Return the frames behind whatever the stream ends with that is none."""
        frames = []
        while self._held:
            frames += self.resync()
        return frames

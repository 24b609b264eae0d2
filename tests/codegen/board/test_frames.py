"""Frames found in a stream of bytes, whatever was lost, damaged or doubled in it."""

from __future__ import annotations

import random
import socket

import pytest

from cmg_mj.codegen.board.frames import Frame, FrameReader
from cmg_mj.codegen.board.serial_line import SerialLine
from cmg_mj.errors import RunStopped

FRAMES = [Frame("u", number, bytes(random.Random(number).randbytes(38))) for number in range(200)]
STREAM = b"".join(frame.encode() for frame in FRAMES)


def test_it_finds_all_of_them_in_any_pieces() -> None:
    for size in (1, 7, 44, 10_000):
        reader = FrameReader()
        found = [frame for at in range(0, len(STREAM), size) for frame in reader.feed(STREAM[at : at + size])]
        assert found == FRAMES
        assert reader.damaged == 0


def test_a_frame_is_as_the_firmware_says() -> None:
    """0xA5, kind, number, length, payload, CRC-16/CCITT of all but the first byte, low byte first."""
    crc = 0xFFFF
    body = b"u\x07\x02\xa5\x01"
    for byte in body:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    assert Frame("u", 7, b"\xa5\x01").encode() == b"\xa5" + body + bytes((crc & 255, crc >> 8))


@pytest.mark.parametrize("fault", ["lost", "doubled", "damaged", "noise"])
def test_a_mistake_spoils_its_own_frame_alone(fault: str) -> None:
    chance = random.Random(5)
    for _ in range(200):
        at = chance.randrange(44 * 50, 44 * 51)
        wrong = {
            "lost": b"",
            "doubled": STREAM[at : at + 1] * 2,
            "damaged": bytes((STREAM[at] ^ 1 << chance.randrange(8),)),
            "noise": STREAM[at : at + 1] + chance.randbytes(3),
        }[fault]
        reader = FrameReader()
        found = reader.feed(STREAM[:at] + wrong + STREAM[at + 1 :])
        missing = [frame for frame in FRAMES if frame not in found]
        assert found == [frame for frame in FRAMES if frame in found]
        # A length that has grown swallows frames until it is full; they are found in what it has swallowed.
        assert missing in ([], [FRAMES[50]])
        assert reader.damaged == len(missing) or fault in ("noise", "doubled")


def test_a_frame_whose_rest_does_not_come_is_given_up() -> None:
    reader = FrameReader()
    whole = FRAMES[0].encode()
    assert reader.resync() == []
    assert reader.feed(b"\xa5u\x01\xff" + whole) == []  # it waits for 255 bytes
    assert reader.resync() == [FRAMES[0]]
    assert reader.damaged == 1


def test_a_frame_that_is_slow_is_not_given_up_where_it_is_awaited() -> None:
    reader, whole = FrameReader(), FRAMES[3].encode()
    for count in (2, 7):
        assert reader.feed(whole[:count]) == reader.resync("u", 38) == []
        assert reader.feed(whole[count:]) == [FRAMES[3]]
    assert reader.feed(FRAMES[4].encode()[:7]) == reader.resync("u", 37) == reader.resync("o", 38) == []
    assert reader.damaged == 1


def test_a_late_answer_of_another_number_is_no_damage() -> None:
    reader = FrameReader()
    for frame in FRAMES[:5]:
        assert reader.feed(frame.encode()[:20]) == reader.resync("u", 38) == []
        assert reader.feed(frame.encode()[20:]) == [frame]
    assert reader.damaged == 0


@pytest.mark.parametrize(
    ("received", "message"),
    [
        (b"\xa5u\x01\x00\x00\x00", "damaged on the line, or bytes that are no message$"),
        (b"hello" + Frame("u", 1, b"").encode(), "damaged on the line, or bytes that are no message$"),
        (Frame("?", 1, b"").encode(), "knows no message 'u' of 0 bytes"),
        (Frame("u", 2, b"").encode(), "answered something else than what 'u' asked$"),
        (b"\xa5u\x01", "has not answered for 0.05 s$"),
    ],
    ids=["damaged", "noise", "unknown", "number", "half"],
)
def test_an_emulated_boards_line_makes_no_mistakes(received: bytes, message: str) -> None:
    host, board = socket.socketpair()
    with host, board:
        board.sendall(received)
        with pytest.raises(RunStopped, match=message):
            SerialLine(host, 0.05).ask("u", b"", "<")

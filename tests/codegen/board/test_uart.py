"""The firmware for the STM32F746 on a USART that has room for one byte, with USB between it and the host."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

from cmg_mj.codegen.board import wired_board
from cmg_mj.codegen.board.wired_board import WiredBoard
from cmg_mj.errors import RunStopped
from tests.codegen.board.uart import UartWire, native_firmware
from tests.codegen.board.wire import TOY

pytestmark = [pytest.mark.slow, pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")]

DEADLINE_S = 0.005
WIRE_S = 10 * (30 + 42) / 460_800
GAP_NS = 200_000
"""Time of the host between an answer and the next sample [ns]."""


@pytest.fixture(scope="module")
def firmware(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return native_firmware(tmp_path_factory.mktemp("native"))


@contextmanager
def connected(
    wire: UartWire, monkeypatch: pytest.MonkeyPatch, again_s: float | None = None
) -> Iterator[tuple[UartWire, WiredBoard]]:
    """A board behind the model's wire, at its start, on the model's time."""
    monkeypatch.setattr(wired_board, "time", SimpleNamespace(perf_counter=wire.perf_counter))
    board = WiredBoard(wire, "the port", TOY, 4, DEADLINE_S, again_s, wire_s=WIRE_S)
    board.start()
    try:
        yield wire, board
    finally:
        wire.close()


def updates(wire: UartWire, board: WiredBoard, count: int) -> list[float]:
    """The toy's commands: 100 for each update that it has executed, and the angle, which counts the samples."""
    commands = []
    for k in range(count):
        wire.wait(GAP_NS)
        commands.append(board.update((0.0, 9.8, 0.0, 9.8), (float(k), 0.0)).u)
    return commands


def each_once(count: int) -> list[float]:
    return [101.0 * k + 100.0 for k in range(count)]


@pytest.mark.parametrize("usb_ms", [0.1, 0.5, 0.7, 0.9, 1.1, 1.2], ids="usb {} ms".format)
def test_a_loop_survives_answers_that_come_after_half_of_the_deadline(
    firmware: Path, usb_ms: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Round trips of 2.5 to 4 ms: each sample is sent twice, the second time while the board answers the first."""
    with connected(UartWire(firmware, 1e-3 * usb_ms), monkeypatch, 0.5 * DEADLINE_S) as (wire, board):
        assert updates(wire, board, 150) == each_once(150)
    trips = board.counts.round_trips_s
    assert WIRE_S + 2e-3 * usb_ms < min(trips) <= max(trips) < DEADLINE_S
    assert board.counts.lost == 0
    assert board.counts.sent_again == (150 if usb_ms > 0.4 else 0)


def test_two_copies_of_a_sample_back_to_back_are_one(firmware: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """USB holds the first until the second comes: bytes of the second are lost while the board executes the first."""
    with connected(UartWire(firmware, 0.0001), monkeypatch, 0.5 * DEADLINE_S) as (wire, board):
        commands = []
        for k in range(50):
            wire.wait(GAP_NS)
            if k % 5 == 0:
                wire.jammed_until = wire.now + 2_900_000
            commands.append(board.update((0.0, 9.8, 0.0, 9.8), (float(k), 0.0)).u)
        assert commands == each_once(50)
        assert (board.counts.lost, board.counts.sent_again) == (0, 10)
        assert wire.overruns >= 10


@pytest.mark.parametrize("place", [0, 1, 2, 3, 4, 11, 12, 20, 28, 29], ids="byte {}".format)
def test_a_byte_that_the_cable_loses_costs_no_tick(firmware: Path, place: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The board refuses the rest when the line is quiet, and is sent the sample again.

    Where it does not know the number, it is sent the sample after half of the deadline.
    """
    again_s = None if place < 3 else DEADLINE_S
    handshake = 3 * 6
    lost = frozenset({handshake + 10 * 30 + place})
    with connected(UartWire(firmware, 0.0003, lost), monkeypatch, again_s) as (wire, board):
        assert updates(wire, board, 40) == each_once(40)
    assert (board.counts.lost, board.counts.sent_again, wire.overruns) == (0, 1, 0)


def test_a_line_on_which_half_the_samples_are_spoiled_recovers(firmware: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ticks are lost, and none after the line is good again."""
    lost = frozenset(range(300, 3000, 37))
    with connected(UartWire(firmware, 0.0008, lost), monkeypatch) as (wire, board):
        board.max_lost = 127
        updates(wire, board, 100)
        assert board.counts.lost > 20
        before = board.counts.lost
        assert wire.sent > 3000
        updates(wire, board, 50)
        assert board.counts.lost == before


def test_a_board_that_starts_again_and_is_not_heard_ends_the_run(
    firmware: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with connected(UartWire(firmware, 0.0003), monkeypatch) as (wire, board):
        assert updates(wire, board, 5) == each_once(5)
        wire.reset()
        with pytest.raises(RunStopped, match=r"the board has started again, and its controller's state is lost$"):
            updates(wire, board, 1)


def test_it_keeps_the_bits_that_are_reserved(firmware: Path) -> None:
    """PLLCFGR: 25, 432, halved, from the oscillator, 9; bit 29 as a reset leaves it, in 0x24003010."""
    wire = UartWire(firmware, 0.0)
    wire.wait(1_000_000)
    assert wire.pll == 25 | 432 << 6 | 1 << 22 | 9 << 24 | 1 << 29
    wire.close()

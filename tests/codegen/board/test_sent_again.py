"""When the host sends a sample again: not before the line can have answered, nor too late for an answer."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from cmg_mj.codegen.board import wired_board
from cmg_mj.codegen.board.frames import Frame
from cmg_mj.codegen.board.wired_board import WiredBoard
from tests.codegen.board import wire
from tests.codegen.board.wire import TOY, PythonBoard


def update(wired: WiredBoard, angle: float) -> float:
    return wired.update((0.0, 9.8, 0.0, 9.8), (angle, 0.0)).u


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The host's clock, on which 20 us pass with every look and nobody sleeps; one may put it on [s]."""
    now = [0.0]

    def look() -> float:
        now[0] += 2e-5
        return now[0]

    monkeypatch.setattr(wired_board, "time", SimpleNamespace(perf_counter=look))
    monkeypatch.setattr(wire, "time", SimpleNamespace(sleep=lambda seconds: None))
    return now


@pytest.mark.parametrize(
    ("wire_s", "sent"),
    [
        pytest.param(0.0, [4, 4], id="in half of the deadline"),
        pytest.param(0.024, [4, 4], id="as long as the line takes"),
        pytest.param(0.028, [4], id="too late for an answer"),
    ],
)
@pytest.mark.usefixtures("clock")
def test_a_sample_is_sent_again_where_its_answer_can_come_in_time(wire_s: float, sent: list[int]) -> None:
    board = PythonBoard(answers=lambda frame, answer: [answer] * (frame.kind != "u"))
    wired = WiredBoard(board, "the port", TOY, 3, 0.05, wire_s=wire_s)
    wired.start()
    assert update(wired, 1.0) == 0.0
    assert [frame.number for frame in board.received if frame.kind == "u"] == sent
    assert wired.counts.lost == 1


def test_it_waits_for_the_line_before_it_sends_again(clock: list[float]) -> None:
    sent: list[float] = []

    def answers(frame: Frame, answer: Frame) -> list[Frame]:
        if frame.kind == "u":
            sent.append(clock[0])
        return [answer] * (frame.kind != "u")

    wired = WiredBoard(PythonBoard(answers=answers), "the port", TOY, 3, 0.005, wire_s=0.0018)
    wired.start()
    update(wired, 1.0)
    assert sent[1] - sent[0] == pytest.approx(0.0018 + 0.001, abs=1.5e-4)


def test_an_answer_is_waited_for_where_its_sample_is_not_sent_again(clock: list[float]) -> None:
    board = PythonBoard()
    wired = WiredBoard(board, "the port", TOY, 3, 0.05, wire_s=0.03)
    wired.start()
    at_once, begun = board.read, clock[0]
    board.read = lambda wait_s: at_once(wait_s) if clock[0] > begun + 0.04 else b""  # type: ignore[method-assign]
    assert update(wired, 1.0) == 1.0
    assert (len(board.received), wired.counts.lost) == (4, 0)


def test_a_refusal_that_comes_too_late_sends_nothing_again(clock: list[float]) -> None:
    def answers(frame: Frame, answer: Frame) -> list[Frame]:
        if frame.kind != "u":
            return [answer]
        clock[0] += 0.03
        return [Frame("?", frame.number, b"")]

    board = PythonBoard(answers=answers)
    wired = WiredBoard(board, "the port", TOY, 3, 0.05, wire_s=0.022)
    wired.start()
    assert update(wired, 1.0) == 0.0
    assert [frame.number for frame in board.received if frame.kind == "u"] == [4]
    assert (wired.counts.lost, wired.figures()["refused_by_board"]) == (1, 1)

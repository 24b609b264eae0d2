"""The host's side of a wire: handshake, deadlines, frames sent again, ticks lost, and how a run over it ends."""

from __future__ import annotations

import dataclasses
import math
import struct
import time

import pytest

from cmg_mj.codegen.board import on_a_wire, wired_board
from cmg_mj.codegen.board.frames import Frame, FrameReader
from cmg_mj.codegen.board.identity import Identity, identity_of, read_identity
from cmg_mj.codegen.board.ports import require_fit
from cmg_mj.codegen.board.wired_board import WiredBoard
from cmg_mj.core.tilt import GimbalAngle
from cmg_mj.errors import InputError, RunStopped
from tests.codegen.board.toy import short
from tests.codegen.board.wire import TOY, PythonBoard

ACCELERATIONS = (0.0, 9.8, 0.0, 9.8)


def connect(board: PythonBoard, deadline_s: float = 5.0, again_s: float = 0.02, max_lost: int = 20) -> WiredBoard:
    wired = WiredBoard(board, "the port", TOY, 3, deadline_s, again_s, max_lost)
    wired.start()
    return wired


def update(wired: WiredBoard, angle: float) -> float:
    return wired.update(ACCELERATIONS, (angle, 0.0)).u


def test_an_identity_survives_the_line() -> None:
    rig = GimbalAngle((1.0, -1.0, 1.0, -1.0), (1.5707963, -0.25, 0.0, 3.0))
    identity = Identity("cmg_mj", "2", "own", "single", 1000.0 / 3.0, "0123abcd", (0.0671751, 0.2015254), rig)
    payload = struct.pack("<2I", 216_000_000, 5) + f"{identity.text()} board=STM32F746G-DISCO".encode()
    assert len(payload) <= 255
    known = dataclasses.replace(identity, board="STM32F746G-DISCO", cycles_per_second=216_000_000)
    back = read_identity(Frame("h", 1, payload), "here")
    assert dataclasses.replace(back, rate_hz=known.rate_hz) == known
    assert back.rate_hz == pytest.approx(known.rate_hz, rel=1e-8)


def test_an_identity_is_the_controllers() -> None:
    controller = short("gyro_free").axis_controller()
    identity = identity_of(controller, "gyro_free", "int x;")
    assert (identity.observer, identity.precision, identity.rate_hz) == ("gyro_free", "single", 200.0)
    assert identity.radii_m == (controller.tilt.r_inner, controller.tilt.r_outer)
    assert identity.code == "32c65dec" != identity_of(controller, "gyro_free", "int y;").code


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("firmware", "blinky", "the board has firmware blinky, the scenario wants cmg_mj: export and flash it again"),
        ("version", "1", "the board has firmware version 1, the scenario wants 2: export and flash it again"),
        ("observer", "ltv", "the board has observer ltv, the scenario wants toy: export and flash it again"),
        ("precision", "double", "the board has precision double, the scenario wants single: export and flash it again"),
        ("rate_hz", 400.0, "the board has rate 400 Hz, the scenario wants 200 Hz: export and flash it again"),
        ("radii_m", (0.1, 0.3), "the board has radii of the accelerometers 0.1,0.3 m, the scenario wants 0.1,0.2 m"),
        ("gimbals", GimbalAngle((1.0,), (0.0,)), r"the board has gimbals \+1@0, the scenario wants "),
        (
            "code",
            "deadbeef",
            r"the board's toy has other numbers than the scenario's \(checksums deadbeef and 0badc0de",
        ),
    ],
)
def test_another_firmware_is_refused_by_name(field: str, value: object, message: str) -> None:
    with pytest.raises(InputError, match=f"^the port: {message}"):
        connect(PythonBoard(dataclasses.replace(TOY, **{field: value})))


def test_a_checksum_that_is_not_known_is_not_compared() -> None:
    unknown = dataclasses.replace(TOY, code="")
    assert not WiredBoard(PythonBoard(), "the port", unknown, 3, 1.0).checksum_compared
    assert connect(PythonBoard()).checksum_compared


def test_without_a_checksum_radii_and_gimbals_are_compared_still() -> None:
    unknown = dataclasses.replace(TOY, code="")
    for field, value in (("radii_m", (0.1, 0.3)), ("gimbals", GimbalAngle((1.0, 1.0), (1.5, 1.5)))):
        board = PythonBoard(dataclasses.replace(TOY, **{field: value}))
        with pytest.raises(InputError, match=r"^the port: the board has (radii of the accelerometers|gimbals) "):
            WiredBoard(board, "the port", unknown, 3, 1.0)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("controller.notch_hz=12", r"^controller\.notch_hz = 12\.0: cannot be exported: no notch is exported"),
        ("controller.feedback=truth", r"^controller\.feedback = 'truth': a board has no such sensor"),
    ],
    ids=["notch", "feedback"],
)
def test_what_cannot_be_exported_is_refused_without_casadi(
    setting: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before anything is opened: nobody is at that port."""
    monkeypatch.setattr(wired_board, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=message), on_a_wire(short("gyro_free", setting).axis_controller(), "tcp:x:1"):
        pass


def test_a_line_that_sends_back_what_it_receives_is_no_board() -> None:
    with pytest.raises(InputError, match=r"^the port: echoes all that it receives: a loopback plug or an echoing term"):
        connect(PythonBoard(answers=lambda frame, answer: [frame]))


def test_who_does_not_answer_the_handshake(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wired_board, "PATIENCE_S", 0.02)
    monkeypatch.setattr(wired_board, "AGAIN_S", 0.005)
    with pytest.raises(
        InputError, match=r"^the port: no answer within 0\.02 s: is the firmware on it, and is the baud"
    ):
        connect(PythonBoard(answers=lambda frame, answer: []))
    with pytest.raises(InputError, match=r"^TCP:x:1: no answer .*and is no other program connected to it\?$"):
        WiredBoard(PythonBoard(answers=lambda frame, answer: []), "TCP:x:1", TOY, 3, 1.0)
    with pytest.raises(InputError, match="knows no handshake: it is older than this cmg_mj"):
        connect(PythonBoard(answers=lambda frame, answer: [Frame("?", frame.number, b"")]))
    other = PythonBoard(answers=lambda frame, answer: [Frame("h", frame.number, b"12345678hello, world")])
    with pytest.raises(
        InputError, match=r"^the port: what introduces itself there is no firmware of cmg_mj: 'hello, w"
    ):
        connect(other)
    with pytest.raises(InputError, match="the board's estimate has other parts"):
        WiredBoard(PythonBoard(), "the port", TOY, 4, 1.0)


def test_a_board_that_speaks_late_in_the_handshake() -> None:
    """It announces itself, and its first answers are lost."""
    lost = iter(range(2))
    board = PythonBoard(
        answers=lambda frame, answer: [Frame("!", 0, b"")] if next(lost, None) is not None else [answer]
    )
    assert connect(board).identity.board == "python"


@pytest.mark.parametrize("loss", ["answer", "refused", "doubled"])
def test_a_frame_is_sent_again_under_its_number_and_executed_once(loss: str) -> None:
    troubles = {"left": 1}

    def answers(frame: Frame, answer: Frame) -> list[Frame]:
        if frame.kind != "u" or not troubles["left"]:
            return [answer]
        troubles["left"] -= 1
        return {"answer": [], "refused": [Frame("?", frame.number, b"")], "doubled": [answer, answer]}[loss]

    board = PythonBoard(answers=answers)
    wired = connect(board)
    assert [update(wired, angle) for angle in (1.0, 2.0, 3.0)] == [1.0, 3.0, 6.0]
    assert board.executed == [1.0, 2.0, 3.0]
    numbers = [frame.number for frame in board.received if frame.kind == "u"]
    again = loss != "doubled"
    assert numbers == ([4, 4, 5, 6] if again else [4, 5, 6])
    counts = wired.counts
    assert (counts.sent_again, counts.lost, counts.refused) == (int(again), 0, int(loss == "refused"))
    assert counts.late_or_doubled == int(not again)
    assert len(counts.round_trips_s) == 3


def test_a_length_that_came_damaged_does_not_swallow_the_answers() -> None:
    """It asks for 255 bytes; what lies behind its first is looked through when the sample is sent again."""
    board = PythonBoard()
    wired = connect(board)
    board.noise = b"\xa5u\x04\xff"
    assert [update(wired, angle) for angle in (1.0, 2.0)] == [1.0, 3.0]
    assert (wired.counts.sent_again, wired.figures()["damaged_from_board"]) == (1, 1)


def test_a_tick_that_is_lost_holds_the_command() -> None:
    late: list[Frame] = []

    def answers(frame: Frame, answer: Frame) -> list[Frame]:
        if frame.kind != "u" or frame.number not in (5, 6):
            return [*late, answer]
        late.append(answer)
        return []

    board = PythonBoard(answers=answers)
    wired = connect(board, deadline_s=0.05, again_s=0.025)
    assert [update(wired, angle) for angle in (1.0, 2.0, 3.0, 4.0)] == [1.0, 1.0, 1.0, 10.0]
    assert [frame.number for frame in board.received if frame.kind == "u"] == [4, 5, 5, 6, 6, 7]
    figures = wired.figures()
    assert (figures["ticks"], figures["lost"], figures["lost_in_a_row"], figures["sent_again"]) == (4, 2, 2, 2)
    assert figures["late_or_doubled"] == 4
    assert figures["update_us"] == {"median": 7.0, "most": 7}


def test_a_first_tick_that_is_lost_commands_nothing() -> None:
    wired = connect(PythonBoard(answers=lambda frame, answer: [answer] * (frame.number != 4)), 0.02, 0.01)
    assert wired.update(ACCELERATIONS, (1.0, 0.0)) == (0.0, 0.0, (0.0, 0.0, 0.0))
    assert update(wired, 1.0) == 2.0


def test_an_answer_after_the_deadline_is_late_and_the_tick_lost() -> None:
    """A read that takes longer than the deadline, as of a converter that collects bytes for 16 ms."""
    board = PythonBoard()
    wired = connect(board, 0.005, 0.005)
    at_once = board.read

    def slow(wait_s: float) -> bytes:
        time.sleep(0.02)
        return at_once(wait_s)

    board.read = slow  # type: ignore[method-assign]
    assert update(wired, 1.0) == 0.0
    assert (wired.counts.lost, wired.counts.late_or_doubled) == (1, 1)
    board.read = at_once  # type: ignore[method-assign]
    assert update(wired, 1.0) == 2.0


def test_too_many_lost_in_a_row_end_the_run() -> None:
    board = PythonBoard(answers=lambda frame, answer: [answer] * (frame.kind != "u" or frame.number % 3 == 0))
    wired = connect(board, 0.01, 0.01, max_lost=3)
    assert [update(wired, 1.0) for _ in range(9)][-1] == 9.0  # two in a row are no end
    board.answers = lambda frame, answer: []
    with pytest.raises(
        RunStopped, match=r"^the port: the board has not answered for 3 ticks in a row, within 10 ms each"
    ):
        [update(wired, 1.0) for _ in range(3)]


def test_a_board_that_starts_again_has_lost_its_state() -> None:
    for why, words in ((b"", "is lost$"), (bytes((101,)), "is lost: its processor met a fault$")):
        board = PythonBoard()
        wired = connect(board)
        board.answers = lambda frame, answer, why=why: [Frame("!", 0, why)]
        with pytest.raises(
            RunStopped, match=f"^the port: the board has started again, and its controller's state {words}"
        ):
            update(wired, 1.0)


def test_a_cable_that_is_pulled_is_said() -> None:
    board = PythonBoard()
    wired = connect(board)
    update(wired, 1.0)
    board.gone = True
    with pytest.raises(RunStopped, match=r"^the port: the cable is pulled, or the board is gone$"):
        update(wired, 1.0)


def test_a_controller_that_has_stopped_is_said() -> None:
    board = PythonBoard()
    wired = connect(board)
    board.answers = lambda frame, answer: [Frame("u", frame.number, struct.pack("<3I5f", 7, 0, 1, *[0.0] * 5))]
    with pytest.raises(RunStopped, match=r"^the controller on the board has stopped: a reading was not finite$"):
        update(wired, 1.0)


def test_a_number_that_is_not_finite_is_not_taken() -> None:
    board = PythonBoard()
    wired = connect(board)
    board.answers = lambda frame, answer: [Frame("u", frame.number, struct.pack("<3I5f", 7, 0, 0, *[math.nan] * 5))]
    with pytest.raises(RunStopped, match=r"^the port: the board answered a number that is not finite$"):
        update(wired, 1.0)


def test_an_introduction_that_is_too_long_is_refused() -> None:
    long = dataclasses.replace(TOY, observer="o" * 40, gimbals=GimbalAngle((1.0,) * 6, (1.5707963,) * 6))
    with pytest.raises(
        InputError, match=r"its introduction has 2.. characters, a frame has room for 215: take a shorter"
    ):
        long.text()
    assert dataclasses.replace(long, gimbals=GimbalAngle((-1.0,) * 4, (-1.5707963,) * 4)).text()


def test_its_log_has_the_frames_and_the_rates() -> None:
    wired = connect(PythonBoard())
    for angle in (1.0, 2.0):
        update(wired, angle)
    frames = FrameReader().feed(wired.log([0.25]))
    assert [frame.kind for frame in frames] == ["h", "u", "u", "r", "u", "u"]
    assert frames[3].payload == struct.pack("<f", 0.25)
    wired.start()
    assert [frame.kind for frame in FrameReader().feed(wired.log())] == ["h"]


def test_frames_that_do_not_fit_are_refused() -> None:
    """There has to be time for one and a half times the frames; all that the message proposes is taken."""
    require_fit(204_000, (30, 38), 0.005)
    with pytest.raises(
        InputError,
        match=r"^--baud 203999: a tick's frames do not fit: 30 \+ 38 bytes take 3\.33 ms, 5 with room for USB, and the "
        r"deadline is 5 ms; take at least 204000 baud, such as 230400, a ",
    ):
        require_fit(203_999, (30, 38), 0.005)
    with pytest.raises(
        InputError, match=r"controller\.rate_hz of at most 112, or a --deadline-ms of at least 8\.9 where nothing moves"
    ):
        require_fit(115_200, (30, 38), 0.005)
    require_fit(115_200, (30, 38), 1.0 / 112.0)
    require_fit(115_200, (30, 38), 0.0089)
    with pytest.raises(InputError, match=r"take at least 204000 baud, such as 230400$"):
        require_fit(1, (30, 38), 0.005)

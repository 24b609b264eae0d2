"""The emulated board: what it is sent and answers, how it counts, and how it ends."""

from __future__ import annotations

import socket
import struct
import time
from pathlib import Path

import pytest

from cmg_mj.core.errors import InputError, RunStopped
from cmg_mj.features.board.qemu import Board
from tests.features.board.toy import needs_board, toy

pytestmark = needs_board

ACCELERATIONS = (0.25, 9.75, -0.5, 9.5)


def is_running(process: int) -> bool:
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def test_it_answers_what_the_controller_decides(tmp_path: Path) -> None:
    with Board(toy(tmp_path)) as board:
        assert board.sizes == (4, 4, 16, 4)
        answers = [board.update(ACCELERATIONS, (k, 0.5)) for k in range(3)]
        assert [answer.u for answer in answers] == [105.0, 206.0, 307.0]
        assert [answer.x_e for answer in answers] == [0.0, 0.5, 1.0]
        board.start()
        answer = board.update(ACCELERATIONS, (0.0, 0.0))
    assert answer.u == 100.0
    assert answer.estimate == ACCELERATIONS


def test_a_controller_that_has_stopped_ends_the_run(tmp_path: Path) -> None:
    with Board(
        toy(tmp_path, update="if (e[0] > 8.0f) { *u = 0; return e[0] > 9.0f ? 7 : (toy_status)e[1]; }")
    ) as board:
        for status, reason in (
            (1.0, "a reading was not finite"),
            (2.0, "its state, estimate or command was not finite"),
        ):
            with pytest.raises(RunStopped, match=rf"{reason}$"):
                board.update(ACCELERATIONS, (8.5, status))
        with pytest.raises(RunStopped, match=r"status 7$"):
            board.update(ACCELERATIONS, (9.5, 0.0))
        assert board.update(ACCELERATIONS, (0.0, 0.0)).u == 100.0


def test_its_observer_is_not_the_controllers(tmp_path: Path) -> None:
    with Board(toy(tmp_path)) as board:
        board.init(0.0, 0.0, 0.0)
        assert board.step(1.0, 2.0, 3.0, 4.0)[0] == (1.0, 2.0, 3.0, 4.0)
        assert board.update(ACCELERATIONS, (0.0, 0.0)).u == 100.0


@pytest.mark.slow
def test_it_counts_instructions_and_stack(tmp_path: Path) -> None:
    """Exactly, and always the same: a step with 250 more instructions takes 250 more."""
    step_costs = []
    for more in ("", '__asm volatile(".rept 250\\n\\tnop\\n\\t.endr");'):
        with Board(toy(tmp_path, step=more), counting=True) as board:
            board.init(0.0, 0.0, 0.0)
            counts = {board.step(0.1, 0.2, 0.3, 0.4)[1] for _ in range(20)}
            assert len(counts) == 1
            step_costs.append(counts.pop())
    assert step_costs[1].instructions - step_costs[0].instructions == 250
    assert 0 < step_costs[0].instructions < 20
    assert step_costs[0].stack == 0


def test_it_knows_the_deepest_stack(tmp_path: Path) -> None:
    room = "volatile int room[300]; for (int i = 0; i < 300; i++) room[i] = 1; s->steps += room[7];"
    with Board(toy(tmp_path, step=room)) as board:
        assert 1200 <= board.step(0.0, 0.0, 0.0, 0.0)[1].stack <= 1216
        board.init(0.0, 0.0, 0.0)
        assert board.init(0.0, 0.0, 0.0).stack == 0


def test_no_process_is_left_behind(tmp_path: Path) -> None:
    with Board(toy(tmp_path)) as board:
        process = board._process.pid
        assert is_running(process)
    assert not is_running(process)
    board = Board(tmp_path / "toy-toy.elf")
    process = board._process.pid
    del board
    assert not is_running(process)


@pytest.mark.parametrize(
    ("update", "message"),
    [
        pytest.param("for (;;) {}", "the board has not answered for 3 s", marks=pytest.mark.slow),
        ("__builtin_trap();", "the board is gone: its processor met a fault"),
        (
            "volatile int room[1100]; for (int i = 1099; i >= 0; i--) room[i] = i; c->x_e = room[3];",
            "the board is gone: its stack is full",
        ),
    ],
)
def test_what_goes_wrong_on_it_is_said(tmp_path: Path, update: str, message: str) -> None:
    image = toy(tmp_path, update=f"if (e[0] == 1) {{ {update} }}")
    with Board(image, patience_s=3.0 if "not answered" in message else 30.0) as board:
        assert board.update(ACCELERATIONS, (0.0, 0.0)).u == 100.0
        with pytest.raises(RunStopped, match=f"^{message}$"):
            board.update(ACCELERATIONS, (1.0, 0.0))
        process = board._process.pid
    assert not is_running(process)


def test_c_that_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^toy: arm-none-eabi-gcc refuses it: .*no_such"):
        toy(tmp_path, update="no_such(e[0]);")


def test_arithmetic_in_double_precision_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="double-promotion"):
        toy(tmp_path, update="if (e[0] * 0.1 > e[1]) return TOY_OK;")


def test_what_is_sent_before_the_question_is_no_answer(tmp_path: Path) -> None:
    """A board that answers twice is asked three times."""
    with Board(toy(tmp_path)) as board:
        for _ in range(3):
            board._line.sendall(b"n" + board._packed(0.0, 0.0, 0.0))
            while len(board._line.recv(64, socket.MSG_PEEK)) < struct.calcsize("<c2I"):
                time.sleep(0.001)  # an answer arrives in pieces
            assert board.step(1.0, 2.0, 3.0, 4.0)[0] == (1.0, 2.0, 3.0, 4.0)

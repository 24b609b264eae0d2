"""A board's log, the frames of its line, as a log of the user's."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cmg_mj.codegen.board.frames import Frame
from cmg_mj.codegen.board.identity import Identity
from cmg_mj.codegen.board.log_file import read_board_log
from cmg_mj.core.tilt import GimbalAngle
from cmg_mj.errors import InputError
from cmg_mj.replay.logs import ReadOptions, table
from cmg_mj.replay.logs.reading import read_log
from tests.command import cmg_mj

PAIR = GimbalAngle((1.0, -1.0), (1.5, 1.5))
WHO = Identity("cmg_mj", "2", "linear", "single", 100.0, "", (0.1, 0.2), PAIR)
N = 400
TILT = 0.1 * np.sin(0.05 * np.arange(N))
RATE = 0.5 * np.cos(0.05 * np.arange(N))


def hello(identity: Identity = WHO) -> bytes:
    return Frame("h", 1, struct.pack("<2I", 1, 2) + identity.text().encode()).encode()


def sample(k: int) -> bytes:
    """Both accelerometers show gravity alone; the gimbals are 0.01 k from their zeros, the command is k."""
    forces = (-9.81 * math.sin(TILT[k]), 9.81 * math.cos(TILT[k])) * 2
    return Frame("u", k % 256, struct.pack("<6f", *forces, 1.5 + 0.01 * k, 1.5 - 0.01 * k)).encode()


def answer(k: int) -> bytes:
    return Frame("u", k % 256, struct.pack("<3I5f", 0, 0, 0, k, 0.0, 0.0, 0.0, 0.0)).encode()


def reference(k: int) -> bytes:
    return Frame("r", k % 256, struct.pack("<f", RATE[k])).encode()


def asked(kind: str, number: int = 1) -> bytes:
    """A question without a payload; of the kind 's' the answer too."""
    return Frame(kind, number, b"").encode()


def write(path: Path, parts: Sequence[bytes]) -> Path:
    path.write_bytes(b"".join(parts))
    return path


def whole(lacking: Sequence[int] = ()) -> list[bytes]:
    return [hello(), *(sample(k) + answer(k) + reference(k) for k in range(N) if k not in lacking)]


def test_it_is_a_log_with_everything(tmp_path: Path) -> None:
    log = read_log(write(tmp_path / "board.frames", whole()))
    assert log.has == {"gimbals", "acceleration", "reference"}
    assert (log.dt, len(log), log.notes) == (0.01, N, ())
    np.testing.assert_allclose(log["y1_rad"], TILT, atol=1e-6)
    np.testing.assert_allclose(log["y2_rad"], 0.01 * np.arange(N), atol=1e-5)
    np.testing.assert_array_equal(log["u_rad_s"], np.arange(N))
    np.testing.assert_allclose(log["reference_rad_s"], RATE, atol=1e-6)
    assert log.tilt is not None
    assert (log.tilt.r_inner, log.tilt.r_outer) == (0.1, 0.2)


def test_without_a_reference_it_has_none(tmp_path: Path) -> None:
    parts = [hello(), *(sample(k) + answer(k) for k in range(N))]
    assert read_log(write(tmp_path / "board.frames", parts)).has == {"gimbals", "acceleration"}


def test_an_answer_that_was_lost_holds_the_command(tmp_path: Path) -> None:
    parts = [hello(), *(sample(k) + (b"" if k in (7, 8) else answer(k)) for k in range(N))]
    log = read_log(write(tmp_path / "board.frames", parts))
    assert log["u_rad_s"][5:10].tolist() == [5.0, 6.0, 6.0, 6.0, 9.0]


def test_what_is_missing_and_damaged_is_said(tmp_path: Path) -> None:
    """Two samples in a row, and a byte of a third: three are bridged, and the times after them are right."""
    parts = whole(lacking=(100, 101))
    spoiled = bytearray(parts[51])
    spoiled[9] ^= 4
    parts[51] = bytes(spoiled)
    log = read_log(write(tmp_path / "board.frames", parts))
    assert len(log) == N
    assert log["time_s"][-1] == pytest.approx(0.01 * (N - 1))
    assert "the board's log is damaged in 1 place" in log.notes
    assert "3 samples are missing in the board's log, by its frames' numbers" in log.notes
    np.testing.assert_allclose(log["y1_rad"], TILT, atol=1e-3)


def test_a_sample_that_was_sent_twice_is_no_answer(tmp_path: Path) -> None:
    parts = [hello(), *(sample(k) * (2 if k == 7 else 1) + answer(k) for k in range(N))]
    log = read_log(write(tmp_path / "board.frames", parts))
    assert log["u_rad_s"].tolist() == list(range(N))


def test_a_rate_belongs_to_the_sample_of_its_number(tmp_path: Path) -> None:
    parts = [hello(), *((b"" if k == 10 else sample(k) + answer(k)) + reference(k) for k in range(N))]
    log = read_log(write(tmp_path / "board.frames", parts))
    np.testing.assert_allclose(log["reference_rad_s"][[8, 9, 11]], RATE[[8, 9, 11]], atol=1e-6)


def test_what_lies_behind_a_damaged_length_is_read(tmp_path: Path) -> None:
    """The length of the last sample but two says that the frame goes on beyond the file's end."""
    parts = whole()
    spoiled = bytearray(parts[-3])
    spoiled[3] = 255
    log = read_log(write(tmp_path / "board.frames", [*parts[:-3], bytes(spoiled), *parts[-2:]]))
    assert log["u_rad_s"][-2:].tolist() == [N - 2, N - 1]
    assert "the board's log is damaged in 1 place" in log.notes


def test_a_recording_may_begin_with_the_boards_start(tmp_path: Path) -> None:
    started = Frame("!", 0, b"\0").encode()
    assert len(read_log(write(tmp_path / "board.frames", [started, *whole()]))) == N


def test_both_directions_of_a_wire_are_the_log_that_the_host_writes(tmp_path: Path) -> None:
    """Questions, sizes, starts, refusals, frames sent again, answers that come late or twice."""
    extra = {5: sample(5), 6: answer(5), 7: answer(7), 8: Frame("?", 8, b"").encode() + sample(8)}
    begun = Frame("!", 0, b"\0").encode()
    handshake = asked("h") + hello() + asked("i", 2) + Frame("i", 2, struct.pack("<4I", 4, 36, 52, 3)).encode()
    start = asked("s", 3) * 2
    exchanged = [sample(k) + extra.get(k, b"") + answer(k) for k in range(N)]
    exchanged[0] += asked("s", 3)  # the answer to a start that was sent twice
    raw = read_log(write(tmp_path / "wire.bin", [begun, handshake, start, *exchanged]))
    cut = read_log(write(tmp_path / "cut.bin", [sample(9)[11:], asked("x"), begun, hello(), start, *exchanged]))
    host = read_log(write(tmp_path / "board.frames", [hello(), *(sample(k) + answer(k) for k in range(N))]))
    for name in ("time_s", "y1_rad", "y2_rad", "u_rad_s"):
        np.testing.assert_array_equal(raw[name], host[name], err_msg=name)
        np.testing.assert_array_equal(cut[name], host[name], err_msg=name)
    assert raw.notes == host.notes == ()
    assert cut.notes == ("the board's log is damaged in 1 place",)


FOUR = replace(WHO, gimbals=GimbalAngle((1.0, -1.0, 1.0, -1.0), (1.5,) * 4))


def four(k: int) -> bytes:
    """A sample of four gimbals: 32 bytes."""
    return Frame("u", k % 256, struct.pack("<8f", 0.0, 9.81, 0.0, 9.81, *[1.5 + 0.01 * k] * 4)).encode()


def four_answer(k: int, stack: int = 200) -> bytes:
    """Its answer with an estimate of three parts: 32 bytes too."""
    return Frame("u", k % 256, struct.pack("<3I5f", 900, stack, 0, k, 0.0, 0.0, 0.0, 0.0)).encode()


def test_a_sample_and_an_answer_of_the_same_size(tmp_path: Path) -> None:
    """The answer of a missing sample is not a sample; a sample without its answer is one."""
    parts = [b"" if k in (10, 20) else four(k) for k in range(60)]
    answers = [b"" if k in (20, 30) else four_answer(k) for k in range(60)]
    exchanged = [part + answer for part, answer in zip(parts, answers, strict=True)]
    log = read_board_log(write(tmp_path / "board.frames", [hello(FOUR), *exchanged]), 100)
    ticks = [k for k in range(60) if k not in (10, 20)]
    np.testing.assert_allclose(log.columns["time_s"], 0.01 * np.array(ticks))
    np.testing.assert_array_equal(log.columns["command_rad_s"], [29.0 if k == 30 else k for k in ticks])
    assert (log.missing, log.damaged) == (2, 0)


def test_a_frame_that_may_be_either_is_refused_where_their_order_does_not_tell(tmp_path: Path) -> None:
    """In free fall a sample begins as an answer of a board that measures no stack does."""
    falling = Frame("u", 1, struct.pack("<8f", *[0.0] * 4, *[1.5] * 4)).encode()
    path = write(tmp_path / "board.frames", [hello(FOUR), four(0), four_answer(0), falling, four_answer(1, 0), four(2)])
    assert read_board_log(path, 100).columns["command_rad_s"].tolist() == [0.0, 1.0, 1.0]
    for lone in (falling, four_answer(1, 0)):
        for rest in (b"", four(2)):
            write(path, [hello(FOUR), four(0), four_answer(0), lone, rest])
            with pytest.raises(InputError, match=r"number 1, row 2, may be a sample without its answer or an answer"):
                read_board_log(path, 100)


def test_a_file_is_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    counts = []
    monkeypatch.setattr(
        "cmg_mj.replay.logs.from_board.read_board_log", lambda *a: counts.append(a) or read_board_log(*a)
    )
    path = write(tmp_path / "board.frames", whole())
    read_log(path)
    assert len(counts) == 1
    assert "read_board_log" not in Path(table.__file__).read_text()


def test_a_long_gap_parts_the_log(tmp_path: Path) -> None:
    log = read_log(write(tmp_path / "board.frames", whole(lacking=range(150, 300))))
    assert [len(range(*part.indices(N))) for part in log.parts] == [150, 100]
    assert log["time_s"][150] == pytest.approx(3.0)


def test_its_options_are_a_users(tmp_path: Path) -> None:
    path = write(tmp_path / "board.frames", whole())
    log = read_log(path, ReadOptions(time_range_s=(1.0, 2.0), scale={"rate": -1.0}))
    assert len(log) == 101
    np.testing.assert_allclose(log["reference_rad_s"], -RATE[100:201], atol=1e-6)
    assert read_log(path, ReadOptions(columns={"time": "time_s", "rate": "reference_rad_s", "tilt": "gimbal_rad"})).has
    with pytest.raises(InputError, match=r"has no column 'gyro_rad'; it has: 'command_rad_s'"):
        read_log(path, ReadOptions(columns={"tilt": "gyro_rad"}))


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ([hello()], "a board's log without a sample: record what the host sends too$"),
        ([Frame("h", 1, b"12345678who knows").encode(), sample(0)], "no firmware of cmg_mj: 'who knows'$"),
        ([hello()[:20]], "without its introduction, the frame 'h', or with a damaged one: record both directions"),
        ([sample(k) + answer(k) for k in range(5)], "without its introduction, the frame 'h', or with a damaged one"),
        ([asked("h"), asked("i"), sample(0), sample(1)], "without its introduction, the frame 'h', or with a damaged"),
        ([hello(), answer(0), answer(1)], "a board's log without a sample: record what the host sends too$"),
        (
            [hello(), asked("s", 2), sample(0), answer(0), sample(1), asked("s", 9), sample(2)],
            "the log of two runs: the controller starts again after 2 samples: cut it in two$",
        ),
        ([hello(), sample(0), hello(replace(WHO, rate_hz=400.0))], "the log of two boards, or of two controllers"),
        ([hello(replace(WHO, version="99")), sample(0)], "firmware's version 99; this cmg_mj reads version 2$"),
    ],
)
def test_logs_that_are_none(tmp_path: Path, parts: list[bytes], message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_log(write(tmp_path / "board.frames", parts))


@pytest.mark.slow
@pytest.mark.usefixtures("elsewhere")
def test_the_command_takes_it() -> None:
    path = write(Path("board.frames"), whole())
    outcome = cmg_mj("replay", path, "--observers", "linear,finite_difference", "--out", "here", "--markdown")
    assert outcome.status == 0, outcome.err
    assert "| `finite_difference` |" in outcome.out
    assert Path("here/summary.json").is_file()

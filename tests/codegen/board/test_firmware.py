"""The firmware's own side of the wire, on the emulated board; and its port layers for two boards."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import signal
import socket
import struct
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from cmg_mj.codegen.board.frames import Frame, FrameReader
from cmg_mj.codegen.board.identity import read_identity
from cmg_mj.codegen.board.image import FIRMWARE, MACHINES
from cmg_mj.codegen.board.project import project_files
from cmg_mj.codegen.board.qemu import emulator_command
from cmg_mj.codegen.board.tools import available
from tests.codegen.board.toy import needs_board, toy
from tests.codegen.board.wire import TOY
from tests.command import ROOT, cmg_mj

pytestmark = needs_board

PORT_LAYER = ["port_cycles", "port_init", "port_read", "port_reset", "port_time", "port_write"]
CONSTANTS = ["port_cycles_a_second", "port_name"]


class RawLine:
    """The emulated board's line, byte by byte."""

    def __init__(self, line: socket.socket) -> None:
        self.line, self._reader = line, FrameReader()

    def first(self) -> Frame:
        """The first frame, which nobody has asked for."""
        while not (frames := self._reader.feed(self.line.recv(64))):
            pass
        return frames[0]

    def answers(self, data: bytes, count: int | None = None) -> list[Frame]:
        """What comes back for some bytes before the answer to another frame; so many frames, where that is known."""
        self.line.sendall(data + Frame("i", 255, b"").encode())
        frames: list[Frame] = []
        while not frames or (frames[-1].kind, frames[-1].number) != ("i", 255):
            frames += self._reader.feed(self.line.recv(4096))
        assert count is None or len(frames) == count + 1
        return frames[:-1]


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The toy's, which the tests here share."""
    return toy(tmp_path_factory.mktemp("toy"), identity=TOY.text())


@pytest.fixture
def line(image: Path) -> Iterator[RawLine]:
    with emulated(image) as line:
        line.answers(Frame("s", 0, b"").encode(), 1)
        yield line


@contextmanager
def emulated(image: Path) -> Iterator[RawLine]:
    """A board that has just begun."""
    host, board = socket.socketpair()
    with board:
        process = subprocess.Popen(emulator_command(image), stdin=board.fileno(), stdout=board.fileno())
    with process, host:
        host.settimeout(60.0)
        try:
            raw = RawLine(host)
            assert raw.first() == Frame("!", 0, b"")
            yield raw
        finally:
            process.kill()


def sample(number: int, angle: float) -> bytes:
    return Frame("u", number, struct.pack("<6f", 0.0, 9.8, 0.0, 9.8, angle, 0.0)).encode()


def commands(frames: list[Frame]) -> list[tuple[int, float]]:
    return [(frame.number, struct.unpack_from("<3If", frame.payload)[3]) for frame in frames]


def test_a_frame_sent_again_is_not_executed_again(line: RawLine) -> None:
    """u of the toy is the angle and 100 an update. The cost too is that of the first time."""
    first, again, other = line.answers(sample(1, 1.0) + sample(1, 1.0) + sample(2, 1.0), 3)
    assert first == again
    assert commands([first, other]) == [(1, 101.0), (2, 201.0)]
    (start,) = line.answers(Frame("s", 3, b"").encode(), 1)
    assert start == Frame("s", 3, b"")
    # One that comes late, after another, is neither executed nor answered; up to 127 numbers ahead it is a new one.
    assert commands(line.answers(sample(5, 1.0) + sample(4, 1.0) + sample(1, 1.0) + sample(6, 1.0), 2)) == [
        (5, 101.0),
        (6, 201.0),
    ]
    assert commands(line.answers(sample(100, 1.0) + sample(227, 1.0), 2)) == [(100, 301.0), (227, 401.0)]


def test_it_introduces_itself(line: RawLine) -> None:
    (hello,) = line.answers(Frame("h", 1, b"").encode(), 1)
    identity = read_identity(hello, "")
    assert (identity.board, identity.cycles_per_second) == ("mps2-an500", 0)
    assert identity.text() == TOY.text()
    times = [struct.unpack_from("<2I", line.answers(Frame("h", n, b"").encode(), 1)[0].payload)[1] for n in (2, 3)]
    assert 0 < times[1] - times[0] < 60_000_000


@pytest.mark.parametrize("fault", ["lost", "doubled", "damaged", "noise"])
def test_a_mistake_costs_one_frame_and_not_the_next(line: RawLine, fault: str) -> None:
    """Where a frame is spoiled, the one sent again under its number is executed, and once."""
    good, angle = sample(1, 1.0), 1.0
    for executed, at in enumerate(range(len(good)), 1):
        wrong = {
            "lost": b"",
            "doubled": good[at : at + 1] * 2,
            "damaged": bytes((good[at] ^ 0x10,)),
            "noise": good[at : at + 1] + b"\xa5\x5a",
        }[fault]
        number = at % 100 + 1
        good = sample(number, angle)
        frames = line.answers(good[:at] + wrong + good[at + 1 :] + good)
        assert commands([frame for frame in frames if frame.kind == "u"])[-1] == (number, angle + 100.0 * executed)


def test_an_unknown_message_is_refused_once_the_line_is_quiet(line: RawLine) -> None:
    unknown = Frame("x", 9, b"").encode() + Frame("u", 8, b"1234").encode()
    line.line.sendall(unknown)
    assert line.first() == Frame("?", 9, b"")  # once; the emulated board waits for a second
    assert line.answers(unknown, 0) == []  # what comes whole behind it is answered instead
    line.line.sendall(sample(7, 1.0)[:-1])
    assert line.first() == Frame("?", 7, b"")
    assert line.answers(sample(7, 1.0)[-1:], 0) == []  # the rest comes too late


def test_a_board_that_has_started_again_says_so_until_it_is_put_at_its_start(image: Path) -> None:
    """Its first message may be lost, and it must not go on with a fresh controller in the middle of a run."""
    with emulated(image) as line:
        ready = Frame("!", 0, b"")
        assert line.answers(sample(17, 1.0) + sample(17, 1.0) + sample(18, 1.0), 3) == [ready] * 3
        start = Frame("s", 19, b"")
        assert line.answers(start.encode(), 1) == [start]
        assert commands(line.answers(sample(20, 1.0), 1)) == [(20, 101.0)]


def objects(machine: str, folder: Path) -> list[str]:
    """Names that the port layer of a machine defines for others."""
    source, target = FIRMWARE / MACHINES[machine].sources, folder / "port.o"
    subprocess.run(["arm-none-eabi-gcc", "-mcpu=cortex-m7", "-c", source, "-o", target], check=True)
    names = subprocess.run(["arm-none-eabi-nm", "-g", target], capture_output=True, text=True, check=True).stdout
    return sorted(line.split()[-1] for line in names.splitlines() if " U " not in line)


@pytest.mark.parametrize("machine", MACHINES)
def test_a_port_layer_is_six_functions_and_two_constants(machine: str, tmp_path: Path) -> None:
    assert objects(machine, tmp_path) == sorted(PORT_LAYER + CONSTANTS)
    header = (FIRMWARE / "port.h").read_text()
    assert sorted(re.findall(r"\b(port_\w+)\(", header)) == PORT_LAYER


def test_the_flashed_image_lies_where_the_chip_begins(tmp_path: Path) -> None:
    """Vectors first in the flash, the stack's end and `reset` in them; what is written lies in the 64 kB of DTCM."""
    elf = toy(tmp_path, machine="stm32f746", identity=TOY.text())
    binary = tmp_path / "toy.bin"
    subprocess.run(["arm-none-eabi-objcopy", "-O", "binary", elf, binary], check=True)
    stack, reset = struct.unpack_from("<2I", binary.read_bytes())
    listing = subprocess.run(["arm-none-eabi-nm", elf], capture_output=True, text=True, check=True).stdout
    places = {name: int(place, 16) for place, _, name in (line.split() for line in listing.splitlines())}
    assert stack == places["stack_top"] == 0x20001000
    assert reset == places["reset"] | 1
    assert all(0x08000000 <= place < 0x08100000 or 0x20000000 <= place < 0x20010000 for place in places.values())
    assert places["vectors"] == 0x08000000
    assert b"board=" in binary.read_bytes()
    assert b"STM32F746G-DISCO" in binary.read_bytes()


def make(folder: Path, *arguments: str) -> bytes:
    """Build a project; return its binary."""
    subprocess.run(["make", "-s", "-C", folder, *arguments], check=True)
    return (folder / "gyro_free.bin").read_bytes()


@pytest.mark.slow
@pytest.mark.skipif(not available() or shutil.which("make") is None, reason="no make, or no CasADi")
@pytest.mark.parametrize("machine", MACHINES)
def test_the_project_builds(machine: str, tmp_path: Path) -> None:
    folder = tmp_path / "project"
    outcome = cmg_mj("export", "gyro_free", "--firmware", machine, "--out", folder)
    assert outcome.status == 0
    assert ("has never run on one" in outcome.err) == (machine != "mps2")
    assert {*project_files(machine), "gyro_free.c", "gyro_free.h"} <= {path.name for path in folder.iterdir()}
    assert make(folder) == make(folder, "BAUD=460800")
    assert 4000 < (folder / "gyro_free.bin").stat().st_size < 20_000
    if machine != "mps2":  # whose line has no rate
        fast = make(folder, "BAUD=921600")
        assert make(folder, "BAUD=921600") == fast != make(folder)
        for rate in (1_647, 7_000_000):
            with pytest.raises(subprocess.CalledProcessError):
                make(folder, f"BAUD={rate}")
    again = cmg_mj("export", "gyro_free", "--firmware", machine, "--out", folder)
    assert again.status == 0


@pytest.mark.usefixtures("elsewhere")
def test_what_a_firmware_cannot_be() -> None:
    assert cmg_mj("export", "linear", "--firmware", "mps2", "--precision", "double").complaint == (
        "--precision double: the firmware's controller is in single precision; leave it out"
    )
    assert cmg_mj("export", "linear", "--firmware", "mps2", "--name", "mine").complaint == (
        "--name mine: the firmware's controller has the observer's own name; leave it out"
    )
    assert not Path("runs").exists()


@pytest.mark.slow
@pytest.mark.skipif(not available() or shutil.which("make") is None, reason="no make, or no CasADi")
@pytest.mark.usefixtures("elsewhere")
def test_what_the_export_says_can_be_typed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A user's class and settings that a shell would read; `make emulate` in one terminal, the run in another."""
    shutil.copy(ROOT / "examples/own_observer.py", "own_observer.py")
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = str(server.getsockname()[1])
    monkeypatch.setenv("PORT", port)
    settings = ["--set", "push=[]", "--set", "duration_s=0.5", "--set", "controller.gains=[36, 4, -1, 0.3]"]
    outcome = cmg_mj(
        *["export", "own_observer:HalfDifference", "--firmware", "mps2", "--out", "the firmware"], *settings
    )
    first, second = outcome.err.splitlines()[-2:]
    blocking, run_it = first.partition("keeps busy: ")[2], second.partition("in this one: ")[2]
    comments = Path("the firmware/Makefile").read_text().splitlines()[1:3]
    assert [line[2:].replace("make ", "make -C 'the firmware' ") for line in comments] == [
        first.partition(". ")[2],
        second,
    ]
    command, *arguments = shlex.split(run_it.replace("5555", port))
    assert command == "cmg-mj"
    emulator = subprocess.Popen(shlex.split(blocking), start_new_session=True, stdout=subprocess.DEVNULL)
    try:
        arguments += ["--deadline-ms", "60000", "--out", "here"]
        while "Connection refused" in (run := cmg_mj(*arguments)).err:
            assert emulator.poll() is None
            time.sleep(0.1)
    finally:
        os.killpg(emulator.pid, signal.SIGKILL)
        emulator.wait()
    assert run.status == 0
    assert "100 ticks" in run.out
    assert "update on the board" not in run.out  # the emulator knows no cycles

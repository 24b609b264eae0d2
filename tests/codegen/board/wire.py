"""Boards on a wire for tests: one in Python, and the emulated one behind a pty whose line makes mistakes."""

from __future__ import annotations

import os
import pty
import random
import select
import socket
import struct
import subprocess
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from cmg_mj.codegen.board.frames import Frame, FrameReader
from cmg_mj.codegen.board.identity import Identity
from cmg_mj.codegen.board.qemu import emulator_command
from cmg_mj.codegen.board.serial_line import Closed
from cmg_mj.core.tilt import GimbalAngle

PAIR = GimbalAngle((1.0, -1.0), (1.5, 1.5))
TOY = Identity("cmg_mj", "2", "toy", "single", 200.0, "0badc0de", (0.1, 0.2), PAIR)


@dataclass
class PythonBoard:
    """A port behind which a board sums up the first encoder; `answers` says what goes back for each frame.

    Attributes:
        identity: Who it says it is.
        answers: (frame, answer) -> what is sent.
        executed: First encoder of each sample that was executed.
        received: Frames that have come.
        noise: Bytes that come before the next answer.
        gone: Whether the cable is pulled.
    """

    identity: Identity = TOY
    answers: Callable[[Frame, Frame], list[Frame]] = lambda frame, answer: [answer]
    executed: list[float] = field(default_factory=list)
    received: list[Frame] = field(default_factory=list)
    noise: bytes = b""
    gone: bool = False
    _out: bytearray = field(default_factory=bytearray)
    _reader: FrameReader = field(default_factory=FrameReader)
    _last: tuple[Frame, Frame] | None = None

    def read(self, wait_s: float) -> bytes:
        if self.gone:
            raise Closed("the cable is pulled, or the board is gone")
        out = bytes(self._out)
        self._out.clear()
        if not out:
            time.sleep(min(wait_s, 0.001))
        return out

    def write(self, data: bytes) -> None:
        if self.gone:
            raise Closed("the cable is pulled, or the board is gone")
        for frame in self._reader.feed(data):
            self.received.append(frame)
            if self._last is None or frame != self._last[0]:
                self._last = frame, Frame(frame.kind, frame.number, self._execute(frame))
            for sent in self.answers(frame, self._last[1]):
                self._out += self.noise + sent.encode()
                self.noise = b""

    def close(self) -> None:
        self.gone = True

    def _execute(self, frame: Frame) -> bytes:
        if frame.kind == "h":
            return struct.pack("<2I", 1_000_000, 0) + f"{self.identity.text()} board=python".encode()
        if frame.kind == "i":
            return struct.pack("<4I", 4, 4, 16, 3)
        if frame.kind != "u":
            return b""
        self.executed.append(struct.unpack("<6f", frame.payload)[4])
        return struct.pack("<3I5f", 7, 0, 0, sum(self.executed), 0.5, 0.1, 0.2, 0.3)


@dataclass
class Faults:
    """Mistakes of a line, for each byte of either direction.

    Attributes:
        seed: Of the mistakes.
        lose: Share of bytes that are lost.
        double: Share of bytes that come twice.
        delay: Share of bytes before which the line waits.
        delay_s: For how long [s].
        counts: Number of mistakes of each kind.
    """

    seed: int
    lose: float = 0.0
    double: float = 0.0
    delay: float = 0.0
    delay_s: float = 0.0
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(("lose", "double", "delay"), 0))

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)

    def pieces(self, data: bytes) -> Iterator[bytes]:
        """Make mistakes in some bytes; yield what comes of them, piece by piece."""
        out = bytearray()
        for byte in data:
            chance = self._random.random()
            if chance < self.lose:
                self.counts["lose"] += 1
                continue
            if chance < self.lose + self.delay:
                self.counts["delay"] += 1
                yield bytes(out)
                out.clear()
                time.sleep(self.delay_s)
            out.append(byte)
            if chance > 1.0 - self.double:
                self.counts["double"] += 1
                out.append(byte)
        yield bytes(out)


class PtyWire:
    """The emulated board behind a pty.

    Args:
        image: The image it starts from.
        faults: Mistakes of the line.

    Attributes:
        name: The port to open.
        pulled_after: Number of bytes from the host after which the cable is pulled.
        deaf: While it is above 0, so many bytes from the host are lost.
        late_s: Time for which what the board sends is held back [s].
        recorded: All bytes of both directions, in their order.
    """

    def __init__(self, image: Path, faults: Faults | None = None) -> None:
        self.faults = faults
        self.pulled_after: int | None = None
        self.deaf = 0
        self.late_s = 0.0
        self.recorded = bytearray()
        self._socket, board = socket.socketpair()
        with board:
            self.process = subprocess.Popen(
                emulator_command(image), stdin=board.fileno(), stdout=board.fileno(), stderr=subprocess.DEVNULL
            )
        self._socket.settimeout(30.0)
        reader = FrameReader()
        while not (frames := reader.feed(self._socket.recv(64))):
            pass
        assert frames == [Frame("!", 0, b"")]
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.name = os.ttyname(self._slave)
        self._pulled = threading.Event()
        self._thread = threading.Thread(target=self._carry, daemon=True)
        self._thread.start()

    def __enter__(self) -> PtyWire:
        return self

    def __exit__(self, *exception: object) -> None:
        self._pulled.set()
        self._thread.join()
        self.process.kill()
        self.process.wait()
        self._socket.close()

    def _carry(self) -> None:
        sent = 0
        while not self._pulled.is_set():
            for source in select.select([self._master, self._socket], [], [], 0.02)[0]:
                if source is self._socket:
                    data = self._socket.recv(4096)
                    self.recorded += data
                    time.sleep(self.late_s)
                    for piece in self.faults.pieces(data) if self.faults else [data]:
                        os.write(self._master, piece)
                    continue
                data = os.read(self._master, 4096)
                sent += len(data)
                self.recorded += data
                if self.pulled_after is not None and sent > self.pulled_after:
                    self._pulled.set()
                    break
                if self.deaf:
                    self.deaf = max(0, self.deaf - len(data))
                    continue
                for piece in self.faults.pieces(data) if self.faults else [data]:
                    self._socket.sendall(piece)
        os.close(self._slave)
        os.close(self._master)


@contextmanager
def tcp_board(image: Path) -> Iterator[str]:
    """The emulated board behind a TCP port, as a serial server has it; yields the port to open."""
    processes: list[subprocess.Popen[bytes]] = []

    def serve() -> None:
        with suppress(OSError):
            while True:
                line, _ = server.accept()
                with line:
                    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    processes.append(
                        subprocess.Popen(
                            emulator_command(image),
                            stdin=line.fileno(),
                            stdout=line.fileno(),
                            stderr=subprocess.DEVNULL,
                        )
                    )

    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        try:
            yield f"tcp:127.0.0.1:{server.getsockname()[1]}"
        finally:
            server.shutdown(socket.SHUT_RDWR)
            thread.join()
            for process in processes:
                process.kill()
                process.wait()

"""A Cortex-M7 with an exported controller, emulated by QEMU."""

from __future__ import annotations

import select
import shutil
import socket
import struct
import subprocess
import sys
import threading
import weakref
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from cmg_mj.core.errors import RunStopped
from cmg_mj.features.board.image import EMULATOR
from cmg_mj.features.board.processor import Decision

PATIENCE_S = 30.0
"""Longest wait for an answer, which takes a fraction of a millisecond unless the machine is busy [s]."""

OPTIONS = "-M mps2-an500 -nodefaults -nographic -monitor none -semihosting-config enable=on,target=native -serial stdio"
"""Options of the emulator; the serial line is its standard input and output."""

STATUSES = {
    0: "nobody has talked to it for three minutes, and it has switched itself off",
    101: "its processor met a fault",
    102: "its stack is full",
}
"""Exit status -> the reason, as firmware/port.h numbers them."""

NOT_FINITE = {1: "a reading was not finite", 2: "its state, estimate or command was not finite"}
"""Status of an update -> the reason why the controller has stopped, as the exported header numbers them."""

NANOSECONDS_AN_INSTRUCTION = 1024
"""Emulated time of an instruction where instructions are counted: many ticks of the 25 MHz timer, so that none is
missed. Only the timer sees this clock [ns]."""


class Cost(NamedTuple):
    """The cost of one call on the board.

    Attributes:
        instructions: Exact number of instructions, including those of called functions; 0 if the board does not count.
        stack: Size of the used stack [bytes].
    """

    instructions: int
    stack: int


class Sizes(NamedTuple):
    """Sizes on the board: bytes of a real, of the observer, of the controller; parts of an estimate."""

    real: int
    observer: int
    controller: int
    estimates: int


class Board:
    """An emulated board that runs until `close`, or until it has received nothing for about three minutes.

    Args:
        image: The image to start from.
        counting: Whether to count instructions; the board is then slower by half an order of magnitude.
        patience_s: Longest wait for an answer [s].

    Attributes:
        costs: Cost of every update since the start.

    Raises:
        RunStopped: The board does not start.
    """

    def __init__(self, image: Path, *, counting: bool = False, patience_s: float = PATIENCE_S) -> None:
        host, board = socket.socketpair()
        command = [*_parent_death_prefix(), EMULATOR, *OPTIONS.split(), "-kernel", str(image)]
        if counting:
            command += ["-icount", f"shift={NANOSECONDS_AN_INSTRUCTION.bit_length() - 1}"]
        with board:
            # A new session: this process acts on Ctrl-C, between two ticks.
            try:
                self._process = subprocess.Popen(
                    command, stdin=board.fileno(), stdout=board.fileno(), stderr=subprocess.PIPE, start_new_session=True
                )
            except OSError as error:
                host.close()
                raise RunStopped(f"{EMULATOR} cannot be run: {error.strerror}") from error
        self.close = weakref.finalize(self, _end, self._process, host)
        self.costs: list[Cost] = []
        self._line = host
        self._line.settimeout(patience_s)
        try:
            self._receive("!", "<")
            self.sizes = Sizes(*self._ask("i", b"", "<4I"))
            self._reals = "f" if self.sizes.real == 4 else "d"
            self._per_instruction, self._empty = self._calibrated() if counting else (0.0, {})
            self.start()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Board:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def start(self) -> None:
        """Put the controller at its start."""
        self._ask("s", b"", "<")
        self.costs.clear()

    def update(self, accelerations: Sequence[float], encoders: Sequence[float]) -> Decision:
        """Send a sample of the sensors and receive the controller's decision.

        Args:
            accelerations: Specific force: inner x, z, outer x, z [m/s^2].
            encoders: Angles of the gimbals [rad].

        Returns:
            The decision.

        Raises:
            RunStopped: A number was not finite; u is 0 on the board until `start`.
        """
        numbers = 2 + self.sizes.estimates
        payload = self._packed(*accelerations, *encoders)
        counts, stack, status, u, x_e, *estimate = self._ask("u", payload, f"<3I{numbers}{self._reals}")
        self.costs.append(self._cost("u", counts, stack))
        if status:
            raise RunStopped(f"the controller on the board has stopped: {NOT_FINITE.get(status, f'status {status}')}")
        return Decision(u, x_e, tuple(estimate))

    def init(self, y1: float, y2: float, acceleration: float) -> Cost:
        """Start the separate observer, which is not the controller's."""
        return self._cost("n", *self._ask("n", self._packed(y1, y2, acceleration), "<2I"))

    def step(self, y1: float, y2: float, acceleration: float, u: float) -> tuple[tuple[float, ...], Cost]:
        """Step the separate observer; return its estimate and the cost."""
        layout = f"<2I{self.sizes.estimates}{self._reals}"
        counts, stack, *estimate = self._ask("o", self._packed(y1, y2, acceleration, u), layout)
        return tuple(estimate), self._cost("o", counts, stack)

    def _packed(self, *numbers: float) -> bytes:
        return struct.pack(f"<{len(numbers)}{self._reals}", *numbers)

    def _calibrated(self) -> tuple[float, dict[str, int]]:
        """Calibrate: counts for an instruction; counts of calls of empty functions, by kind of message."""
        _, _, hundred, _, thousand, _ = self._ask("c", b"", "<6I")
        return (thousand - hundred) / 900.0, dict(zip("uno", self._ask("e", b"", "<6I")[::2], strict=True))

    def _cost(self, kind: str, counts: int, stack: int) -> Cost:
        return Cost(round((counts - self._empty[kind]) / self._per_instruction) if self._empty else 0, stack)

    def _ask(self, kind: str, payload: bytes, layout: str) -> tuple:
        """Send a message, as firmware/board.c describes it, and receive the numbers of its answer."""
        try:
            while select.select([self._line], [], [], 0.0)[0] and self._line.recv(4096):
                pass  # what was sent before the question is no answer
            self._line.sendall(kind.encode() + payload)
        except OSError as error:
            raise RunStopped(f"the board is gone: {self._exit_message()}") from error
        return self._receive(kind, layout)

    def _receive(self, kind: str, layout: str) -> tuple:
        answer, size = b"", 1 + struct.calcsize(layout)
        while len(answer) < size:
            try:
                part = self._line.recv(size - len(answer))
            except TimeoutError as error:
                raise RunStopped(f"the board has not answered for {self._line.gettimeout():g} s") from error
            except OSError:
                part = b""
            if not part:
                raise RunStopped(f"the board is gone: {self._exit_message()}")
            answer += part
        if answer[:1] != kind.encode():
            raise RunStopped(f"the board answered something else than what {kind!r} asked")
        return struct.unpack(layout, answer[1:])

    def _exit_message(self) -> str:
        with suppress(subprocess.TimeoutExpired):
            status = self._process.wait(1.0)
            assert self._process.stderr is not None
            lines = self._process.stderr.read().decode(errors="replace").splitlines()
            messages = [line.strip() for line in lines if "warning:" not in line]
            if messages:
                return f"{EMULATOR} says {messages[-1]!r}"
            if status < 0:
                return f"{EMULATOR} was ended by signal {-status}"
            return STATUSES.get(status, f"{EMULATOR} has ended with status {status}")
        return "it has closed the line"


def _parent_death_prefix() -> list[str]:
    """Return a prefix for a command that must end with this process; without it the emulator ends when idle."""
    # To the system the thread that starts a process is its parent.
    main = threading.current_thread() is threading.main_thread()
    setpriv = shutil.which("setpriv") if sys.platform == "linux" and main else None
    return [setpriv, "--pdeathsig", "KILL"] if setpriv else []


def _end(process: subprocess.Popen, line: socket.socket) -> None:
    line.close()
    process.kill()
    process.wait()
    if process.stderr is not None:
        process.stderr.close()

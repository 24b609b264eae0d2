"""A Cortex-M7 with an exported controller, emulated by QEMU."""

from __future__ import annotations

import shutil
import socket
import struct
import subprocess
import sys
import threading
import weakref
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from cmg_mj.codegen.board.serial_line import Closed, SerialLine
from cmg_mj.codegen.board.tools import EMULATOR
from cmg_mj.controllers.processor import Decision
from cmg_mj.errors import RunStopped

PATIENCE_S = 30.0
"""An answer takes a fraction of a millisecond; a machine that is busy with other things may take its time."""

STATUSES = {
    0: "nobody has talked to it for three minutes, and it has switched itself off",
    101: "its processor met a fault",
    102: "its stack is full",
}
"""Why it halts, as firmware/machine.h numbers it."""

NANOSECONDS_AN_INSTRUCTION = 1024
"""Where instructions are counted, the emulated clock takes so long for each: many ticks of the 25 MHz timer, so that
none is missed. Nothing but the timer sees that clock."""


class Cost(NamedTuple):
    """What one call on the board took.

    Attributes:
        instructions: From its first to its last, those of the functions it calls too, exactly; only a board that counts
            knows them, another says 0.
        stack: Bytes of stack it has used.
    """

    instructions: int
    stack: int


class Sizes(NamedTuple):
    """What the board says of itself: bytes of a real, of the observer, of the controller; parts of an estimate."""

    real: int
    observer: int
    controller: int
    estimates: int


class Board:
    """An emulated board that runs until `close`, or until nobody has talked to it for about three minutes.

    Args:
        image: What it starts from.
        counting: Whether it counts instructions; it is then slower by half an order of magnitude.
        patience_s: For how long an answer may fail to come [s].

    Attributes:
        costs: What every update since the start has taken.

    Raises:
        RunStopped: It does not start.
    """

    def __init__(self, image: Path, *, counting: bool = False, patience_s: float = PATIENCE_S) -> None:
        ours, its = socket.socketpair()
        command = [*_ends_with_us(), EMULATOR, "-M", "mps2-an500", "-nodefaults", "-nographic", "-monitor", "none"]
        command += ["-semihosting-config", "enable=on,target=native", "-serial", "stdio", "-kernel", str(image)]
        if counting:
            command += ["-icount", f"shift={NANOSECONDS_AN_INSTRUCTION.bit_length() - 1}"]
        with its:
            # In a session of its own: a Ctrl-C is ours to act on, between two ticks.
            try:
                self._process = subprocess.Popen(
                    command, stdin=its.fileno(), stdout=its.fileno(), stderr=subprocess.PIPE, start_new_session=True
                )
            except OSError as error:
                ours.close()
                raise RunStopped(f"{EMULATOR} cannot be run: {error.strerror}") from error
        self.close = weakref.finalize(self, _end, self._process, ours)
        self.costs: list[Cost] = []
        self._line = SerialLine(ours, patience_s)
        try:
            self._told(self._line.await_ready)
            self.sizes = Sizes(*self._ask("i", b"", "<4I"))
            self._reals = "f" if self.sizes.real == 4 else "d"
            self._per_instruction, self._empty = self._calibrated() if counting else (0.0, {})
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Board:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    @property
    def process_id(self) -> int:
        """Of the emulator."""
        return self._process.pid

    def start(self) -> None:
        """Put the controller at its start."""
        self._ask("s", b"", "<")
        self.costs.clear()

    def update(self, accelerations: Sequence[float], encoders: Sequence[float]) -> Decision:
        """Hand over what the sensors show, and take what the controller decides.

        Args:
            accelerations: Inner x, z, outer x, z [m/s^2].
            encoders: Both gimbals' angles [rad].

        Returns:
            The decision.
        """
        numbers = 2 + self.sizes.estimates
        carried = self._packed(*accelerations, *encoders)
        counts, stack, u, x_e, *estimate = self._ask("u", carried, f"<2I{numbers}{self._reals}")
        self.costs.append(self._cost("u", counts, stack))
        return Decision(u, x_e, tuple(estimate))

    def init(self, y1: float, y2: float, acceleration: float) -> Cost:
        """Put the observer by itself, which is not the controller's, at its start."""
        return self._cost("n", *self._ask("n", self._packed(y1, y2, acceleration), "<2I"))

    def step(self, y1: float, y2: float, acceleration: float, u: float) -> tuple[tuple[float, ...], Cost]:
        """One step of the observer by itself: its estimate, and what that took."""
        layout = f"<2I{self.sizes.estimates}{self._reals}"
        counts, stack, *estimate = self._ask("o", self._packed(y1, y2, acceleration, u), layout)
        return tuple(estimate), self._cost("o", counts, stack)

    def calibration_counts(self) -> list[int]:
        """How many instructions it counts where there are none, 100 and 1000: that it counts right."""
        nothing, _, hundred, _, thousand, _ = self._ask("c", b"", "<6I")
        return [round((counts - nothing) / self._per_instruction) for counts in (nothing, hundred, thousand)]

    def _packed(self, *numbers: float) -> bytes:
        return struct.pack(f"<{len(numbers)}{self._reals}", *numbers)

    def _calibrated(self) -> tuple[float, dict[str, tuple[int, int]]]:
        """Counts an instruction; counts and stack of calls of empty functions, by the message they stand for."""
        _, _, hundred, _, thousand, _ = self._ask("c", b"", "<6I")
        costs = self._ask("e", b"", "<6I")
        empty = {kind: (costs[2 * i], costs[2 * i + 1]) for i, kind in enumerate("uno")}
        return (thousand - hundred) / 900.0, empty

    def _cost(self, kind: str, counts: int, stack: int) -> Cost:
        if not self._empty:
            return Cost(0, stack)
        empty, _ = self._empty[kind]
        return Cost(round((counts - empty) / self._per_instruction), stack)

    def _ask(self, kind: str, carried: bytes, layout: str) -> tuple:
        return self._told(self._line.ask, kind, carried, layout)

    def _told(self, of_line: Callable, *arguments: Any) -> Any:
        try:
            return of_line(*arguments)
        except Closed as error:
            raise RunStopped(f"the board is gone: {self._exit_message()}") from error

    def _exit_message(self) -> str:
        with suppress(subprocess.TimeoutExpired):
            status = self._process.wait(1.0)
            assert self._process.stderr is not None
            lines = self._process.stderr.read().decode(errors="replace").splitlines()
            said = [line.strip() for line in lines if "warning:" not in line]
            if said:
                return f"{EMULATOR} says {said[-1]!r}"
            if status < 0:
                return f"{EMULATOR} was ended by signal {-status}"
            return STATUSES.get(status, f"{EMULATOR} has ended with status {status}")
        return "it has closed the line"


def _ends_with_us() -> list[str]:
    """What lets the emulator end with this process, however that ends; elsewhere it ends when nobody talks to it."""
    # The system takes the thread that starts a process for its parent.
    main = threading.current_thread() is threading.main_thread()
    setpriv = shutil.which("setpriv") if sys.platform == "linux" and main else None
    return [setpriv, "--pdeathsig", "KILL"] if setpriv else []


def _end(process: subprocess.Popen, line: socket.socket) -> None:
    line.close()
    process.kill()
    process.wait()
    if process.stderr is not None:
        process.stderr.close()

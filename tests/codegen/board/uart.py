"""The firmware for the STM32F746 on a model of its USART, and the host's clock with it: no time but the model's."""

from __future__ import annotations

import struct
import subprocess
from collections import deque
from pathlib import Path

from cmg_mj.codegen.board.image import FIRMWARE, macros_of
from cmg_mj.codegen.board.ports import BAUD, BITS_A_BYTE, POLL_S
from tests.codegen.board.toy import HEADER, SOURCE
from tests.codegen.board.wire import TOY

UPDATE_NS = 60_000
"""Time of an update with the painting of its stack: two bytes come meanwhile [ns]."""
STEP_NS = 50_000
"""Longest time for which host and board do not look at each other [ns]."""
LOOK_NS = 1_000
"""Time that passes between two looks of the host at the clock [ns]."""
NATIVE = {
    "board.c": {
        '__asm volatile("mov %0, sp" : "=r"(where)::"memory")': "((where) = stack_bottom)",
        '"t"(': '"g"(',
    },
    "stm32f746.c": {
        "#define WORD(address) (*(volatile uint32_t *)(address))": (
            "volatile uint32_t *look_at(uint32_t place);\n#define WORD(address) (*look_at(address))"
        ),
        '__asm volatile("dsb\\n\\tisb" ::: "memory")': "(void)0",
    },
}
"""File of the firmware -> what is the Cortex-M's in it, and what stands there on the computer that runs the test."""


def native_firmware(folder: Path, firmware: Path = FIRMWARE) -> Path:
    """Build the firmware with the toy's controller for this computer, its registers in uart.c."""
    for name, changes in NATIVE.items():
        source = (firmware / name).read_text()
        for old, new in changes.items():
            assert old in source
            source = source.replace(old, new)
        (folder / name).write_text(source)
    (folder / "toy.h").write_text(HEADER)
    update = f"extern void pass(unsigned long long); pass({UPDATE_NS});"
    (folder / "toy.c").write_text(SOURCE % {"step": "", "update": update})
    macros = [f"-D{macro}" for macro in macros_of("toy", "stm32f746", TOY.text())]
    sources = [folder / "board.c", folder / "stm32f746.c", folder / "toy.c", Path(__file__).with_name("uart.c")]
    program = folder / "firmware"
    command: list[str | Path] = ["cc", "-O1", *macros, "-I", folder, "-I", firmware, *sources, "-o", program]
    subprocess.run(command, check=True)
    return program


class UartWire:
    """A port, and a USB converter that holds every byte back, before the firmware on its model.

    Args:
        program: The firmware.
        usb_s: Time for which the converter holds a byte back, either way [s].
        lost: Numbers of the bytes from the host that the cable loses.

    Attributes:
        now: The time [ns].
        sent: Number of bytes that the host has sent.
        jammed_until: Time before which no byte leaves the converter for the board [ns].
        overruns: Number of bytes that the board's USART has lost.
        pll: PLLCFGR.
    """

    def __init__(self, program: Path, usb_s: float, lost: frozenset[int] = frozenset()) -> None:
        self.now, self.sent, self.overruns, self.pll = 0, 0, 0, 0
        self.jammed_until = 0
        self.usb = round(1e9 * usb_s)
        self.lost = lost
        self._byte = 1_000_000_000 * BITS_A_BYTE // BAUD
        self._free = 0
        self._up: list[tuple[int, int]] = []
        self._down: deque[tuple[int, int]] = deque()
        self._program = program
        self.begin()

    def begin(self) -> None:
        """Start the board: its time begins with the host's."""
        self._begun = self.now
        self._process = subprocess.Popen([self._program], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._report()

    def reset(self) -> None:
        """Start the board again; what it says first is lost."""
        self.close()
        self.begin()
        self.wait(2_000_000)
        self._down.clear()

    def perf_counter(self) -> float:
        """The host's clock [s]."""
        self.now += LOOK_NS
        return 1e-9 * self.now

    def wait(self, ns: int) -> None:
        """Let time pass."""
        then = self.now + ns
        while self.now < then:
            self._run_to(min(self.now + STEP_NS, then))

    def read(self, wait_s: float) -> bytes:
        until = self.now + round(1e9 * min(wait_s, POLL_S))
        self._run_to(self.now)
        while not (self._down and self._down[0][0] <= self.now) and self.now < until:
            self._run_to(min(self.now + STEP_NS, until))
        received = bytearray()
        while self._down and self._down[0][0] <= self.now:
            received.append(self._down.popleft()[1])
        return bytes(received)

    def write(self, data: bytes) -> None:
        at = max(self.now + self.usb, self.jammed_until, self._free)
        for byte in data:
            at += self._byte
            if self.sent not in self.lost:
                self._up.append((at, byte))
            self.sent += 1
        self._free = at

    def close(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait()

    def _run_to(self, time: int) -> None:
        """Let the board run; bytes that are not yet due come with the next step."""
        assert self._process.stdin is not None
        due = [byte for byte in self._up if byte[0] <= time]
        self._up = self._up[len(due) :]
        parts = [struct.pack("<QI", max(0, time - self._begun), len(due))]
        parts += [struct.pack("<QB", max(0, at - self._begun), byte) for at, byte in due]
        self._process.stdin.write(b"".join(parts))
        self._process.stdin.flush()
        self._report()
        self.now = time

    def _report(self) -> None:
        assert self._process.stdout is not None
        self.overruns, self.pll, count = struct.unpack("<3I", self._process.stdout.read(12))
        for _ in range(count):
            at, byte = struct.unpack("<QB", self._process.stdout.read(9))
            self._down.append((at + self._begun + self.usb, byte))

"""The ports behind which a real board is: a serial line by pyserial, or a TCP connection."""

from __future__ import annotations

import math
import select
import socket
from importlib.util import find_spec
from typing import Protocol

from cmg_mj.codegen.board.serial_line import Closed
from cmg_mj.errors import InputError, shown

TCP = "tcp:"
BAUD = 460_800
"""Baud rate where none is given, that of the firmware for a real board [1/s]."""
BAUDS = (9_600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 921_600, 1_000_000, 2_000_000, 3_000_000)
"""Usual baud rates [1/s]."""
BITS_A_BYTE = 10
"""Bits of a byte on a serial line: 8, a start bit and a stop bit."""
HEADROOM = 1.5
"""Least deadline, in times that a sample and its answer take on the line: the rest is for USB and the update."""
POLL_S = 0.001
"""Longest time a read of a serial line waits before the caller looks at the clock again [s]."""
CONNECT_S = 5.0
"""Longest wait for a connection, and for a line that takes nothing [s]."""
TAKES_NOTHING = f"the {{}} has taken no byte for {CONNECT_S:g} s: flow control, or a converter that has stopped"


def _reason(error: Exception) -> str:
    """Return the system's words behind an error of pyserial's, which repeats the port and its number."""
    cause = error.__context__ or error
    text = getattr(cause, "strerror", None) or (cause.args[1] if len(cause.args) > 1 else cause)
    if text == "Inappropriate ioctl for device":
        return "it is no serial port"
    return " ".join(str(text).split())


class Port(Protocol):
    """A stream of bytes in both directions; every method raises `Closed` when there is nobody at the other end."""

    def read(self, wait_s: float) -> bytes:
        """Return what has come, or nothing after at most about `wait_s`."""
        ...

    def write(self, data: bytes) -> None:
        """Send bytes."""
        ...

    def close(self) -> None:
        """Close the port."""
        ...


def open_port(name: str, baud: int | None = None) -> Port:
    """Open a port.

    Args:
        name: The name of a serial port, such as /dev/ttyACM0 or COM3, or tcp:HOST:PORT.
        baud: Baud rate of a serial port; None for `BAUD`.

    Returns:
        The port.

    Raises:
        InputError: There is no such port, it is in use, or pyserial is not installed.
    """
    if is_tcp(name):
        if baud is not None:
            raise InputError(f"--baud {baud}: {name} has no baud rate; leave it out")
        return _TcpPort(name)
    return _SerialPort(name, baud or BAUD)


def is_tcp(name: str) -> bool:
    """Return whether a port is a TCP connection."""
    return name.lower().startswith(TCP)


class _SerialPort:
    """A serial port."""

    def __init__(self, name: str, baud: int) -> None:
        if find_spec("serial") is None:
            raise InputError(f'--port {name}: pyserial is not installed: python -m pip install "cmg_mj[board]"')
        import serial

        try:
            self._too_slow = serial.SerialTimeoutException
            self._serial = serial.Serial(name, baud, timeout=POLL_S, write_timeout=CONNECT_S, exclusive=True)
        except (OSError, ValueError, OverflowError) as error:  # pyserial's own errors are of these kinds
            raise InputError(f"--port {name}: cannot be opened at {baud} baud: {_reason(error)}") from error

    def read(self, wait_s: float) -> bytes:
        try:
            return self._serial.read(self._serial.in_waiting or 1)
        except OSError as error:
            raise Closed("the cable is pulled, or the board is gone") from error

    def write(self, data: bytes) -> None:
        try:
            self._serial.write(data)
        except self._too_slow as error:  # one of OSError's kinds
            raise Closed(TAKES_NOTHING.format("line")) from error
        except OSError as error:
            raise Closed("the cable is pulled, or the board is gone") from error

    def close(self) -> None:
        self._serial.close()


class _TcpPort:
    """A TCP connection."""

    def __init__(self, name: str) -> None:
        host, _, port = name[len(TCP) :].rpartition(":")
        if not host or not port.isdecimal() or len(port) > 5 or not 0 < int(port) < 65536:
            raise InputError(f"--port {shown(name)}: write tcp:HOST:PORT, such as tcp:localhost:5555")
        try:
            self._socket = socket.create_connection((host.strip("[]"), int(port)), CONNECT_S)
        except (OSError, UnicodeError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise InputError(f"--port {name}: cannot be reached: {reason}") from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def read(self, wait_s: float) -> bytes:
        try:
            if not select.select([self._socket], [], [], max(0.0, wait_s))[0]:
                return b""
            data = self._socket.recv(4096)
        except OSError as error:
            raise Closed("the connection is lost") from error
        if not data:
            raise Closed("the connection is closed")
        return data

    def write(self, data: bytes) -> None:
        try:
            self._socket.sendall(data)
        except TimeoutError as error:
            raise Closed(TAKES_NOTHING.format("connection")) from error
        except OSError as error:
            raise Closed("the connection is lost") from error

    def close(self) -> None:
        self._socket.close()


def wire_time(baud: int, bytes_a_tick: tuple[int, int]) -> float:
    """Compute the time that a sample and its answer take on a serial line [s].

    Args:
        baud: Baud rate [1/s].
        bytes_a_tick: Bytes of a sample's frame and of its answer's.
    """
    return BITS_A_BYTE * sum(bytes_a_tick) / baud


def require_fit(baud: int, bytes_a_tick: tuple[int, int], deadline_s: float) -> None:
    """Refuse a baud rate at which the frames of a tick, with headroom, take longer than they may.

    Args:
        baud: Baud rate [1/s].
        bytes_a_tick: Bytes of a sample's frame and of its answer's.
        deadline_s: Time from the sample to the answer [s].

    Raises:
        InputError: They do not fit.
    """
    needed_s = HEADROOM * wire_time(baud, bytes_a_tick)
    if needed_s <= deadline_s * (1.0 + 1e-9):
        return
    least = math.ceil(baud * needed_s / deadline_s - 1e-6)
    usual = next((rate for rate in BAUDS if rate >= least), None)
    sample, answer = bytes_a_tick
    cures = f"at least {least} baud{f', such as {usual}' if usual else ''}"
    if needed_s <= 1.0:
        least_ms = math.ceil(1e4 * needed_s - 1e-6) / 10.0
        cures += f", a controller.rate_hz of at most {math.floor(1.0 / needed_s + 1e-9)}"
        cures += f", or a --deadline-ms of at least {least_ms:g} where nothing moves in real time"
    raise InputError(
        f"--baud {baud}: a tick's frames do not fit: {sample} + {answer} bytes take "
        f"{1e3 * needed_s / HEADROOM:.3g} ms, {1e3 * needed_s:.3g} with room for USB, and the deadline is "
        f"{1e3 * deadline_s:g} ms; take {cures}"
    )

"""A board's log: the frames of its line, recorded, as columns."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cmg_mj.codegen.board.frames import LONGEST, START_BYTE, Frame, FrameReader
from cmg_mj.codegen.board.identity import FIRMWARE_NAME, FIRMWARE_VERSION, HELLO, Identity, read_identity
from cmg_mj.codegen.board.qemu import NOT_FINITE
from cmg_mj.errors import InputError, shortened

READ = 1 << 20
"""Size of a piece in which a log is read [bytes]."""
KINDS = frozenset("h!isur?")
"""Kinds of the frames between a board and its host, and of a rate."""
LARGEST_STACK = 0x00800000
"""Above the stack of any board [bytes]; as a float the smallest normal number."""
COLUMNS = {
    "time": "time_s",
    "inner_x": "inner_x_m_s2",
    "inner_z": "inner_z_m_s2",
    "outer_x": "outer_x_m_s2",
    "outer_z": "outer_z_m_s2",
    "gimbal": "gimbal_rad",
    "command": "command_rad_s",
    "rate": "reference_rad_s",
}
"""Role in a user's log -> heading of a board's."""


class BoardLog(NamedTuple):
    """A board's log.

    Attributes:
        identity: The board's account of itself.
        columns: Heading -> numbers, (n_samples,); without a reference in the log there is no column for one.
        damaged: Number of places where the file was no frame.
        missing: Number of samples whose frames are missing, by the frames' numbers.
    """

    identity: Identity
    columns: dict[str, np.ndarray]
    damaged: int
    missing: int

    def remarks(self) -> list[str]:
        """Say in a line each what is wrong with the log."""
        places = f"{self.damaged:,} place{'' if self.damaged == 1 else 's'}"
        samples = f"{self.missing:,} sample{' is' if self.missing == 1 else 's are'}"
        return [
            *([f"the board's log is damaged in {places}"] if self.damaged else []),
            *([f"{samples} missing in the board's log, by its frames' numbers"] if self.missing else []),
        ]


def is_board_log(head: bytes) -> bool:
    """Return whether a file that begins so is a board's log; one may begin in the midst of a frame."""
    if head.startswith((START_BYTE + HELLO.encode(), START_BYTE + b"!")):
        return True
    return b"\0" in head and sum(frame.kind in KINDS for frame in FrameReader().feed(head)) > 1


def read_board_log(path: Path, most_samples: int) -> BoardLog:
    """Read a board's log: who it is ('h'), then of every period the sample, its answer ('u') and perhaps a rate ('r').

    Everything else that goes over a wire is passed over, so that a recording of both directions is a log too. A sample
    whose answer is missing has the command that was held. Numbers of samples run on modulo 256: where frames are
    missing, the times of those after them are later.

    Args:
        path: The file.
        most_samples: Largest number of samples.

    Returns:
        The log.

    Raises:
        InputError: The file cannot be read, is no such log, or is too long.
    """
    reader, rows = FrameReader(), None
    for frame in _frames(path, reader):
        if frame.kind == HELLO and frame.payload:  # the host's question carries nothing
            identity = read_identity(frame, str(path))
            rows = rows or _Rows(identity, path, most_samples)
            rows.require(identity)
        elif rows is not None:
            rows.add(frame)
    if rows is None:
        raise InputError(
            f"{path}: a board's log without its introduction, the frame 'h', or with a damaged one: record both "
            "directions of the wire, from the handshake on"
        )
    if not rows.samples:
        raise InputError(f"{path}: a board's log without a sample: record what the host sends too")
    columns = rows.columns()
    return BoardLog(rows.identity, columns, reader.damaged, rows.missing)


def _frames(path: Path, reader: FrameReader) -> Iterator[Frame]:
    """Yield a file's frames."""
    try:
        with path.open("rb") as file:
            while piece := file.read(READ):
                yield from reader.feed(piece)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    yield from reader.end()


class _Rows:
    """The samples of a log in the making."""

    def __init__(self, identity: Identity, path: Path, most_samples: int) -> None:
        if identity.firmware != FIRMWARE_NAME:
            raise InputError(f"{path}: a log of the firmware {identity.firmware!r}, not of {FIRMWARE_NAME}")
        if identity.version != str(FIRMWARE_VERSION):
            raise InputError(
                f"{path}: a log of the firmware's version {shortened(identity.version)}; this cmg_mj reads version "
                f"{FIRMWARE_VERSION}"
            )
        self.identity, self._path, self._most = identity, path, most_samples
        real = "f" if identity.precision == "single" else "d"
        self._sample = struct.Struct(f"<{4 + len(identity.gimbals.zeros)}{real}")
        self._decision, self._rate = struct.Struct(f"<3I{real}"), struct.Struct(f"<{real}")
        self._answer_sizes = range(12 + 5 * self._rate.size, LONGEST + 1, self._rate.size)
        self._start: int | None = None
        self._last: int | None = None
        self._payload = b""
        self._answered = True
        self._ambiguous = False
        self._command = 0.0
        self._tick = 0
        self.missing = 0
        self.samples: list[tuple[float, ...]] = []
        self._ticks: list[int] = []
        self._commands: list[float] = []
        self._rates: list[float] = []

    def require(self, identity: Identity) -> None:
        """Refuse a log in which a board introduces itself as another."""
        if identity != self.identity:
            raise InputError(f"{self._path}: the log of two boards, or of two controllers: cut it in two")

    def add(self, frame: Frame) -> None:
        """Add a frame; kinds that are neither a sample, an answer, a rate nor a start are passed over."""
        if frame.kind == "u" and frame.number != self._last:
            self._add_sample(frame)
        elif frame.kind == "u" and self._is_answer(frame.payload):
            self._answered, self._ambiguous = True, False
            self._answer_sizes = range(len(frame.payload), len(frame.payload) + 1)
            self._command = self._commands[-1] = self._decision.unpack_from(frame.payload)[3]
        elif frame.kind == "r" and frame.number == self._last and len(frame.payload) == self._rate.size:
            self._rates += [np.nan] * (len(self.samples) - len(self._rates))
            self._rates[-1] = self._rate.unpack(frame.payload)[0]
        elif frame.kind == "s":
            self._require_one_run(frame)

    def _require_one_run(self, start: Frame) -> None:
        """Refuse a controller that starts again; a start that comes late has the number of the first."""
        if self.samples and start.number != self._start:
            raise InputError(
                f"{self._path}: the log of two runs: the controller starts again after {len(self.samples):,} samples: "
                "cut it in two"
            )
        self._start = start.number

    def _is_answer(self, payload: bytes) -> bool:
        """Return whether this is the answer, and not the sample a second time."""
        return not self._answered and payload != self._payload and len(payload) in self._answer_sizes

    def _add_sample(self, frame: Frame) -> None:
        self._require_certainty()
        size = self._sample.size
        if len(frame.payload) != size:
            # An answer whose sample is missing: the sample is, and so is this one.
            return
        if size in self._answer_sizes:
            _, stack, status = struct.unpack_from("<3I", frame.payload)
            if 0 < stack < LARGEST_STACK and status <= max(NOT_FINITE):
                return  # such an answer, as long as a sample
            self._ambiguous = stack == 0 and status <= max(NOT_FINITE)
        if len(self.samples) >= self._most:
            raise InputError(f"{self._path}: more than {self._most:,} samples: cut out a part of it")
        if self._last is not None:
            step = (frame.number - self._last) % 256
            self._tick += step
            self.missing += step - 1
        self._last, self._payload, self._answered = frame.number, frame.payload, False
        self.samples.append(self._sample.unpack(frame.payload))
        self._ticks.append(self._tick)
        self._commands.append(self._command)

    def _require_certainty(self) -> None:
        """Refuse a frame that may be a sample or an answer; where both have come their order tells them apart."""
        if self._ambiguous:
            raise InputError(
                f"{self._path}: the frame 'u' of number {self._last}, row {len(self.samples):,}, may be a sample "
                f"without its answer or an answer without its sample, both of {self._sample.size} bytes: cut the log "
                "there"
            )

    def columns(self) -> dict[str, np.ndarray]:
        """Return the columns, in the order of `COLUMNS`."""
        self._require_certainty()
        samples = np.array(self.samples)
        gimbal = self.identity.gimbals(list(samples[:, 4:].T))
        series = [np.array(self._ticks) / self.identity.rate_hz, *samples[:, :4].T, gimbal, np.array(self._commands)]
        if self._rates:
            series.append(np.array(self._rates + [np.nan] * (len(samples) - len(self._rates))))
        return dict(zip(COLUMNS.values(), series, strict=False))

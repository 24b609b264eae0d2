"""A real board on a wire: deadlines, frames sent again, ticks lost, round trips."""

from __future__ import annotations

import math
import shlex
import statistics
import struct
import time
from array import array
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from importlib.util import find_spec

import numpy as np

from cmg_mj.codegen.board.frames import OVERHEAD, Frame, FrameReader
from cmg_mj.codegen.board.identity import HELLO, Identity, identity_of, read_identity, require_own_estimate
from cmg_mj.codegen.board.ports import BAUD, Port, is_tcp, open_port, require_fit, wire_time
from cmg_mj.codegen.board.qemu import STATUSES, Board, decision_of
from cmg_mj.codegen.board.serial_line import Closed
from cmg_mj.codegen.export import generate_code
from cmg_mj.codegen.export.names import name_of
from cmg_mj.codegen.export.refusals import refuse_unexported
from cmg_mj.controllers.processor import Decision, Processor
from cmg_mj.core.controller import Controller
from cmg_mj.errors import InputError, RunStopped
from cmg_mj.results.result import Result
from cmg_mj.results.summary_keys import Summary
from cmg_mj.results.wire import WireReport, WireSettings

PATIENCE_S = 3.0
"""Longest wait for an answer of the handshake [s]."""
AGAIN_S = 0.25
"""A frame of the handshake is sent again after so long [s]."""
MAX_LOST = 20
"""Number of ticks lost in a row that ends a run: 0.1 s at 200 Hz, in which an unstable rig's tilt doubles."""
LARGEST_MAX_LOST = 127
"""The largest of these: by its number, modulo 256, a board takes a later sample for one that it has had."""
USB_S = 0.001
"""Time for which USB may hold bytes back: the length of one of its frames [s]."""
_COST = struct.Struct("<3I")


@dataclass
class WireCounts:
    """The traffic over a wire during a run.

    Attributes:
        sent_again: Number of samples that were sent again.
        lost: Number of ticks without an answer in time.
        lost_in_a_row: Largest number of these in a row.
        late_or_doubled: Number of answers that nobody waited for any more.
        refused: Number of refusals: the board refuses a frame that came damaged once its line is quiet.
        round_trips_s: Time from a sample to its answer, of each tick that was answered [s].
        counts: Counts of the board's counter that its update took, likewise.
    """

    sent_again: int = 0
    lost: int = 0
    lost_in_a_row: int = 0
    late_or_doubled: int = 0
    refused: int = 0
    round_trips_s: array[float] = field(default_factory=lambda: array("d"))
    counts: array[int] = field(default_factory=lambda: array("L"))


class WiredBoard:
    """A board behind a port that takes the control decisions; see `on_a_wire`.

    A sample that has no answer after `again_s`, or that the board refuses, is sent again under the same number, unless
    its answer could not come in time any more. The board does not execute it again. Without an answer by the deadline
    the tick is lost: the last command is held.

    Args:
        port: The open port.
        name: Its name, for messages.
        expected: The firmware and controller that the scenario asks for.
        estimates: Parts of an estimate.
        deadline_s: Time from a sample to its answer [s].
        again_s: Time after which a sample is sent again; None for half of the deadline, or longer on a slow line [s].
        max_lost: Number of ticks lost in a row that ends the run.
        wire_s: Time that a sample and its answer take on the line [s].

    Attributes:
        identity: The board's own account of itself.
        counts: What has gone over the wire since `start`.
        settings: The settings of the wire that a rerun needs.
        checksum_compared: Whether the checksum of the controller's C was compared.

    Raises:
        InputError: Nobody answers, or the board has another firmware or controller.
    """

    def __init__(
        self,
        port: Port,
        name: str,
        expected: Identity,
        estimates: int,
        deadline_s: float,
        again_s: float | None = None,
        max_lost: int = MAX_LOST,
        wire_s: float = 0.0,
    ) -> None:
        self.name, self.deadline_s, self.max_lost = name, deadline_s, max_lost
        self.settings = WireSettings(name)
        self._wire_s = wire_s
        self._again_s = max(0.5 * deadline_s, wire_s + USB_S) if again_s is None else again_s
        self._port, self._reader, self._number = port, FrameReader(), 0
        self._waiting: list[Frame] = []
        self._answer = struct.Struct(f"<{2 + estimates}f")
        self._nothing = Decision(0.0, 0.0, (0.0,) * estimates)
        self._begin()
        self._hello = self._shake(HELLO)
        if not self._hello.payload:  # the question, which carries nothing
            raise InputError(
                f"{name}: echoes all that it receives: a loopback plug or an echoing terminal is there, not a board"
            )
        self.identity = read_identity(self._hello, name)
        self.identity.require(expected, name)
        self.checksum_compared = bool(expected.code)
        sizes = self._shake("i").payload
        if len(sizes) != 16 or struct.unpack("<4I", sizes)[3] != estimates:
            raise InputError(
                f"{name}: the board's estimate has other parts than the scenario's: export and flash again"
            )

    def _begin(self) -> None:
        self.counts = WireCounts()
        self._damaged_before = self._reader.damaged
        self._lost_now = 0
        self._decision = self._nothing
        self._exchanges: list[tuple[bytes, bytes]] = []

    def start(self) -> None:
        """Put the controller at its start, and count from here."""
        self._shake("s")
        self._begin()

    def update(self, accelerations: Sequence[float], encoders: Sequence[float]) -> Decision:
        """Send a sample of the sensors and receive the controller's decision; the last one if the tick is lost.

        Args:
            accelerations: Specific force: inner x, z, outer x, z [m/s^2].
            encoders: Angles of the gimbals [rad].

        Returns:
            The decision.

        Raises:
            RunStopped: The cable is pulled, the board has started again or has stopped, or too many ticks are lost.
        """
        payload = struct.pack(f"<{4 + len(encoders)}f", *accelerations, *encoders)
        frame = self._next("u", payload)
        question = frame.encode()
        answer = self._exchange(frame, question)
        self._exchanges.append((question, b"" if answer is None else answer.encode()))
        if answer is None:
            self._lose()
            return self._decision
        self._lost_now = 0
        if len(answer.payload) != _COST.size + self._answer.size:
            raise RunStopped(f"{self.name}: the board answered something else than what was asked")
        counts, _, status = _COST.unpack_from(answer.payload)
        self.counts.counts.append(counts)
        u, x_e, *estimate = self._answer.unpack_from(answer.payload, _COST.size)
        decision = decision_of(status, u, x_e, estimate)
        if not all(map(math.isfinite, (u, *estimate))):  # a law without an integrator has none
            raise RunStopped(f"{self.name}: the board answered a number that is not finite")
        self._decision = decision
        return decision

    def _exchange(self, frame: Frame, question: bytes) -> Frame | None:
        """Send a sample, again if need be, and return its answer; None if there is none by the deadline."""
        start = now = time.perf_counter()
        deadline, first = start + self.deadline_s, True
        while now + self._wire_s < deadline:
            if not first:
                self.counts.sent_again += 1
                self._waiting += self._reader.resync(frame.kind, _COST.size + self._answer.size)
            self._send(question)
            until = now + self._again_s
            if until + self._wire_s >= deadline:  # sent again then, it would be answered too late
                until = deadline
            answer = self._await(frame, until, until_refused=first)
            now, first = time.perf_counter(), False
            if answer is not None and now < deadline:
                self.counts.round_trips_s.append(now - start)
                return answer
            self.counts.late_or_doubled += answer is not None
        return None

    def _lose(self) -> None:
        self._lost_now += 1
        self.counts.lost += 1
        self.counts.lost_in_a_row = max(self.counts.lost_in_a_row, self._lost_now)
        if self._lost_now >= self.max_lost:
            ticks = f"{self._lost_now} ticks" if self._lost_now > 1 else "a tick"
            within = f"{1e3 * self.deadline_s:g} ms"
            raise RunStopped(
                f"{self.name}: the board has not answered for {ticks} in a row, within {within} each (--deadline-ms "
                "allows more)"
            )

    def _await(self, frame: Frame, until: float, *, until_refused: bool = False) -> Frame | None:
        """Return the answer to a frame; None if none comes in time, or if the board has refused it."""
        while True:
            for reply in self._received(until):
                if reply.kind == "!" and frame.kind == "u":
                    why = STATUSES.get(reply.payload[0], "") if reply.payload else ""
                    raise RunStopped(
                        f"{self.name}: the board has started again, and its controller's state is lost"
                        f"{': ' + why if why else ''}"
                    )
                if reply.kind == frame.kind and reply.number == frame.number:
                    return reply
                if reply.kind == "?":
                    self.counts.refused += 1
                    if until_refused and reply.number == frame.number:
                        return None
                elif reply.kind == frame.kind:
                    self.counts.late_or_doubled += 1
            if time.perf_counter() >= until:
                return None

    def _received(self, until: float) -> Iterator[Frame]:
        """Yield frames that have come, and then those that come within a moment."""
        if not self._waiting:
            wait_s = until - time.perf_counter()
            try:
                self._waiting += self._reader.feed(self._port.read(max(0.0, wait_s)))
            except Closed as error:
                raise RunStopped(f"{self.name}: {error}") from error
        while self._waiting:
            yield self._waiting.pop(0)

    def _shake(self, kind: str) -> Frame:
        """Ask something outside of a run, again and again until there is an answer.

        Raises:
            InputError: The board does not answer.
        """
        frame = self._next(kind, b"")
        start = time.perf_counter()
        refused = self.counts.refused
        while time.perf_counter() < start + PATIENCE_S:
            self._send(frame.encode())
            answer = self._await(frame, time.perf_counter() + AGAIN_S)
            if answer is not None:
                return answer
            self._waiting += self._reader.resync()
        if kind == HELLO and self.counts.refused > refused:
            raise InputError(
                f"{self.name}: the board's firmware knows no handshake: it is older than this cmg_mj; export and flash "
                "it again"
            )
        other = "is no other program connected to it" if is_tcp(self.name) else "is the baud rate its own"
        raise InputError(f"{self.name}: no answer within {PATIENCE_S:g} s: is the firmware on it, and {other}?")

    def _next(self, kind: str, payload: bytes) -> Frame:
        self._number = (self._number + 1) % 256
        return Frame(kind, self._number, payload)

    def _send(self, data: bytes) -> None:
        try:
            self._port.write(data)
        except Closed as error:
            raise RunStopped(f"{self.name}: {error}") from error

    def figures(self) -> Summary:
        """Return the counts of the run since `start`, as `--json` prints them."""
        counts = self.counts
        trips = np.array(counts.round_trips_s) * 1e3
        figures: Summary = {
            "port": self.name,
            "board": self.identity.board,
            "options": shlex.join(self.settings.options()),
            "deadline_ms": 1e3 * self.deadline_s,
            "ticks": len(self._exchanges),
            "sent_again": counts.sent_again,
            "lost": counts.lost,
            "lost_in_a_row": counts.lost_in_a_row,
            "late_or_doubled": counts.late_or_doubled,
            "refused_by_board": counts.refused,
            "damaged_from_board": self._reader.damaged - self._damaged_before,
        }
        if len(trips):
            figures["round_trip_ms"] = {
                "median": float(np.median(trips)),
                "percentile_99": float(np.percentile(trips, 99.0)),
                "most": float(trips.max()),
            }
        if len(counts.counts) and self.identity.cycles_per_second:
            a_microsecond = self.identity.cycles_per_second / 1e6
            figures["update_us"] = {
                "median": statistics.median(counts.counts) / a_microsecond,
                "most": max(counts.counts) / a_microsecond,
            }
        return figures

    def log(self, rates: Sequence[float] = ()) -> bytes:
        """Return the frames of the run since `start`, as `replay` takes them.

        Args:
            rates: Reference rate of each tick, of which the log gets frames of the kind 'r' [rad/s].
        """
        parts = [self._hello.encode()]
        for i, (question, answer) in enumerate(self._exchanges):
            parts += [question, answer]
            if i < len(rates):
                parts.append(Frame("r", question[2], struct.pack("<f", rates[i])).encode())
        return b"".join(parts)


def result_of(processor: Processor, result: Result) -> Result:
    """Return the result of a run with what its processor adds: that it was a board, and what went over its wire."""
    if isinstance(processor, WiredBoard):
        rates = () if result.trajectory is None else result.trajectory["x2_rad_s"].tolist()
        wire = WireReport(processor.settings, processor.figures(), processor.log(rates))
        return replace(result, driver="board", wire=wire)
    return replace(result, driver="board") if isinstance(processor, Board) else result


@contextmanager
def on_a_wire(
    controller: Controller,
    port: str,
    *,
    baud: int | None = None,
    deadline_s: float | None = None,
    again_s: float | None = None,
    max_lost: int = MAX_LOST,
) -> Iterator[WiredBoard]:
    """Connect to a board that runs a controller, and check that it is this one.

    Args:
        controller: The controller.
        port: The name of a serial port, such as /dev/ttyACM0, or tcp:HOST:PORT.
        baud: Baud rate of a serial port; None for `BAUD`.
        deadline_s: Time from a sample to its answer; None for the control period [s].
        again_s: Time after which a sample is sent again; None for half of the deadline, or longer on a slow line [s].
        max_lost: Number of ticks lost in a row that ends a run.

    Yields:
        The board; the port is closed at the end.

    Raises:
        InputError: The port cannot be opened, the frames do not fit the baud rate, nobody answers, or the board has
            another firmware or controller.
    """
    require_own_estimate(controller)
    refuse_unexported(controller)
    settings = WireSettings(
        port,
        baud,
        None if deadline_s is None else 1e3 * deadline_s,
        None if max_lost == MAX_LOST else max_lost,
    )
    deadline_s = controller.law.dt if deadline_s is None else deadline_s
    if not (0.0 < deadline_s < math.inf and 0 < max_lost <= LARGEST_MAX_LOST):
        raise InputError(
            f"deadline_s = {deadline_s:g}, max_lost = {max_lost}: must be above 0, and 1 to {LARGEST_MAX_LOST}"
        )
    estimates = 3 + len(controller.extra_signals[0])
    sizes = (OVERHEAD + 4 * (4 + len(controller.gimbal_angle.zeros)), OVERHEAD + _COST.size + 4 * (2 + estimates))
    wire_s = 0.0
    if not is_tcp(port):
        require_fit(baud or BAUD, sizes, deadline_s)
        wire_s = wire_time(baud or BAUD, sizes)
    expected = expected_identity(controller)
    line = open_port(port, baud)
    try:
        board = WiredBoard(line, port, expected, estimates, deadline_s, again_s, max_lost, wire_s)
        board.settings = settings
        yield board
    finally:
        line.close()


def expected_identity(controller: Controller) -> Identity:
    """Find out which firmware a controller asks for; without CasADi no checksum of its C."""
    name = name_of(controller.observer)
    if find_spec("casadi") is None:
        return identity_of(controller, name)
    return identity_of(controller, name, generate_code(controller, "single", name).files[f"{name}.c"])

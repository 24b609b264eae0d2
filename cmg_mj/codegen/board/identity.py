"""The identity with which a board introduces itself: firmware, version, observer, precision, and what a log needs."""

from __future__ import annotations

import re
import struct
import zlib
from dataclasses import dataclass

from cmg_mj.codegen.board.frames import LONGEST, Frame
from cmg_mj.core.controller import Controller
from cmg_mj.core.tilt import GimbalAngle
from cmg_mj.errors import InputError, shortened, shown

FIRMWARE_NAME = "cmg_mj"
FIRMWARE_VERSION = 2
"""Version of the firmware's messages: raised whenever a host and a board of different versions misunderstand."""
HELLO = "h"
"""Kind of the frame in which a board introduces itself."""
LONGEST_BOARD_NAME = 24
"""Longest name of a board, as firmware/board.c has it [characters]."""
_NUMBERS = struct.Struct("<2I")
LONGEST_TEXT = LONGEST - _NUMBERS.size - len(" board=") - LONGEST_BOARD_NAME - 1
"""Longest introduction: a payload less two numbers, the board's own name and C's end of a text [characters]."""
_FIELDS = re.compile(r"(\w+)=(\S*)")


@dataclass(frozen=True)
class Identity:
    """Firmware and controller of a board.

    Attributes:
        firmware: Name of the firmware.
        version: Version of its messages.
        observer: The observer's name in C.
        precision: `single` or `double`.
        rate_hz: Rate of the updates [Hz].
        code: Checksum of the controller's C; empty if it is not known.
        radii_m: Distances of the accelerometers from the pivot [m].
        gimbals: Directions and zeros of the gimbals.
        board: Name of the board, from its port layer.
        cycles_per_second: Rate of its counter; 0 if that does not measure time.
    """

    firmware: str
    version: str
    observer: str
    precision: str
    rate_hz: float
    code: str
    radii_m: tuple[float, float]
    gimbals: GimbalAngle
    board: str = ""
    cycles_per_second: int = 0

    def text(self) -> str:
        """Write it as the firmware's IDENTITY; the board adds its own name.

        Raises:
            InputError: It is too long for a frame.
        """
        text = (
            f"firmware={self.firmware} version={self.version} observer={self.observer} precision={self.precision} "
            f"rate_hz={self.rate_hz:.9g} code={self.code} radii={self._radii} gimbals={self._turns}"
        )
        if len(text) > LONGEST_TEXT:
            raise InputError(
                f"firmware: its introduction has {len(text)} characters, a frame has room for {LONGEST_TEXT}: take a "
                f"shorter name than {self.observer}, or fewer gimbals than {len(self.gimbals.zeros)}"
            )
        return text

    @property
    def _turns(self) -> str:
        return ",".join(f"{d:+g}@{z:.8g}" for d, z in zip(self.gimbals.directions, self.gimbals.zeros, strict=True))

    @property
    def _radii(self) -> str:
        return ",".join(f"{radius:.8g}" for radius in self.radii_m)

    def require(self, expected: Identity, place: str) -> None:
        """Refuse another firmware or controller than the expected one.

        Args:
            expected: The identity that a scenario asks for; without `code` the checksum is not compared.
            place: The board's port, for the message.

        Raises:
            InputError: They differ; the message names in what.
        """
        cure = "export and flash it again"
        for name, value, other in (
            ("firmware", self.firmware, expected.firmware),
            ("firmware version", self.version, expected.version),
            ("observer", self.observer, expected.observer),
            ("precision", self.precision, expected.precision),
            ("rate", f"{self.rate_hz:g} Hz", f"{expected.rate_hz:g} Hz"),
            ("radii of the accelerometers", f"{self._radii} m", f"{expected._radii} m"),
            ("gimbals", self._turns, expected._turns),
        ):
            if value != other:
                raise InputError(
                    f"{place}: the board has {name} {shortened(value)}, the scenario wants {shortened(other)}: {cure}"
                )
        if expected.code and self.code != expected.code:
            raise InputError(
                f"{place}: the board's {self.observer} has other numbers than the scenario's (checksums {self.code} "
                f"and {expected.code}: parameters, gains, rig, or another version of the export): {cure}"
            )


def require_own_estimate(controller: Controller) -> None:
    """Refuse a controller that feeds back what a board cannot measure.

    Raises:
        InputError: It feeds back another rate than its observer's.
    """
    if controller.feedback != "observer":
        raise InputError(
            f"controller.feedback = {shown(controller.feedback)}: a board has no such sensor; it closes the loop "
            "on its own estimate, 'observer'"
        )


def identity_of(controller: Controller, observer: str, code: str = "") -> Identity:
    """Collect the identity of an exported controller.

    Args:
        controller: The controller.
        observer: The observer's name in C.
        code: Text of its .c file, if it is at hand.
    """
    tilt = controller.tilt
    return Identity(
        firmware=FIRMWARE_NAME,
        version=str(FIRMWARE_VERSION),
        observer=observer,
        precision="single",
        rate_hz=1.0 / controller.law.dt,
        code=f"{zlib.crc32(code.encode()):08x}" if code else "",
        radii_m=(float(tilt.r_inner), float(tilt.r_outer)),
        gimbals=controller.gimbal_angle,
    )


def read_identity(frame: Frame, place: str) -> Identity:
    """Read the frame in which a board introduces itself.

    Args:
        frame: A frame of the kind 'h'.
        place: The board's port, or the log's file, for the message.

    Raises:
        InputError: It is no such introduction.
    """
    text = frame.payload[_NUMBERS.size :].decode("ascii", "replace")
    fields = dict(_FIELDS.findall(text))
    try:
        cycles, _ = _NUMBERS.unpack_from(frame.payload)
        inner, outer = map(float, fields["radii"].split(","))
        turns = [turn.split("@") for turn in fields["gimbals"].split(",")]
        gimbals = GimbalAngle(tuple(float(d) for d, _ in turns), tuple(float(z) for _, z in turns))
        rate = float(fields["rate_hz"])
        if not (0.0 < inner < outer and rate > 0.0):
            raise ValueError
        return Identity(
            firmware=fields["firmware"],
            version=fields["version"],
            observer=fields["observer"],
            precision=fields["precision"],
            rate_hz=rate,
            code=fields["code"],
            radii_m=(inner, outer),
            gimbals=gimbals,
            board=fields.get("board", ""),
            cycles_per_second=cycles,
        )
    except (struct.error, LookupError, ValueError):
        raise InputError(
            f"{place}: what introduces itself there is no firmware of {FIRMWARE_NAME}: {shortened(text)!r}"
        ) from None

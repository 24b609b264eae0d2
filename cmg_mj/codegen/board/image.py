"""An exported controller and the board's own C, built into what the Cortex-M7 starts from."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import NamedTuple

from cmg_mj.codegen.board.tools import COMPILER, SIZE
from cmg_mj.errors import InputError

FIRMWARE = Path(__file__).parent / "firmware"

CORE = ("-mcpu=cortex-m7", "-mthumb", "-mfpu=fpv5-sp-d16", "-mfloat-abi=hard")
"""The STM32F746's: a Cortex-M7 whose floating-point unit has single precision alone."""
FLAGS = (
    *CORE,
    "-std=c99",
    "-O2",
    "-ffp-contract=off",  # a product and a sum are rounded one after the other, as on the host
    "-Wall",
    "-Wextra",
    "-pedantic",
    "-Werror",
    "-Wdouble-promotion",
    "-ffunction-sections",
    "-fdata-sections",
    "-nostartfiles",
    "--specs=nano.specs",
    "-Wl,--gc-sections",
    "-Wl,--fatal-warnings",
)


class Image(NamedTuple):
    """A program for the board.

    Attributes:
        path: The ELF file.
        flash: What it occupies of the flash, all in all [bytes].
    """

    path: Path
    flash: int


def build(observer: str, folder: Path, controller: Path | None = None) -> Image:
    """Build an exported controller for the board.

    Args:
        observer: Its name in C.
        folder: Where its .h and .c are; the image is put there too.
        controller: Another file in place of its .c, such as `EMPTY`.

    Returns:
        The image.

    Raises:
        InputError: The compiler refuses it.
    """
    source = controller or folder / f"{observer}.c"
    path = folder / f"{observer}-{source.stem}.elf"
    own = [FIRMWARE / name for name in ("startup.c", "mps2.c", "board.c")]
    told = [f"-DOBSERVER={observer}"]
    told += [f"-D{what}={observer.upper()}_{what}" for what in ("ESTIMATES", "ENCODERS")]
    command: list[str | Path] = [COMPILER, *FLAGS, *told, "-I", folder, "-I", FIRMWARE]
    command += ["-T", FIRMWARE / "mps2.ld", *own, source, "-lm", "-o", path]
    _run(command, observer)
    text, data, *_ = _run([SIZE, path], observer).splitlines()[1].split()
    return Image(path, int(text) + int(data))


EMPTY = FIRMWARE / "empty.c"
"""A controller that does nothing: what an image holds beside the controller."""


def flash_of(observer: str, folder: Path) -> int:
    """Flash that a controller takes with what it needs of the C library: an image less one whose controller is empty.

    Args:
        observer: Its name in C.
        folder: Where its .h and .c are.

    Returns:
        The size [bytes].
    """
    return build(observer, folder).flash - build(observer, folder, EMPTY).flash


def _run(command: list[str | Path], observer: str) -> str:
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    except OSError as error:
        raise InputError(f"{observer}: {command[0]} cannot be run: {error.strerror}") from error
    if done.returncode:
        lines = [line for line in done.stderr.splitlines() if "error" in line or "undefined" in line]
        reason = (lines or done.stderr.splitlines() or [f"status {done.returncode}"])[0]
        raise InputError(f"{observer}: {command[0]} refuses it: {reason.strip()}")
    return done.stdout

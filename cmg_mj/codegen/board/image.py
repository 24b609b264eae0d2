"""Builds an exported controller and the firmware into an image for the Cortex-M7."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import NamedTuple

from cmg_mj.codegen.board.tools import COMPILER, SIZE
from cmg_mj.errors import InputError

FIRMWARE = Path(__file__).parent / "firmware"

CORE = ("-mcpu=cortex-m7", "-mthumb", "-mfpu=fpv5-sp-d16", "-mfloat-abi=hard")
"""Flags of the STM32F746: a Cortex-M7 whose floating-point unit has single precision alone."""
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


class Machine(NamedTuple):
    """A board that the firmware has a port layer for.

    Attributes:
        title: The board's name for people.
        sources: The port layer, a file in the firmware's folder.
        script: The linker script there.
        macros: Definitions for the compiler.
    """

    title: str
    sources: str
    script: str
    macros: tuple[str, ...] = ()


MACHINES = {
    "mps2": Machine("QEMU's mps2-an500", "mps2.c", "mps2.ld", ("QUIET_US=180000000u", "GAP_US=1000000u")),
    "stm32f746": Machine("ST's 32F746GDISCOVERY", "stm32f746.c", "stm32f746.ld"),
}
"""Machine -> its board. The emulated one ends when nobody talks to it for about three minutes.

Its line loses nothing, and its host may be busy: it waits a second for the rest of a message before it drops it.
"""


class Image(NamedTuple):
    """A program for the board.

    Attributes:
        path: The ELF file.
        flash: Size of the whole image in the flash [bytes].
    """

    path: Path
    flash: int


def build(
    observer: str, folder: Path, controller: Path | None = None, machine: str = "mps2", identity: str = ""
) -> Image:
    """Build an exported controller for the board.

    Args:
        observer: The observer's name in C.
        folder: Folder of the .h and .c files, to which the image is written.
        controller: Another file in place of the .c file, such as `EMPTY`.
        machine: The board, one of `MACHINES`.
        identity: The text with which it introduces itself: see `Identity`.

    Returns:
        The image.

    Raises:
        InputError: The compiler reports errors.
    """
    source = controller or folder / f"{observer}.c"
    board = MACHINES[machine]
    path = folder / f"{observer}-{source.stem}-{machine}.elf"
    firmware = [FIRMWARE / name for name in ("startup.c", board.sources, "board.c")]
    macros = [f"-D{macro}" for macro in macros_of(observer, machine, identity)]
    command: list[str | Path] = [COMPILER, *FLAGS, *macros, "-I", folder, "-I", FIRMWARE]
    command += ["-T", FIRMWARE / board.script, *firmware, source, "-lm", "-o", path]
    _run(command, observer)
    text, data, *_ = _run([SIZE, path], observer).splitlines()[1].split()
    return Image(path, int(text) + int(data))


def macros_of(observer: str, machine: str, identity: str) -> list[str]:
    """List the definitions that the firmware is compiled with; `identity` has no character that C quotes."""
    sizes = [f"{size}={observer.upper()}_{size}" for size in ("ESTIMATES", "ENCODERS")]
    return [f"OBSERVER={observer}", *sizes, f'IDENTITY="{identity}"', *MACHINES[machine].macros]


EMPTY = FIRMWARE / "empty.c"
"""A controller that does nothing."""


def flash_of(observer: str, folder: Path) -> int:
    """Measure the flash of a controller and its part of the C library: an image less one with an empty controller.

    Args:
        observer: The observer's name in C.
        folder: Folder of the .h and .c files.

    Returns:
        The size [bytes].
    """
    return build(observer, folder).flash - build(observer, folder, EMPTY).flash


def _run(command: list[str | Path], observer: str) -> str:
    try:
        process = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    except OSError as error:
        raise InputError(f"{observer}: {command[0]} cannot be run: {error.strerror}") from error
    if process.returncode:
        lines = [line for line in process.stderr.splitlines() if "error" in line or "undefined" in line]
        reason = (lines or process.stderr.splitlines() or [f"status {process.returncode}"])[0]
        raise InputError(f"{observer}: {command[0]} refuses it: {reason.strip()}")
    return process.stdout

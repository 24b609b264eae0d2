"""Builds an exported controller and the firmware into an image for the Cortex-M7."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

from cmg_mj.core.errors import InputError
from cmg_mj.features.export import compiler

COMPILER, SIZE, EMULATOR = "arm-none-eabi-gcc", "arm-none-eabi-size", "qemu-system-arm"
PACKAGES = {
    COMPILER: "gcc-arm-none-eabi",
    SIZE: "gcc-arm-none-eabi",
    "nano.specs": "libnewlib-arm-none-eabi",
    EMULATOR: "qemu-system-arm",
}
"""Program or file -> its Debian package."""

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


class Image(NamedTuple):
    """A program for the board.

    Attributes:
        path: The ELF file.
        flash: Size of the whole image in the flash [bytes].
    """

    path: Path
    flash: int


def missing() -> list[str]:
    """List the Debian packages that are not installed."""
    return list(dict.fromkeys(package for name, package in PACKAGES.items() if not _is_installed(name)))


def require() -> None:
    """Require all Debian packages.

    Raises:
        InputError: Some are not installed; the message names them.
    """
    packages = missing()
    if packages:
        raise InputError(f"the emulated board: packages are not installed: apt install {' '.join(packages)}")


def _is_installed(name: str) -> bool:
    if not name.endswith(".specs"):
        return shutil.which(name) is not None
    if shutil.which(COMPILER) is None:
        return False
    command = [COMPILER, f"-print-file-name={name}"]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip() != name


def build(observer: str, folder: Path, controller: Path | None = None) -> Image:
    """Build an exported controller for the board.

    Args:
        observer: The observer's name in C.
        folder: Folder of the .h and .c files, to which the image is written.
        controller: Another file in place of the .c file, such as `empty.c` of the firmware, which does nothing.

    Returns:
        The image.

    Raises:
        InputError: The compiler reports errors.
    """
    source = controller or folder / f"{observer}.c"
    path = folder / f"{observer}-{source.stem}.elf"
    firmware = [FIRMWARE / name for name in ("startup.c", "mps2.c", "board.c")]
    sizes = [f"-D{size}={observer.upper()}_{size}" for size in ("ESTIMATES", "ENCODERS")]
    command: list[str | Path] = [COMPILER, *FLAGS, f"-DOBSERVER={observer}", *sizes, "-I", folder, "-I", FIRMWARE]
    compiler.build(
        [*command, "-T", FIRMWARE / "mps2.ld", *firmware, source, "-lm", "-o", path], f"{observer}: {COMPILER}"
    )
    text, data, *_ = compiler.build([SIZE, path], f"{observer}: {SIZE}").splitlines()[1].split()
    return Image(path, int(text) + int(data))

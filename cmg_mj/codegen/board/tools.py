"""The programs that build for the board and emulate it, which are Debian's packages and not pip's."""

from __future__ import annotations

import shutil
import subprocess
from importlib.util import find_spec

from cmg_mj.errors import InputError

COMPILER, SIZE, EMULATOR = "arm-none-eabi-gcc", "arm-none-eabi-size", "qemu-system-arm"
PACKAGES = {
    COMPILER: "gcc-arm-none-eabi",
    SIZE: "gcc-arm-none-eabi",
    "nano.specs": "libnewlib-arm-none-eabi",
    EMULATOR: "qemu-system-arm",
}
"""What is needed: which of Debian's packages has it."""


def missing() -> list[str]:
    """Debian's packages that are needed and not installed."""
    return list(dict.fromkeys(package for thing, package in PACKAGES.items() if not _is_there(thing)))


def available() -> bool:
    """Whether a controller can be exported, built and emulated here."""
    return not missing() and find_spec("casadi") is not None


def require() -> None:
    """See that all of Debian's is there.

    Raises:
        InputError: It is not; the line says what to install.
    """
    packages = missing()
    if packages:
        raise InputError(
            f"the emulated board needs what is not installed here: apt install {' '.join(packages)} (Debian's names: "
            "a C compiler and newlib for ARM Cortex-M, and QEMU for ARM)"
        )


def _is_there(thing: str) -> bool:
    if not thing.endswith(".specs"):
        return shutil.which(thing) is not None
    if shutil.which(COMPILER) is None:
        return False
    told = subprocess.run([COMPILER, f"-print-file-name={thing}"], capture_output=True, text=True, check=False)
    return told.stdout.strip() != thing  # the whole path where there is such a file

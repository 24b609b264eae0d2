"""Checks for the programs that build for the board and emulate it: Debian packages, not pip's."""

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
"""Program or file -> its Debian package."""


def missing() -> list[str]:
    """List the Debian packages that are not installed."""
    return list(dict.fromkeys(package for name, package in PACKAGES.items() if not _is_installed(name)))


def available() -> bool:
    """Return whether a controller can be exported, built and emulated here."""
    return not missing() and find_spec("casadi") is not None


def require() -> None:
    """Require all Debian packages.

    Raises:
        InputError: Some are not installed; the message names them.
    """
    packages = missing()
    if packages:
        raise InputError(
            f"the emulated board needs packages that are not installed: apt install {' '.join(packages)} (Debian's "
            "names: a C compiler and newlib for ARM Cortex-M, and QEMU for ARM)"
        )


def _is_installed(name: str) -> bool:
    if not name.endswith(".specs"):
        return shutil.which(name) is not None
    if shutil.which(COMPILER) is None:
        return False
    process = subprocess.run([COMPILER, f"-print-file-name={name}"], capture_output=True, text=True, check=False)
    return process.stdout.strip() != name  # the whole path if the file exists

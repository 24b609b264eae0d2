"""Finds the C compiler, and runs it or what it has made."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from cmg_mj.core.errors import InputError


def find_compiler() -> list[str] | None:
    """Find a C compiler: CC, or else cc, gcc or clang."""
    try:
        command = shlex.split(os.environ.get("CC", ""))
    except ValueError as error:
        raise InputError(f"CC = {os.environ['CC']!r}: {error}") from error
    if command:
        return command
    return next(([path] for path in map(shutil.which, ("cc", "gcc", "clang")) if path), None)


def run(command: Sequence[str | Path], what: str, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run a program, named `what` in messages.

    Raises:
        InputError: It cannot be run, or does not end.
    """
    try:
        return subprocess.run(
            command, cwd=folder, capture_output=True, text=True, errors="replace", timeout=300, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise InputError(f"{what} cannot be run: {getattr(error, 'strerror', None) or error}") from error


def build(command: Sequence[str | Path], what: str, folder: Path | None = None) -> str:
    """Run a compiler, or another tool, that must succeed.

    Returns:
        Its output.

    Raises:
        InputError: It cannot be run, or refuses; the message has its first error.
    """
    process = run(command, what, folder)
    if process.returncode:
        lines = process.stderr.strip().splitlines() or [f"it ended with status {process.returncode}, silently"]
        reason = next((line for line in lines if "error" in line or "undefined" in line), lines[0])
        hint = "; CC must name a compiler for this machine" if os.environ.get("CC") else ""
        raise InputError(f"{what} refuses it: {reason.strip()}{hint}")
    return process.stdout

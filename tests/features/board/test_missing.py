"""Without the cross-compiler or the emulator: one line that says what to install."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from cmg_mj.features.board.image import COMPILER, EMULATOR, SIZE, missing
from tests.command import cmg_mj

pytestmark = pytest.mark.usefixtures("elsewhere")


def install(folder: Path, *programs: str) -> None:
    """Programs that do nothing, found before any other."""
    for program in programs:
        path = folder / program
        path.write_text("#!/bin/sh\necho nano.specs\n")
        path.chmod(0o755)


@pytest.mark.parametrize(
    ("programs_there", "packages"),
    [
        ((), "gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm"),
        ((COMPILER, SIZE, EMULATOR), "libnewlib-arm-none-eabi"),
    ],
)
def test_it_is_said_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, programs_there: tuple[str, ...], packages: str
) -> None:
    programs = tmp_path / "programs"
    programs.mkdir()
    install(programs, *programs_there)
    monkeypatch.setenv("PATH", f"{programs}{os.pathsep}/bin/nowhere")
    assert missing() == packages.split()
    assert cmg_mj("run", "push_recovery", "--driver", "board").complaint.endswith(f"apt install {packages}")
    assert not Path("runs").exists()

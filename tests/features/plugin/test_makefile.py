"""The Makefile beside a plugin: what has changed is compiled again, with the user's compiler."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from cmg_mj.features.plugin import tables
from tests.features.plugin.made import needs_compiler, quick

pytestmark = [needs_compiler, pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")]


def commands(folder: Path, **variables: str) -> str:
    """What make would run."""
    process = subprocess.run(
        ["make", "-n"], cwd=folder, env={**os.environ, **variables}, capture_output=True, text=True, check=True
    )
    return process.stdout


def test_what_has_changed_is_compiled_again(tmp_path: Path) -> None:
    made = quick().plugin
    folder = shutil.copytree(made.library.parent, tmp_path / "balance")
    library = folder / made.library.name
    code = [path for path in folder.glob("*.[ch]") if not path.name.endswith("_example.c")]
    os.utime(library, (2e9, 2e9))
    assert "up to date" in commands(folder)
    for path in code:
        os.utime(path, (2.1e9, 2.1e9))
        assert "-shared" in commands(folder, CC="my_compiler"), path.name
        os.utime(path, (1e9, 1e9))
    os.utime(library, (1e8, 1e8))
    assert commands(folder, CC="my_compiler").startswith("my_compiler -std=c99 ")


def test_a_path_with_a_blank_and_a_quote(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo's folder, and the plugin's."""
    made = quick().plugin
    folder = shutil.copytree(made.library.parent, tmp_path / "it's my $rig")
    mujoco = tables.find_mujoco()
    place = tmp_path / "a place's $libs"
    place.symlink_to(mujoco.parent)
    monkeypatch.setattr(tables, "find_mujoco", lambda: place / mujoco.name)
    name = made.library.stem.removeprefix("libcmg_mj_")
    (sources,) = re.findall("SOURCES = (.*)", (folder / "Makefile").read_text())
    text = tables.extra_files(name, sources.split(), sources.split(), "")["Makefile"]
    (folder / "Makefile").write_text(text)
    (folder / made.library.name).unlink()
    process = subprocess.run(["make"], cwd=folder, capture_output=True, text=True, check=False)
    assert process.returncode == 0, process.stderr
    assert (folder / made.library.name).is_file()

"""A folder for installed plugins, and a MuJoCo that opens no library."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace

import mujoco
import pytest

from cmg_mj.codegen.engine_plugin import install as installing
from cmg_mj.codegen.engine_plugin import load as loading
from cmg_mj.codegen.engine_plugin.load import VARIABLE

MUJOCO = version("mujoco")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the plugins; libraries are taken to load."""
    path = tmp_path / "data" / "plugins"
    monkeypatch.setenv(VARIABLE, str(path))
    monkeypatch.setattr(installing, "_try", lambda library, copy, name: MUJOCO)
    return path


@pytest.fixture
def open_names(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the plugins whose libraries `load` opens in a MuJoCo of this version."""
    names: list[str] = []
    monkeypatch.setitem(sys.modules, "mujoco", SimpleNamespace(__version__=MUJOCO))
    monkeypatch.setattr(loading, "open_library", lambda library, name: names.append(name))
    return names


@pytest.fixture
def messages() -> Iterator[list[str]]:
    """What MuJoCo warns of."""
    result: list[str] = []
    mujoco.set_mju_user_warning(result.append)
    yield result
    mujoco.set_mju_user_warning(None)
